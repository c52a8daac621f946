"""Nested Disjunctions become one system whose modes are the ways down (theory, section 1)."""

import pyomo.environ as pyo
import pytest
from pyomo.gdp import Disjunct, Disjunction
from pyomo.mpec import Complementarity

import pyomo_fesd
from pyomo_fesd import FesdError
from tests.models import (
    EVERYWHERE,
    dcs,
    finite_elements,
    form_of,
    generated,
    modes_on,
    rate,
    scalar_ode,
    thresholds,
    values_of_generated,
    weights,
)
from tests.problems.forms_of import form_block
from tests.problems.running import SCHEMES, move, seen, solve

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
    for x, outer, within, dx in ((-1.0, [1, 0], [0, 0], 3), (0.5, [0, 1], [1, 0], 2), (1.5, [0, 1], [0, 1], 1)):
        m.x[0].value = x
        modes_on(m.level[0])
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
    before = seen(m)
    new = fesd_dcs.create_using(m)
    assert seen(m) == before
    copy = finite_elements(new.clone(), nfe=2, ncp=2)
    assert seen(m) == before
    assert len(generated(copy, Complementarity)) == 4 * len(copy.t)
    assert set(weights(copy.level[0])) == {copy.low[0], copy.high[0]}


def test_a_second_time_changes_nothing():
    m = dcs(two_levels(declared_inside))
    before = seen(m)
    dcs(m)
    assert seen(m) == before


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
    for x, dy in ((-1.0, 5), (0.5, -0.5), (1.5, -1.5)):
        m.x[0].value = x
        modes_on(m.level[0])
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
    for k, x in enumerate((-0.5, 0.5, 1.5, 2.5, 3.5), start=1):
        m.x[0].value = x
        assert modes_on(m.split[0]) == [m.here[0] if k == 1 else m.beyond[0]]
        assert rate(m.split[0], m.dx[0]) == pytest.approx(k)


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
    for x, F in ((0.5, 1), (1.5, 2)):
        for y, G in ((-1.0, 10), (1.0, 20)):
            m.x[0].value, m.y[0].value = x, y
            assert modes_on(m.power[0]) == [m.on[0]]
            assert [rate(m.power[0], v) for v in (m.F[0], m.G[0])] == pytest.approx([F, G])
            first, second = ([pyo.value(w) for w in weights(d).values()] for d in (m.on[0].first, m.on[0].second))
            assert (first, second) == ([F == 1, F == 2], [G == 10, G == 20])


def test_independent_inner_disjunctions_need_no_products_of_their_steps():
    m = dcs(several_inside(), form='heaviside')
    F, G = (str(m._pyomo_fesd_dcs.power._pyomo_fesd_heaviside_3.mode[0, j].expr) for j in (1, 2))
    assert ('alpha[0,2]' in F, 'alpha[0,3]' in F) == (True, False)
    assert ('alpha[0,2]' in G, 'alpha[0,3]' in G) == (False, True)


# Modes that are switched off


@pytest.mark.parametrize(
    'switch', [lambda d: d.deactivate(), lambda d: d.indicator_var.fix(False)], ids=['deactivated', 'fixed to False']
)
def test_an_inner_mode_that_is_switched_off_leaves_nothing(switch):
    m = two_levels(declared_inside)
    for t in m.t:
        m.high[t].slow.region.deactivate()  # what is left divides the line
        switch(m.high[t].fast)
    dcs(m)
    assert form_block(m)[0] == ''
    assert len(generated(m, Complementarity)) == 2 * len(m.t)
    assert set(weights(m.high[0].speed)) == {m.high[0].slow}


def test_an_inner_mode_that_is_fixed_to_true_has_its_outer_mode_on():
    m = two_levels(declared_inside)
    for t in m.t:
        m.high[t].slow.indicator_var.fix(True)
    dcs(m)
    assert generated(m, Complementarity) == {}
    found = {str(c.expr) for c in generated(m, pyo.Constraint).values()}
    assert found == {text for t in m.t for text in (f'0  <=  x[{t}]', f'x[{t}]  <=  1', f'dx[{t}]  ==  2')}


