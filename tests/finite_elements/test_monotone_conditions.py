"""A condition with which both sides grow determines a continuous variable: no warning, and switches on boundaries."""

import logging
from math import exp

import pyomo.environ as pyo
import pytest
from pyomo.mpec import Complementarity, complements

import pyomo_fesd
from tests.problems.laws import over

R, LEVEL = 0.5, 0.7
#: What is at least 0 beside the current i: in both directions of writing, and with a mutable resistance.
WRITINGS = {
    'linear': lambda m, t: LEVEL + R * m.i[t] - m.x[t] >= 0,
    'other side': lambda m, t: m.x[t] - R * m.i[t] <= LEVEL,
    'mutable': lambda m, t: LEVEL + m.R * m.i[t] - m.x[t] >= 0,
}


def diode(writing, resistance=R):
    """x' = 1 - i; from x = 0.7 on i = (x - 0.7) / R, so z = x - 0.7 obeys z' = 1 - 2 z."""
    m = over(2, x=0)
    m.R = pyo.Param(initialize=resistance, mutable=True)
    m.i = pyo.Var(m.t, initialize=0, bounds=(0, None))
    m.charge = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == 1 - m.i[t])
    m.diode = Complementarity(m.t, rule=lambda m, t: complements(m.i[t] >= 0, writing(m, t)))
    return m


def warnings(m, caplog):
    with caplog.at_level(logging.WARNING, 'pyomo_fesd'):
        pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=8, ncp=3)
    return [r.getMessage() for r in caplog.records if 'continuous in time' in r.getMessage()]


@pytest.mark.parametrize('name', WRITINGS)
def test_a_diode_with_a_resistor_is_continuous(name, caplog):
    m = diode(WRITINGS[name])
    assert not warnings(m, caplog)
    pyo.assert_optimal_termination(pyo.SolverFactory('mpec_hybrid').solve(m))
    assert m.x[2].value == pytest.approx(LEVEL + R * (1 - exp(-2 * 1.3)), abs=1e-5)
    time = pyomo_fesd.trajectory(m).index
    assert min(abs(time - LEVEL)) < 1e-8


@pytest.mark.parametrize('law', [lambda i: i + i**2, lambda i: i**3, lambda i: pyo.exp(i) - 1], ids=['sum', 'cube', 'exp'])
def test_a_law_that_grows_where_the_bounds_of_the_variable_hold_is_continuous(law, caplog):
    assert not warnings(diode(lambda m, t: LEVEL + law(m.i[t]) - m.x[t] >= 0), caplog)


@pytest.mark.parametrize('writing', [lambda m, t: LEVEL - m.R * m.i[t] - m.x[t] >= 0, lambda m, t: LEVEL - m.i[t] * m.x[t] >= 0])
def test_a_condition_that_does_not_grow_with_the_variable_is_still_warned_of(writing, caplog):
    assert warnings(diode(writing), caplog)
