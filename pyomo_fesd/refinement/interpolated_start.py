"""Start values on a finer grid, from the solution on a coarser one.

Every piece of the old solution, cut at new fixed points, gets elements of equal length, at least one, so that its switches are
element boundaries again and the values identify the branch of the old solution.  Between the boundaries the values are those of the
collocation polynomials.

Takes: a model on its new grid, and the ``RoundSolution``.
Leaves: values of all variables over time, of the element lengths, and of variables without time.
Does not apply: to variables at element boundaries only (modes with hysteresis, jumps); there a simulation with the old controls is
the start, if it succeeds.
"""

from collections.abc import Iterator
from contextlib import suppress

import numpy as np
from pyomo.core import Block, Var, value
from pyomo.dae import ContinuousSet

from pyomo_fesd.core import FesdError, TimeIndex, moving_grids, numbers_of_elements
from pyomo_fesd.refinement.dense_output import RoundSolution
from pyomo_fesd.simulation import simulate
from pyomo_fesd.starts import set_within_bounds

#: A piece that reaches into a stage by less than this part of it is round-off.
SHORT = 1e-9


def start_from(model: Block, wrt: ContinuousSet, solution: RoundSolution) -> None:
    """Set the values of ``model`` to those of ``solution``."""
    moving = moving_grids(model)[wrt]
    grid = moving.grid
    over_time = _variables_over_time(model, wrt, solution)
    for v, was in solution.constants.items():
        set_within_bounds(v, was)
    for name, found in over_time.items():
        if wrt.first() in found:
            set_within_bounds(found[wrt.first()], solution.values[name][wrt.first()])
    for element, piece, begin, end in _placed(grid, solution):
        _set_length(moving, element, end - begin)
        times = begin + (end - begin) * np.array([*grid.tau, 1.0][: len(element.own_labels)])
        for name, found in over_time.items():
            _set_all(found, element.own_labels, solution.inside(name, piece, times))
    if moving.hysteresis is not None or moving.state_jumps is not None:
        # after an error, the values up to there are a start too
        with suppress(FesdError):
            simulate(model, wrt)


def _variables_over_time(model, wrt, solution):
    free = (v for v in model.component_data_objects(Var, descend_into=Block) if not v.fixed)
    return {name: found for name, found in TimeIndex(wrt).families(free).items() if name in solution.values}


def _set_length(moving, element, h):
    """Set the length multiplier of an element to the length h on physical time."""
    multiplier = moving.r[element.n]
    if not multiplier.fixed:
        speed = 1.0 if moving.sigma is None else value(moving.sigma[element.n])
        multiplier.set_value(h / (speed * element.length), skip_validation=True)


def _set_all(variables, labels, numbers):
    for label, number in zip(labels, numbers):
        if label in variables:
            set_within_bounds(variables[label], number)


def _placed(grid, solution) -> Iterator[tuple]:
    """``(element, piece, begin, end)`` of all elements of the new grid, on physical time."""
    for elements in grid.stages.values():
        inside = list(_cut(solution, *solution.at_boundaries([elements[0].left, elements[-1].right])))
        waiting = iter(elements)
        for (piece, first, last), number in zip(inside, numbers_of_elements([b - a for _, a, b in inside], len(elements))):
            nodes = np.linspace(first, last, number + 1)
            for begin, end in zip(nodes, nodes[1:]):
                yield next(waiting), piece, begin, end


def _cut(solution, begin, end):
    """``(piece, first, last)`` of the pieces between two times, each as far as it lies there."""
    for piece in solution.pieces:
        first, last = max(begin, piece.nodes[0]), min(end, piece.nodes[-1])
        if last - first > SHORT * (end - begin):
            yield piece, first, last
