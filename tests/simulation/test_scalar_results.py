"""Equations without a time of their own: initial values, and results such as an Integral."""

import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
from pyomo.gdp import Disjunction

import pyomo_fesd
from pyomo_fesd import FesdError
from tests.problems.laws import over


def falling():
    """x = 1 - t until t = 1, then it slides on 0."""
    m = over(2, x=1)
    m.mode = Disjunction(m.t, rule=lambda m, t: [[m.x[t] >= 0, m.dx[t] == -1], [m.x[t] <= 0, m.dx[t] == 1]])
    return m


def simulated(m):
    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=6, ncp=2)
    pyomo_fesd.simulate(m)
    return m


def _scalar(m):
    m.init = pyo.Constraint(expr=m.x[0] == 1)


def _by_list(m):
    m.init = pyo.ConstraintList()
    m.init.add(m.x[0] == 1)


def _by_list_with_another(m):
    m.level, m.init = pyo.Var(m.t), pyo.ConstraintList()
    m.measured = pyo.Constraint(m.t, rule=lambda m, t: m.level[t] == 2 * m.x[t])
    m.init.add(m.x[0] + m.level[0] == 3)


def _by_a_scalar(m):
    m.start = pyo.Var(initialize=0.25)
    m.known = pyo.Constraint(expr=m.start == 1)
    m.init = pyo.Constraint(expr=m.x[0] == m.start)


@pytest.mark.parametrize('state', [_scalar, _by_list, _by_list_with_another, _by_a_scalar])
def test_initial_values_may_be_given_by_equations_without_a_time_of_their_own(state):
    m = falling()
    m.x[0].unfix()
    m.x[0].value = 0.3
    state(m)
    simulated(m)
    assert m.x[0].value == pytest.approx(1)
    assert [s.time for s in pyomo_fesd.switches(m)] == pytest.approx([1])


def test_an_equation_of_another_time_gives_no_initial_value():
    m = falling()
    m.x[0].unfix()
    m.end = pyo.Constraint(expr=m.x[2] == 0)
    with pytest.raises(FesdError, match='neither fixed at the first time nor determined'):
        simulated(m)


def test_variables_without_time_that_follow_from_the_solution_are_set():
    m = falling()
    m.square = dae.Integral(m.t, rule=lambda m, t: m.x[t] ** 2)
    m.cost, m.both, m.end, m.given = pyo.Var(initialize=7), pyo.Var(), pyo.Var(), pyo.Var(initialize=5)
    m.is_both = pyo.Constraint(expr=m.both == 2 * m.cost + m.end)
    m.is_cost = pyo.Constraint(expr=m.cost == m.square)
    m.is_end = pyo.Constraint(expr=m.end == m.x[2] + 1)
    simulated(m)
    assert [m.cost.value, m.end.value, m.both.value] == pytest.approx([1 / 3, 1, 5 / 3], abs=1e-9)
    assert m.given.value == 5
    assert not m.cost.stale


def test_variables_without_time_in_equations_over_time_stay_as_given():
    m = over(1, x=0)
    m.rate, m.end = pyo.Var(initialize=2), pyo.Var()
    m.mode = Disjunction(m.t, rule=lambda m, t: [[m.x[t] >= 1, m.dx[t] == 1], [m.x[t] <= 1, m.dx[t] == m.rate]])
    m.is_end = pyo.Constraint(expr=m.end == m.x[1] + m.rate)
    simulated(m)
    assert [m.rate.value, m.end.value] == pytest.approx([2, 3.5])
