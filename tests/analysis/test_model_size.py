"""The size of a model, as the solver will see it.

The numbers follow from the equations.  For signum with T times (the first, and K in each of N Radau elements; with Gauss the
boundary, too), all but x at the first time free:

    variables    x, dx, nu, p, n at every time, r of every element                          5 T - 1 + N
    constraints  K N discretisation, T + T switching and mode, 1 length                     K N + 2 T + 1
                 with Gauss N continuity equations and N held copies of nu more             + 2 N
    pairs        two at the first time and in each element (eq. 11a)                        2 (N + 1)
    decided      one between two elements (eq. 13)                                          N - 1
"""

import gas_liquid_tank
import pyomo.environ as pyo
import pytest
import signum
from pyomo.common.timing import HierarchicalTimer
from pyomo.gdp import Disjunction
from pyomo.mpec import Complementarity, complements

import pyomo_fesd
from pyomo_fesd.mpcc.compile.compile import compile_mpcc
from pyomo_fesd.mpcc.compile.read_mpcc import read_mpcc
from tests.models import dcs
from tests.problems import free_start, held_control, sliding, weir
from tests.problems.running import LEGENDRE, RADAU, move, run, transform


def counts(report):
    """Variables, constraints and pairs."""
    return report['variables'], report['constraints'], report['pairs'] + report['decided']


def compiled(m):
    """The same of what the solver compiles."""
    problem = compile_mpcc(read_mpcc(m), HierarchicalTimer())
    return len(problem.variables), len(problem.constraints), len(problem.conditions) + problem.eta.numel()


def test_signum_as_in_its_example():
    assert pyomo_fesd.report(transform(signum.build(), 10, 2, scheme=LEGENDRE)) == {
        'variables': 164,
        'multipliers': 103,
        'constraints': 103,
        'pairs': 22,
        'decided': 27,
        'binaries at most': 22,
        'sources': 60,
        'disjunctions': 31,
        'modes left out': 0,
    }


@pytest.mark.parametrize('scheme', [RADAU, LEGENDRE])
@pytest.mark.parametrize('N, K', [(1, 1), (2, 1), (3, 2), (5, 4)])
def test_signum_of_any_size(N, K, scheme):
    T = 1 + N * (K + (scheme == LEGENDRE))
    report = pyomo_fesd.report(transform(signum.build(), N, K, scheme=scheme))
    one = N == 1  # a single element has a fixed length
    assert report['variables'] == 5 * T - 1 + (0 if one else N)
    assert report['multipliers'] == 3 * T + (0 if one else N)
    assert report['constraints'] == K * N + 2 * T + (not one) + (2 * N if scheme == LEGENDRE else 0)
    assert report['pairs'] == report['binaries at most'] == 2 * (N + 1)
    # equal lengths; and, with a slope to tell, the exits of both conditions
    assert report['decided'] == (N - 1) * (3 if K > 1 else 1)
    assert report['sources'] == 2 * (T - 1)
    assert report['disjunctions'] == T


@pytest.mark.parametrize(
    'build, variables, constraints',
    [
        # at 31 times the 4 holdups and derivatives, P, L, G and 3 multipliers, less 2 fixed; 10 lengths
        # 31 times 3 balances, switching and 2 mode equations; 60 discretisation equations, 1 length
        (gas_liquid_tank.build, 31 * 10 - 2 + 10, 31 * 6 + 60 + 1),
        (gas_liquid_tank.build_in_blocks, 31 * 10 - 2 + 10, 31 * 6 + 60 + 1),
        # without P, L, G and the balances, with the quotient of the gas mode continued outside of its region
        (gas_liquid_tank.build_eliminated, 31 * 8 - 2 + 10, 31 * 4 + 60 + 1),
    ],
)
def test_the_tank_with_ten_elements(build, variables, constraints):
    report = pyomo_fesd.report(transform(build(), 10, 3))
    assert counts(report) == (variables, constraints, 22 + 9 * 3)
    # the continued quotient counts as a multiplier
    assert report['multipliers'] == 31 * (4 if build is gas_liquid_tank.build_eliminated else 3) + 10
    assert (report['sources'], report['disjunctions']) == (60, 31)


def test_the_weir_with_five_elements():
    # V, dV, F at 11 times less V(0), 5 lengths; 11 balances, 10 discretisation equations, 11 signs of the slack, 1 length
    report = pyomo_fesd.report(move(weir.build(), 5, 2))
    assert counts(report) == (3 * 11 - 1 + 5, 11 + 10 + 11 + 1, 6 + 4 + 4)
    assert (report['sources'], report['disjunctions']) == (10, 0)


