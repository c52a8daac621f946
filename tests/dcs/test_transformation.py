"""fesd.dcs as a user meets it: declaration styles, what is left out, maps, refusals."""

import logging

import pyomo.environ as pyo
import pytest
from pyomo import dae
from pyomo.common.log import LoggingIntercept
from pyomo.core.expr.visitor import identify_variables
from pyomo.gdp import Disjunct, Disjunction
from pyomo.mpec import Complementarity, complements

from pyomo_fesd import FesdError, simulate
from tests import models
from tests.models import (
    EVERYWHERE,
    above,
    add_modes,
    below,
    dcs,
    disjunctions,
    finite_elements,
    form_of,
    generated,
    modes_on,
    put_on,
    rate,
    scalar_ode,
    signum,
    signum_of_lists,
    snapshot,
    tank,
    thresholds,
    turn_on,
    units,
    values_of_generated,
)
from tests.problems.forms_of import form_block

fesd_dcs = pyo.TransformationFactory('fesd.dcs')

STYLES = [
    models.signum,
    models.signum_of_lists,
    models.signum_of_scalars,
    models.units,
    models.units_by_index,
    models.tank,
    models.thresholds,
    models.quadrants,
]
SIGNUM_STYLES = [models.signum, models.signum_of_lists, models.signum_of_scalars]
UNIT_STYLES = [models.units, models.units_by_index]


def active(m, ctype):
    return list(m.component_data_objects(ctype, active=True, descend_into=EVERYWHERE))


def flow_model():
    """Algebraic variables F and P over time beside the states; no Disjunction yet."""
    m = scalar_ode()
    m.F, m.P = pyo.Var(m.t, initialize=1.0), pyo.Var(m.t, initialize=1.0)
    return m


# Declaration styles, before and after discretisation


@pytest.mark.parametrize('style', STYLES, ids=lambda style: style.__name__)
def test_before_and_after_discretisation_give_the_same_equations(style):
    before = finite_elements(dcs(style()), nfe=2, ncp=2)
    after = dcs(style(discretised=True))
    assert list(before.t) == list(after.t)
    expected = values_of_generated(after)
    assert len(expected) % len(after.t) == 0 and len(expected) > 0
    assert values_of_generated(before) == pytest.approx(expected)


@pytest.mark.parametrize('style', STYLES, ids=lambda style: style.__name__)
def test_nothing_hybrid_stays_active(style):
    m = finite_elements(dcs(style()), nfe=2, ncp=2)
    assert active(m, Disjunction) == [] and active(m, Disjunct) == []
    assert len(disjunctions(m)) % len(m.t) == 0


@pytest.mark.parametrize('style', SIGNUM_STYLES, ids=lambda style: style.__name__)
def test_every_style_says_the_same_system(style):
    m = dcs(style(discretised=True))
    assert len(disjunctions(m)) == len(m.t)
    for t, disjunction in zip(m.t, disjunctions(m)):
        for x, dx in ((-2.0, 3), (0.5, 1)):
            m.x[t].value = x
            assert len(modes_on(disjunction)) == 1
            assert rate(disjunction, m.dx[t]) == pytest.approx(dx)


@pytest.mark.parametrize('style', UNIT_STYLES, ids=lambda style: style.__name__)
def test_every_unit_switches_at_its_own_level(style):
    m = dcs(style())
    at_start = [d for d in disjunctions(m) if '0' in d.name]
    assert len(at_start) == 2
    for (i, level), disjunction in zip({'a': 0.0, 'b': 1.0}.items(), at_start):
        for x, dx in ((level - 0.1, 3), (level + 0.1, 1)):
            m.x[i, 0].value = x
            modes_on(disjunction)
            assert rate(disjunction, m.dx[i, 0]) == pytest.approx(dx)


def test_a_disjunction_may_skip_times():
    def skipping(m, t):
        return Disjunction.Skip if t == 0 else [below(m, t), above(m, t)]

    before, after = scalar_ode(), scalar_ode(discretised=True)
    for m in (before, after):
        m.sgn = Disjunction(m.t, rule=skipping)
        dcs(m)
    finite_elements(before, nfe=2, ncp=2)
    assert len(generated(after, pyo.Constraint)) == 2 * (len(after.t) - 1)
    assert values_of_generated(before) == pytest.approx(values_of_generated(after))


