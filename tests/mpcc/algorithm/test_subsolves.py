"""What the single NLPs of a run are given: Ipopt's own scaling, and its barrier parameter beside impacts."""

import pyomo.environ as pyo
import pytest
from problems import contacts, free_start
from pyomo import mpec

from pyomo_fesd.mpcc.algorithm.subsolves import CENTRED, STEEP, STEEPEST_ROW
from pyomo_fesd.mpcc.nlp.casadi_solvers import CasadiIpopt


@pytest.fixture
def budgets(monkeypatch):
    """The name and the budget of each NLP solver that is made."""
    made, init = [], CasadiIpopt.__init__

    def watched(self, name, x, p, f, g, budget, *args, **options):
        made.append((name, budget))
        init(self, name, x, p, f, g, budget, *args, **options)

    monkeypatch.setattr(CasadiIpopt, '__init__', watched)
    return made


@pytest.fixture
def lasts(monkeypatch):
    """Of each NLP solver that is made the name, the budget of a start with multipliers, and whether its Hessian is shifted."""
    made, init = [], CasadiIpopt.__init__

    def watched(self, name, *args):
        made.append((name, *args[-2:]))
        init(self, name, *args)

    monkeypatch.setattr(CasadiIpopt, '__init__', watched)
    return made


def solve_steep(weight, **options):
    """Solve with an objective whose gradient at the start has the largest entry 35/6 ``weight``, by x(2) = -1."""
    m = free_start.build_free()
    m.cost.set_value(weight * m.cost.expr)
    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=2, ncp=2)
    pyo.SolverFactory('mpec_hybrid').solve(m, **options)


@pytest.mark.parametrize('weight, factor', [(1.0, 1.0), (1e3, STEEP / (1e3 * 35 / 6)), (1e4, STEEP / STEEPEST_ROW)])
def test_where_elements_have_lengths_ipopt_leaves_steep_rows_and_the_objective_has_its_own_factor(budgets, weight, factor):
    solve_steep(weight)
    # the simulation before the first relaxation has NLPs of its own, without the objective
    assert all(budget['nlp_scaling_max_gradient'] == STEEPEST_ROW for _, budget in budgets)
    for of in ('elastic', 'branch'):
        assert pytest.approx(factor) in [budget['obj_scaling_factor'] for name, budget in budgets if name == of]


@pytest.mark.parametrize('options', [{'nlp_scaling_method': 'none'}, {'nlp_scaling_max_gradient': 100.0}])
def test_the_user_says_how_ipopt_scales(budgets, options):
    solve_steep(1e3, nlp_options=options)
    assert budgets and not any('obj_scaling_factor' in budget for _, budget in budgets)


def test_another_option_of_the_user_leaves_the_factor(budgets):
    solve_steep(1e3, nlp_options={'mumps_scaling': 77})
    assert any(budget['obj_scaling_factor'] < 1.0 for _, budget in budgets)


def test_a_problem_without_parts_has_ipopts_own_scaling(budgets):
    m = pyo.ConcreteModel()
    m.x, m.y = (pyo.Var(bounds=(0, None), initialize=1.0) for _ in range(2))
    m.rows = mpec.Complementarity(expr=mpec.complements(m.x >= 0, m.y >= 0))
    m.cost = pyo.Objective(expr=1e3 * (m.x - 1) ** 2 + m.y)
    pyo.SolverFactory('mpec_hybrid').solve(m)
    assert budgets and not any('nlp_scaling_max_gradient' in budget for _, budget in budgets)


def solve_ball(**options):
    """Solve a ball that bounces, without a simulation before."""
    m = contacts.ball(0.5)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=4, ncp=2)
    pyo.SolverFactory('mpec_hybrid').solve(m, **{'simulate_first': False} | options)


def test_beside_impacts_ipopt_scales_as_ever(budgets):
    solve_ball()
    assert budgets and not any('nlp_scaling_max_gradient' in budget for _, budget in budgets)


def test_only_relaxations_beside_impacts_are_centred_where_they_start_with_multipliers(budgets, lasts):
    solve_steep(1.0)
    assert budgets and not any(warm for _, warm, _ in lasts)
    solve_ball()
    relaxations = {name for name, _ in budgets} & {'elastic', 'scholtes'}
    assert {name for name, warm, _ in lasts if warm} == relaxations and all(warm in (None, CENTRED) for _, warm, _ in lasts)


def test_hessians_are_shifted_beside_impacts_where_no_simulation_completes_points(lasts):
    solve_steep(1.0)
    assert lasts and not any(shifts for *_, shifts in lasts)
    lasts.clear()
    solve_ball()
    assert {name for name, *_ in lasts} >= {'elastic', 'branch'} and all(shifts for *_, shifts in lasts)
    lasts.clear()
    solve_ball(simulate_first=True)
    assert 'branch' in {name for name, *_ in lasts} and not any(shifts for *_, shifts in lasts)