def test_cross_complementarity_by_stages_and_in_full_costs_more_pairs():
    pairs = {
        cross: pyomo_fesd.report(transform(signum.build(), 10, 3, cross_complementarity=cross))['pairs']
        for cross in ('element', 'point', 'full')
    }
    assert pairs == {'element': 2 + 2 * 10, 'point': 2 + 2 * 10 * 3, 'full': 2 + 2 * 10 * 3 * 4}


def test_stewarts_form_costs_two_multipliers_a_mode_and_one_more():
    small, large = (pyomo_fesd.report(transform(signum.build(), 5, 1, form=form)) for form in ('heaviside', 'stewart'))
    assert large['multipliers'] - small['multipliers'] == 6 * (5 - 3)
    assert large['pairs'] == small['pairs'] == 2 * 6


@pytest.mark.parametrize('mode', ['two_stage', 'complementarity', 'penalty', 'none'])
def test_conditions_that_the_pairs_stand_for_are_those_of_the_model(mode):
    report = pyomo_fesd.report(transform(signum.build(), 10, 2, equilibration=mode))
    assert report['sources'] == 2 * 20


@pytest.mark.parametrize(
    'build',
    [signum.build, gas_liquid_tank.build_eliminated, sliding.build, free_start.build_free, held_control.build],
    ids=lambda f: f.__module__.split('.')[-1],
)
@pytest.mark.parametrize('scheme', [RADAU, LEGENDRE])
def test_the_counts_are_those_of_what_the_solver_compiles(build, scheme):
    m = transform(build(), 6, 2, scheme=scheme)
    assert counts(pyomo_fesd.report(m)) == compiled(m)


def test_a_variable_that_only_the_objective_has_is_counted():
    m = transform(signum.build(), 5)
    m.z = pyo.Var(initialize=0)
    m.cost = pyo.Objective(expr=(m.z - 1) ** 2)
    assert counts(pyomo_fesd.report(m)) == compiled(m)


def test_a_condition_between_two_bounds_is_counted_as_the_solver_splits_it():
    m = pyo.ConcreteModel()
    m.x, m.y = pyo.Var(initialize=0), pyo.Var(initialize=0)
    m.clip = Complementarity(expr=complements(pyo.inequality(0, m.x, 1), m.y - 2))
    m.cost = pyo.Objective(expr=m.y**2)
    assert pyomo_fesd.report(m)['pairs'] == compiled(m)[2]


def test_parts_of_the_model_without_switching_cost_what_they_did():
    m = transform(signum.build(), 5)
    before = pyomo_fesd.report(m)
    m.unit = pyo.Block()
    m.unit.v = pyo.Var([1, 2, 3], initialize=1)
    m.unit.e = pyo.Constraint([1, 2], rule=lambda b, i: b.v[i] == b.v[i + 1])
    after = pyomo_fesd.report(m)
    assert {name: after[name] - before[name] for name in before if after[name] != before[name]} == {
        'variables': 3,
        'constraints': 2,
    }


def test_fixed_variables_and_inactive_constraints_are_not_counted():
    m = pyo.ConcreteModel()
    m.x, m.y = pyo.Var(), pyo.Var(initialize=1)
    m.y.fix()
    m.line = pyo.Constraint(expr=m.x == m.y)
    m.other = pyo.Constraint(expr=m.x >= 0)
    m.other.deactivate()
    assert counts(pyomo_fesd.report(m)) == (1, 1, 0)


def off(m, how):
    """Switch the mode above off, at every time."""
    if how == 'deactivated':
        m.above.deactivate()
    else:
        for t in m.t:
            m.above[t].indicator_var.fix(False)


@pytest.mark.parametrize('how', ['deactivated', 'indicator fixed'])
def test_modes_that_are_switched_off_are_counted_and_cost_nothing(how):
    m = signum.build()
    off(m, how)
    report = pyomo_fesd.report(dcs(m))
    assert report['modes left out'] == len(m.t) == 2
    assert (report['multipliers'], report['pairs']) == (0, 0)


def test_a_disjunction_that_nobody_transformed_is_not_counted_as_transformed():
    m = signum.build()
    m.other = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 5], [m.x[t] >= 5]])
    m.other.deactivate()
    assert pyomo_fesd.report(dcs(m))['disjunctions'] == 2


def test_a_report_prints_as_a_table():
    text = str(pyomo_fesd.report(run(signum.build(), 5)))
    assert text == repr(pyomo_fesd.report(run(signum.build(), 5)))
    assert len(text.splitlines()) == 9 and text.splitlines()[0].split() == ['variables', '59']
