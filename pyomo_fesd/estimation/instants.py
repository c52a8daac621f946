"""Shares of the elements that pass before a physical time; complementarity decides which element contains it.

    sum_n s_n h_n = t - t_first,      0 <= 1 - s_n  perp  s_{n+1} >= 0,      0 <= s_n <= 1

An element begins to pass only when the one before it has passed.  So s_n = 1 before the time, s_n = 0 after it, and where the time
lies in element n, s_n is its place there, for any lengths: no element is chosen in advance, and none has to be checked afterwards.
A branch of the solver fixes all s_n but one; the hint ``Filling``
lets it follow the elements when other pairs move them.

Takes: a ``MovingGrid`` and a time.
Leaves: a block with ``s``, ``place`` and ``order`` on the block of the grid, shared by all variables at this time.
Does not apply: with a free final time; where only one element can contain the time, as on a control stage of one element; then the
share is an expression.
"""

import numpy as np
from pyomo.core import Any, Block, Constraint, Var, quicksum, value
from pyomo.mpec import Complementarity, complements

from pyomo_fesd.core import FesdError, Filling, Instant, MovingGrid, homotopy_hints

#: Distance from a boundary of a control stage, in horizons, below which a time is that of the boundary.
SAME = 1e-12


def instant(moving: MovingGrid, time: float) -> Instant:
    """Return the ``Instant`` of a physical time.

    Raises
    ------
    FesdError
        for a time that is not a number within the horizon, and for free durations
    """
    if moving.sigma is not None:
        raise FesdError(moving.wrt, "at: its final time, or the lengths of its control stages, are free", "fix them")
    if isinstance(time, bool) or not isinstance(time, (int, float, np.number)) or not np.isfinite(time):
        raise FesdError(moving.wrt, f"at: the time {time} is not a number", "give a number")
    first, last = moving.wrt.first(), moving.wrt.last()
    if not abs(time - (first + last) / 2) <= (0.5 + SAME) * (last - first):
        raise FesdError(
            moving.wrt, f"at: the time {time:g} lies outside of [{first:g}, {last:g}]", "give a time within the horizon"
        )
    time = float(time)
    if time not in moving.instants:
        moving.instants[time] = _instant(moving, _stage(moving, time, SAME * (last - first)), time)
    return moving.instants[time]


def _stage(moving, now, tolerance):
    """The elements of the control stage that contains the time ``now``, or the label of a boundary at this time.

    The boundaries of control stages keep their time.
    """
    stages = list(moving.grid.stages.values())
    for label in (stages[0][0].left, *(stage[-1].right for stage in stages)):
        if abs(label - now) <= tolerance:
            return label
    return next(stage for stage in stages if now < stage[-1].right)


def _instant(moving, candidates, time):
    """The ``Instant`` of ``time`` among ``candidates``, elements or the label of a boundary."""
    if isinstance(candidates, (int, float)):
        return Instant(candidates, {}, [], 0.0)
    begin, durations = candidates[0].left, [moving.duration(e) for e in candidates]
    passed = time - moving.time_expression(begin)
    if len(candidates) == 1:
        return Instant(begin, {candidates[0].n: passed / durations[0]}, durations, passed)
    found = Instant(begin, _shares(moving, candidates, durations, passed), durations, passed)
    found.place()
    return found


def _shares(moving, elements, durations, passed):
    """Add the shares of ``elements`` and the conditions that determine them."""
    if moving.block.component('instant') is None:
        moving.block.instant = Block(Any)
    block = moving.block.instant[len(moving.block.instant) + 1]
    numbers = [e.n for e in elements]
    block.s = Var(numbers, bounds=(0, 1))
    # in mean lengths: tolerances do not know the unit of time
    mean = (elements[-1].right - elements[0].left) / len(elements)
    extents = [(e.length / mean, moving.r[e.n]) for e in elements]
    block.place = Constraint(expr=quicksum(h / mean * block.s[n] for n, h in zip(numbers, durations)) == passed / mean)
    block.order = Complementarity(numbers[:-1], rule=lambda b, n: complements(1 - b.s[n] >= 0, b.s[n + 1] >= 0))
    hints = homotopy_hints(moving.block)
    hints.fillings.append(Filling(list(block.order.values()), list(block.s.values()), extents, value(passed) / mean))
    return {n: block.s[n] for n in numbers}
