"""Nested Disjunctions become one system whose modes are the ways down (theory, section 1)."""

import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
from pyomo.gdp import Disjunct, Disjunction
from pyomo.mpec import Complementarity

import pyomo_fesd
from pyomo_fesd import FesdError
from tests.models import (
    EVERYWHERE,
    collocate,
    dcs,
    finite_elements,
    form_of,
    generated,
    rate,
    scalar_ode,
    snapshot,
    thresholds,
    turn_on,
    values_of_generated,
    weights,
)
from tests.problems.running import SCHEMES, move, solve

fesd_dcs = pyo.TransformationFactory('fesd.dcs')
FORMS = ['auto', 'stewart', 'heaviside']


def declared_inside(d, m, t):
    """Disjuncts and Disjunction in the outer disjunct."""
    d.slow, d.fast = Disjunct(), Disjunct()
    d.slow.region = pyo.Constraint(expr=m.x[t] <= 1)
    d.slow.ode = pyo.Constraint(expr=m.dx[t] == 2)
    d.fast.region = pyo.Constraint(expr=m.x[t] >= 1)
    d.fast.ode = pyo.Constraint(expr=m.dx[t] == 1)
    d.speed = Disjunction(expr=[d.slow, d.fast])


def in_lists(d, m, t):
    """The same, the inner modes as lists of expressions."""
    d.speed = Disjunction(expr=[[m.x[t] <= 1, m.dx[t] == 2], [m.x[t] >= 1, m.dx[t] == 1]])


def in_a_block(d, m, t):
    """The same, in a Block in the outer disjunct."""
    d.inside = pyo.Block()
    declared_inside(d.inside, m, t)


def without_disjunction(d, m, t):
    """The inner disjuncts alone: their Disjunction stands beside the outer one."""
    declared_inside(d, m, t)
    d.del_component(d.speed)


def two_levels(inner, discretised=False):
    """dx = 3 below 0, 2 between 0 and 1, 1 above 1: what is above 0 is an outer mode with two inner ones."""
    m = scalar_ode(discretised=discretised)

    @m.Disjunct(m.t)
    def low(d, t):
        m = d.model()
        d.region = pyo.Constraint(expr=m.x[t] <= 0)
        d.ode = pyo.Constraint(expr=m.dx[t] == 3)

    @m.Disjunct(m.t)
    def high(d, t):
        m = d.model()
        d.region = pyo.Constraint(expr=m.x[t] >= 0)
        inner(d, m, t)

    @m.Disjunction(m.t)
    def level(m, t):
        return [m.low[t], m.high[t]]

    if inner is without_disjunction:
        m.speed = Disjunction(m.t, rule=lambda m, t: [m.high[t].slow, m.high[t].fast])
    return m


WRITINGS = [declared_inside, in_lists, in_a_block, without_disjunction]
#: Name of the inner Disjunction in each writing, and of its first mode.
INNER = {
    declared_inside: ('high.speed', 'slow', 'fast'),
    in_lists: ('high.speed', 'mode 1', 'mode 2'),
    in_a_block: ('high.inside.speed', 'slow', 'fast'),
    without_disjunction: ('speed', 'slow', 'fast'),
}
writings = pytest.mark.parametrize('inner', WRITINGS, ids=lambda w: w.__name__)


def inner_disjunction(m, t):
    """The inner DisjunctionData of ``two_levels``."""
    found = [d for d in m.component_data_objects(Disjunction, descend_into=EVERYWHERE) if 'speed' in d.name and f'[{t}]' in d.name]
    (data,) = found
    return data


# What is written


@writings
def test_nested_modes_cost_as_much_as_the_same_modes_in_one_disjunction(inner):
    nested, flat = dcs(two_levels(inner)), dcs(thresholds())
    for ctype in (pyo.Var, pyo.Constraint, Complementarity):
        assert len(generated(nested, ctype)) == len(generated(flat, ctype))
    assert not list(nested.component_data_objects((Disjunction, Disjunct), active=True, descend_into=EVERYWHERE))