@writings
def test_an_outer_mode_that_is_switched_off_takes_its_inner_ones_with_it(inner):
    m = two_levels(inner)
    m.high.deactivate()
    dcs(m)
    assert generated(m, Complementarity) == {}
    assert not list(m.component_data_objects(Disjunction, active=True, descend_into=EVERYWHERE))
    assert len(generated(m, pyo.Constraint)) == 2 * len(m.t)


def test_a_nested_disjunction_that_is_switched_off_asks_for_its_disjuncts_to_be_so_too():
    m = two_levels(declared_inside)
    for t in m.t:
        m.high[t].speed.deactivate()
    with pytest.raises(FesdError, match=r"'high\[0\].slow', which belongs to no active Disjunction"):
        dcs(m)
    for t in m.t:
        m.high[t].slow.deactivate()
        m.high[t].fast.deactivate()
        m.high[t].ode = pyo.Constraint(expr=m.dx[t] == 2)
    dcs(m)
    assert form_block(m)[0] == ''


# The whole path


@writings
@pytest.mark.parametrize('form', ['heaviside', 'stewart'])
def test_switches_are_found_in_outer_and_inner_disjunctions(inner, form):
    # from -2 at rate 3, then 2, then 1: at 0 after 2/3, at 1 after 1/2 more, at 11/6 after 2
    m = two_levels(inner)
    m.rest = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == 0)
    m.y[0].fix(1)
    solve(move(dcs(m, form=form), 8, 2))
    name, slow, fast = INNER[inner]
    found = pyomo_fesd.switches(m)
    assert [(s.disjunction, s.before, s.after) for s in found] == [('level', 'low', 'high'), (name, slow, fast)]
    assert [s.time for s in found] == pytest.approx([2 / 3, 7 / 6], abs=1e-9)
    assert m.x[2].value == pytest.approx(11 / 6, abs=1e-9)
    assert [m.low[2].indicator_var.value, m.high[2].indicator_var.value] == [False, True]
    assert [d.indicator_var.value for d in inner_disjunction(m, 2).disjuncts] == [False, True]
    frame = pyomo_fesd.trajectory(m)
    outer, within = (frame[[f'{d}: {mode}' for mode in modes]] for d, modes in (('level', ['high']), (name, [slow, fast])))
    assert outer.sum(axis=1).tolist() == pytest.approx(within.sum(axis=1).tolist())


def test_nested_modes_may_stand_in_blocks_over_time_and_have_indices():
    m = scalar_ode()
    m.rest = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == 0)
    m.y[0].fix(1)

    @m.Block(m.t)
    def plant(b, t):
        m = b.model()
        b.low, b.high = Disjunct(), Disjunct()
        b.low.region = pyo.Constraint(expr=m.x[t] <= 0)
        b.low.ode = pyo.Constraint(expr=m.dx[t] == 3)
        b.high.region = pyo.Constraint(expr=m.x[t] >= 0)
        b.high.speed = Disjunction(['a'], rule=lambda d, i: [[m.x[t] <= 1, m.dx[t] == 2], [m.x[t] >= 1, m.dx[t] == 1]])
        b.level = Disjunction(expr=[b.low, b.high])

    solve(move(dcs(m), 8, 2))
    found = pyomo_fesd.switches(m)
    assert [s.disjunction for s in found] == ['plant.level', 'plant.high.speed[a]']
    assert [s.time for s in found] == pytest.approx([2 / 3, 7 / 6], abs=1e-9)


