"""The record of switched systems: what passes from the modelling pieces to elements and results."""

import io
import pickle
from copy import deepcopy

import bouncing_ball
import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
import signum
import thermostat
from pyomo.common.collections import ComponentSet
from pyomo.core.expr.visitor import identify_variables
from pyomo.mpec import Complementarity
from pyomo.repn.plugins.nl_writer import NLWriter

import pyomo_fesd
from pyomo_fesd.core import all_switched_systems, is_generated, remember_records, switched_systems
from tests.models import dcs
from tests.problems import sliding, weir
from tests.problems.running import move, transform


def test_a_record_is_no_component():
    m = pyo.ConcreteModel()
    m.x = pyo.Var()
    switched_systems(m).selectors.add(m.x)
    assert list(m.component_map()) == ['x']
    assert list(all_switched_systems(m).selectors) == [m.x]


def test_a_second_entry_replaces_the_first():
    m = pyo.ConcreteModel()
    m.x = pyo.Var()
    m.c, m.d = pyo.Constraint(expr=m.x == 1), pyo.Constraint(expr=m.x == 2)
    for rule in (m.c, m.d):
        switched_systems(m).continuous[m.x] = rule
    assert list(all_switched_systems(m).continuous.items()) == [(m.x, m.d)]


def test_an_indexed_component_and_its_data_are_different_entries():
    m = pyo.ConcreteModel()
    m.x = pyo.Var([1, 2])
    switched_systems(m).selectors.add(m.x)
    assert m.x in all_switched_systems(m).selectors and m.x[1] not in all_switched_systems(m).selectors


def on_two_blocks():
    m = pyo.ConcreteModel()
    m.b = pyo.Block([1, 2])
    for i in (1, 2):
        m.b[i].x = pyo.Var()
        switched_systems(m.b[i]).selectors.add(m.b[i].x)
    return m


def names(components):
    return [c.name for c in components]


def test_records_of_blocks_below_are_found_and_those_of_inactive_blocks_are_not():
    m = on_two_blocks()
    assert names(all_switched_systems(m).selectors) == ['b[1].x', 'b[2].x']
    assert names(all_switched_systems(m.b[2]).selectors) == ['b[2].x']
    m.b[1].deactivate()
    assert names(all_switched_systems(m).selectors) == ['b[2].x']


def test_a_deleted_block_takes_its_record_along():
    m = on_two_blocks()
    m.del_component('b')
    assert not all_switched_systems(m).selectors


def test_reading_leaves_no_record_behind():
    m = pyo.ConcreteModel()
    m.b = pyo.Block([1, 2])
    all_switched_systems(m)
    assert not m._private_data and not any(b._private_data for b in m.b.values())


def test_a_block_that_is_switched_off_as_a_whole_has_no_entries():
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 1))

    @m.Block(m.t)
    def b(b, t):
        b.x = pyo.Var()
        switched_systems(b).selectors.add(b.x)

    m.b.deactivate()
    # pyomo.dae makes the new data active
    pyo.TransformationFactory('dae.collocation').apply_to(m, wrt=m.t, nfe=2, ncp=1)
    assert m.b[0.5].active
    assert not all_switched_systems(m).selectors


def test_what_is_remembered_comes_back_and_what_is_new_goes():
    m = on_two_blocks()
    m.y = pyo.Var()
    restore = remember_records(m)
    switched_systems(m.b[1]).selectors.clear()
    switched_systems(m).selectors.add(m.y)
    restore()
    assert names(all_switched_systems(m).selectors) == ['b[1].x', 'b[2].x']


def test_entries_of_deleted_components_are_forgotten():
    m = signum.build()
    dcs(m)
    block = m._pyomo_fesd_dcs.sgn
    systems = switched_systems(block)
    systems.forget(ComponentSet([block.p, block.alpha]))
    assert list(systems.continuous) == [block.n] and not systems.selectors


def copied(m):
    return pickle.loads(pickle.dumps(m))


@pytest.mark.parametrize('copy_of', [pyo.ConcreteModel.clone, copied])
def test_entries_of_a_copy_are_its_own(copy_of):
    m = pyo.ConcreteModel()
    m.x, m.y = pyo.Var([1, 2]), pyo.Var()
    m.c = pyo.Constraint(expr=m.y == 1)
    switched_systems(m).continuous[m.x] = m.c
    switched_systems(m).multipliers[m.y] = 1 - m.x[1]
    copy = copy_of(m)
    systems = all_switched_systems(copy)
    ((x, c),), ((y, expr),) = systems.continuous.items(), systems.multipliers.items()
    assert x is copy.x and c is copy.c and y is copy.y
    assert list(identify_variables(expr)) == [copy.x[1]]
    assert list(all_switched_systems(m).continuous) == [m.x]


@pytest.mark.parametrize('copy_of', [pyo.ConcreteModel.clone, deepcopy])
def test_typed_entries_of_a_copy_point_into_it(copy_of):
    m = bouncing_ball.build()
    copy = copy_of(m)
    resets = all_switched_systems(copy).resets
    assert len(resets) == len(m.t)
    for entry in resets:
        assert entry.block.model() is copy and entry.guard.model() is copy
        assert all(x.model() is copy and after.model() is copy for x, after in entry.resets)


