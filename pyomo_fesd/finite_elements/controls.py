"""Inputs that are constant on each control stage.

    u(t) = u(S_k)   for S_{k-1} < t <= S_k;  the first time belongs to the first control stage

S_k the label at the end of control stage k: the value there is the value of the control stage.

Takes: Vars and mutable Params over time.
Leaves: ``held``, an equation for every other time of a control stage; none where the input is given at the end of its control
stage, by a Param or a Var that is fixed there: all times of the control stage then get this value.
Does not apply: to inputs that vary inside a control stage.
"""

from collections.abc import Iterator

from pyomo.common.collections import ComponentSet
from pyomo.core import ConstraintList, Param, Var, value
from pyomo.dae import ContinuousSet

from pyomo_fesd.core import FesdError, Grid, MovingGrid, TimeIndex, derivatives, is_indexed_by, signal_breakpoints

KEYWORD = 'piecewise_constant'


def check_controls(controls: list, wrt: ContinuousSet) -> None:
    """Refuse controls that are not Vars or mutable Params over time, and states."""
    states = ComponentSet(d.get_state_var() for d in derivatives(wrt.model(), wrt))
    for u in controls:
        if not hasattr(u, 'ctype'):
            raise FesdError(u, f"{KEYWORD}: this is a {type(u).__name__}, not a component", "give the Var itself, e.g. m.u")
        if not is_indexed_by(u, wrt):
            raise FesdError(u, f"{KEYWORD}: this is not indexed by '{wrt.name}'", "give Vars over the ContinuousSet")
        if u.ctype is Param and not u.mutable:
            raise FesdError(u, f"{KEYWORD}: this Param cannot change", "declare it with mutable=True")
        if u.ctype not in (Var, Param):
            raise FesdError(u, f"{KEYWORD}: this is a {u.ctype.__name__}", "give Vars or mutable Params over the ContinuousSet")
        if u.parent_component() in states:
            raise FesdError(u, f"{KEYWORD}: this is a state, which its derivative determines", "give inputs only")


def _by_stage(u, grid, wrt) -> Iterator[tuple]:
    """``({time: data}, times of a control stage, its end last)`` of one control; a mutable Param gets data where it has none."""
    datas = (u[index] for index in u.index_set()) if u.ctype is Param else u.values()
    owner, stages = _control_stages(grid, wrt), {}
    for t in wrt:
        stages.setdefault(owner.get(t, 1), []).append(t)
    for by_time in TimeIndex(wrt).families(datas).values():
        for times in stages.values():
            yield by_time, times


def _control_stages(grid, wrt):
    """Control stage of every label but the first, 1...; breakpoints of signals do not divide them."""
    inner, found, number = signal_breakpoints(wrt), {}, 0
    for element in grid.elements:
        number += element.inputs_change and element.left not in inner
        found.update(dict.fromkeys(element.own_labels, number))
    return found


def fix_given(controls: list, grid: Grid, wrt: ContinuousSet) -> None:
    """Let inputs that are given at the end of a control stage have this value at all its times.

    Raises
    ------
    FesdError
        for a Param without a value at the end of a control stage, and for a first value that differs from its control stage's
    """
    for u in controls:
        for by_time, times in _by_stage(u, grid, wrt):
            end = by_time.get(times[-1])
            if end is None or (u.ctype is Var and not end.fixed):
                continue
            _check_given(u, by_time, end, times, wrt)
            for t in times[:-1]:
                if u.ctype is Param:
                    by_time[t].set_value(value(end))
                else:
                    by_time[t].fix(end.value)


def _check_given(u, by_time, end, times, wrt):
    now = value(end, exception=False)
    if now is None:
        raise FesdError(
            end,
            f"{KEYWORD}: it has no value, and its control stage gets this one",
            "give the value at the end of each",
        )
    first = by_time.get(wrt.first()) if times[0] == wrt.first() else None
    before = _given(u, first) if first is not None and first is not end else None
    if before is not None and abs(before - now) > 1e-12 * max(1.0, abs(now)):
        raise FesdError(
            first,
            f"{KEYWORD}: {before:g} here, but {now:g} at the end of this control stage, '{end.name}'",
            "the value at the end counts for the whole control stage: give the same here, or leave it out",
        )


def _given(u, data):
    """The value that the user has given to one data; None for a free Var, or the default of a Param."""
    if u.ctype is Var:
        return data.value if data.fixed else None
    now = value(data, exception=False)
    return None if now == u.default() else now


def hold_controls(moving: MovingGrid, controls: list) -> None:
    """Add u(t) = u(end of its control stage) for every other time, where u is free."""
    moving.block.held = moving.held = ConstraintList()
    for u in controls:
        if u.ctype is Var:
            for by_time, times in _by_stage(u, moving.grid, moving.wrt):
                end = by_time[times[-1]]
                for t in times[:-1]:
                    if not (end.fixed and by_time[t].fixed):
                        moving.held.add(by_time[t] == end)
