"""``Integral`` on elements that move: the quadrature of the scheme, with the lengths as variables."""

import numpy as np
import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pyomo_fesd
from tests.models import dcs
from tests.problems import free_start
from tests.problems.running import EXACT_SCHEMES, RADAU, SCHEMES, move, multipliers, run, solve, transform

FIRST, SECOND = 2 / 9, 8 / 9 + 64 / 81  # integrals of x and of x^2 over signum's trajectory
DEGREE = 9


def path(scheme, ncp):
    """A Var c to hold the physical time, and the integral of a polynomial of it; three elements on [1, 4]."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(1, 4))
    m.c = pyo.Var(m.t)
    m.dc = dae.DerivativeVar(m.c)
    m.a = pyo.Param(range(DEGREE + 1), initialize=0, mutable=True)
    m.integral = dae.Integral(m.t, wrt=m.t, rule=lambda m, t: sum(m.a[k] * m.c[t] ** k for k in m.a))
    return move(m, 3, ncp, scheme=scheme)


PATHS = {(scheme, ncp): path(scheme, ncp) for scheme in SCHEMES for ncp in range(1, 6)}


@given(
    st.sampled_from(sorted(PATHS)),
    st.lists(st.floats(-2, 2, allow_subnormal=False), min_size=DEGREE + 1, max_size=DEGREE + 1),
    st.lists(st.floats(0.1, 1), min_size=3, max_size=3),
)
@settings(max_examples=150, deadline=None)
def test_polynomials_of_the_degree_of_the_scheme_are_integrated_exactly_on_elements_of_any_length(which, a, shares):
    scheme, ncp = which
    m, degree = PATHS[which], 2 * ncp - 2 if scheme == RADAU else 2 * ncp - 1
    for k in m.a:
        m.a[k] = a[k] if k <= degree else 0
    for n, r in multipliers(m.t).items():
        r.set_value(3 * shares[n - 1] / sum(shares), skip_validation=True)
    for t, now in pyomo_fesd.physical_time(m).items():
        m.c[t].value = now
    antiderivative = np.polynomial.Polynomial(a[: degree + 1]).integ()
    assert pyo.value(m.integral) == pytest.approx(antiderivative(4) - antiderivative(1), rel=1e-9, abs=1e-7)


@pytest.mark.parametrize('scheme, ncp', EXACT_SCHEMES)
def test_an_integral_over_a_switch_is_exact(scheme, ncp):
    m = free_start.build(-2)
    m.first = dae.Integral(m.t, wrt=m.t, rule=lambda m, t: m.x[t])
    m.second = dae.Integral(m.t, wrt=m.t, rule=lambda m, t: m.x[t] ** 2)
    run(m, nfe=5, ncp=ncp, scheme=scheme)
    if (scheme, ncp) != (RADAU, 1):
        assert pyo.value(m.first) == pytest.approx(FIRST, abs=1e-9)
    if ncp > 1:
        assert pyo.value(m.second) == pytest.approx(SECOND, abs=1e-8)


def test_the_trapezoid_rule_on_labels_would_be_wrong():
    m = free_start.build(-2)
    m.first = dae.Integral(m.t, wrt=m.t, rule=lambda m, t: m.x[t])
    run(m, nfe=5, ncp=2)
    labels = list(m.t)
    trapezoid = np.trapezoid([m.x[t].value for t in labels], labels)
    assert abs(trapezoid - FIRST) > 1e-2
    assert pyo.value(m.first) == pytest.approx(FIRST, abs=1e-9)


def test_an_objective_follows_its_integral():
    m = free_start.build(-2)
    m.first = dae.Integral(m.t, wrt=m.t, rule=lambda m, t: m.x[t])
    m.cost = pyo.Objective(expr=3 * m.first + m.x[2])
    m.again = pyo.Objective(rule=lambda m: m.first**2)
    m.again.deactivate()
    transform(m, nfe=5, ncp=3)
    results = pyo.SolverFactory('mpec_hybrid').solve(m)
    pyo.assert_optimal_termination(results)
    assert pyo.value(m.cost) == pytest.approx(3 * FIRST + 4 / 3, abs=1e-8)
    assert pyo.value(m.again) == pytest.approx(FIRST**2, abs=1e-8)
    assert not m.again.active


def test_integrals_with_further_indices_on_either_side_of_time():
    m = free_start.build(-2)
    m.k, m.j = pyo.RangeSet(2), pyo.Set(initialize=['a', 'b'])
    gain = {'a': 1, 'b': 10}
    m.after = dae.Integral(m.t, m.k, wrt=m.t, rule=lambda m, t, k: m.x[t] ** k)
    m.before = dae.Integral(m.k, m.t, wrt=m.t, rule=lambda m, k, t: m.x[t] ** k)
    m.between = dae.Integral(m.j, m.t, m.k, wrt=m.t, rule=lambda m, j, t, k: gain[j] * m.x[t] ** k)
    run(m, nfe=5, ncp=3)
    for k, exact in ((1, FIRST), (2, SECOND)):
        assert pyo.value(m.after[k]) == pytest.approx(exact, abs=1e-8)
        assert pyo.value(m.before[k]) == pytest.approx(exact, abs=1e-8)
        for j in m.j:
            assert pyo.value(m.between[j, k]) == pytest.approx(gain[j] * exact, abs=1e-7)


def test_an_integral_on_a_sub_block_is_rebuilt_too():
    m = pyo.ConcreteModel()
    m.fs = free_start.build(-2)
    m.fs.first = dae.Integral(m.fs.t, wrt=m.fs.t, rule=lambda b, t: b.x[t])
    m.fs.powers = dae.Integral(m.fs.t, [1, 2], wrt=m.fs.t, rule=lambda b, t, k: b.x[t] ** k)
    m.cost = pyo.Objective(expr=m.fs.first + m.fs.powers[2])
    solve(move(dcs(m), 5, 3))
    assert pyo.value(m.fs.first) == pytest.approx(FIRST, abs=1e-9)
    assert pyo.value(m.fs.powers[1]) == pytest.approx(FIRST, abs=1e-9)
    assert pyo.value(m.cost) == pytest.approx(FIRST + SECOND, abs=1e-8)


def test_an_integral_on_a_grid_that_was_there_is_rebuilt_too():
    def discretise(m):
        m.first = dae.Integral(m.t, wrt=m.t, rule=lambda m, t: m.x[t])
        pyo.TransformationFactory('dae.collocation').apply_to(m, wrt=m.t, nfe=5, ncp=2)

    m = solve(move(dcs(free_start.build(-2, discretise=discretise))))
    assert pyo.value(m.first) == pytest.approx(FIRST, abs=1e-9)


def test_an_integral_in_a_constraint_holds_on_moved_elements():
    m = free_start.build_free(guess=-1.8)
    m.cost.deactivate()
    m.first = dae.Integral(m.t, wrt=m.t, rule=lambda m, t: m.x[t])
    m.balance = pyo.Constraint(expr=m.first == 11 / 9)  # -x0^2/6 + (2 + x0/3)^2/2
    run(m, nfe=10, ncp=2)
    assert m.x[0].value == pytest.approx(-1, abs=1e-7)


def test_a_constant_integrand_gives_the_length_of_time():
    m = free_start.build(-2)
    m.duration = dae.Integral(m.t, wrt=m.t, rule=lambda m, t: 5.0)
    run(m, nfe=5)
    assert pyo.value(m.duration) == pytest.approx(10, abs=1e-9)
