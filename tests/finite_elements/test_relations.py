"""Which variables an expression depends on at one label, and by which equations."""

import pyomo.environ as pyo
import pytest
from pyomo.common.collections import ComponentMap
from pyomo.mpec import Complementarity, complements

from pyomo_fesd.core import TimeIndex
from pyomo_fesd.finite_elements.relations import Relations
from tests.problems.states import over_time


@pytest.fixture
def model():
    """u follows from w, w from x; r is a result of w; s follows from nothing."""
    m = over_time(1, x=0)
    m.u, m.w, m.r, m.s = (pyo.Var(m.t, initialize=0) for _ in range(4))
    m.of_u = pyo.Constraint(m.t, rule=lambda m, t: m.u[t] == 2 * m.w[t])
    m.of_w = pyo.Constraint(m.t, rule=lambda m, t: m.w[t] == m.x[t])
    m.of_r = pyo.Constraint(m.t, rule=lambda m, t: m.r[t] == m.w[t] ** 2)
    m.limit = pyo.Constraint(m.t, rule=lambda m, t: m.s[t] <= m.w[t])
    return m


def closure(m, wanted, known=None):
    relations = Relations(m, TimeIndex(m.t), {1}, ComponentMap(), lambda v, label: v.parent_component() is not m.x, known)
    tied, found = relations.closure(1, wanted)
    return {v.name for v in tied}, {r.equation.name for r in found}


def test_equations_are_followed_down_to_what_is_not_algebraic(model):
    assert closure(model, [model.u[1]]) == ({'u[1]', 'w[1]'}, {'of_u[1]', 'of_w[1]'})


def test_a_result_is_left_out_unless_it_is_wanted(model):
    assert 'r[1]' not in closure(model, [model.w[1]])[0]
    assert closure(model, [model.r[1]]) == ({'r[1]', 'w[1]'}, {'of_r[1]', 'of_w[1]'})


def test_inequalities_determine_nothing(model):
    assert closure(model, [model.s[1]]) == (set(), set())


def test_a_relation_with_an_unknown_variable_determines_nothing(model):
    assert closure(model, [model.w[1]], lambda v: v.parent_component() is not model.x) == (set(), set())


def test_the_argument_of_a_positive_part_stays_where_nothing_determines_it(model):
    # a pair determines p = max(0, w + d), not d
    m = model
    m.p, m.d = pyo.Var(m.t, initialize=0), pyo.Var(m.t, initialize=0)
    m.part = Complementarity(m.t, rule=lambda m, t: complements(m.p[t] >= 0, m.p[t] - m.w[t] - m.d[t] >= 0))
    rules = ComponentMap([(m.p, m.part)])
    relations = Relations(m, TimeIndex(m.t), {1}, rules, lambda v, label: v.parent_component() is not m.x)
    tied, found = relations.closure(1, [m.p[1]])
    assert {v.name for v in tied} == {'p[1]', 'w[1]', 'd[1]'}
    assert {getattr(r.equation, 'name', None) for r in found} == {None, 'of_w[1]'}
