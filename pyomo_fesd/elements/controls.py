"""Inputs that are constant on each control stage.

    u(t) = u(S_k)   for S_{k-1} < t <= S_k;  the first time belongs to the first stage

S_k the label at the end of stage k: the value there is that of the stage.

Takes: Vars and mutable Params over time.
Leaves: ``held``, an equation for every other time of a stage; none where the input is given at the end of its stage, by a Param or
a Var that is fixed there: all times of the stage then get this value.
Does not apply: to inputs that vary inside a stage.
"""

from pyomo.core import ConstraintList, Param, Var, value

from pyomo_fesd.errors import FesdError
from pyomo_fesd.timeindex import TimeIndex, is_indexed_by

KEYWORD = 'piecewise_constant'


def check_controls(controls, wrt):
    """Every control must be a Var or mutable Param over time, given at the end of each stage if it is a Param."""
    for u in controls:
        if not hasattr(u, 'ctype'):
            raise FesdError(u, f"{KEYWORD}: this is a {type(u).__name__}, not a component", "give the Var itself, e.g. m.u")
        if not is_indexed_by(u, wrt):
            raise FesdError(u, f"{KEYWORD}: this is not indexed by '{wrt.name}'", "give Vars over the ContinuousSet")
        if u.ctype is Param and not u.mutable:
            raise FesdError(u, f"{KEYWORD}: this Param cannot change", "declare it with mutable=True")
        if u.ctype not in (Var, Param):
            raise FesdError(u, f"{KEYWORD}: this is a {u.ctype.__name__}", "give Vars or mutable Params over the ContinuousSet")


def _families(u, wrt):
    """``{name: {time: data}}`` of one control; a mutable Param gets data at times that have none."""
    datas = (u[index] for index in u.index_set()) if u.ctype is Param else u.values()
    return TimeIndex(wrt).families(datas)


def fix_given(controls, grid, wrt):
    """Let inputs that are given at the end of a stage have this value at all its times.

    Raises
    ------
    FesdError
        for a Param without a value at the end of a stage, and for a first value that is not that of the first stage
    """
    for u in controls:
        for values in _families(u, wrt).values():
            for times in _stages(grid, wrt):
                end = values.get(times[-1])
                if end is None or (u.ctype is Var and not end.fixed):
                    continue
                _check_given(u, values, end, times, wrt)
                for t in times[:-1]:
                    if u.ctype is Param:
                        values[t].set_value(value(end))
                    else:
                        values[t].fix(end.value)


def _check_given(u, values, end, times, wrt):
    now = value(end, exception=False)
    if now is None:
        raise FesdError(end, f"{KEYWORD}: it has no value, and its stage gets this one", "give the value at the end of each stage")
    first = values.get(wrt.first()) if times[0] == wrt.first() else None
    before = _stated(u, first) if first is not None and first is not end else None
    if before is not None and abs(before - now) > 1e-12 * max(1.0, abs(now)):
        raise FesdError(
            first,
            f"{KEYWORD}: {before:g} here, but {now:g} at the end of this stage, '{end.name}'",
            "the value at the end of a stage is the value of the whole stage: give the same here, or leave it out",
        )


def _stated(u, data):
    """The value that the user has given to one data; None for a free Var, or the default of a Param."""
    if u.ctype is Var:
        return data.value if data.fixed else None
    now = value(data, exception=False)
    return None if now == u.default() else now


def _stages(grid, wrt):
    """The times of each control stage, its end last."""
    owner, found = grid.element_of(), {}
    for t in wrt:
        found.setdefault(owner[t].stage if t in owner else 1, []).append(t)
    return found.values()


def hold_controls(block, controls, grid, wrt):
    """u(t) = u(end of its stage) for every other time of a control stage, where u is free."""
    block.held = ConstraintList()
    for u in controls:
        if u.ctype is Var:
            for values in _families(u, wrt).values():
                for times in _stages(grid, wrt):
                    end = values[times[-1]]
                    for t in times[:-1]:
                        if not (end.fixed and values[t].fixed):
                            block.held.add(values[t] == end)
