"""What random problems brought to light, each as the smallest model that shows it."""

import pyomo.environ as pyo
import pytest
from problems import fuzz
from pyomo.mpec import Complementarity, complements

import pyomo_fesd  # noqa: F401


def solve(model, **options):
    return pyo.SolverFactory('mpec_hybrid').solve(model, **options)


def pair(x0, y0):
    m = pyo.ConcreteModel()
    m.x = pyo.Var(bounds=(0, None))
    m.y = pyo.Var(bounds=(0, None))
    for v, now in ((m.x, x0), (m.y, y0)):
        v.set_value(now, skip_validation=True)
    m.c = Complementarity(expr=complements(m.x >= 0, m.y >= 0))
    return m


@pytest.mark.parametrize('y0', [None, -1.0, 0.0, 1.0])
def test_a_variable_that_stands_only_in_a_pair_is_free(y0):
    """y stands in no row and not in the objective, so the NL writer leaves it out: it must not become a constant."""
    m = pair(0.3, y0)
    m.f = pyo.Objective(expr=(m.x - 1) ** 2)
    assert solve(m).solver.stationarity == 'B'
    assert (m.x.value, m.y.value) == (pytest.approx(1), pytest.approx(0, abs=1e-6))


@pytest.mark.parametrize('start', [None, 0.0, 2.0])
def test_a_pair_alone_is_solved(start):
    m = pair(start, start)
    assert pyo.check_optimal_termination(solve(m))
    assert min(m.x.value, m.y.value) == pytest.approx(0, abs=1e-6)


def test_a_side_with_zero_coefficients_needs_no_values():
    """0*x + 3 counts as fixed, yet has no value while x has none."""
    m = pair(None, None)
    m.f = pyo.Objective(expr=(m.x - 1) ** 2 + m.y)
    m.d = Complementarity(expr=complements(0 * m.x + 3 >= 0, m.y >= 0))
    assert solve(m).solver.stationarity == 'B'


def test_everything_fixed():
    m = pair(0.0, 1.0)
    m.f = pyo.Objective(expr=m.x + m.y)
    m.x.fix()
    m.y.fix()
    assert solve(m).solver.stationarity == 'B'


def test_a_violated_row_of_fixed_variables_is_infeasible_and_no_exception():
    m = pair(0.0, 0.0)
    m.f = pyo.Objective(expr=(m.x - 1) ** 2 + m.y)
    m.z = pyo.Var(initialize=0)
    m.z.fix()
    m.k = pyo.Constraint(expr=m.z >= 1)
    results = solve(m)
    assert results.solver.termination_condition == pyo.TerminationCondition.infeasible


@pytest.mark.parametrize('seed', [100])
def test_two_sides_that_vanish_together_leave_more_equations_than_unknowns(seed):
    """Ipopt then refuses with 'not enough degrees of freedom', and its iteration count is not set: any number may stand there."""
    for _ in range(3):
        assert fuzz.run(seed).outcome == fuzz.CERTIFIED


@pytest.mark.parametrize('seed', [7, 118, 314])
def test_a_branch_without_multipliers_is_solved_to_the_descent_tolerance(seed):
    """Large multipliers make Ipopt's scaled optimality error lenient (s_max): its 'solved' is 1e-5 off, and the LPEC refuses it."""
    assert fuzz.run(seed).outcome == fuzz.CERTIFIED


@pytest.mark.parametrize('seed', [1, 6])
def test_an_infeasible_branch_does_not_end_the_search(seed):
    """The relaxations end at a point that no branch contains; another branch is feasible."""
    assert fuzz.run(seed).outcome == fuzz.CERTIFIED


def test_a_line_without_bound_is_unbounded_and_not_infeasible():
    """Ipopt leaves each NLP at 1e14 to 1e23 or with its iterations used up, where round-off is larger than the tolerance."""
    m = pyo.ConcreteModel()
    m.x = pyo.Var(bounds=(None, 7), initialize=0)
    m.y = pyo.Var(bounds=(0, None), initialize=0)
    m.z = pyo.Var(bounds=(-2, None), initialize=0)
    m.f = pyo.Objective(expr=-m.x + m.y - 2 * m.z)
    m.c = Complementarity(expr=complements(-2 * m.x - m.y + m.z + 5 >= 0, 2 * m.x - 2 * m.y + m.z + 3 >= 0))
    assert solve(m).solver.termination_condition == pyo.TerminationCondition.unbounded