@pytest.mark.parametrize('scheme', SCHEMES)
def test_a_slide_between_an_outer_mode_and_an_inner_one(scheme):
    """x slides at 0 between 'low' (rate 1) and the inner mode 'down' of 'high' (rate -3); at y = 0 'up' takes over (rate 1)."""
    m = scalar_ode(x0=1.0)
    m.fall = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == -1)
    m.y[0].fix(1)

    @m.Disjunct(m.t)
    def low(d, t):
        d.region = pyo.Constraint(expr=m.x[t] <= 0)
        d.ode = pyo.Constraint(expr=m.dx[t] == 1)

    @m.Disjunct(m.t)
    def high(d, t):
        d.region = pyo.Constraint(expr=m.x[t] >= 0)
        d.down, d.up = Disjunct(), Disjunct()
        d.down.region = pyo.Constraint(expr=m.y[t] >= 0)
        d.down.ode = pyo.Constraint(expr=m.dx[t] == -3)
        d.up.region = pyo.Constraint(expr=m.y[t] <= 0)
        d.up.ode = pyo.Constraint(expr=m.dx[t] == 1)
        d.way = Disjunction(expr=[d.down, d.up])

    m.level = Disjunction(m.t, rule=lambda m, t: [m.low[t], m.high[t]])
    solve(move(dcs(m), 9, 2, scheme=scheme))
    frame, found = pyomo_fesd.trajectory(m), pyomo_fesd.switches(m)
    assert [(s.disjunction, s.before, s.after) for s in found] == [
        ('level', 'high', 'sliding low | high'),
        ('level', 'sliding low | high', 'high'),
        ('high.way', 'down', 'up'),
    ]
    assert [s.time for s in found] == pytest.approx([1 / 3, 1, 1], abs=1e-8)
    sliding = frame[(frame.index > 0.4) & (frame.index < 0.9)]
    assert sliding['high.way: down'].tolist() == pytest.approx([0.25] * len(sliding))
    assert m.x[2].value == pytest.approx(1, abs=1e-8)


def test_the_report_counts_inner_disjunctions_and_modes_that_are_left_out():
    m = two_levels(declared_inside)
    for t in m.t:
        m.high[t].slow.region.deactivate()
        m.high[t].fast.deactivate()
    dcs(m)
    size = pyomo_fesd.report(m)
    assert [size[name] for name in ('disjunctions', 'modes left out', 'pairs')] == [4, 2, 4]


# What is refused


def at_another_time(m):
    m.inner = Disjunction(expr=[[m.y[0] <= 0, m.dy[0] == 1], [m.y[0] >= 0, m.dy[0] == 2]])
    m.later = Disjunction(m.t, rule=lambda m, t: [m.high[2 - t].slow, m.high[2 - t].fast])


def in_two_places(m):
    m.other = Disjunct(m.t, rule=lambda d, t: None)
    m.speed = Disjunction(m.t, rule=lambda m, t: [m.high[t].slow, m.other[t]])


def without_condition(m):
    for t in m.t:
        m.high[t].slow.region.deactivate()
        m.high[t].fast.region.deactivate()
        m.high[t].region.deactivate()


def overlapping(m):
    for t in m.t:
        m.high[t].fast.region.deactivate()
        m.high[t].fast.other = pyo.Constraint(expr=m.x[t] <= 5)


def inclusive(m):
    for t in m.t:
        m.high[t].speed.xor = False


def all_off(m):
    for t in m.t:
        m.high[t].slow.deactivate()
        m.high[t].fast.deactivate()


def lonely(m):
    for t in m.t:
        m.high[t].third = Disjunct()


def both_on(m):
    for t in m.t:
        m.low[t].indicator_var.fix(True)
        m.high[t].fast.indicator_var.fix(True)


def missing_equation(m):
    for t in m.t:
        m.high[t].slow.ode.deactivate()


RESTS = {
    'of the inner Disjunction': (True, True, False),
    'between': (False, False, True),
    'of both': (False, True, False),
}


