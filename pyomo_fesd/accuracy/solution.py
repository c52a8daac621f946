"""What one round has found, as plain numbers: it outlives the grid, which is taken back.

A *piece* is a run of elements of one control stage in which one active set holds: between two switches, jumps or stage
boundaries.  Inside it the solution is smooth; eta of step equilibration (theory, eq. 12) tells where it ends.
"""

from dataclasses import dataclass

import numpy as np
from pyomo.common.collections import ComponentMap
from pyomo.core import Block, Objective, Var, value
from pyomo.core.base.suffix import SuffixFinder
from pyomo.mpec import Complementarity
from scipy.interpolate import BarycentricInterpolator

from pyomo_fesd.elements.cross import grid_of
from pyomo_fesd.elements.memory import read_modes
from pyomo_fesd.records import records
from pyomo_fesd.timeindex import TimeIndex, derivatives
from pyomo_fesd.trajectory import jumps_that_happen, physical_time
from pyomo_fesd.values import finite, number


@dataclass(frozen=True)
class Piece:
    """A smooth piece.

    Attributes
    ----------
    stage : int
    modes : tuple
        what tells its active set from others
    elements : tuple of Element
    nodes : ndarray, shape (n + 1,)
        physical times of the element boundaries
    """

    stage: int
    modes: tuple
    elements: tuple
    nodes: np.ndarray

    @property
    def length(self):
        """On physical time."""
        return self.nodes[-1] - self.nodes[0]


@dataclass(frozen=True)
class Solution:
    """The solution of one round.

    Attributes
    ----------
    grid : Grid
    time : dict label -> physical time
    values : dict family name -> dict label -> value
        of every variable over time
    states : dict family name -> size that an error is compared with
    rates : dict family name of a state -> family name of its first derivative
    after : dict element number -> dict family name -> value after the jump that begins the element
    pieces : tuple of Piece
    constants : ComponentMap VarData -> value
        of the variables without time
    quantities : ndarray
        what the user has named
    objective : float
        nan without one
    pairs : int
    """

    grid: object
    time: dict
    values: dict
    states: dict
    rates: dict
    after: dict
    pieces: tuple
    constants: ComponentMap
    quantities: np.ndarray
    objective: float
    pairs: int

    def begin(self, name, element):
        """Value of a state where an element begins."""
        return self.after.get(element.n, {}).get(name, self.values[name].get(element.left, np.nan))

    def at_nodes(self, name, piece):
        """A state at the nodes of a piece."""
        return np.array([self.begin(name, piece.elements[0]), *(self.values[name][e.right] for e in piece.elements)])

    def slopes_at_nodes(self, name, piece):
        """Its derivatives at the nodes of a piece but the first; None where no stage point stands on them."""
        if name not in self.rates or not self.grid.right_is_stage:
            return None
        return np.array([self.values[self.rates[name]].get(e.right, np.nan) for e in piece.elements])

    def polynomial(self, name, element):
        """``(nodes on [0, 1], values)`` of a variable in an element; a state is known at its left boundary too."""
        values = [self.values[name].get(t, np.nan) for t in element.points]
        if name in self.states:
            return np.array([0.0, *self.grid.tau]), np.array([self.begin(name, element), *values])
        return np.array(self.grid.tau), np.array(values)

    def inside(self, name, piece, times):
        """A variable at physical ``times`` in a piece, by the collocation polynomials."""
        number = np.clip(np.searchsorted(piece.nodes, times, side='left') - 1, 0, len(piece.elements) - 1)
        found = np.empty(len(times))
        for k in set(number):
            tau, values = self.polynomial(name, piece.elements[k])
            share = (times[number == k] - piece.nodes[k]) / (piece.nodes[k + 1] - piece.nodes[k])
            found[number == k] = BarycentricInterpolator(tau, values)(share)
        return found


def read_solution(model, wrt, quantities):
    """Read what a round has found.

    Parameters
    ----------
    quantities : list of (component, index)
    """
    block, times = records(model).grids[wrt], TimeIndex(wrt)
    grid, time = grid_of(block), physical_time(model, wrt)
    variables = list(model.component_data_objects(Var, descend_into=Block))
    families = times.families(variables)
    objective = next(model.component_data_objects(Objective, active=True, descend_into=Block), None)
    return Solution(
        grid,
        time,
        {name: {t: number(v) for t, v in family.items()} for name, family in families.items()},
        _states(model, wrt, times),
        _rates(model, wrt, times),
        {e.n + 1: {times.split(x)[1]: v for x, v in found} for e, _, _, found in jumps_that_happen(model, wrt)},
        tuple(_pieces(model, wrt, block, grid, time)),
        ComponentMap((v, v.value) for v in variables if times.time(v) is None and not v.fixed),
        np.array([number(component[index]) for component, index in quantities]),
        number(objective),
        sum(1 for _ in model.component_data_objects(Complementarity, active=True, descend_into=Block)),
    )


def _states(model, wrt, times):
    """The size of every state: the largest value on its way, at least 1, or the inverse of its ``scaling_factor``."""
    factor, sizes = SuffixFinder('scaling_factor', 1.0, model.model()).find, {}
    for derivative in derivatives(model, wrt):
        for v in derivative.get_state_var().values():
            name = times.split(v)[1]
            sizes[name] = max(sizes.get(name, 1 / abs(factor(v))), abs(finite(v)))
    return sizes


def _rates(model, wrt, times):
    first = (d for d in derivatives(model, wrt) if sum(1 for s in d.get_continuousset_list() if s is wrt) == 1)
    return {times.split(d.get_state_var()[i])[1]: times.split(d[i])[1] for d in first for i in d}


def _pieces(model, wrt, block, grid, time):
    eta, jumps = block.component('eta'), block.component('jumps')
    memories = read_modes(model, wrt)
    for stage, elements in grid.stages.items():
        runs = [[elements[0]]]
        for before, after in zip(elements, elements[1:]):
            if eta is not None and value(eta[before.n]) < 0.5:
                runs.append([])
            runs[-1].append(after)
        for run in runs:
            nodes = np.array([time[run[0].left], *(time[e.right] for e in run)])
            yield Piece(stage, _modes(block, memories, jumps, run), tuple(run), nodes)


def _modes(block, memories, jumps, run):
    """Which sides are on in a piece, which modes with memory, and which jump begins it."""
    first, theta = run[0], block.component('theta')
    sides = [] if theta is None else [finite(theta[f, first.n]) > 0.5 for f in block.family if (f, first.n) in theta]
    weights = [finite(mode.weight(first)) > 0.5 for mode in memories]
    jumped = [] if jumps is None or first.n == 1 else [finite(jumps.e[law, first.n - 1]) > 0.5 for law in jumps.law]
    return (*sides, *weights, *jumped)
