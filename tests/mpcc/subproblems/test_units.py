"""No unit and no offset changes a verdict: objectives times 1e-10 ... 1e10, offsets to 1e8, variables times 1e-8 ... 1e8, rows."""

from dataclasses import replace

import numpy as np
import pyomo.environ as pyo
import pytest
from benchmarks.random_mpcc.instances import Units, generate
from hypothesis import example, given, settings
from hypothesis import strategies as st
from pyomo.contrib.solver.common.factory import SolverFactory
from pyomo.mpec import Complementarity, complements

import pyomo_fesd
from pyomo_fesd.mpcc.subproblems.stationarity import Stationarity

B, DESCENT = Stationarity.B, Stationarity.DESCENT
#: Points of min (x - 1)^2 + (y - 1)^2, x perp y, and their grades; 1e-8 from a minimum does not count; in
#: the variable's own unit where that is between 1e-2 and 1e4.
POINTS = [(0.5, 0, DESCENT), (1, 0, B), (0, 1, B), (0, 0, DESCENT), (1 + 1e-8, 0, B)]


def toy(x, y, factor=1.0, offset=0.0, size=1.0):
    m = pyo.ConcreteModel()
    m.x, m.y = (pyo.Var(bounds=(0, None), initialize=v * size) for v in (x, y))
    m.c = Complementarity(expr=complements(m.x >= 0, m.y >= 0))
    m.f = pyo.Objective(expr=factor * ((m.x / size - 1) ** 2 + (m.y / size - 1) ** 2) + offset)
    return m


factors = st.floats(-10, 10).map(lambda e: 10.0**e)
offsets = st.floats(-1e8, 1e8)
sizes = st.floats(-8, 8).map(lambda e: 10.0**e)


@settings(max_examples=20, deadline=None)
@given(st.sampled_from(POINTS), factors, sizes)
def test_factors_of_objective_and_variables_do_not_change_a_grade(point, factor, size):
    x, y, grade = point
    assert pyomo_fesd.certify(toy(x, y, factor, 0.0, size)).grade is grade


@settings(max_examples=20, deadline=None)
@given(st.sampled_from(POINTS), offsets)
def test_an_offset_does_not_change_a_grade(point, offset):
    x, y, grade = point
    assert pyomo_fesd.certify(toy(x, y, offset=offset)).grade is grade


def test_the_value_is_in_units_of_the_objective():
    for factor in (1e-10, 1.0, 1e10):
        assert pyomo_fesd.certify(toy(0.0, 0.0, factor)).value == pytest.approx(-2 * factor)


@settings(max_examples=10, deadline=None)
@given(factors, offsets, sizes)
@example(1e-10, 0.0, 1e-4)
@example(1e-8, 0.0, 10**-2.875)
@example(1e-6, 0.0, 10**-1.75)
def test_a_solve_ends_in_a_minimum_whatever_the_units(factor, offset, size):
    m = toy(0.3, 0.4, factor, offset * factor, size)
    results = SolverFactory('mpec_hybrid').solve(m)
    assert results.extra_info.stationarity == 'B'
    # sizes from 1e-2 on are ordinary: the tolerance of a variable is that of max(1, |w|)
    exact = 1e-6 * (size if size < 1e-2 else max(1.0, size))
    assert sorted([m.x.value, m.y.value]) == pytest.approx([0, size], abs=exact)


@pytest.mark.parametrize('seed', [0, 2, 3, 4])
def test_random_problems_in_other_units(seed):
    good = generate(seed)
    n, m = len(good.lb), len(good.low)
    units = [Units(np.ones(n), np.ones(m), f, o) for f, o in ((1, 0), (1e-10, 0), (1e10, 0), (1, 1e8))]
    units += [Units(np.full(n, x), np.full(m, g)) for x, g in ((1e-8, 1), (1e8, 1), (1, 1e-6), (1, 1e6))]
    solved = good.model()
    assert SolverFactory('mpec_hybrid').solve(solved).extra_info.stationarity == 'B'
    at = good.values(solved)
    for w in (at, good.point, np.clip(at + 0.1, good.lb, good.ub)):
        grades = {pyomo_fesd.certify(replace(good, units=u, start=w).model()).grade for u in units}
        assert len(grades) == 1


def weights(x, weight):
    """min weight (z - 1)^2 + (x - 1)^2, x perp y, at z = 1."""
    m = toy(x, 0.0)
    m.z = pyo.Var(initialize=1.0)
    m.f.set_value(weight * (m.z - 1) ** 2 + (m.x - 1) ** 2 + (m.y - 1) ** 2)
    return m


@pytest.mark.parametrize('weight', [1.0, 1e3, 1e6])
def test_a_heavy_term_does_not_hide_the_descent_of_another_one(weight):
    assert pyomo_fesd.certify(weights(0.5, weight)).grade is DESCENT
    assert pyomo_fesd.certify(weights(1.0, weight)).grade is B


def test_a_heavy_penalty_does_not_hide_the_descent_of_another_term():
    m = toy(0.5, 0.0)
    m.slack = pyo.Var(bounds=(0, None), initialize=0.0)
    m.f.set_value(m.f.expr + 1e6 * m.slack)
    assert pyomo_fesd.certify(m).grade is DESCENT


def test_a_minimum_without_any_gradient_is_certified_where_the_gradient_is_round_off():
    m = pyo.ConcreteModel()
    m.x = pyo.Var(initialize=1 + 1e-9)
    m.w = pyo.Var(initialize=4 - 1e-9, bounds=(-10, 10))
    m.k = pyo.Constraint(expr=m.x + m.w == 5)
    m.f = pyo.Objective(expr=(m.x - 1) ** 2)
    assert pyomo_fesd.certify(m).grade is B


@pytest.mark.parametrize('factor', [1e-6, 1.0, 1e6])
def test_a_row_in_small_units_is_not_held_by_round_off(factor):
    m = toy(1.0, 0.0)
    m.k = pyo.Constraint(expr=factor * (m.x + m.y) >= factor * 1.5)
    assert pyomo_fesd.certify(m).grade is Stationarity.INFEASIBLE


def test_natural_units_are_optional():
    m = toy(0.5, 0.0, size=1e-8)
    assert pyomo_fesd.certify(m).grade is DESCENT
    assert pyomo_fesd.certify(m, natural_units='user').biactive == 1
