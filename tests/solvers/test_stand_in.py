"""The names of Ipopt's executable mean casadi_ipopt while it stands in, and afterwards what they meant before."""

import logging

import pyomo.environ as pyo
import pytest
from pyomo.contrib.solver.common.factory import SolverFactory as NewSolverFactory

import pyomo_fesd
from pyomo_fesd import casadi_ipopt


def root():
    m = pyo.ConcreteModel()
    m.x = pyo.Var(initialize=1.0)
    m.square = pyo.Constraint(expr=m.x**2 == 4)
    return m


def registered():
    return [pyo.SolverFactory._cls.get(n) for n in ('ipopt', 'ipopt_v2')] + [NewSolverFactory._cls.get('ipopt')]


@pytest.mark.parametrize('make', [pyo.SolverFactory, NewSolverFactory])
@pytest.mark.parametrize('name', ['ipopt', 'ipopt_v2'])
def test_the_names_mean_casadis_ipopt(make, name):
    if make is NewSolverFactory and name == 'ipopt_v2':
        pytest.skip("no name of the newer registry")
    m = root()
    with casadi_ipopt.stand_in():
        solver = make(name)
        assert solver.available()
        solver.solve(m)
    assert m.x.value == pytest.approx(2)


def test_it_is_undone_also_after_an_error_and_inside_another(caplog):
    before = registered()
    with caplog.at_level(logging.INFO, 'pyomo_fesd'), pytest.raises(ZeroDivisionError), casadi_ipopt.stand_in():
        during = registered()
        with casadi_ipopt.stand_in():
            pass
        assert registered() == during != before
        raise ZeroDivisionError
    assert registered() == before and "stands in for 'ipopt' and 'ipopt_v2'" in caplog.text
    replacement = casadi_ipopt.stand_in()
    replacement.undo()
    replacement.undo()
    assert registered() == before


def test_what_scripts_say_to_an_executable_is_understood():
    m = root()
    with casadi_ipopt.stand_in():
        solver = pyo.SolverFactory('ipopt', executable='/nowhere/ipopt', solver_io='nl', options={'linear_solver': 'ma57'})
        solver.set_options('tol=1e-9 max_iter=1')
        results = solver.solve(m, keepfiles=False, symbolic_solver_labels=True, tee=False, load_solutions=False)
        assert results.solver.termination_condition == pyo.TerminationCondition.maxIterations
        solver.options['max_iter'] = 50
        solver.options['ma57_automatic_scaling'] = 'yes'
        pyo.assert_optimal_termination(solver.solve(m, options={'halt_on_ampl_error': 'yes'}))


def test_importing_the_package_replaces_nothing():
    assert not any(c in (casadi_ipopt.LegacyStandInIpopt, casadi_ipopt.StandInIpopt) for c in registered())


# If-then-else in a static model


def friction(x, y):
    """y = log x + (1 below 5, else x**2) from 1 on, 3 below."""
    inner = pyo.Expr_if(x <= 5, 1, x**2)
    return y == pyo.Expr_if(x >= 1, pyo.log(x) + inner, 3) + 1


@pytest.mark.parametrize('x, y', [(2.0, 2.693147180559945), (-1.0, 4.0), (10.0, 103.30258509299405)])
def test_if_then_else_is_evaluated_and_the_model_stays(x, y):
    m = pyo.ConcreteModel()
    m.x, m.y = pyo.Var(initialize=x), pyo.Var(initialize=2.0)
    m.given = pyo.Constraint(expr=m.x == x)
    m.law = pyo.Constraint(expr=friction(m.x, m.y))
    m.scale = pyo.Param(initialize=2.0, mutable=True)
    m.cost = pyo.Objective(expr=pyo.Expr_if(pyo.inequality(0, m.x, 5), m.scale, 7.0) + m.x)
    before = [c.name for c in m.component_objects()]
    results = pyo.SolverFactory('casadi_ipopt').solve(m)
    assert m.y.value == pytest.approx(y, rel=1e-8)
    assert pyo.value(m.cost) == pytest.approx((2.0 if 0 <= x <= 5 else 7.0) + x)
    assert results.solver.message == 'Solve Succeeded'
    assert [c.name for c in m.component_objects()] == before and m.law.active and m.cost.active


def test_an_optimum_inside_a_branch():
    m = pyo.ConcreteModel()
    m.x = pyo.Var(initialize=3.0)
    m.cost = pyo.Objective(expr=pyo.Expr_if(m.x >= 1, (m.x - 2) ** 2, 50 - m.x))
    pyo.SolverFactory('casadi_ipopt').solve(m)
    assert m.x.value == pytest.approx(2.0)


def test_mpec_hybrid_refuses_it_since_it_would_not_find_the_kink():
    m = root()
    m.y = pyo.Var(initialize=1.0)
    m.law = pyo.Constraint(expr=friction(m.x, m.y))
    with pytest.raises(pyomo_fesd.FesdError, match="law: the function 'Expr_if'"):
        pyo.SolverFactory('mpec_hybrid').solve(m)
    assert m.law.active


def test_a_condition_that_is_no_inequality_is_refused():
    m = root()
    m.y = pyo.Var(initialize=1.0)
    m.law = pyo.Constraint(expr=m.y == pyo.Expr_if(pyo.Expr_if(m.x >= 1, 1, 0), m.x, 2))
    with pytest.raises(pyomo_fesd.FesdError, match="if-then-else whose condition is no inequality"):
        pyo.SolverFactory('casadi_ipopt').solve(m)
    assert m.law.active and m.component('_pyomo_fesd_conditionals') is None


def test_external_functions_are_refused_with_a_way_out():
    m = root()
    m.f = pyo.ExternalFunction(lambda x: x**2)
    m.law = pyo.Constraint(expr=m.f(m.x) == 4)
    with pytest.raises(Exception, match="external|compiled library"):
        pyo.SolverFactory('casadi_ipopt').solve(m)