def test_generated_blocks_are_known_by_their_name():
    m = pyo.ConcreteModel()
    m.b = pyo.Block()
    m.b._pyomo_fesd_dcs = pyo.Block([1])
    m.b._pyomo_fesd_dcs[1].x = pyo.Var([1])
    m.b.x = pyo.Var()
    m.pyomo_fesd_x = pyo.Var()
    for mine in (m.b._pyomo_fesd_dcs, m.b._pyomo_fesd_dcs[1], m.b._pyomo_fesd_dcs[1].x, m.b._pyomo_fesd_dcs[1].x[1]):
        assert is_generated(mine)
    for other in (m, m.b, m.b.x, m.pyomo_fesd_x):
        assert not is_generated(other)


# What the transformations record


def test_every_mode_has_its_multiplier_at_every_time():
    m = transform(signum.build(), 3)
    found = {d.name: w for d, w in all_switched_systems(m).multipliers.items()}
    assert set(found) == {d[t].name for d in (m.below, m.above) for t in m.t}
    assert all(pyo.value(found[f'below[{t}]'] + found[f'above[{t}]']) == pytest.approx(1) for t in m.t)


@pytest.mark.parametrize('form', ['auto', 'stewart', 'heaviside'])
def test_parts_that_are_continuous_in_time_point_to_their_equation(form):
    m = transform(signum.build(), 3, form=form)
    for part, rule in all_switched_systems(m).continuous.items():
        assert rule.ctype is pyo.Constraint and rule.parent_block() is part.parent_block()
        for index in part:
            equation = rule[index] if index in rule else rule[(index, 1) if not isinstance(index, tuple) else index]
            assert any(v is part[index] for v in identify_variables(equation.body))


def test_disjuncts_excluded_by_logic_differ_from_those_that_the_user_switched_off():
    m = signum.build()
    m.logic = pyo.LogicalConstraint(m.t, rule=lambda m, t: pyo.lnot(m.above[t].indicator_var))
    m.other = pyo.LogicalConstraint(m.t, rule=lambda m, t: m.below[t].indicator_var)
    m.other.deactivate()
    dcs(m)
    assert {c.name for c in all_switched_systems(m).excluded} == {c.name for c in (*m.logic.values(), *m.above.values())}


def test_modes_with_hysteresis_are_recorded_with_their_conditions():
    m = thermostat.build(1)
    dcs(m, hysteresis=[m.relay])
    found = all_switched_systems(m).hysteresis
    assert len(found) == 2 * len(m.t)
    for mode in found:
        assert mode.weight.ctype is pyo.Expression and all(c.ctype is pyo.Expression for c in mode.conditions)
        assert mode.disjunct is mode.disjunction.disjuncts[mode.number - 1]
    move(m, 3, 2)
    assert len(all_switched_systems(m).hysteresis) == 2 * len(m.t)


def test_state_jumps_are_recorded_with_guards_and_values_after():
    m = bouncing_ball.build()
    found = all_switched_systems(m).resets
    assert names(entry.guard for entry in found) == [f'impact[{t}].guard' for t in m.t]
    assert names(x for entry in found for x, _ in entry.resets) == [f'v[{t}]' for t in m.t]
    move(m, 3, 2)
    assert len(all_switched_systems(m).resets) == len(m.t)


def test_records_do_not_reach_the_solver_file():
    m = move(weir.build(), 3)
    for c in m.component_data_objects(Complementarity):
        c.deactivate()
    stream = io.StringIO()
    NLWriter().write(m, stream)
    assert not [line for line in stream.getvalue().splitlines() if line.startswith('S')]


@pytest.mark.parametrize('build', [signum.build, sliding.build])
def test_records_survive_a_clone_between_the_transformations(build):
    m = dcs(build())
    copy = m.clone()
    for name in ('continuous', 'selectors', 'multipliers'):
        ours, theirs = (getattr(all_switched_systems(model), name) for model in (m, copy))
        assert names(ours) == names(theirs)
        assert all(c.model() is copy for c in theirs)


def test_a_clone_is_continued_at_its_own_times():
    m = dcs(sliding.build())
    before, copy = len(all_switched_systems(m).multipliers), m.clone()
    move(copy, 3, 2)
    assert len(all_switched_systems(copy).multipliers) * len(m.t) == before * len(copy.t)
    assert all(disjunct.model() is copy for disjunct in all_switched_systems(copy).multipliers)
    assert len(all_switched_systems(m).multipliers) == before


def test_a_user_may_record_a_variable_of_their_own_as_continuous():
    # an algebraic level, as continuous as the state that it follows from
    m = weir.build(level='algebraic')
    switched_systems(m).continuous[m.h] = m.cylinder
    move(m, 5, 2)
    pyo.assert_optimal_termination(pyo.SolverFactory('mpec_hybrid').solve(m))
    (switch,) = pyomo_fesd.switches(m)
    assert switch.time == pytest.approx(weir.SWITCH, abs=1e-9)