def test_a_field_in_space_switches_point_by_point():
    m = pyo.ConcreteModel()
    m.t, m.z = dae.ContinuousSet(bounds=(0, 1)), dae.ContinuousSet(bounds=(0, 1))
    m.T = pyo.Var(m.t, m.z, initialize=2.0)
    m.dT = dae.DerivativeVar(m.T, wrt=m.t)

    @m.Disjunction(m.t, m.z)
    def melting(m, t, z):
        return [[m.T[t, z] <= 1, m.dT[t, z] == 3], [m.T[t, z] >= 1, m.dT[t, z] == 1]]

    dcs(m, wrt=m.t)
    assert len(active(m, Complementarity)) == 2 * len(m.t) * len(m.z)
    put_on(m.melting[1, 1], 2)
    assert rate(m.melting[1, 1], m.dT[1, 1]) == pytest.approx(1)


@pytest.mark.parametrize('style', STYLES, ids=lambda style: style.__name__)
def test_the_transformation_prints_no_warning(style):
    m = style()
    with LoggingIntercept(module='pyomo', level=logging.WARNING) as log:
        dcs(m)
    assert log.getvalue() == ''


def test_everything_generated_lies_in_one_block_beside_the_disjunction():
    m = signum()
    before = set(m.component_map())
    dcs(m)
    assert set(m.component_map()) - before == {'_pyomo_fesd_dcs'}


def test_equations_outside_the_disjuncts_are_left_alone():
    m = tank()
    before = {t: str(m.balance[t].expr) for t in m.t}
    dcs(m)
    assert {t: str(m.balance[t].expr) for t in m.t} == before
    assert all(m.balance[t].active for t in m.t)


# Which Disjunctions


def test_a_disjunction_that_is_not_over_time_is_left_alone():
    m = signum()
    m.size = pyo.Var(bounds=(0, 2))
    m.design = Disjunction(expr=[[m.size <= 1], [m.size >= 1]])
    dcs(m)
    assert active(m, Disjunction) == [m.design]
    assert len(active(m, Disjunct)) == 2


def test_a_deactivated_disjunction_is_left_alone():
    m = signum()
    m.sgn.deactivate()
    dcs(m)
    assert active(m, Complementarity) == []
    assert len(active(m, Disjunct)) == 2 * len(m.t)


def test_a_deactivated_disjunction_stays_off_at_the_times_added_later():
    m = signum()
    m.sgn.deactivate()
    finite_elements(dcs(m), nfe=2, ncp=2)
    assert generated(m, pyo.Constraint) == {}


def test_a_deactivated_time_of_a_disjunction_is_left_alone():
    m = signum(discretised=True)
    m.sgn[0].deactivate()
    dcs(m)
    assert len(active(m, Complementarity)) == 2 * (len(m.t) - 1)
    assert m.below[0].active and m.above[0].active


def test_a_disjunction_in_a_deactivated_block_is_left_alone():
    m = units()
    m.unit['b'].deactivate()
    dcs(m)
    assert len(active(m, Complementarity)) == 2 * len(m.t)
    assert all(name.startswith('unit[a]') for name in generated(m, pyo.Constraint))


def test_applied_to_a_block_nothing_outside_it_changes():
    m = units()
    fesd_dcs.apply_to(m.unit['a'], wrt=m.t)
    assert len(active(m, Complementarity)) == 2 * len(m.t)
    assert len(active(m, Disjunction)) == len(m.t)
    finite_elements(m, nfe=2, ncp=2)
    assert [d.name for d in disjunctions(m) if d.active] == [d.name for d in disjunctions(m) if 'unit[b]' in d.name]


def one_more_sign(**keywords):
    """signum with a second Disjunction 'also' for y."""
    return add_modes(
        signum(**keywords),
        lambda m, t: [m.y[t] <= 0, m.dy[t] == 3],
        lambda m, t: [m.y[t] >= 0, m.dy[t] == 1],
        name='also',
    )


@pytest.mark.parametrize('target', ['component', 'list', 'data'])
def test_only_the_target_is_transformed(target):
    m = one_more_sign()
    dcs(m, targets={'component': m.sgn, 'list': [m.sgn], 'data': [m.sgn[0], m.sgn[2]]}[target])
    assert [d.active for d in disjunctions(m)] == [False, False, True, True]


def test_a_target_at_one_time_leaves_the_other_times():
    m = signum(discretised=True)
    dcs(m, targets=m.sgn[0])
    assert [m.sgn[t].active for t in m.t] == [False, True, True, True, True]


