"""One run of a random system with one method, and its verdict."""

import numpy as np
import pyomo.environ as pyo
from benchmarks.common.warnings_of_package import warnings_of_package
from benchmarks.random_systems.systems import end_state, model, to_complementarity, transform

import pyomo_fesd

#: Largest error of a right answer, relative to the largest size of each state on the way.
TOLERANCE = 1e-3
RIGHT, ALARM, REFUSED, WRONG = 'right', 'right with a warning', 'refused', 'silently wrong'
VERDICTS = (RIGHT, ALARM, REFUSED, WRONG)


def simulate(m, system, limit):
    """Run ``simulate`` on elements; it raises an error where it does not succeed."""
    pyomo_fesd.simulate(transform(m, system), time_limit=limit)
    return 'simulated'


def simulate_without_grid(m, system, limit):
    """Run ``simulate`` on a model without elements."""
    pyomo_fesd.simulate(to_complementarity(m, system), nfe=system.nfe, ncp=3, time_limit=limit)
    return 'simulated'


def mpec_hybrid(m, system, limit):
    """Run ``mpec_hybrid`` at its defaults; raises an error where it claims no solution."""
    results = pyo.SolverFactory('mpec_hybrid').solve(transform(m, system), time_limit=limit)
    if results.solver.termination_condition != pyo.TerminationCondition.optimal:
        raise RuntimeError(f'{results.solver.termination_condition}: {results.solver.message}')
    return str(results.solver.message)


METHODS = {'simulate': simulate, 'simulate, no grid': simulate_without_grid, 'mpec_hybrid': mpec_hybrid}


def run(system, found, method, limit):
    """Return the verdict, the error and the messages of one run."""
    with warnings_of_package() as said:
        try:
            m = model(system)
            status = METHODS[method](m, system, limit)
        except Exception as error:
            return REFUSED, np.nan, f'{type(error).__name__}: {error}'.replace('\n', ' ')[:300]
    error = np.max(np.abs(end_state(m, system) - found.x) / np.maximum(found.size, 1e-2))
    return _verdict(found, error, bool(said)), error, ' | '.join([status, *said]).replace('\n', ' ')[:300]


def _verdict(found, error, warned):
    if not found.unique:
        # one of several solutions, which has to be said
        return RIGHT if warned else WRONG
    if error <= TOLERANCE:
        return ALARM if warned else RIGHT
    return REFUSED if warned else WRONG
