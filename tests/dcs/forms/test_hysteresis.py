"""Modes with memory: reading Disjunctions whose regions overlap, and what is left of them."""

import pyomo.environ as pyo
import pytest
import thermostat
from pyomo.gdp import Disjunct, Disjunction
from pyomo.mpec import Complementarity

import pyomo_fesd
from pyomo_fesd import FesdError
from pyomo_fesd.core import all_switched_systems
from tests.models import collocate, dcs, generated, scalar_ode, signum, snapshot, solution
from tests.problems import burst_disc, gears, thermostats
from tests.problems.forms_of import form_block
from tests.problems.running import seen


def remembered(m, *names):
    """fesd.dcs with memory for the Disjunctions of these names."""
    return dcs(m, hysteresis=[m.component(name) for name in names])


def form(m, name='relay', modes=2):
    """The generated block of a Disjunction."""
    return m._pyomo_fesd_dcs.component(name).component(f'_pyomo_fesd_hysteresis_{modes}')


def conditions(m):
    """The recorded conditions by name of their weight, as strings."""
    found = all_switched_systems(m).hysteresis
    return {mode.weight.name.split('.', 3)[-1]: [str(c.expr) for c in mode.conditions] for mode in found}


# What is left


def test_two_modes_cost_one_variable_and_one_equation_a_time():
    m = remembered(thermostat.build(), 'relay')
    assert len(generated(m, pyo.Var)) == len(generated(m, pyo.Constraint)) == len(m.t)
    assert not generated(m, Complementarity)


def test_three_modes_cost_two_variables_and_one_equation_a_time():
    m = gears.build()
    m.pedal.deactivate()
    remembered(m, 'gear')
    assert [len(generated(m, ctype)) for ctype in (pyo.Var, pyo.Constraint)] == [2 * len(m.t), len(m.t)]


@pytest.mark.parametrize('on, rate', [(1, 10 - 19 / 5), (0, -19 / 5)])
def test_the_weight_decides_the_rate(on, rate):
    m = remembered(thermostat.build(), 'relay')
    m.y[0].value = 19
    form(m).nu[0, 1].set_value(on)
    assert solution(form(m).mode[0, 1], m.dy[0]) == pytest.approx(rate)


def test_the_weights_of_three_modes_sum_up_to_one():
    m = remembered(gears.build(), 'gear')
    block = form(m, 'gear', 3)
    for values in ((1, 0), (0, 1), (0, 0), (0.25, 0.5)):
        for i, nu in enumerate(values, start=1):
            block.nu[0, i].set_value(nu)
        weights = [pyo.value(block.weight[0, i]) for i in (1, 2, 3)]
        assert weights == pytest.approx([*values, 1 - sum(values)])


def test_each_mode_is_marked_with_the_conditions_of_its_region():
    m = remembered(thermostat.build(), 'relay')
    assert conditions(m) == {f'weight[{t},{i}]': [text] for t in m.t for i, text in ((1, f'20.0 - y[{t}]'), (2, f'y[{t}] - 18.0'))}


def test_an_absorbing_mode_has_no_condition():
    m = remembered(burst_disc.build(), 'disc')
    assert conditions(m)['weight[0,2]'] == []


def test_a_region_may_have_two_ends():
    m = remembered(gears.build(), 'gear')
    assert conditions(m)['weight[0,2]'] == ['v[0] - 1.0', '5.0 - v[0]']


def test_reverse_maps():
    m = remembered(thermostat.build(), 'relay')
    transformation = pyo.TransformationFactory('fesd.dcs')
    (image,) = transformation.get_transformed_constraints(m.heating[0].ode)
    assert transformation.get_src_disjunction(image) is m.relay[0]
    assert set(map(id, transformation.get_src_constraint(image))) == {id(m.heating[0].ode), id(m.cooling[0].ode)}
    multipliers = transformation.get_multipliers(m.relay[0])
    form(m).nu[0, 1].set_value(1)
    assert [pyo.value(multipliers[d[0]]) for d in (m.heating, m.cooling)] == [1, 0]
    assert not m.relay[0].active and not m.heating[0].active


# Which mode comes first


