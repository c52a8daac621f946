"""No review costs a result: functions that Pyomo does not differentiate, and reviews that fail."""

import logging

import pyomo.environ as pyo
import pytest
from pyomo.gdp import Disjunction

import pyomo_fesd
from pyomo_fesd.diagnostics import review
from tests.problems.laws import over


def relay(function):
    """A relay that reaches 0 and slides there; an algebraic variable follows by ``function``."""
    m = over(2, x=1)
    m.a = pyo.Var(m.t)
    m.follows = pyo.Constraint(m.t, rule=lambda m, t: m.a[t] == function(m.x[t]))
    m.mode = Disjunction(
        m.t,
        rule=lambda m, t: [[m.x[t] >= 0, m.dx[t] == -1 - 0.1 * m.a[t]], [m.x[t] <= 0, m.dx[t] == 1 - 0.1 * m.a[t]]],
    )
    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=6, ncp=2)
    return m


@pytest.mark.parametrize('name', ['tanh', 'sinh', 'cosh', 'abs', 'atan'])
@pytest.mark.parametrize('solver', ['simulate', 'mpec_hybrid'])
def test_functions_that_pyomo_does_not_differentiate_are_reviewed(name, solver, caplog):
    m = relay(abs if name == 'abs' else getattr(pyo, name))
    caplog.clear()  # fesd.finite_elements names the nonsmooth term
    with caplog.at_level(logging.WARNING, 'pyomo_fesd'):
        if solver == 'simulate':
            pyomo_fesd.simulate(m)
        else:
            pyo.assert_optimal_termination(pyo.SolverFactory(solver).solve(m))
    assert m.x[2].value == pytest.approx(0, abs=1e-8)
    assert not caplog.records


@pytest.mark.parametrize('name', review.CHECKS)
def test_a_review_that_fails_logs_one_line_and_the_result_stays(name, monkeypatch, caplog):
    def fails(*_):
        raise ArithmeticError("two\nlines")

    monkeypatch.setitem(review.CHECKS, name, fails)
    m = relay(pyo.tanh)
    with caplog.at_level(logging.WARNING, 'pyomo_fesd'):
        results = pyo.SolverFactory('mpec_hybrid').solve(m)
        trajectory = pyomo_fesd.simulate(m)
    pyo.assert_optimal_termination(results)
    assert trajectory['x'].iloc[-1] == pytest.approx(0, abs=1e-8)
    assert [r.getMessage() for r in caplog.records] == [
        f't: the solution stands, but it was not reviewed for {name}: two lines'
    ] * 2
    assert len(results.solver.warnings) == 1
