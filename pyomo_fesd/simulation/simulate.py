"""``simulate``: solve a system with zero degrees of freedom on its moving grid, or find a start for all elements at once.

Element after element is solved by itself, so no homotopy over the whole horizon is needed.

Takes: a model on a moving grid whose states at the first time are fixed.
Leaves: values of all variables over time: the solution of a system with zero degrees of freedom (lengths are not equalised), or
a start for ``mpec_hybrid`` with ``warm_start=True``.
Does not apply: to systems with degrees of freedom; inputs have to be given.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

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
    find_continuous_set,
    interruptible,
    kept_values,
    moving_grids,
    phase,
)
from pyomo_fesd.diagnostics import diagnose
from pyomo_fesd.mpcc import Deadline
from pyomo_fesd.results import set_indicators, trajectory
from pyomo_fesd.simulation.inputs import read_inputs
from pyomo_fesd.simulation.passes import Simulation
from pyomo_fesd.simulation.scalar_results import evaluate_scalars
from pyomo_fesd.simulation.static_equations import solve_static_equations
from pyomo_fesd.simulation.timeless_equations import timeless_equations


@interruptible
def simulate(
    model: Block,
    wrt: ContinuousSet | None = None,
    inputs: Var | Sequence[Var] = (),
    timer: HierarchicalTimer | None = None,
    **options,
) -> pd.DataFrame:
    """Simulate a system with zero degrees of freedom on its moving grid, element by element.

    Parameters
    ----------
    model : Block
        after ``fesd.finite_elements``; its states are fixed at the first time
    wrt : ContinuousSet, optional
    inputs : Var or list of Var
        variables over time that keep their present values, such as a guess of controls; those named in
        ``piecewise_constant`` need not be named again
    timer : pyomo.common.timing.HierarchicalTimer, optional
        for the time of each phase; in the phase ``march``, ``newton`` counts elements tried by Newton's method and ``mpcc`` the
        small problems with complementarity
    options : options of ``mpec_hybrid`` for the small problems with complementarity, solved where modes change; ``time_limit`` is
        that of the whole simulation

    Returns
    -------
    pandas.DataFrame, the ``trajectory``; the model has the values

    Raises
    ------
    FesdError
        where the simulation cannot go on: the time limit, more switches than elements (with the time at which they accumulate, if
        they do), a state that is not fixed at the first time, an undetermined variable.  The model has the values up to there.
    """
    wrt = find_continuous_set(model, wrt, 'simulate')
    if wrt not in moving_grids(model):
        raise FesdError(wrt, "simulate: its elements are not movable", "apply fesd.finite_elements first")
    known = SolverFactory('mpec_hybrid').CONFIG
    check_keywords(known, options | {'timer': timer}, 'simulate')
    inputs = read_inputs(inputs, wrt)
    deadline = Deadline.after(known(options).time_limit)
    options.pop('time_limit', None)
    timer = timer or HierarchicalTimer()
    with PauseGC(), kept_values(states_fixed_later(model, wrt)), phase(timer, 'simulate'):
        with phase(timer, 'read'):
            times = TimeIndex(wrt)
            timeless = timeless_equations(model, times)
            solve_static_equations(timeless, times)
            simulation = Simulation(model, times, inputs, options, timer, deadline)
        with phase(timer, 'march'):
            simulation.run()
        with phase(timer, 'review'):
            evaluate_scalars(model, times, timeless)
            set_indicators(model)
            diagnose(model)
        with phase(timer, 'trajectory'):
            return trajectory(model, wrt)


def states_fixed_later(model: Block, wrt: ContinuousSet) -> Iterator[VarData]:
    """Return the states that are fixed after the first time, as at the end of a control problem."""
    times = TimeIndex(wrt)
    for derivative in derivatives(model, wrt):
        for v in derivative.get_state_var().values():
            if v.fixed and times.time(v) != wrt.first():
                yield v