def test_a_block_is_a_target():
    m = units()
    dcs(m, targets=[m.unit['b']])
    assert all(name.startswith('unit[b]') for name in generated(m, pyo.Constraint))
    assert len(active(m, Complementarity)) == 2 * len(m.t)


def test_the_target_is_remembered_when_time_gets_its_points():
    m = one_more_sign()
    finite_elements(dcs(m, targets=m.sgn), nfe=2, ncp=2)
    assert not any(m.sgn[t].active for t in m.t)
    assert all(m.also[t].active for t in m.t)


def test_the_form_is_remembered_when_time_gets_its_points():
    m = finite_elements(dcs(signum(), form='stewart'), nfe=2, ncp=2)
    name, block = form_block(m)
    assert name == 'stewart_2' and len(block.mu) == len(m.t)


def test_two_disjunctions_are_independent_systems():
    m = dcs(one_more_sign())
    m.x[0].value, m.y[0].value = -1.0, 1.0
    assert [modes_on(m.sgn[0]), modes_on(m.also[0])] == [[m.below[0]], [m.also[0].disjuncts[1]]]
    assert [rate(m.sgn[0], m.dx[0]), rate(m.also[0], m.dy[0])] == pytest.approx([3, 1])


# Modes that are switched off


def leave_only_the_first(disjunction, how):
    """Switch all modes but the first off, or the first on."""
    disjuncts = disjunction.disjuncts
    if how == 'on':
        disjuncts[0].indicator_var.fix(True)
    for other in disjuncts[1:]:
        if how == 'deactivated':
            other.deactivate()
        elif how == 'fixed False':
            other.indicator_var.fix(False)


@pytest.mark.parametrize('how', ['deactivated', 'fixed False', 'on'])
@pytest.mark.parametrize('build, name', [(signum_of_lists, 'sgn'), (thresholds, 'level')], ids=['two modes', 'three modes'])
def test_one_mode_left_simply_holds_without_any_pair(build, name, how):
    m = build()
    for t in m.t:
        leave_only_the_first(m.component(name)[t], how)
    dcs(m)
    assert generated(m, Complementarity) == {} and generated(m, pyo.Var) == {}
    found = {str(con.body): (pyo.value(con.lower), pyo.value(con.upper)) for con in generated(m, pyo.Constraint).values()}
    assert found == {f'{v}[{t}]': bounds for t in m.t for v, bounds in (('x', (None, 0)), ('dx', (3, 3)))}


@pytest.mark.parametrize('how', ['deactivated', 'fixed False', 'on'])
def test_no_disjunct_of_a_transformed_disjunction_stays_active(how):
    m = signum()
    for t in m.t:
        leave_only_the_first(m.sgn[t], how)
    dcs(m)
    assert active(m, Disjunct) == []


def test_switching_one_of_three_modes_off_leaves_the_small_form():
    m = add_modes(scalar_ode(), below, above, lambda m, t: [m.x[t] >= 9, m.dx[t] == 9])
    for t in m.t:
        m.sgn[t].disjuncts[2].indicator_var.fix(False)
    dcs(m)
    assert form_block(m)[0] == ''
    assert len(active(m, Complementarity)) == 2 * len(m.t)


def test_a_mode_switched_off_at_one_time_is_on_at_the_others():
    m = signum(discretised=True)
    m.above[0].deactivate()
    dcs(m)
    assert len(active(m, Complementarity)) == 2 * (len(m.t) - 1)
    (ode,) = fesd_dcs.get_transformed_constraints(m.below[0].ode)
    assert [str(ode.body), ode.lower, ode.upper] == ['dx[0]', 3, 3]


def test_a_mode_deactivated_as_a_whole_stays_off_at_the_times_added_later():
    m = signum()
    m.above.deactivate()
    finite_elements(dcs(m), nfe=2, ncp=2)
    assert generated(m, Complementarity) == {}
    assert len(generated(m, pyo.Constraint)) == 2 * len(m.t)


def test_a_disjunct_with_no_region_is_fine_where_it_is_the_only_one():
    m = scalar_ode()
    m.always = Disjunct(m.t, rule=lambda d, t: setattr(d, 'ode', pyo.Constraint(expr=m.dx[t] == 3)))
    m.sgn = Disjunction(m.t, rule=lambda m, t: [m.always[t]])
    dcs(m)
    assert len(generated(m, pyo.Constraint)) == len(m.t)


