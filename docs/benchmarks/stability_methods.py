"""The methods of the stability study: each takes a system and tells what it found and what it said."""

import logging
from contextlib import contextmanager
from dataclasses import dataclass

import pyomo.environ as pyo
from stability_systems import fixed_grid, model, reached, smoothed, transform_moving

import pyomo_fesd

#: Fixed grids get more elements than moving ones, and a step of tanh this width, relative to the switching function at time 0.
FINER, WIDTH = 4, 1e-3


@dataclass
class Outcome:
    """What a method says.

    Attributes
    ----------
    solved : bool
        whether it claims success
    values : list
        what it found, to be compared with the answer
    said : str
        status and warnings
    warned : bool
    """

    solved: bool
    values: list
    said: str = ''
    warned: bool = False


@contextmanager
def warnings_of_package():
    """The warnings of pyomo_fesd, gathered in a list."""
    logger, said = logging.getLogger('pyomo_fesd'), []
    handler = logging.Handler(logging.WARNING)
    handler.emit = lambda record: said.append(record.getMessage())
    logger.addHandler(handler)
    kept, logger.propagate = logger.propagate, False
    try:
        yield said
    finally:
        logger.removeHandler(handler)
        logger.propagate = kept


def told(solve, values):
    """Run ``solve`` and say what it found; an error of the package is a refusal."""
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


def ours(system, case, limit):
    """mpec_hybrid as it comes."""

    def solve():
        transform_moving(m, system, case.nfe, case.ncp, case.scheme)
        return pyo.SolverFactory('mpec_hybrid').solve(m, time_limit=limit)

    m = model(system)
    return told(solve, lambda: reached(m))


def marched(system, case, limit):
    """simulate, where nothing is free."""

    def solve():
        transform_moving(m, system, case.nfe, case.ncp, case.scheme)
        pyomo_fesd.simulate(m, time_limit=limit)

    m = model(system)
    return told(solve, lambda: reached(m))


def fixed(system, case, limit):
    """The same complementarity conditions on pyomo.dae's grid."""
    m = model(system, fixed_grid(system, FINER * case.nfe, case.ncp))

    def solve():
        pyo.TransformationFactory('fesd.dcs').apply_to(m)
        return pyo.SolverFactory('mpec_hybrid').solve(m, time_limit=limit)

    return told(solve, lambda: reached(m))


def smooth(system, case, limit):
    """tanh instead of the step, on pyomo.dae's grid."""
    m = smoothed(system, WIDTH)
    fixed_grid(system, FINER * case.nfe, case.ncp)(m)
    return told(lambda: pyo.SolverFactory('mpec_hybrid').solve(m, time_limit=limit), lambda: reached(m))


def nosnoc(system, case, limit):
    """nosnoc 0.2.0 at its defaults."""
    import stability_nosnoc

    solve = stability_nosnoc.solve_free if system.free else stability_nosnoc.solve
    try:
        solved, values, said = solve(system, case.nfe, case.ncp, case.scheme)
    except NotImplementedError:
        return None
    except Exception as error:
        return Outcome(False, None, f'{type(error).__name__}: {error}'.split('\n')[0][:160], True)
    return Outcome(solved, values, ('SUCCESS' if solved else 'INFEASIBLE') + (f' | {said}' if said else ''))


METHODS = {'mpec_hybrid': ours, 'simulate': marched, 'fixed grid': fixed, 'smoothing': smooth, 'nosnoc': nosnoc}
