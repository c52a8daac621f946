"""LogicalConstraints over time: modes that are switched off, pairs that exclude combinations, and what the geometry says anyway."""

import itertools

import numpy as np
import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyomo.gdp import Disjunct, Disjunction
from pyomo.mpec import Complementarity

import pyomo_fesd
from pyomo_fesd import FesdError
from pyomo_fesd.core.complementarity import read_complementarity
from pyomo_fesd.dcs.reading.exclusions import _rectangles
from tests.models import EVERYWHERE, add_modes, collocate, dcs, finite_elements, generated, scalar_ode, weights
from tests.problems.running import LEGENDRE, RADAU, move, seen, solve


def on(disjunct):
    return disjunct.indicator_var


def valves(number=2, discretised=False):
    """States z_i with rates z'_i = F_i and Disjunctions ``valve_i``: 'shut' (z_i <= 0, F_i = 1), 'open' (z_i >= 0, F_i = 2)."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2))
    m.i = pyo.RangeSet(number)
    m.z = pyo.Var(m.i, m.t, initialize=-1.0)
    m.dz = dae.DerivativeVar(m.z, wrt=m.t)
    if discretised:
        collocate(m)

    @m.Disjunct(m.i, m.t)
    def shut(d, i, t):
        m = d.model()
        d.region = pyo.Constraint(expr=m.z[i, t] <= 0)
        d.ode = pyo.Constraint(expr=m.dz[i, t] == 1)

    @m.Disjunct(m.i, m.t)
    def open(d, i, t):
        m = d.model()
        d.region = pyo.Constraint(expr=m.z[i, t] >= 0)
        d.ode = pyo.Constraint(expr=m.dz[i, t] == 2)

    @m.Disjunction(m.i, m.t)
    def valve(m, i, t):
        return [m.shut[i, t], m.open[i, t]]

    return m


def with_logic(m, rule):
    """``m`` with a LogicalConstraint over time; ``rule(shut_1, open_1, shut_2, ..)``."""
    m.logic = pyo.LogicalConstraint(m.t, rule=lambda m, t: rule(*(on(d[i, t]) for i in m.i for d in (m.shut, m.open))))
    return m


def exclusions(m, t=0):
    """The pairs that the logic has left at a time, as sets of two texts."""
    found = [c for c in m.component_data_objects(Complementarity) if c.parent_component().local_name == 'exclusion']
    return {frozenset(map(str, read_complementarity(c))) for c in found if c.index()[0] == t}


# Which pairs


TWO = {
    'not both': (lambda s1, o1, s2, o2: pyo.lnot(o1.land(o2)), [('open', 'open')]),
    'atmost': (lambda s1, o1, s2, o2: pyo.atmost(1, o1, o2), [('open', 'open')]),
    'implies': (lambda s1, o1, s2, o2: o1.implies(o2), [('open', 'shut')]),
    'or': (lambda s1, o1, s2, o2: o1.lor(o2), [('shut', 'shut')]),
    'atleast': (lambda s1, o1, s2, o2: pyo.atleast(1, o1, o2), [('shut', 'shut')]),
    'xor': (lambda s1, o1, s2, o2: o1.xor(o2), [('open', 'open'), ('shut', 'shut')]),
    'exactly': (lambda s1, o1, s2, o2: pyo.exactly(1, o1, o2), [('open', 'open'), ('shut', 'shut')]),
    'equivalent': (lambda s1, o1, s2, o2: o1.equivalent_to(o2), [('open', 'shut'), ('shut', 'open')]),
    'land of two clauses': (
        lambda s1, o1, s2, o2: pyo.land(o1.implies(o2), o2.implies(o1)),
        [('open', 'shut'), ('shut', 'open')],
    ),
    'always true': (lambda s1, o1, s2, o2: o1.lor(s1), []),
    'what xor of one Disjunction says already': (lambda s1, o1, s2, o2: pyo.lnot(s1.land(o1)), []),
}


@pytest.mark.parametrize('form', ['auto', 'stewart', 'heaviside'])
@pytest.mark.parametrize('how', TWO)
def test_a_clause_of_two_literals_is_one_pair(how, form):
    rule, expected = TWO[how]
    m = dcs(with_logic(valves(), rule), form=form)
    nu = [weights(m.valve[i, 0]) for i in m.i]
    pairs = {frozenset((str(nu[0][m.component(a)[1, 0]]), str(nu[1][m.component(b)[2, 0]]))) for a, b in expected}
    assert exclusions(m) == pairs
    assert not any(c.active for c in m.logic.values())
    assert len(generated(m, Complementarity)) == (4 * len(m.t) if not expected else (4 + len(expected)) * len(m.t))


def levels(number, name, v, m):
    """A Disjunction of ``number`` intervals of ``v``, of length 1 from 0 on; each defines a variable of its own."""
    m.add_component(f'F_{name}', pyo.Var(m.t))
    F = m.component(f'F_{name}')

    @m.Disjunct(range(number), m.t)
    def mode(d, k, t):
        if k > 0:
            d.above = pyo.Constraint(expr=v[t] >= k)
        if k < number - 1:
            d.below = pyo.Constraint(expr=v[t] <= k + 1)
        d.rate = pyo.Constraint(expr=F[t] == k)

    disjuncts = m.component('mode')
    m.del_component(disjuncts)
    m.add_component(f'mode_{name}', disjuncts)
    m.add_component(name, Disjunction(m.t, rule=lambda m, t: [disjuncts[k, t] for k in range(number)]))
    return disjuncts


def grid(nx=3, ny=3):
    """Disjunctions over intervals of x and of y."""
    m = scalar_ode()
    levels(nx, 'of_x', m.x, m)
    levels(ny, 'of_y', m.y, m)
    return m


def modes(m, t):
    return [[on(m.component(f'mode_{name}')[k, t]) for k in range(3)] for name in ('of_x', 'of_y')]


THREE = {
    'one clause': (lambda x, y: x[0].lor(y[0]), 1),
    'two clauses of one mode': (lambda x, y: pyo.land(pyo.lnot(x[2].land(y[1])), pyo.lnot(x[2].land(y[2]))), 1),
    'implication of a disjunction': (lambda x, y: x[2].implies(y[0].lor(y[1])), 1),
    'a diagonal': (lambda x, y: pyo.land(*(a.equivalent_to(b) for a, b in zip(x, y))), 3),
}


@pytest.mark.parametrize('form', ['stewart', 'heaviside'])
@pytest.mark.parametrize('how', THREE)
def test_combinations_that_form_a_rectangle_are_one_pair(how, form):
    rule, number = THREE[how]
    m = grid()
    m.logic = pyo.LogicalConstraint(m.t, rule=lambda m, t: rule(*modes(m, t)))
    dcs(m, form=form)
    assert len(exclusions(m)) == number


@settings(max_examples=100, deadline=None)
@given(st.integers(1, 5).flatmap(lambda n: st.lists(st.lists(st.booleans(), min_size=n, max_size=n), min_size=1, max_size=5)))
def test_rectangles_cover_the_excluded_combinations_and_nothing_else(rows):
    excluded = np.array(rows)
    covered = np.zeros_like(excluded, dtype=int)
    for of_rows, of_columns in _rectangles(excluded):
        covered[np.ix_(of_rows, of_columns)] += 1
    assert (covered == excluded).all()


def test_a_fixed_boolean_is_a_constant():
    m = valves()
    m.winter = pyo.BooleanVar(initialize=True)
    m.winter.fix()
    m.logic = pyo.LogicalConstraint(m.t, rule=lambda m, t: m.winter.implies(on(m.open[1, t]).implies(on(m.open[2, t]))))
    assert len(exclusions(dcs(m))) == 1


def test_logic_may_stand_in_blocks_over_time_and_speak_of_modes_there():
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2))
    m.x, m.y = pyo.Var(m.t, initialize=-1.0), pyo.Var(m.t, initialize=-1.0)
    m.dx, m.dy = dae.DerivativeVar(m.x), dae.DerivativeVar(m.y)

    @m.Block(m.t)
    def plant(b, t):
        m = b.model()
        b.first = Disjunction(expr=[[m.x[t] <= 0, m.dx[t] == 1], [m.x[t] >= 0, m.dx[t] == 2]])
        b.second = Disjunction(expr=[[m.y[t] <= 0, m.dy[t] == 1], [m.y[t] >= 0, m.dy[t] == 2]])
        b.logic = pyo.LogicalConstraint(expr=on(b.first.disjuncts[1]).implies(on(b.second.disjuncts[1])))

    finite_elements(dcs(m), nfe=2, ncp=2)
    found = [c for c in m.component_data_objects(Complementarity) if c.parent_component().local_name == 'exclusion']
    assert len(found) == len(m.t) and not any(m.plant[t].logic.active for t in m.t)


def nested_valve():
    """valves, where 'open' of the second has inner modes 'some' and 'full'."""
    m = valves()
    m.flow = pyo.Var(m.t)
    for t in m.t:
        m.shut[2, t].flow = pyo.Constraint(expr=m.flow[t] == 0)
        d = m.open[2, t]
        d.some, d.full = Disjunct(), Disjunct()
        d.some.region = pyo.Constraint(expr=m.z[2, t] <= 1)
        d.some.flow = pyo.Constraint(expr=m.flow[t] == 1)
        d.full.region = pyo.Constraint(expr=m.z[2, t] >= 1)
        d.full.flow = pyo.Constraint(expr=m.flow[t] == 2)
        d.much = Disjunction(expr=[d.some, d.full])
    return m


@pytest.mark.parametrize('inner', [True, False])
def test_literals_may_be_outer_and_inner_modes(inner):
    m = nested_valve()
    m.logic = pyo.LogicalConstraint(
        m.t, rule=lambda m, t: pyo.lnot(on(m.open[1, t]).land(on(m.open[2, t].full if inner else m.open[2, t])))
    )
    dcs(m, form='heaviside')
    first, second = weights(m.valve[1, 0])[m.open[1, 0]], weights(m.valve[2, 0])[m.open[2, 0]]
    other = weights(m.open[2, 0].much)[m.open[2, 0].full] if inner else second
    assert exclusions(m) == {frozenset((str(first), str(other)))}


# What the geometry says anyway


def on_one_state(logic):
    """Thresholds of x at 0 and at 1 in two Disjunctions, and a third one of y."""
    m = scalar_ode()
    m.F, m.G = pyo.Var(m.t), pyo.Var(m.t)
    for name, v, limit, out in (('first', m.x, 0, m.F), ('second', m.x, 1, m.G), ('third', m.y, 0, m.dy)):
        add_modes(
            m,
            lambda m, t, v=v, limit=limit, out=out: [v[t] <= limit, out[t] == 1],
            lambda m, t, v=v, limit=limit, out=out: [v[t] >= limit, out[t] == 2],
            name=name,
        )
    m.logic = pyo.LogicalConstraint(
        m.t, rule=lambda m, t: logic(*(on(d) for dj in (m.first, m.second, m.third) for d in dj[t].disjuncts))
    )
    return m


GEOMETRY = {
    'above 1 implies above 0': (lambda x0, x0_, x1, x1_, y, y_: x1_.implies(x0_), 0),
    'below 0 implies below 1': (lambda x0, x0_, x1, x1_, y, y_: x0.implies(x1), 0),
    'above 0 implies above 1': (lambda x0, x0_, x1, x1_, y, y_: x0_.implies(x1_), 1),
    'both the same': (lambda x0, x0_, x1, x1_, y, y_: x0.equivalent_to(x1), 1),
    'of another state': (lambda x0, x0_, x1, x1_, y, y_: y_.implies(x1_), 1),
    'three of which two meet nowhere': (lambda x0, x0_, x1, x1_, y, y_: pyo.lnot(pyo.land(x0, x1_, y)), 0),
}


@pytest.mark.parametrize('case', GEOMETRY)
def test_modes_whose_regions_have_no_point_in_common_get_no_pair(case):
    logic, number = GEOMETRY[case]
    m = dcs(on_one_state(logic))
    assert len(exclusions(m)) == number
    assert not m.logic[0].active
    finite_elements(m, nfe=2, ncp=2)
    assert all(len(exclusions(m, t)) == number for t in m.t)


def test_an_implied_exclusion_changes_nothing():
    plain = on_one_state(lambda *literals: literals[0].lor(literals[1]))
    implied = on_one_state(lambda x0, x0_, x1, x1_, y, y_: x1_.implies(x0_))
    sizes = [dict(pyomo_fesd.report(finite_elements(dcs(m), nfe=4, ncp=2))) for m in (plain, implied)]
    assert sizes[0] == sizes[1]


# Modes that are switched off


@pytest.mark.parametrize(
    'rule',
    [
        lambda s1, o1, s2, o2: pyo.lnot(o1),
        lambda s1, o1, s2, o2: s1,
        lambda s1, o1, s2, o2: s1.land(o2.lor(s2)),
        lambda s1, o1, s2, o2: pyo.atmost(0, o1),
        lambda s1, o1, s2, o2: pyo.land(o1.implies(o2), o1.implies(s2)),
    ],
    ids=['not', 'literal', 'land', 'atmost 0', 'by contradiction'],
)
def test_a_clause_of_one_literal_switches_a_mode_off(rule):
    m = dcs(with_logic(valves(), rule))
    assert exclusions(m) == set()
    assert len(generated(m, Complementarity)) == 2 * len(m.t)  # of the second valve
    assert [m.open[1, 0].active, m.open[1, 0].indicator_var.value] == [False, False]
    assert not list(m.component_data_objects(Disjunct, active=True, descend_into=EVERYWHERE))
    assert pyomo_fesd.report(m)['modes left out'] == len(m.t)
    held = {str(c.expr) for c in generated(m, pyo.Constraint).values()}
    assert 'z[1,0]  <=  0' in held and 'dz[1,0]  ==  1' in held


def test_one_switched_off_by_one_constraint_switches_another_off_in_the_next():
    m = valves()
    m.second = pyo.LogicalConstraint(m.t, rule=lambda m, t: on(m.open[2, t]).implies(on(m.open[1, t])))
    m.first = pyo.LogicalConstraint(m.t, rule=lambda m, t: pyo.lnot(on(m.open[1, t])))
    dcs(m)
    assert generated(m, Complementarity) == {}
    assert not m.open[2, 0].active


def test_a_mode_that_the_user_switched_off_counts_as_false():
    m = with_logic(valves(), lambda s1, o1, s2, o2: o1.lor(o2))
    m.open.deactivate()
    for t in m.t:
        m.open[1, t].activate()
    dcs(m)
    assert not m.shut[1, 0].active and generated(m, Complementarity) == {}


def test_what_logic_switched_off_at_the_ends_only_is_on_between():
    m = valves()
    m.logic = pyo.LogicalConstraint(m.t, rule=lambda m, t: pyo.lnot(on(m.open[1, t])) if t == 0 else pyo.LogicalConstraint.Skip)
    m.logic_at_end = pyo.LogicalConstraint(
        m.t, rule=lambda m, t: pyo.lnot(on(m.shut[1, t])) if t == 2 else pyo.LogicalConstraint.Skip
    )
    finite_elements(dcs(m), nfe=4, ncp=2)
    for t in m.t:
        assert len(weights(m.valve[1, t])) == (0 if t in (0, 2) else 2), t
        assert len(weights(m.valve[2, t])) == 2


# Before and after the discretisation


def implication(discretised=False):
    m = valves(discretised=discretised)
    m.logic = pyo.LogicalConstraint(m.t, rule=lambda m, t: on(m.open[1, t]).implies(on(m.open[2, t])))
    return m


def test_before_and_after_discretisation_give_the_same_pairs():
    before, after = finite_elements(dcs(implication()), nfe=2, ncp=2), dcs(implication(discretised=True))
    assert list(before.t) == list(after.t) == list(before.logic)
    for t in after.t:
        assert exclusions(before, t) == exclusions(after, t) and len(exclusions(after, t)) == 1


def test_a_pair_leads_back_to_its_logic_also_in_a_clone():
    m = dcs(implication()).clone()
    pair = m._pyomo_fesd_dcs.logic.exclusion[0, 1]
    (source,) = pyo.TransformationFactory('fesd.dcs').get_src_constraint(pair)
    assert source is m.logic[0]


def test_a_second_time_changes_nothing():
    m = dcs(implication())
    before = seen(m)
    dcs(m)
    assert seen(m) == before


def test_create_using_and_clones_leave_the_original_as_it_was():
    m = implication()
    before = seen(m)
    new = pyo.TransformationFactory('fesd.dcs').create_using(m)
    assert seen(m) == before and len(exclusions(new)) == 1


def test_logic_that_is_switched_off_stays_off_at_new_times():
    m = implication()
    m.logic.deactivate()
    finite_elements(dcs(m), nfe=2, ncp=2)
    assert not any(c.active for c in m.logic.values())
    assert not any(exclusions(m, t) for t in m.t)


def test_pairs_between_multipliers_are_not_warned_of(caplog):
    finite_elements(dcs(implication()), nfe=4, ncp=2)
    assert not [r for r in caplog.records if 'continuous' in r.message]


def test_the_report_counts_the_pairs_of_logic():
    plain, bound = (finite_elements(dcs(m), nfe=4, ncp=2) for m in (valves(), implication()))
    sizes = [pyomo_fesd.report(m) for m in (plain, bound)]
    # one pair an element and one at the first time; no variable, no constraint
    assert sizes[1]['pairs'] - sizes[0]['pairs'] == 4 + 1
    assert sizes[1]['sources'] - sizes[0]['sources'] == len(plain.t) - 1
    assert [sizes[1][k] - sizes[0][k] for k in ('variables', 'constraints', 'decided')] == [0, 0, 0]


# The whole path


def gated(logic=True, discretised=False):
    """Move x from 0 to 3/2 in three units of time with least effort; above 1 the control counts double.

    A gate closes at time 1, and while it is closed x must be above 1.  Free: x = 1 at 12/5, effort 5/12 + 5/48 = 25/48.  With
    the gate: x = 1 at 1 (u = 1, effort 1), then u = 1/8 for two units (effort 1/32).
    """
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 3))
    m.x, m.u = pyo.Var(m.t, initialize=lambda m, t: t / 2), pyo.Var(m.t, initialize=0.5)
    m.clock, m.gate = pyo.Var(m.t, initialize=lambda m, t: t), pyo.Var(m.t, initialize=0)
    m.dx, m.dclock = dae.DerivativeVar(m.x), dae.DerivativeVar(m.clock)
    m.x[0].fix(0), m.x[3].fix(1.5), m.clock[0].fix(0)
    m.tick = pyo.Constraint(m.t, rule=lambda m, t: m.dclock[t] == 1)
    m.effort = dae.Integral(m.t, rule=lambda m, t: m.u[t] ** 2)
    m.cost = pyo.Objective(expr=m.effort)
    if discretised:
        collocate(m, nfe=9)

    @m.Disjunct(m.t, [1, 2])
    def level(d, t, k):
        m = d.model()
        d.region = pyo.Constraint(expr=m.x[t] <= 1 if k == 1 else m.x[t] >= 1)
        d.ode = pyo.Constraint(expr=m.dx[t] == k * m.u[t])

    @m.Disjunct(m.t, [0, 1])
    def closed(d, t, k):
        m = d.model()
        d.region = pyo.Constraint(expr=m.clock[t] <= 1 if k == 0 else m.clock[t] >= 1)
        d.gate = pyo.Constraint(expr=m.gate[t] == k)

    m.height = Disjunction(m.t, rule=lambda m, t: [m.level[t, 1], m.level[t, 2]])
    m.door = Disjunction(m.t, rule=lambda m, t: [m.closed[t, 0], m.closed[t, 1]])
    if logic:
        m.logic = pyo.LogicalConstraint(m.t, rule=lambda m, t: on(m.closed[t, 1]).implies(on(m.level[t, 2])))
    return m


def certified(m):
    results = pyo.SolverFactory('mpec_hybrid').solve(m)
    assert results.solver.stationarity == 'B', results.solver.reason
    return m


@pytest.mark.parametrize('form', ['auto', 'stewart'])
@pytest.mark.parametrize('scheme', [RADAU, LEGENDRE])
@pytest.mark.parametrize('logic, cost, switches', [(False, 25 / 48, [1, 2.4]), (True, 33 / 32, [1, 1])])
def test_an_excluded_combination_costs_what_it_must(scheme, form, logic, cost, switches):
    m = certified(move(dcs(gated(logic), form=form), 9, 2, scheme=scheme))
    assert pyo.value(m.cost) == pytest.approx(cost, abs=1e-9)
    assert [s.time for s in pyomo_fesd.switches(m)] == pytest.approx(switches, abs=1e-6)


def test_on_a_grid_that_is_there_already_it_costs_the_same():
    m = certified(move(dcs(gated(discretised=True))))
    assert pyo.value(m.cost) == pytest.approx(33 / 32, abs=1e-9)


def corridor(logic):
    """Move x from 1/2 to 5/2 in three units of time with least effort; from 1 on a door is closed, from 2 on the way is low.

    Free: u = 2/3, effort 4/3.  While the door is closed 'upper' is excluded, so x = 1 not before 2: u = 1/4 until then
    (effort 1/8), 3/2 afterwards (9/4).
    """
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 3))
    m.x, m.u = pyo.Var(m.t, initialize=lambda m, t: 0.5 + 2 * t / 3), pyo.Var(m.t, initialize=0.5)
    m.clock, m.place = pyo.Var(m.t, initialize=lambda m, t: t), pyo.Var(m.t, initialize=0)
    m.gate = pyo.Var(m.t, initialize=0)
    m.dx, m.dclock = dae.DerivativeVar(m.x), dae.DerivativeVar(m.clock)
    m.x[0].fix(0.5), m.x[3].fix(2.5), m.clock[0].fix(0)
    m.tick = pyo.Constraint(m.t, rule=lambda m, t: m.dclock[t] == 1)
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.u[t])
    m.effort = dae.Integral(m.t, rule=lambda m, t: m.u[t] ** 2)
    m.cost = pyo.Objective(expr=m.effort)
    add_modes(
        m,
        lambda m, t: [m.x[t] <= 1, m.place[t] == 0],
        lambda m, t: [m.x[t] >= 1, m.clock[t] <= 2, m.place[t] == 1],
        lambda m, t: [m.x[t] >= 1, m.clock[t] >= 2, m.place[t] == 2],
        name='where',
    )
    add_modes(m, lambda m, t: [m.clock[t] <= 1, m.gate[t] == 0], lambda m, t: [m.clock[t] >= 1, m.gate[t] == 1], name='door')
    if logic:
        m.logic = pyo.LogicalConstraint(
            m.t, rule=lambda m, t: pyo.lnot(on(m.where[t].disjuncts[1]).land(on(m.door[t].disjuncts[1])))
        )
    return m


@pytest.mark.parametrize('form', ['stewart', 'heaviside'])
@pytest.mark.parametrize('logic, cost', [(False, 4 / 3), (True, 19 / 8)])
def test_a_mode_whose_weight_is_a_product_can_be_excluded(form, logic, cost):
    m = certified(move(dcs(corridor(logic), form=form), 9, 2))
    assert pyo.value(m.cost) == pytest.approx(cost, abs=1e-8)


def test_a_mode_that_logic_has_trimmed_does_not_come_up():
    # below zero the rate is 3, the mode above is excluded: x must stay below, which it does from -9
    m = scalar_ode(x0=-9.0)
    m.rest = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == 0)
    m.y[0].fix(1)
    add_modes(m, lambda m, t: [m.x[t] <= 0, m.dx[t] == 3], lambda m, t: [m.x[t] >= 0, m.dx[t] == 1])
    m.logic = pyo.LogicalConstraint(m.t, rule=lambda m, t: pyo.lnot(on(m.sgn[t].disjuncts[1])))
    m = solve(move(dcs(m), 4, 2))
    assert m.x[2].value == pytest.approx(-3, abs=1e-9)
    assert pyomo_fesd.report(m)['pairs'] == 0 and pyomo_fesd.switches(m) == []


def test_what_the_geometry_implies_does_not_disturb():
    m = on_one_state(lambda x0, x0_, x1, x1_, y, y_: x1_.implies(x0_))
    m.sum = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.F[t] + m.G[t])
    m.y[0].fix(1)
    # rate 2 from -2, at 0 after 1; then 3, at 1 after 1/3 more; then 4 for 2/3
    m = solve(move(dcs(m), 9, 2))
    assert [s.time for s in pyomo_fesd.switches(m)] == pytest.approx([1, 4 / 3], abs=1e-9)
    assert m.x[2].value == pytest.approx(1 + 8 / 3, abs=1e-9)


# What is refused


def joined(rule, number=2):
    return lambda: with_logic(valves(number), rule)


def with_constraint(rule):
    def build():
        m = valves()
        m.flag = pyo.BooleanVar()
        m.design = Disjunct()
        m.logic = pyo.LogicalConstraint(m.t, rule=rule)
        return m

    return build


def contradiction():
    m = valves()
    m.logic = pyo.LogicalConstraint(m.t, rule=lambda m, t: on(m.open[1, t]).lor(on(m.open[2, t])))
    for d in m.open.values():
        d.deactivate()
    return m


def gap():
    m = grid()
    m.logic = pyo.LogicalConstraint(m.t, rule=lambda m, t: pyo.lnot(modes(m, t)[0][2]))
    return m


def combinations_of_many():
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2))
    return with_logic(valves(14), lambda *literals: pyo.atmost(3, *literals[1::2]))


BAD = {
    'three modes that exclude one another only all together': (
        joined(lambda s1, o1, s2, o2, s3, o3: pyo.lnot(pyo.land(o1, o2, o3)), 3),
        'logic[0]',
        r"excludes the modes 'open\[1,0\]', 'open\[2,0\]', 'open\[3,0\]' only all together",
    ),
    'at least one of three': (
        joined(lambda s1, o1, s2, o2, s3, o3: pyo.atleast(1, o1, o2, o3), 3),
        'logic[0]',
        'only all together',
    ),
    'no combination left': (contradiction, 'logic[0]', 'no combination'),
    'a contradiction': (joined(lambda s1, o1, s2, o2: o1.land(s1)), 'logic[0]', 'no combination'),
    'never': (with_constraint(lambda m, t: pyo.LogicalConstraint.Infeasible), 'logic[0]', 'no combination'),
    'a Boolean that is no mode': (with_constraint(lambda m, t: on(m.open[1, t]).implies(m.flag)), 'logic[0]', "'flag'"),
    'a Disjunct without time': (
        with_constraint(lambda m, t: on(m.open[1, t]).implies(on(m.design))),
        'logic[0]',
        "'design.indicator_var'",
    ),
    'a condition on a state': (
        with_constraint(lambda m, t: on(m.open[1, t]).implies(m.z[2, t] >= 0)),
        'logic[0]',
        r"'z\[2,0\]' is not the indicator",
    ),
    'modes of two times': (
        with_constraint(lambda m, t: on(m.open[1, 0]).implies(on(m.open[2, 2]))),
        'logic[0]',
        r"'open\[2,2\].indicator_var'",
    ),
    'a gap where a mode was switched off': (gap, 'of_x[0]', 'gap'),
    'too many combinations': (combinations_of_many, 'logic[0]', '16384 combinations'),
}


@pytest.mark.parametrize('fault', BAD)
def test_a_fault_is_refused_by_name_and_the_model_stays_as_it_was(fault):
    build, component, cause = BAD[fault]
    m = build()
    before = seen(m)
    with pytest.raises(FesdError, match=cause) as refusal:
        dcs(m)
    assert refusal.value.component == component and refusal.value.fix
    assert seen(m) == before


def test_three_at_most_one_of_which_is_on_exclude_one_another_two_by_two():
    m = dcs(with_logic(valves(3), lambda s1, o1, s2, o2, s3, o3: pyo.atmost(1, o1, o2, o3)))
    nu = [str(weights(m.valve[i, 0])[m.open[i, 0]]) for i in m.i]
    assert exclusions(m) == {frozenset(pair) for pair in itertools.combinations(nu, 2)}


def test_logic_about_a_disjunction_that_is_no_target_is_refused():
    m = implication()
    dcs(m, targets=m.valve)
    with pytest.raises(FesdError, match='transformed with it'):
        dcs(m)


def test_logic_without_time_is_left_alone():
    m = valves()
    m.always = pyo.LogicalConstraint(expr=on(m.open[1, 2]))
    dcs(m)
    assert m.always.active and exclusions(m) == set()