def test_the_only_mode_may_state_more_at_later_times():
    m = flow_model()

    @m.Disjunct(m.t)
    def always(d, t):
        d.ode = pyo.Constraint(expr=m.dx[t] == 3)
        if t > 0:
            d.flow = pyo.Constraint(expr=m.F[t] == 1)

    m.sgn = Disjunction(m.t, rule=lambda m, t: [m.always[t]])
    dcs(m)
    assert len(generated(m, pyo.Constraint)) == 3


# Again, in a copy, in a clone


def test_a_second_time_changes_nothing():
    m = dcs(signum())
    before = snapshot(m)
    dcs(m)
    assert snapshot(m) == before


def test_applied_twice_before_discretisation_the_equations_stand_once():
    once, twice = dcs(signum()), dcs(dcs(signum()))
    finite_elements(once), finite_elements(twice)
    assert values_of_generated(twice) == pytest.approx(values_of_generated(once))


@pytest.mark.parametrize('style', STYLES, ids=lambda style: style.__name__)
def test_create_using_leaves_the_original_as_it_was(style):
    m = style()
    before = snapshot(m)
    new = fesd_dcs.create_using(m, wrt=m.t)
    assert snapshot(m) == before
    assert active(new, Disjunction) == [] and generated(new, pyo.Constraint)
    finite_elements(new, nfe=2, ncp=2)
    assert snapshot(m) == before


def test_create_using_takes_targets_of_the_original():
    m = one_more_sign()
    new = fesd_dcs.create_using(m, targets=m.also)
    assert new.sgn[0].active and not new.also[0].active


def test_a_clone_can_be_discretised_by_itself():
    m = dcs(signum())
    before = snapshot(m)
    new = finite_elements(m.clone(), nfe=2, ncp=2)
    assert snapshot(m) == before
    assert values_of_generated(new) == pytest.approx(values_of_generated(dcs(signum(discretised=True))))


def test_the_maps_of_a_clone_lead_to_the_clone():
    new = dcs(signum()).clone()
    condition = new._pyomo_fesd_dcs.sgn.complementarity[0, 1]
    assert fesd_dcs.get_src_disjunct(condition) is new.below[0]
    assert fesd_dcs.get_src_disjunction(condition) is new.sgn[0]
    (image,) = fesd_dcs.get_transformed_constraints(new.below[0].ode)
    assert image is new._pyomo_fesd_dcs.sgn.mode[0, 1]
    multipliers = fesd_dcs.get_multipliers(new.sgn[0])
    assert [v.model() is new for nu in multipliers.values() for v in identify_variables(nu)] == [True, True]


# Maps back to the source


@pytest.mark.parametrize('style', STYLES, ids=lambda style: style.__name__)
def test_every_generated_equation_and_condition_knows_its_disjunction(style):
    m = dcs(style())
    components = [*generated(m, pyo.Constraint).values(), *generated(m, Complementarity).values()]
    found = [fesd_dcs.get_src_disjunction(c) for c in components]
    assert {d.name for d in found} == {d.name for d in disjunctions(m)}


@pytest.mark.parametrize('build, name', [(signum, 'sgn'), (thresholds, 'level')], ids=['two modes', 'three modes'])
def test_every_condition_knows_its_disjunct(build, name):
    m = dcs(build(), form='auto' if build is signum else 'stewart')
    for t in m.t:
        disjunction = m.component(name)[t]
        block, _ = form_of(disjunction)
        found = [fesd_dcs.get_src_disjunct(block.complementarity[t, i + 1]) for i in range(len(disjunction.disjuncts))]
        assert found == disjunction.disjuncts


def test_a_blended_equation_knows_the_equations_that_it_blends():
    m = dcs(tank())
    for t in m.t:
        (L,) = fesd_dcs.get_transformed_constraints(m.full[t].first)
        (G,) = fesd_dcs.get_transformed_constraints(m.full[t].second)
        assert any(v is m.L[t] for v in identify_variables(L.body))
        assert any(v is m.G[t] for v in identify_variables(G.body))
        assert fesd_dcs.get_src_constraint(L) == [m.full[t].first, m.empty[t].second]
        assert fesd_dcs.get_src_constraint(G) == [m.full[t].second, m.empty[t].first]