@pytest.mark.parametrize('form', ['stewart', 'heaviside'])
@pytest.mark.parametrize('rest', RESTS)
def test_a_mode_without_inequality_takes_what_the_others_leave(rest, form):
    """From x = -2: rate 3 to 0 at 2/3, 2 to 1 at 7/6, then 1."""
    high_has, slow_has, fast_has = RESTS[rest]
    m = scalar_ode()

    @m.Disjunct(m.t)
    def high(d, t):
        x, dx = d.model().x[t], d.model().dx[t]
        if high_has:
            d.region = pyo.Constraint(expr=x >= 0)
        d.speed = Disjunction(expr=[[x <= 1, dx == 2][1 - slow_has :], [x >= 1, dx == 1][1 - fast_has :]])

    @m.Disjunct(m.t)
    def low(d, t):
        d.region = pyo.Constraint(expr=d.model().x[t] <= 0)
        d.ode = pyo.Constraint(expr=d.model().dx[t] == 3)

    m.level = Disjunction(m.t, rule=lambda m, t: [m.low[t], m.high[t]])
    m = solve(move(dcs(m, form=form), 8, 2))
    assert [s.time for s in pyomo_fesd.switches(m)] == pytest.approx([2 / 3, 7 / 6])


BAD = {
    'at another time': (without_disjunction, at_another_time, 'later[', 'of another time'),
    'in two places': (without_disjunction, in_two_places, 'speed[0]', 'different disjuncts'),
    'no condition on the whole way': (declared_inside, without_condition, 'high[0].fast', 'no region condition'),
    'inner regions that overlap': (declared_inside, overlapping, 'level[0]', 'overlap'),
    'an inner xor=False': (declared_inside, inclusive, 'high[0].speed', 'xor=False'),
    'all inner modes off': (declared_inside, all_off, 'high[0].speed', 'switched off'),
    'an inner disjunct in no Disjunction': (declared_inside, lonely, 'high[0]', 'no active Disjunction'),
    'an inner and another outer mode fixed to True': (declared_inside, both_on, 'level[0]', "'low.0.', 'high.0..fast'"),
    'an inner mode that defines nothing': (declared_inside, missing_equation, 'high[0].slow', '0 equation'),
}


@pytest.mark.parametrize('fault', BAD)
def test_a_fault_is_refused_by_name_and_the_model_stays_as_it_was(fault):
    inner, spoil, component, cause = BAD[fault]
    m = two_levels(inner)
    if inner is without_disjunction:
        m.del_component(m.speed)
    spoil(m)
    before = seen(m)
    with pytest.raises(FesdError, match=cause) as refusal:
        dcs(m)
    assert refusal.value.component.startswith(component) and refusal.value.fix
    assert seen(m) == before


@pytest.mark.parametrize('inner', [declared_inside, without_disjunction])
def test_a_nested_disjunction_is_no_target(inner):
    m = two_levels(inner)
    before = seen(m)
    with pytest.raises(FesdError, match=r"nested in 'high\[0\]'") as refusal:
        dcs(m, targets=inner_disjunction(m, 0))
    assert 'outermost' in refusal.value.fix
    assert seen(m) == before
    dcs(m, targets=m.level)
    assert not inner_disjunction(m, 0).active


def design_choice():
    """A Disjunction over time in a disjunct that is bought or not, once for all times."""
    m = two_levels(declared_inside)
    m.buy = Disjunct()
    m.buy.sgn = Disjunction(m.t, rule=lambda d, t: [[m.y[t] <= 0, m.dy[t] == 1], [m.y[t] >= 0, m.dy[t] == 2]])
    return m


def test_disjunctions_in_a_design_choice_are_left_alone():
    m = dcs(design_choice())
    assert all(d.active for d in m.buy.sgn.values()) and not m.level[0].active


def test_a_disjunction_in_a_design_choice_is_no_nested_one():
    m = design_choice()
    dcs(m, targets=m.buy.sgn)
    assert not any(d.active for d in m.buy.sgn.values()) and m.level[0].active
