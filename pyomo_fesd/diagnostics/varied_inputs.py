"""Inputs whose fixed values differ inside a control stage: they belong to labels, which are not physical time once elements move.

    u(t) = u_k,   S_{k-1} < t <= S_k        what a held input is: one value, that at the end S_k of its control stage too

Takes: a solved model with a moving grid whose lengths are variables.
Leaves: messages.
Does not apply: to the first time, to signals (their times are boundaries that stay), and to variables that are free somewhere in a
control stage.
"""

from collections.abc import Iterator

from pyomo.common.collections import ComponentSet
from pyomo.core import Block, Var
from pyomo.dae import ContinuousSet
from pyomo.gdp import Disjunct

from pyomo_fesd.core import MovingGrid, TimeIndex, data_of, is_generated, moving_grids, own_components, signals, strip_time
from pyomo_fesd.results import SwitchingFunction

#: Relative difference of values that are equal.
SAME = 1e-9
#: Inputs that are named.
SHOWN = 3
AT_THE_END = (
    "the label of a boundary belongs to the control stage that ends there: fix the new value at later labels only (t > {time:g})"
)
INSIDE = (
    "values at labels move with the elements: let the step be a boundary that stays, with pyomo_fesd.signal(..., kind='stepped')"
)


def varied_inputs(model: Block, wrt: ContinuousSet, functions: list[SwitchingFunction]) -> Iterator[str]:
    """Yield a message for each of the first inputs with different values inside one control stage."""
    moving = moving_grids(model)[wrt]
    if all(r.fixed for r in moving.r.values()):
        return
    found = 0
    for name, by_time in _fixed(model, wrt):
        first = next(filter(None, (_varied(by_time, stage) for stage in _stages(moving))), None)
        if first is not None and found < SHOWN:
            found += 1
            (labels, step), time = first, moving.physical_time()
            remedy = AT_THE_END.format(time=time[step]) if step == labels[-1] else INSIDE
            yield (
                f"{strip_time(name)}: it is fixed to {by_time[labels[0]].value:.6g} and, from the label {step:g} on, to "
                f"{by_time[step].value:.6g} inside the control stage that ends at time {time[labels[-1]]:.6g}; {remedy}."
            )


def _fixed(model, wrt):
    """``(name, {label: data})`` of the user's variables over time that are fixed after the first time."""
    known, first = ComponentSet(signals(wrt)), wrt.first()
    own = own_components(model, Var, (Block, Disjunct))
    fixed = (v for component in own for v in data_of(component) if v.fixed and v.value is not None)
    for name, by_time in TimeIndex(wrt).families(fixed).items():
        one = next(iter(by_time.values()))
        if one.parent_component() not in known and not is_generated(one):
            by_time.pop(first, None)
            yield name, by_time


def _stages(moving: MovingGrid) -> Iterator[tuple[float, ...]]:
    """The labels of each control stage, without its beginning."""
    for elements in moving.grid.control_stages:
        yield tuple(label for e in elements for label in e.own_labels)


def _varied(by_time, labels):
    """The labels at which the input is given in a control stage and that of the first other value; None where there is none."""
    given = [label for label in labels if label in by_time]
    if not given or given[-1] != labels[-1]:
        return None
    start = by_time[given[0]].value
    step = next((label for label in given if _differ(by_time[label].value, start)), None)
    return None if step is None else (given, step)


def _differ(a, b):
    return abs(a - b) > SAME * max(abs(a), abs(b))