def test_an_implicit_equation_is_mapped_to_its_copy_and_to_the_blend():
    m = add_modes(scalar_ode(), lambda m, t: [m.x[t] <= 0, m.dx[t] ** 3 == 27], above)
    implicit = next(c for c in m.sgn[0].disjuncts[0].component_data_objects(pyo.Constraint) if c.equality)
    dcs(m)
    block = m._pyomo_fesd_dcs.sgn
    images = fesd_dcs.get_transformed_constraints(implicit)
    assert {image.name for image in images} == {block.own_equation[0, 1, 1].name, block.mode[0, 1].name}
    assert fesd_dcs.get_src_constraint(block.own_equation[0, 1, 1]) == [implicit]


def test_the_only_mode_left_is_mapped_equation_by_equation():
    m = signum()
    for t in m.t:
        m.above[t].deactivate()
    dcs(m)
    for source in (m.below[0].region, m.below[0].ode):
        (image,) = fesd_dcs.get_transformed_constraints(source)
        assert str(image.expr) == str(source.expr)
        assert fesd_dcs.get_src_constraint(image) == [source]
        assert fesd_dcs.get_src_disjunction(image) is m.sgn[0]


def test_a_disjunct_that_was_not_transformed_has_no_images():
    m = signum()
    assert fesd_dcs.get_transformed_constraints(m.below[0].ode) == []
    assert len(fesd_dcs.get_multipliers(m.sgn[0])) == 0


@pytest.mark.parametrize('form', ['auto', 'stewart', 'heaviside'])
@pytest.mark.parametrize('build, name', [(signum, 'sgn'), (thresholds, 'level')], ids=['two modes', 'three modes'])
def test_the_multipliers_tell_which_mode_is_on(build, name, form):
    m = dcs(build(), form=form)
    disjunction = m.component(name)[0]
    for disjunct in disjunction.disjuncts:
        turn_on(disjunction, disjunct)
        values = [pyo.value(nu) for nu in fesd_dcs.get_multipliers(disjunction).values()]
        assert values == [float(d is disjunct) for d in disjunction.disjuncts]


# What is refused: the message names component, cause and fix, the model stays as it was


def lists(*modes):
    return lambda: add_modes(scalar_ode(), *modes)


def with_flows(first, second):
    """Modes that define the algebraic variables F and P."""
    return lambda: add_modes(flow_model(), lambda m, t: [m.x[t] <= 0, *first(m, t)], lambda m, t: [m.x[t] >= 0, *second(m, t)])


def inclusive_or():
    m = signum()
    m.del_component(m.sgn)
    m.sgn = Disjunction(m.t, rule=lambda m, t: [m.below[t], m.above[t]], xor=False)
    return m


def with_component(name, declare):
    """signum with one more component over time on the model."""

    def build():
        m = signum()
        m.add_component(name, declare(m))
        return m

    return build


def with_content(declare):
    """signum with one more component inside Disjunct 'above'."""

    def build():
        m = signum()
        for t in m.t:
            declare(m, m.above[t], t)
        return m

    return build


def lonely_disjunct(m, d, t):
    d.inner = Disjunct()


def logic_inside(m, d, t):
    d.flag = pyo.BooleanVar()
    d.inner = pyo.LogicalConstraint(expr=d.flag)


def complementarity_inside(m, d, t):
    d.inner = Complementarity(expr=complements(m.x[t] >= 0, m.y[t] >= 0))


def derivative_inside(m, d, t):
    d.s = dae.ContinuousSet(bounds=(0, 1))
    d.z = pyo.Var(d.s)
    d.dz = dae.DerivativeVar(d.z)


def without_continuous_set():
    m = pyo.ConcreteModel()
    m.t = pyo.Set(initialize=[0, 1])
    m.x = pyo.Var(m.t)
    m.dj = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 0], [m.x[t] >= 0]])
    return m


def two_continuous_sets():
    m = signum()
    m.z = dae.ContinuousSet(bounds=(0, 1))
    return m


def all_modes(switch):
    def build():
        m = signum()
        for t in m.t:
            switch(m.below[t])
            switch(m.above[t])
        return m

    return build


def a_good_one_and_a_bad_one():
    return add_modes(signum(), lambda m, t: [m.y[t] <= 0, m.dy[t] == 0], lambda m, t: [m.y[t] >= 1, m.dy[t] == 0], name='bad')


