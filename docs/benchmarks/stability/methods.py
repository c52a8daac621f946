"""The methods of the stability study: each solves a system and returns an ``Outcome``."""

from dataclasses import dataclass

import pyomo.environ as pyo
from benchmarks.common.warnings_of_package import warnings_of_package
from benchmarks.stability.systems import end_state, fixed_grid, model, moving_grid, smoothed

import pyomo_fesd

#: Factor of elements on fixed grids, and width of the smoothed step relative to the switching function at time 0.
FINER, WIDTH = 4, 1e-3


@dataclass
class Outcome:
    """Result and messages of a method.

    Attributes
    ----------
    solved : bool
        whether it claims success
    values : list
        result, to be compared with the answer; None without one
    said : str
        status and texts of warnings
    warned : bool
        whether it warned
    """

    solved: bool
    values: list
    said: str = ''
    warned: bool = False


def outcome_of(solve, values):
    """Run ``solve``, then ``values``; an exception is a refusal."""
    with warnings_of_package() as said:
        try:
            results = solve()
        except Exception as error:
            return Outcome(False, None, f'{type(error).__name__}: {error}'.split('\n')[0][:160], True)
        solved, status = True, 'simulated'
        if results is not None:
            solved = results.solver.termination_condition == pyo.TerminationCondition.optimal
            status = str(results.solver.message if solved else results.solver.termination_condition)
        return Outcome(solved, values(), ' | '.join([status, *(s[:120] for s in said)]).replace('\n', ' '), bool(said))


def with_mpec_hybrid(system, case, limit):
    """``mpec_hybrid`` on moving elements, at the defaults."""

    def solve():
        moving_grid(m, system, case.nfe, case.ncp, case.scheme)
        return pyo.SolverFactory('mpec_hybrid').solve(m, time_limit=limit)

    m = model(system)
    return outcome_of(solve, lambda: end_state(m))


def with_simulate(system, case, limit):
    """``simulate``, for zero degrees of freedom."""

    def solve():
        moving_grid(m, system, case.nfe, case.ncp, case.scheme)
        pyomo_fesd.simulate(m, time_limit=limit)

    m = model(system)
    return outcome_of(solve, lambda: end_state(m))


def with_fixed_grid(system, case, limit):
    """The same complementarity conditions on the grid of pyomo.dae."""
    m = model(system, fixed_grid(system, FINER * case.nfe, case.ncp))

    def solve():
        pyo.TransformationFactory('fesd.dcs').apply_to(m)
        return pyo.SolverFactory('mpec_hybrid').solve(m, time_limit=limit)

    return outcome_of(solve, lambda: end_state(m))


def with_smoothing(system, case, limit):
    """A tanh for each step, on the grid of pyomo.dae."""
    m = smoothed(system, WIDTH)
    fixed_grid(system, FINER * case.nfe, case.ncp)(m)
    return outcome_of(lambda: pyo.SolverFactory('mpec_hybrid').solve(m, time_limit=limit), lambda: end_state(m))


def with_nosnoc(system, case, limit):
    """nosnoc 0.2.0 at its defaults."""
    from benchmarks.stability import nosnoc_peer  # an optional package

    try:
        solved, values, said = nosnoc_peer.solve(system, case.nfe, case.ncp, case.scheme)
    except NotImplementedError:
        return None
    except Exception as error:
        return Outcome(False, None, f'{type(error).__name__}: {error}'.split('\n')[0][:160], True)
    return Outcome(solved, values, ('SUCCESS' if solved else 'INFEASIBLE') + (f' | {said}' if said else ''))


METHODS = {
    'mpec_hybrid': with_mpec_hybrid,
    'simulate': with_simulate,
    'fixed grid': with_fixed_grid,
    'smoothing': with_smoothing,
    'nosnoc': with_nosnoc,
}