@pytest.mark.parametrize(
    'name, value, nu', [('heating', True, 1), ('heating', False, 0), ('cooling', True, 0), ('cooling', False, 1)]
)
def test_a_fixed_indicator_tells_the_mode_at_its_time(name, value, nu):
    m = thermostat.build()
    m.heating[0].indicator_var.unfix()
    m.component(name)[0].indicator_var.fix(value)
    remembered(m, 'relay')
    first, last = (form(m).nu[t, 1] for t in (0, thermostat.HORIZON))
    assert first.fixed and first.value == nu
    assert not last.fixed


@pytest.mark.parametrize('order', [('first', 'second', 'third'), ('third', 'first', 'second')])
@pytest.mark.parametrize('given', ['first', 'second', 'third'])
def test_one_of_three_modes_given(order, given):
    m = remembered(gears.build(order, given), 'gear')
    block = form(m, 'gear', 3)
    assert [pyo.value(block.weight[0, i]) for i in (1, 2, 3)] == [float(name == given) for name in order]
    assert all(block.nu[0, i].fixed for i in (1, 2))


def test_what_excludes_all_modes_but_one_gives_that_one():
    m = gears.build(given=None)
    for name in ('first', 'third'):
        m.component(name)[0].indicator_var.fix(False)
    remembered(m, 'gear')
    assert [pyo.value(form(m, 'gear', 3).weight[0, i]) for i in (1, 2, 3)] == [0, 1, 0]


def test_an_indicator_that_leaves_several_modes_open_is_refused():
    m = gears.build(given=None)
    m.third[0].indicator_var.fix(False)
    before = snapshot(m)
    with pytest.raises(FesdError, match=r"gear\[0\]: .*'third\[0\]'.* False.*2 other modes") as error:
        remembered(m, 'gear')
    assert 'fix the one that comes first to True' in error.value.fix
    assert snapshot(m) == before


def test_nothing_given_leaves_the_weights_free():
    m = remembered(gears.build(given=None), 'gear')
    assert not any(v.fixed for v in form(m, 'gear', 3).nu.values())


# Which Disjunctions


def test_only_those_named_have_memory():
    m = remembered(gears.build(), 'gear')
    assert len(form(m, 'gear', 3).nu) == 2 * len(m.t)
    assert len(m._pyomo_fesd_dcs.pedal.p) == len(m.t)


@pytest.mark.parametrize('name', ['index', 'component', 'block'])
def test_data_a_component_or_a_block_may_be_named(name):
    m = scalar_ode()
    m.b = pyo.Block()
    m.b.d = Disjunction(m.t, rule=lambda b, t: [[m.x[t] <= 1, m.dx[t] == 1], [m.x[t] >= 0, m.dx[t] == -1]])
    named = {'index': list(m.b.d.values()), 'component': m.b.d, 'block': m.b}[name]
    dcs(m, hysteresis=named)
    assert len(m.b._pyomo_fesd_dcs.d._pyomo_fesd_hysteresis_2.nu) == len(m.t)


def test_without_memory_overlapping_regions_are_refused_and_the_message_names_it():
    m = thermostat.build()
    for t in m.t:
        m.heating[t].indicator_var.unfix()
    with pytest.raises(FesdError, match='the regions overlap') as error:
        dcs(m)
    assert 'keyword hysteresis' in error.value.fix


def test_regions_that_only_touch_may_have_memory_too():
    m = dcs(signum(), hysteresis=[])
    assert generated(m, Complementarity)
    m = signum()
    assert not generated(dcs(m, hysteresis=m.sgn), Complementarity)


def test_indexed_disjunctions_have_a_weight_for_each_index():
    m = remembered(thermostats.build(), 'relay')
    assert set(form(m).nu) == {(i, t, 1) for i in m.i for t in m.t}
    m = remembered(thermostats.build(time_first=True), 'relay')
    assert set(form(m).nu) == {(t, i, 1) for i in m.i for t in m.t}


def test_disjunctions_in_blocks_over_time():
    m = dcs(thermostats.build_in_blocks(), hysteresis=None) if False else thermostats.build_in_blocks()
    dcs(m, hysteresis=[m])
    assert m.hyb[0]._pyomo_fesd_dcs.relay._pyomo_fesd_hysteresis_2.nu[1].value == 1


# Modes that are switched off


def test_a_mode_that_is_switched_off_leaves_nothing():
    m = gears.build()
    m.third.deactivate()
    remembered(m, 'gear')
    assert len(form(m, 'gear', 2).nu) == len(m.t)