def one_disjunct_in_gdp_and_here():
    m = signum()
    for v in (*m.x.values(), *m.dx.values()):
        v.bounds = (-10, 10)
    m.again = Disjunction(m.t, rule=lambda m, t: [m.below[t], m.above[t]])
    pyo.TransformationFactory('gdp.bigm').apply_to(m, targets=m.sgn)
    return m


BAD = {
    'a mode lacks an equation': (lists(lambda m, t: [*below(m, t), m.dy[t] == 0], above), 'sgn_disjuncts[1]', r'dy\[0\]'),
    'a mode has one equation too many': (
        lists(below, lambda m, t: [*above(m, t), m.dx[t] == m.y[t]]),
        'sgn_disjuncts[0]',
        'equation',
    ),
    'modes define different derivatives': (lists(below, lambda m, t: [m.x[t] >= 0, m.dy[t] == 1]), 'sgn_disjuncts', r'd[xy]\[0\]'),
    'more derivatives than equations': (
        lists(lambda m, t: [m.x[t] <= 0, m.dx[t] + m.dy[t] == 1], lambda m, t: [m.x[t] >= 0, m.dx[t] - m.dy[t] == 1]),
        'sgn[0]',
        r'dx\[0\], dy\[0\]',
    ),
    'modes define nothing': (lists(lambda m, t: [m.x[t] <= 0], lambda m, t: [m.x[t] >= 0]), 'sgn[2]', 'no equality'),
    'modes define different algebraic variables': (
        with_flows(lambda m, t: [m.F[t] == 1], lambda m, t: [m.P[t] == 1]),
        'sgn[0]',
        'same variables',
    ),
    'the defined variable cannot be told': (
        with_flows(lambda m, t: [m.F[t] - 2 * m.P[t] == 1], lambda m, t: [m.F[t] - 3 * m.P[t] == 1]),
        'sgn[0]',
        r'F\[0\] or P\[0\]',
    ),
    'only a state could be defined': (
        lists(lambda m, t: [m.x[t] <= 0, m.x[t] == m.y[t]], lambda m, t: [m.x[t] >= 0, m.x[t] == 2 * m.y[t]]),
        'sgn[0]',
        'same variables',
    ),
    'xor=False': (inclusive_or, 'sgn[0]', 'xor=False'),
    'a BooleanVar over time': (with_component('flag', lambda m: pyo.BooleanVar(m.t)), 'flag[0]', 'BooleanVar'),
    'a Disjunct in a disjunct without its Disjunction': (with_content(lonely_disjunct), 'above[0]', 'belongs to no'),
    'a LogicalConstraint in a disjunct': (with_content(logic_inside), 'above[0]', 'LogicalConstraint'),
    'a Complementarity in a disjunct': (with_content(complementarity_inside), 'above[0]', 'Complementarity'),
    'a DerivativeVar in a disjunct': (with_content(derivative_inside), 'above[0].dz', 'DerivativeVar'),
    'no ContinuousSet': (without_continuous_set, 'unknown', 'no ContinuousSet'),
    'several ContinuousSets': (two_continuous_sets, 'unknown', r'several ContinuousSets \(t, z\)'),
    'all modes deactivated': (all_modes(lambda d: d.deactivate()), 'sgn[0]', 'switched off'),
    'all modes fixed to False': (all_modes(lambda d: d.indicator_var.fix(False)), 'sgn[0]', 'switched off'),
    'two modes fixed to True': (all_modes(lambda d: d.indicator_var.fix(True)), 'sgn[0]', 'True'),
    'a good Disjunction before the bad one': (a_good_one_and_a_bad_one, 'bad[0]', 'gap'),
    'a disjunct that gdp.bigm has transformed': (one_disjunct_in_gdp_and_here, 'below[0]', 'another transformation'),
}


def refusal_of(m, match, **keywords):
    """The FesdError of fesd.dcs, after a check that the model is as it was."""
    before = snapshot(m)
    with pytest.raises(FesdError, match=match) as refusal:
        dcs(m, **keywords)
    assert snapshot(m) == before
    return refusal.value


@pytest.mark.parametrize('fault', BAD)
def test_a_fault_is_refused_by_name_and_the_model_stays_as_it_was(fault):
    build, component, cause = BAD[fault]
    error = refusal_of(build(), cause)
    assert error.component.startswith(component)
    assert error.component in str(error) and error.fix in str(error)


