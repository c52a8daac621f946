"""How the tests run a model, and how they compare what a user sees of it before and after."""

import pyomo.environ as pyo

import pyomo_fesd
from pyomo_fesd.core import all_hints
from tests.models import dcs, snapshot

RADAU, LEGENDRE = 'LAGRANGE-RADAU', 'LAGRANGE-LEGENDRE'
SCHEMES = (RADAU, LEGENDRE)
#: Schemes for which one element per mode is exact where the right-hand sides are constants.
EXACT_SCHEMES = ((RADAU, 1), (RADAU, 2), (RADAU, 3), (LEGENDRE, 1), (LEGENDRE, 2), (LEGENDRE, 3))


def move(m, nfe=4, ncp=2, **keywords):
    """Apply fesd.finite_elements in place, the only ContinuousSet found by itself."""
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=nfe, ncp=ncp, **keywords)
    return m


def transform(m, nfe=4, ncp=2, form='auto', **keywords):
    """fesd.dcs and fesd.finite_elements in a row."""
    return move(dcs(m, form=form), nfe, ncp, **keywords)


def solve(m, **options):
    """Solve; the test fails here if the solver is not content.  Returns the model."""
    results = pyo.SolverFactory('mpec_hybrid').solve(m, **options)
    assert pyo.check_optimal_termination(results), results.solver.message
    return m


def run(m, nfe=4, ncp=2, **keywords):
    """Transform and solve; returns the model."""
    return solve(transform(m, nfe, ncp, **keywords))


def lengths(m):
    """Lengths of the elements in order, on physical time."""
    return list(pyomo_fesd.element_lengths(m)['length'])


def multipliers(wrt):
    """r_n of each element of a moving grid: an IndexedVar over 1..N."""
    return pyo.TransformationFactory('fesd.finite_elements').get_element_lengths(wrt)


def seen(m):
    """``snapshot``, marks and hints, without the order of declaration and without stale flags, which Pyomo has for all models."""
    found = {}
    for key, value in snapshot(m).items():
        if key[1:] == ('components',):
            value = sorted(map(str, value))
        elif isinstance(value, tuple) and len(value) == 3:
            value = value[:2]
        found[key] = value
    for suffix in m.component_data_objects(pyo.Suffix):
        found[suffix.name, 'marked'] = sorted(component.name for component in suffix)
    hints = all_hints(m)
    return found | {('hints', kind): len(getattr(hints, kind)) for kind in hints.__slots__}