def test_an_only_mode_simply_holds():
    m = thermostat.build()
    m.cooling.deactivate()
    remembered(m, 'relay')
    _, block = form_block(m)
    assert [str(block.mode[0, j].expr) for j in (1, 2)] == ['y[0]  <=  20', 'dy[0]  ==  10 - 0.2*y[0]']
    assert not all_switched_systems(m).hysteresis


# Bad input


def test_two_modes_given_at_once_are_refused():
    m = thermostat.build()
    m.cooling[0].indicator_var.fix(True)
    before = snapshot(m)
    with pytest.raises(FesdError, match=r'relay\[0\]: two modes are fixed to True'):
        remembered(m, 'relay')
    assert snapshot(m) == before


def test_a_derivative_in_a_region_is_refused():
    m = scalar_ode()
    m.d = Disjunction(m.t, rule=lambda m, t: [[m.dx[t] <= 1, m.dx[t] == 1], [m.x[t] >= 0, m.dx[t] == -1]])
    with pytest.raises(FesdError, match='contains the derivative'):
        remembered(m, 'd')


def test_what_the_modes_define_cannot_end_them():
    m = scalar_ode()
    m.u = pyo.Var(m.t)
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.u[t])
    m.d = Disjunction(m.t, rule=lambda m, t: [[m.u[t] <= 1, m.u[t] == 1], [m.x[t] >= 0, m.u[t] == -1]])
    with pytest.raises(FesdError, match=r"contains 'u\[0\]', which the modes themselves define"):
        remembered(m, 'd')


def test_disjuncts_that_define_different_variables_are_refused():
    m = scalar_ode()
    m.d = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 1, m.dx[t] == 1], [m.x[t] >= 0, m.dy[t] == -1]])
    with pytest.raises(FesdError, match='does not define'):
        remembered(m, 'd')


@pytest.mark.parametrize('what, cause', [('nested', 'contains the Disjunct'), ('logic', 'contains a LogicalConstraint')])
def test_what_a_disjunct_over_time_cannot_contain_is_refused(what, cause):
    m = thermostat.build()
    d = m.heating[0]
    if what == 'nested':
        d.inner = Disjunct()
    else:
        d.inner = pyo.LogicalConstraint(expr=d.indicator_var.implies(m.cooling[0].indicator_var))
    before = snapshot(m)
    with pytest.raises(FesdError, match=cause):
        remembered(m, 'relay')
    assert snapshot(m) == before


def test_several_modes_at_once_are_refused():
    m = scalar_ode()
    m.d = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 1, m.dx[t] == 1], [m.x[t] >= 0, m.dx[t] == -1]], xor=False)
    with pytest.raises(FesdError, match='declared with xor=False'):
        remembered(m, 'd')


def test_a_disjunction_of_another_model_is_refused():
    m, other = thermostat.build(), thermostat.build()
    with pytest.raises(FesdError, match='another model'):
        dcs(m, hysteresis=[other.relay])


def test_a_fixed_grid_is_refused_by_the_solver():
    m = remembered(thermostat.add_heater(collocate(thermostat.room())), 'relay')
    with pytest.raises(FesdError, match='a mode with hysteresis on a grid whose elements do not move'):
        pyo.SolverFactory('mpec_hybrid').solve(m)


# The order of transformations, clones


def test_before_and_after_discretisation_give_the_same_model():
    early = remembered(thermostat.build(2), 'relay')
    late = remembered(thermostat.add_heater(collocate(thermostat.room(2), 6, 2)), 'relay')
    for m in (early, late):
        pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=6, ncp=2)
    assert seen(early) == seen(late)


def test_create_using_leaves_the_model():
    m = thermostat.build()
    before = snapshot(m)
    copy = pyo.TransformationFactory('fesd.dcs').create_using(m, hysteresis=[m.relay])
    found = all_switched_systems(copy).hysteresis
    assert found
    assert snapshot(m) == before
    assert len(form(copy).nu) == len(copy.t)
    assert all(mode.weight.model() is copy and c.model() is copy for mode in found for c in mode.conditions)


def test_a_clone_between_the_transformations_is_independent():
    copy = remembered(thermostat.build(2), 'relay').clone()
    pyo.TransformationFactory('fesd.finite_elements').apply_to(copy, nfe=8, ncp=3)
    pyomo_fesd.simulate(copy)
    assert [s.time for s in pyomo_fesd.switches(copy)] == pytest.approx(thermostat.switching_times(2), abs=1e-6)