def test_logic_that_has_nothing_to_do_with_time_is_left_alone():
    m = signum()
    m.buy = pyo.BooleanVar([1, 2])
    m.one = pyo.LogicalConstraint(expr=m.buy[1].xor(m.buy[2]))
    dcs(m)
    assert m.one.active and len(active(m, Complementarity)) == 2 * len(m.t)


@pytest.mark.parametrize(
    'wrong',
    [lambda m: 't', lambda m: m.i, lambda m: m.x, lambda m: 3, lambda m: [0, 1]],
    ids=['a name', 'a Set', 'a Var', 'a number', 'a list'],
)
def test_time_that_is_no_continuous_set_is_refused(wrong):
    m = signum()
    m.i = pyo.Set(initialize=[1])
    assert 'wrt=m.t' in refusal_of(m, 'must be a pyomo.dae.ContinuousSet', wrt=wrong(m)).fix


def test_the_time_of_another_model_is_refused():
    refusal_of(signum(), 'another model', wrt=signum().t)


def test_with_several_continuous_sets_wrt_says_which():
    m = two_continuous_sets()
    dcs(m, wrt=m.t)
    assert len(active(m, Complementarity)) == 2 * len(m.t)


def test_a_target_must_be_a_block_or_a_disjunction():
    m = signum()
    assert refusal_of(m, 'Block or a Disjunction', targets=m.x).component == 'x'


def test_a_target_of_another_model_is_refused():
    other = signum()
    before = snapshot(other)
    refusal_of(signum(), 'another model', targets=other.sgn)
    assert snapshot(other) == before


@pytest.mark.parametrize('keywords', [{'form': 'convex_hull'}, {'from': 'stewart'}], ids=['value', 'name'])
def test_an_unknown_option_is_refused_and_the_model_stays_as_it_was(keywords):
    m = signum()
    before = snapshot(m)
    with pytest.raises(ValueError, match=next(iter(keywords.values())) if 'form' in keywords else 'from'):
        dcs(m, **keywords)
    assert snapshot(m) == before


def test_a_fault_at_a_later_time_can_be_put_right_and_the_discretisation_repeated():
    m = scalar_ode()
    m.level = pyo.Param(initialize=1.0, mutable=True)

    def sign(m, t):
        return [below(m, t), above(m, t) if t in (0, 2) else [m.x[t] >= m.level, m.dx[t] == 1]]

    m.sgn = Disjunction(m.t, rule=sign)
    dcs(m)
    before = snapshot(m)
    with pytest.raises(FesdError, match='gap'):
        finite_elements(m, nfe=2, ncp=2)
    assert snapshot(m) == before
    m.level.value = 0.0
    finite_elements(m, nfe=2, ncp=2)
    assert len(generated(m, Complementarity)) == 2 * len(m.t)


@pytest.mark.parametrize('start', [1e-302, 5e-324, -1e-160, 1e-90, 0.0, 1e150])
@pytest.mark.parametrize('form', ['heaviside', 'stewart', 'auto'])
def test_opposite_conditions_are_recognised_at_any_start_value(form, start):
    m = signum(x0=start)
    dcs(m, form=form)
    assert not m.sgn[0].active


@pytest.mark.parametrize('first, then, end', [(1, -1, 3.0), (-1, 1, 5 / 3), (1, 2, 5 / 3)])
def test_a_parameter_that_changes_between_the_transformations_counts(first, then, end):
    # x' = 3 below 0 and 1 above it, or with p < 0 the other way round, from -1; 1/2 above 3
    m = pyo.ConcreteModel()
    m.t, m.p = dae.ContinuousSet(bounds=(0, 2)), pyo.Param(initialize=first, mutable=True)
    m.x = pyo.Var(m.t, initialize=-1)
    m.dx = dae.DerivativeVar(m.x, wrt=m.t)
    m.x[0].fix()
    m.mode = Disjunction(
        m.t,
        rule=lambda m, t: [
            [m.p * m.x[t] <= 0, m.x[t] <= 3, m.dx[t] == 3],
            [m.p * m.x[t] >= 0, m.x[t] <= 3, m.dx[t] == 1],
            [m.x[t] >= 3, m.dx[t] == 0.5],
        ],
    )
    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    m.p.value = then
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=6, ncp=2)
    simulate(m)
    assert m.x[2].value == pytest.approx(end)