@writings
@pytest.mark.parametrize('form', FORMS)
def test_a_disjunct_has_the_sum_of_the_multipliers_of_its_modes(inner, form):
    m = dcs(two_levels(inner), form=form)
    speed = inner_disjunction(m, 0)
    slow, fast = speed.disjuncts
    for disjunct, outer, within, dx in ((slow, [0, 1], [1, 0], 2), (fast, [0, 1], [0, 1], 1), (m.low[0], [1, 0], [0, 0], 3)):
        turn_on(m.level[0] if disjunct is m.low[0] else speed, disjunct)
        assert [pyo.value(w) for w in weights(m.level[0]).values()] == outer
        assert [pyo.value(w) for w in weights(speed).values()] == within
        assert rate(m.level[0], m.dx[0]) == pytest.approx(dx)


def test_in_the_heaviside_form_the_outer_multiplier_is_the_step_at_the_outer_surface():
    m = dcs(two_levels(declared_inside), form='heaviside')
    assert str(weights(m.level[0])[m.high[0]]).count('alpha') == 1


@writings
def test_before_and_after_discretisation_give_the_same_equations(inner):
    before = finite_elements(dcs(two_levels(inner)), nfe=2, ncp=2)
    after = dcs(two_levels(inner, discretised=True))
    assert values_of_generated(before) == pytest.approx(values_of_generated(after))
    assert not list(before.component_data_objects((Disjunction, Disjunct), active=True, descend_into=EVERYWHERE))


@writings
def test_create_using_and_clones_leave_the_original_as_it_was(inner):
    m = two_levels(inner)
    before = snapshot(m)
    new = fesd_dcs.create_using(m)
    assert snapshot(m) == before
    copy = finite_elements(new.clone(), nfe=2, ncp=2)
    assert snapshot(m) == before
    assert len(generated(copy, Complementarity)) == 4 * len(copy.t)
    assert set(weights(copy.level[0])) == {copy.low[0], copy.high[0]}


def test_a_second_time_changes_nothing():
    m = dcs(two_levels(declared_inside))
    before = snapshot(m)
    dcs(m)
    assert snapshot(m) == before


def test_generated_components_lead_back_to_inner_and_outer_disjuncts():
    m = dcs(two_levels(declared_inside), form='stewart')
    block, _ = form_of(m.level[0])
    found = [fesd_dcs.get_src_disjunct(block.complementarity[0, i]) for i in block.regions]
    assert found == [m.low[0], m.high[0].slow, m.high[0].fast]
    for source in (m.low[0].ode, m.high[0].slow.ode, m.high[0].fast.ode):
        (image,) = fesd_dcs.get_transformed_constraints(source)
        assert source in fesd_dcs.get_src_constraint(image)
        assert fesd_dcs.get_src_disjunction(image) is m.level[0]


def test_what_an_outer_mode_states_itself_holds_in_all_its_inner_modes():
    m = two_levels(declared_inside)
    for t in m.t:
        m.low[t].other = pyo.Constraint(expr=m.dy[t] == 5)
        m.high[t].other = pyo.Constraint(expr=m.dy[t] == -m.x[t])
    dcs(m, form='heaviside')
    m.x[0].value = 0.5
    for disjunct, dy in ((m.low[0], 5), (m.high[0].slow, -0.5), (m.high[0].fast, -0.5)):
        turn_on(m.level[0] if disjunct is m.low[0] else m.high[0].speed, disjunct)
        assert rate(m.level[0], m.dy[0]) == pytest.approx(dy)
    equation = next(str(c.expr) for c in generated(m, pyo.Constraint).values() if 'dy[0]' in str(c.expr))
    assert equation.count('alpha') == 2  # the outer step alone: alpha*5 + (1 - alpha)*(- x)


# Deeper, and several at once


