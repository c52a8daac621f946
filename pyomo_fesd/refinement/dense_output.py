"""The solution of one round as numbers, which outlive its grid.

A *piece* is a sequence of elements of one stage with the same active set: between two switches, jumps, or boundaries that keep
their time.  Inside it the solution is smooth; eta of step equilibration (theory, eq. 12) tells where it ends.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pyomo.common.collections import ComponentMap
from pyomo.core import Block, Var, value
from pyomo.core.base.suffix import SuffixFinder
from pyomo.dae import ContinuousSet
from pyomo.mpec import Complementarity
from scipy.interpolate import KroghInterpolator

from pyomo_fesd.core import TimeIndex, derivatives, moving_grids, value_or_nan, value_or_zero
from pyomo_fesd.refinement.checks import objectives
from pyomo_fesd.results import jumps_that_happen


@dataclass(frozen=True)
class Piece:
    """A smooth piece.

    Attributes
    ----------
    stage : int
    modes : tuple
        its active set
    elements : tuple of Element
    nodes : ndarray, shape (n + 1,)
        physical times of the element boundaries
    """

    stage: int
    modes: tuple
    elements: tuple
    nodes: np.ndarray

    @property
    def length(self) -> float:
        """Length on physical time."""
        return self.nodes[-1] - self.nodes[0]


@dataclass(frozen=True)
class RoundSolution:
    """The solution of one round.

    Attributes
    ----------
    grid : Grid
    time : dict label -> physical time
    values : dict name -> dict label -> value
        of every variable over time
    states : dict name -> size that an error is compared with
    rates : dict name of a state -> name of its first derivative
    after : dict element number -> dict name -> value after the jump that begins the element
    pieces : tuple of Piece
    constants : ComponentMap VarData -> value
        of the variables without time
    quantities : ndarray
        named by the user
    objective : float
        nan without one
    pairs : int
    """

    grid: object
    time: dict[float, float]
    values: dict[str, dict[float, float]]
    states: dict[str, float]
    rates: dict[str, str]
    after: dict[int, dict[str, float]]
    pieces: tuple[Piece, ...]
    constants: ComponentMap
    quantities: np.ndarray
    objective: float
    pairs: int

    def begin(self, name: str, element) -> float:
        """Return the value of a state where an element begins."""
        return self.after.get(element.n, {}).get(name, self.values[name].get(element.left, np.nan))

    def at_boundaries(self, labels: Sequence[float]) -> np.ndarray:
        """Return the physical times of labels that keep theirs."""
        return np.interp(labels, *self._boundaries())

    def label(self, time: float) -> float:
        """Return the label that a boundary at a physical time has if it keeps this time."""
        return float(np.interp(time, *reversed(self._boundaries())))

    def stage_labels(self) -> list[float]:
        """Return the labels of the boundaries that keep their time."""
        return [self.grid.elements[0].left, *(elements[-1].right for elements in self.grid.stages.values())]

    def _boundaries(self):
        labels = self.stage_labels()
        return labels, [self.time[t] for t in labels]

    def at_nodes(self, name: str, piece: Piece) -> np.ndarray:
        """Return a state at the nodes of a piece."""
        return np.array([self.begin(name, piece.elements[0]), *(self.values[name][e.right] for e in piece.elements)])

    def slopes_at_nodes(self, name: str, piece: Piece) -> np.ndarray | None:
        """Return its derivatives at all nodes of a piece but the first; None where these are not collocation points."""
        if name not in self.rates or not self.grid.right_is_collocated:
            return None
        return np.array([self.values[self.rates[name]].get(e.right, np.nan) for e in piece.elements])

    def polynomial(self, name: str, element) -> tuple[np.ndarray, np.ndarray]:
        """Return ``(nodes on [0, 1], values)`` of a variable in an element; a state is known at its left boundary too."""
        values = [self.values[name].get(t, np.nan) for t in element.points]
        if name in self.states:
            return np.array([0.0, *self.grid.tau]), np.array([self.begin(name, element), *values])
        return np.array(self.grid.tau), np.array(values)

    def inside(self, name: str, piece: Piece, times: np.ndarray) -> np.ndarray:
        """Return a variable at physical ``times`` in a piece, by the collocation polynomials."""
        numbers = np.clip(np.searchsorted(piece.nodes, times, side='left') - 1, 0, len(piece.elements) - 1)
        found = np.empty(len(times))
        for k in set(numbers):
            relative = (times[numbers == k] - piece.nodes[k]) / (piece.nodes[k + 1] - piece.nodes[k])
            found[numbers == k] = KroghInterpolator(*self.polynomial(name, piece.elements[k]))(relative)
        return found


def read_solution(model: Block, wrt: ContinuousSet, quantities: Sequence[tuple]) -> RoundSolution:
    """Read the solution of a round; ``quantities`` are pairs (component, index)."""
    moving, times = moving_grids(model)[wrt], TimeIndex(wrt)
    time = moving.physical_time()
    variables = list(model.component_data_objects(Var, descend_into=Block))
    objective = next(objectives(model), None)
    return RoundSolution(
        moving.grid,
        time,
        {name: {t: value_or_nan(v) for t, v in found.items()} for name, found in times.families(variables).items()},
        _states(model, wrt, times),
        _rates(model, wrt, times),
        {e.n + 1: {times.split(x)[1]: v for x, v in found} for e, _, _, found in jumps_that_happen(model, wrt)},
        tuple(_pieces(moving, time)),
        ComponentMap((v, v.value) for v in variables if times.time(v) is None and not v.fixed),
        np.array([value_or_nan(component[index]) for component, index in quantities]),
        value_or_nan(objective),
        sum(1 for _ in model.component_data_objects(Complementarity, active=True, descend_into=Block)),
    )


def _states(model, wrt, times):
    """The size of every state: its largest value over time, at least 1, or the inverse of its ``scaling_factor``."""
    factor, sizes = SuffixFinder('scaling_factor', 1.0, model.model()).find, {}
    for derivative in derivatives(model, wrt):
        for v in derivative.get_state_var().values():
            name = times.split(v)[1]
            sizes[name] = max(sizes.get(name, 1 / abs(factor(v))), abs(value_or_zero(v)))
    return sizes


def _rates(model, wrt, times):
    first = (d for d in derivatives(model, wrt) if sum(1 for s in d.get_continuousset_list() if s is wrt) == 1)
    return {times.split(d.get_state_var()[i])[1]: times.split(d[i])[1] for d in first for i in d}


def _pieces(moving, time):
    for stage, elements in moving.grid.stages.items():
        runs = [[elements[0]]]
        for before, after in zip(elements, elements[1:]):
            if moving.eta is not None and value(moving.eta[before.n]) < 0.5:
                runs.append([])
            runs[-1].append(after)
        for run in runs:
            nodes = np.array([time[run[0].left], *(time[e.right] for e in run)])
            yield Piece(stage, _modes(moving, run[0]), tuple(run), nodes)


def _modes(moving, first):
    """Which sides are positive in a piece, which modes with hysteresis are active, and which jumps begin it."""
    activity = {} if moving.activity is None else moving.activity
    found = [activity[index] for index in activity if index[1] == first.n]
    found += [] if moving.hysteresis is None else [mode.weight(first) for mode in moving.hysteresis.modes]
    jumps = () if moving.state_jumps is None or first.n == 1 else moving.state_jumps.active(first.n - 1)
    return (*(value_or_zero(number) > 0.5 for number in found), *jumps)
