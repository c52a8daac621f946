"""``simulate``: solve a system with zero degrees of freedom element by element, or find a start for all elements at once.

Each element is solved by itself, so no homotopy over the whole horizon is needed.

Takes: a model whose states at the first time are fixed, on a moving grid or without elements.
Leaves: on a grid values of all variables over time, the solution of a system with zero degrees of freedom or a start for
``mpec_hybrid`` with ``warm_start=True``; without elements values at the times that the ContinuousSet has.
Does not apply: to systems with degrees of freedom; inputs have to be given.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from pyomo.common.dependencies import pandas as pd
from pyomo.common.gc_manager import PauseGC
from pyomo.common.timing import HierarchicalTimer
from pyomo.contrib.solver.common.factory import SolverFactory
from pyomo.core import Block, Var
from pyomo.core.base.var import VarData
from pyomo.dae import ContinuousSet

from pyomo_fesd.core import (
    FesdError,
    TimeIndex,
    check_keywords,
    derivatives,
    discretised,
    find_continuous_set,
    interruptible,
    kept_values,
    moving_grids,
    phase,
)
from pyomo_fesd.diagnostics import diagnose
from pyomo_fesd.finite_elements import FiniteElements
from pyomo_fesd.mpcc import Deadline
from pyomo_fesd.results import set_indicators, trajectory
from pyomo_fesd.simulation.inputs import read_inputs
from pyomo_fesd.simulation.marching_elements import MarchingElements
from pyomo_fesd.simulation.passes import Simulation
from pyomo_fesd.simulation.scalar_results import evaluate_scalars
from pyomo_fesd.simulation.static_equations import solve_static_equations
from pyomo_fesd.simulation.timeless_equations import timeless_equations
from pyomo_fesd.simulation.without_grid import OPTIONS, WithoutGrid


@interruptible
def simulate(
    model: Block,
    wrt: ContinuousSet | None = None,
    inputs: Var | Sequence[Var] = (),
    timer: HierarchicalTimer | None = None,
    **options,
) -> pd.DataFrame:
    """Simulate a system with zero degrees of freedom, element by element.

    A model after ``fesd.finite_elements`` is simulated on its grid and keeps the values there.  Any other one is simulated with
    ``nfe`` elements and one more for each switch, as written or after ``fesd.dcs`` (which it needs for ``hysteresis``).  These
    elements are no part of the model afterwards, nor are they all laid at once where they have the same equations.

    Parameters
    ----------
    model : Block
        its states are fixed at the first time
    wrt : ContinuousSet, optional
    inputs : Var or list of Var
        variables over time that keep their present values, such as a guess of controls; those named in
        ``piecewise_constant`` need not be named again.  Without a grid the value at the end of each control stage counts
    timer : pyomo.common.timing.HierarchicalTimer, optional
        for the time of each phase; in the phase ``march``, ``newton`` counts elements tried by Newton's method and ``mpcc`` the
        small problems with complementarity
    options : options of ``mpec_hybrid`` for the small problems with complementarity, solved where modes change; ``time_limit`` is
        that of the whole simulation.  Without a grid also ``nfe``, ``ncp``, ``scheme``, ``cross_complementarity``,
        ``piecewise_constant``, ``continuous`` and ``fixed_points``, as of ``fesd.finite_elements``

    Returns
    -------
    pandas.DataFrame
        the ``trajectory``; ``switches`` takes it as well as a model with a grid.  The model has the values on the grid; without
        one it has those at the times of its ContinuousSet.

    Raises
    ------
    FesdError
        where the simulation cannot go on: the time limit, more switches than elements of a grid, switches that accumulate (with
        their limit), a state that is not fixed at the first time, an undetermined variable.  A model with a grid has the values
        up to there; any other one is as before, and elements that march leave their trajectory as ``trajectory`` of the error.

    Examples
    --------
    >>> frame = pyomo_fesd.simulate(m, nfe=100, ncp=3)
    >>> pyomo_fesd.switches(frame)
    """
    wrt = find_continuous_set(model, wrt, 'simulate')
    grid = {name: options.pop(name) for name in OPTIONS if name in options}
    known = SolverFactory('mpec_hybrid').CONFIG
    check_keywords(known, options | {'timer': timer}, 'simulate')
    check_keywords(FiniteElements.CONFIG, grid, 'simulate')
    _check_grid(wrt, grid)
    deadline = Deadline.after(known(options).time_limit)
    options.pop('time_limit', None)
    timer = timer or HierarchicalTimer()
    inputs = read_inputs(inputs, wrt)
    run = _Run(model, wrt, inputs, options, timer, deadline)
    with PauseGC(), kept_values(states_fixed_later(model, wrt)), phase(timer, 'simulate'):
        return WithoutGrid(model, wrt, inputs, grid, timer).simulate(run.march, run.whole) if grid else run.whole()


def _check_grid(wrt, grid):
    """Refuse a model without elements and without ``nfe``, and options for elements that are there already."""
    if grid and discretised(wrt):
        raise FesdError(wrt, f"simulate: it has elements already, so {', '.join(grid)} does not apply", "leave it out")
    if 'nfe' not in grid and wrt not in moving_grids(wrt):
        fix = "apply fesd.finite_elements first" + ("" if discretised(wrt) else ", or say how many elements to simulate with (nfe)")
        raise FesdError(wrt, "simulate: its elements are not movable", fix)


class _Run:
    """One simulation of a model that has elements; parameters as of ``simulate``, with a Deadline."""

    def __init__(self, model, wrt, inputs, options, timer, deadline):
        self._model, self._wrt, self._inputs = model, wrt, inputs
        self._options, self._timer, self._deadline = options, timer, deadline

    def whole(self) -> pd.DataFrame:
        """Simulate on the whole grid; returns the trajectory."""
        times, timeless = self._read_timeless()
        with phase(self._timer, 'read'):
            simulation = Simulation(self._model, times, self._inputs, self._options, self._timer, self._deadline)
        with phase(self._timer, 'march'):
            simulation.run()
        with phase(self._timer, 'review'):
            self._complete(times, timeless)
            diagnose(self._model)
        with phase(self._timer, 'trajectory'):
            return trajectory(self._model, self._wrt)

    def march(self, numbers: list[int]) -> Callable[[], pd.DataFrame]:
        """Prepare elements that march along, these ``numbers`` and one for each switch; returns the function that simulates.

        Raises
        ------
        ElementsDiffer
        """
        times, timeless = self._read_timeless()
        with phase(self._timer, 'read'):
            marching = MarchingElements(self._model, times, self._inputs, numbers, self._options, self._timer, self._deadline)

        def run():
            with phase(self._timer, 'march'):
                marching.run()
            with phase(self._timer, 'review'):
                self._complete(times, timeless)
            with phase(self._timer, 'trajectory'):
                return marching.trajectory

        return run

    def _read_timeless(self):
        """Solve equations without time that are there before the simulation, and return all of them with the TimeIndex."""
        with phase(self._timer, 'read'):
            times = TimeIndex(self._wrt)
            timeless = timeless_equations(self._model, times)
            solve_static_equations(timeless, times)
        return times, timeless

    def _complete(self, times, timeless):
        """Set what follows from the values over time."""
        evaluate_scalars(self._model, times, timeless)
        set_indicators(self._model)


def states_fixed_later(model: Block, wrt: ContinuousSet) -> Iterator[VarData]:
    """Return the states that are fixed after the first time, as at the end of a control problem."""
    times = TimeIndex(wrt)
    for derivative in derivatives(model, wrt):
        for v in derivative.get_state_var().values():
            if v.fixed and times.time(v) != wrt.first():
                yield v