def deep(depth):
    """Rates 1, 2, .. on intervals of length 1, each interval but the first inside one Disjunct more."""
    m = scalar_ode()

    def fill(d, m, t, k):
        d.ode = pyo.Constraint(expr=m.dx[t] == k + 1) if k == depth else pyo.Constraint()
        if k < depth:
            here, beyond = Disjunct(), Disjunct()
            d.here, d.beyond = here, beyond
            here.region = pyo.Constraint(expr=m.x[t] <= k)
            here.ode = pyo.Constraint(expr=m.dx[t] == k + 1)
            beyond.region = pyo.Constraint(expr=m.x[t] >= k)
            fill(beyond, m, t, k + 1)
            d.split = Disjunction(expr=[here, beyond])

    @m.Disjunct(m.t)
    def here(d, t):
        m = d.model()
        d.region = pyo.Constraint(expr=m.x[t] <= 0)
        d.ode = pyo.Constraint(expr=m.dx[t] == 1)

    @m.Disjunct(m.t)
    def beyond(d, t):
        m = d.model()
        d.region = pyo.Constraint(expr=m.x[t] >= 0)
        fill(d, m, t, 1)

    m.split = Disjunction(m.t, rule=lambda m, t: [m.here[t], m.beyond[t]])
    return m


def test_disjunctions_may_be_nested_to_any_depth():
    m = dcs(deep(4), form='stewart')
    assert len(generated(m, Complementarity)) == 5 * len(m.t)
    innermost = m.beyond[0].beyond.beyond.beyond
    turn_on(m.beyond[0].beyond.beyond.split, innermost)
    assert rate(m.split[0], m.dx[0]) == pytest.approx(5)
    assert pyo.value(weights(m.split[0])[m.beyond[0]]) == 1


def two_inside(m, t, d):
    """Two Disjunctions in one disjunct: F by the sign of x - 1, G by that of y."""
    d.first = Disjunction(expr=[[m.x[t] <= 1, m.F[t] == 1], [m.x[t] >= 1, m.F[t] == 2]])
    d.second = Disjunction(expr=[[m.y[t] <= 0, m.G[t] == 10], [m.y[t] >= 0, m.G[t] == 20]])


def several_inside():
    m = scalar_ode()
    m.F, m.G = pyo.Var(m.t), pyo.Var(m.t)

    @m.Disjunct(m.t)
    def off(d, t):
        d.region = pyo.Constraint(expr=m.x[t] <= 0)
        d.F = pyo.Constraint(expr=m.F[t] == 0)
        d.G = pyo.Constraint(expr=m.G[t] == 0)

    @m.Disjunct(m.t)
    def on(d, t):
        d.region = pyo.Constraint(expr=m.x[t] >= 0)
        two_inside(m, t, d)

    m.power = Disjunction(m.t, rule=lambda m, t: [m.off[t], m.on[t]])
    return m


@pytest.mark.parametrize('form', FORMS)
def test_a_disjunct_with_two_disjunctions_has_a_mode_for_each_combination(form):
    m = dcs(several_inside(), form=form)
    first, second = m.on[0].first, m.on[0].second
    block, _ = form_of(m.power[0])
    seen = set()
    for number in range(1, 9 if block.component('alpha') is not None else 1 + len(block.nu) // 2):
        from tests.models import put_on

        put_on(m.power[0], number)
        if pyo.value(weights(m.power[0])[m.on[0]]) != 1:
            continue
        F, G = ([round(pyo.value(w)) for w in weights(d).values()] for d in (first, second))
        assert rate(m.power[0], m.F[0]) == pytest.approx(F[0] + 2 * F[1])
        assert rate(m.power[0], m.G[0]) == pytest.approx(10 * G[0] + 20 * G[1])
        seen.add((*F, *G))
    assert seen == {(1, 0, 1, 0), (1, 0, 0, 1), (0, 1, 1, 0), (0, 1, 0, 1)}


def test_independent_inner_disjunctions_need_no_products_of_their_steps():
    m = dcs(several_inside(), form='heaviside')
    F, G = (str(m._pyomo_fesd_dcs.power_heaviside_3.mode[0, j].expr) for j in (1, 2))
    assert ('alpha[0,2]' in F, 'alpha[0,3]' in F) == (True, False)
    assert ('alpha[0,2]' in G, 'alpha[0,3]' in G) == (False, True)
