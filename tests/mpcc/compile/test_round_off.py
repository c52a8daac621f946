"""What is left where the terms of fixed values cancel is no evidence of a size, and round-off is 0."""

import numpy as np
import pyomo.environ as pyo
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyomo.common.timing import HierarchicalTimer
from pyomo.mpec import Complementarity, complements

from pyomo_fesd.mpcc.compile.compile import compile_mpcc
from pyomo_fesd.mpcc.compile.parameters import parameter_data
from pyomo_fesd.mpcc.compile.read_mpcc import read_mpcc
from pyomo_fesd.mpcc.compile.round_off import without_round_off


def sums(a=0.1, b=0.2, level=0.3):
    """Rows in which fixed values cancel."""
    m = pyo.ConcreteModel()
    m.a, m.b, m.v = pyo.Var(initialize=a), pyo.Var(initialize=b), pyo.Var(initialize=0)
    m.a.fix()
    m.b.fix()
    m.level = pyo.Param(initialize=level, mutable=True)
    m.equation = pyo.Constraint(expr=m.v == m.a + m.b - m.level)
    m.range = pyo.Constraint(expr=(0, m.a + m.b - m.level - m.v, 1))
    m.square = pyo.Constraint(expr=m.v == m.a**2 + m.a * m.b - 0.1 * m.level)
    m.nonlinear = pyo.Constraint(expr=m.v**2 == m.a + m.b - m.level)
    m.plain = pyo.Constraint(expr=m.v <= 1e-15)
    return m


def cleaned(row, constant, upper=np.inf):
    lower, upper, size = without_round_off([row], np.array([constant]), np.array([upper]))
    return lower[0], size[0]


def test_round_off_is_zero_and_has_the_size_of_its_terms():
    m, left = sums(), 0.1 + 0.2 - 0.3
    assert left != 0
    assert cleaned(m.equation, left) == (0.0, pytest.approx(0.6))
    assert cleaned(m.range, -left, 1 - left) == (0.0, pytest.approx(0.6))
    assert cleaned(m.square, 1e-18) == (0.0, pytest.approx(0.09))


@pytest.mark.parametrize('a, constant', [(0.1 + 1e-11, 1e-11), (0.1 - 1e-6, -1e-6)])
def test_small_constants_stay(a, constant):
    assert cleaned(sums(a).equation, constant) == (constant, pytest.approx(0.6, rel=1e-5))


def test_rows_without_fixed_values_and_nonlinear_ones_stay():
    m = sums()
    assert cleaned(m.plain, 1e-15) == (1e-15, 0.0)
    assert cleaned(m.nonlinear, 1e-17) == (1e-17, 0.0)


def test_terms_without_a_derivative_show_nothing():
    m = sums(0.0)
    m.root = pyo.Constraint(expr=m.v == pyo.sqrt(m.a) + 1e-9)
    assert cleaned(m.root, 1e-9) == (1e-9, 0.0)


def test_small_data_stay_small():
    m = sums(1e-12, 2e-12, 1e-12)
    assert cleaned(m.equation, 2e-12) == (2e-12, pytest.approx(4e-12))


@given(
    st.integers(0, 10**6),
    st.sampled_from([0.0, 1e-16, -1e-16, 1e-14, 1e-12, -1e-10, 1e-8, -1e-6]),
    st.booleans(),
)
@settings(max_examples=40, deadline=None)
def test_multipliers_keep_their_unit_however_near_the_surface_values_are_fixed(seed, distance, as_parameters):
    """lam_p - lam_n = c(x) at a time with fixed x and at one with free x, as a Heaviside form has them."""
    random = np.random.default_rng(seed)
    weights, x0 = (random.choice([-1, 1], 2) * random.uniform(0.1, 2, 2) for _ in range(2))
    m = pyo.ConcreteModel()
    m.x = pyo.Var([0, 1], [0, 1], initialize=lambda m, t, i: x0[i])
    m.p, m.n = pyo.Var([0, 1], initialize=0.0, bounds=(0, None)), pyo.Var([0, 1], initialize=0.0, bounds=(0, None))
    level = float(weights @ x0) - distance
    m.c = pyo.Constraint([0, 1], rule=lambda m, t: m.p[t] - m.n[t] == sum(weights[i] * m.x[t, i] for i in (0, 1)) - level)
    m.pair = Complementarity([0, 1], rule=lambda m, t: complements(m.p[t] >= 0, m.n[t] >= 0))
    m.x[0, 0].fix()
    m.x[0, 1].fix()
    parameters = parameter_data([m.x[0, 0], m.x[0, 1]] if as_parameters else [])
    c = compile_mpcc(read_mpcc(m), HierarchicalTimer(), parameters=parameters, natural_units='starts')
    assert (c.scale.x == 1).all()
