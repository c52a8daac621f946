"""Marks: what passes between the pieces beside Pyomo's own components."""

import io

import bouncing_ball
import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
import signum
import thermostat
from pyomo.core.expr.visitor import identify_variables
from pyomo.mpec import Complementarity
from pyomo.repn.plugins.nl_writer import NLWriter

import pyomo_fesd
from pyomo_fesd import marks
from tests.models import dcs
from tests.problems import sliding, weir
from tests.problems.running import move, transform


def test_a_mark_is_a_local_suffix():
    m = pyo.ConcreteModel()
    m.x = pyo.Var()
    marks.mark(m, 'fesd_test', m.x, 3)
    assert m.fesd_test.ctype is pyo.Suffix and m.fesd_test.direction == pyo.Suffix.LOCAL
    assert [(c.name, v) for c, v in marks.marked(m, 'fesd_test')] == [('x', 3)]


def test_a_second_mark_replaces_the_first():
    m = pyo.ConcreteModel()
    m.x = pyo.Var()
    marks.mark(m, 'fesd_test', m.x, 3)
    marks.mark(m, 'fesd_test', m.x)
    assert list(marks.marked(m, 'fesd_test')) == [(m.x, True)]


def test_an_indexed_component_is_marked_as_a_whole():
    m = pyo.ConcreteModel()
    m.x = pyo.Var([1, 2])
    marks.mark(m, 'fesd_test', m.x)
    marks.mark(m, 'fesd_other', m.x[1])
    assert [c for c, _ in marks.marked(m, 'fesd_test')] == [m.x]
    assert [c for c, _ in marks.marked(m, 'fesd_other')] == [m.x[1]]


def test_marks_of_blocks_below_are_found_and_those_of_inactive_blocks_are_not():
    m = pyo.ConcreteModel()
    m.b = pyo.Block([1, 2])
    for i in (1, 2):
        m.b[i].x = pyo.Var()
        marks.mark(m.b[i], 'fesd_test', m.b[i].x)
    assert [c.name for c, _ in marks.marked(m, 'fesd_test')] == ['b[1].x', 'b[2].x']
    assert [c.name for c, _ in marks.marked(m.b[2], 'fesd_test')] == ['b[2].x']
    m.b[1].deactivate()
    assert [c.name for c, _ in marks.marked(m, 'fesd_test')] == ['b[2].x']


def test_what_is_used_up_is_found_only_when_it_is_asked_for():
    m = over_two_times()
    marks.use_up(m, 'fesd_test', m.t)
    assert [c.name for c, _ in marks.marked(m, 'fesd_test')] == ['b.y[0]']
    assert [c.name for c, _ in marks.marked(m, 'fesd_test', used=True)] == ['a.x[0]', 'b.y[0]']


def test_a_copy_of_what_is_used_up_is_used_up():
    m = over_two_times()
    marks.use_up(m, 'fesd_test', m.t)
    assert [c.name for c, _ in marks.marked(m.clone(), 'fesd_test')] == ['b.y[0]']


def over_two_times():
    """Marks of variables over two different times."""
    m = pyo.ConcreteModel()
    m.t, m.s = dae.ContinuousSet(bounds=(0, 1)), dae.ContinuousSet(bounds=(0, 1))
    m.a, m.b = pyo.Block(), pyo.Block()
    m.a.x, m.b.y = pyo.Var(m.t), pyo.Var(m.s)
    marks.mark(m.a, 'fesd_test', m.a.x[0])
    marks.mark(m.b, 'fesd_test', m.b.y[0])
    return m


def test_a_block_that_is_switched_off_as_a_whole_has_no_marks():
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 1))

    @m.Block(m.t)
    def b(b, t):
        b.x = pyo.Var()
        marks.mark(b, 'fesd_test', b.x)

    m.b.deactivate()
    # pyomo.dae makes the new data active
    pyo.TransformationFactory('dae.collocation').apply_to(m, wrt=m.t, nfe=2, ncp=1)
    assert m.b[0.5].active
    assert not list(marks.marked(m, 'fesd_test')) and not list(marks.marked(m, 'fesd_test', used=True))


def test_suffixes_of_other_names_are_left_alone():
    m = pyo.ConcreteModel()
    m.x = pyo.Var()
    m.scaling_factor = pyo.Suffix(direction=pyo.Suffix.EXPORT)
    m.scaling_factor[m.x] = 10
    assert not list(marks.marked(m, 'fesd_test'))


def test_marks_of_a_clone_are_its_own():
    m = pyo.ConcreteModel()
    m.x, m.y = pyo.Var([1, 2]), pyo.Var()
    m.c = pyo.Constraint(expr=m.y == 1)
    marks.mark(m, marks.CONTINUOUS, m.x, m.c)
    marks.mark(m, marks.INDICATOR, m.y, 1 - m.x[1])
    copy = m.clone()
    ((x, c),) = marks.marked(copy, marks.CONTINUOUS)
    ((y, expr),) = marks.marked(copy, marks.INDICATOR)
    assert x is copy.x and c is copy.c and y is copy.y
    assert list(identify_variables(expr)) == [copy.x[1]]
    assert [c for c, _ in marks.marked(m, marks.CONTINUOUS)] == [m.x]


def test_generated_blocks_are_told_by_their_name():
    m = pyo.ConcreteModel()
    m.b = pyo.Block()
    m.b._pyomo_fesd_dcs = pyo.Block([1])
    m.b._pyomo_fesd_dcs[1].x = pyo.Var([1])
    m.b.x = pyo.Var()
    m.pyomo_fesd_x = pyo.Var()
    for mine in (m.b._pyomo_fesd_dcs, m.b._pyomo_fesd_dcs[1], m.b._pyomo_fesd_dcs[1].x, m.b._pyomo_fesd_dcs[1].x[1]):
        assert marks.is_generated(mine)
    for other in (m, m.b, m.b.x, m.pyomo_fesd_x):
        assert not marks.is_generated(other)


# What the transformations mark


def test_every_mode_has_its_multiplier_at_every_time():
    m = transform(signum.build(), 3)
    found = dict((d.name, w) for d, w in marks.marked(m, marks.INDICATOR))
    assert set(found) == {d[t].name for d in (m.below, m.above) for t in m.t}
    assert all(pyo.value(found[f'below[{t}]'] + found[f'above[{t}]']) == pytest.approx(1) for t in m.t)


@pytest.mark.parametrize('form', ['two_mode', 'stewart', 'heaviside'])
def test_parts_that_are_continuous_in_time_point_to_their_equation(form):
    m = transform(signum.build(), 3, form=form)
    for part, rule in marks.marked(m, marks.CONTINUOUS):
        assert rule.ctype is pyo.Constraint and rule.parent_block() is part.parent_block()
        for index in part:
            equation = rule[index] if index in rule else rule[(index, 1) if not isinstance(index, tuple) else index]
            assert any(v is part[index] for v in identify_variables(equation.body))


def test_what_logic_between_modes_has_switched_off_is_told_from_what_the_user_has():
    m = signum.build()
    m.logic = pyo.LogicalConstraint(m.t, rule=lambda m, t: pyo.lnot(m.above[t].indicator_var))
    m.other = pyo.LogicalConstraint(m.t, rule=lambda m, t: m.below[t].indicator_var)
    m.other.deactivate()
    dcs(m)
    assert {c.name for c, _ in marks.marked(m, marks.REPLACED)} == {c.name for c in (*m.logic.values(), *m.above.values())}


def test_every_decided_pair_points_to_its_equation_of_equal_length():
    m = transform(signum.build(), 5)
    found = [(pair, con) for pair, con in marks.marked(m, marks.DECIDED) if con.parent_component().local_name == 'equal_length']
    assert len(found) == 4
    for pair, equation in found:
        assert pair.ctype is Complementarity and pair.active
        assert not equation.active and equation.index() == pair.index()


def test_the_penalty_is_small_and_carries_its_weight():
    m = transform(signum.build(), 5, rho=0.25)
    ((expr, weight),) = marks.marked(m, marks.PENALTY)
    assert weight == 0.25 and pyo.value(expr) == 0
    pyo.TransformationFactory('fesd.finite_elements').get_element_lengths(m.t)[1].value = 1.5
    assert pyo.value(expr) == pytest.approx(0.25)


def test_modes_with_memory_are_marked_with_their_conditions_and_then_used_up():
    m = thermostat.build(1)
    dcs(m, memory=[m.relay])
    found = list(marks.marked(m, marks.MEMORY))
    assert len(found) == 2 * len(m.t)
    assert all(w.ctype is pyo.Expression and all(c.ctype is pyo.Expression for c in cs) for w, cs in found)
    move(m, 3, 2)
    assert not list(marks.marked(m, marks.MEMORY))
    assert len(list(marks.marked(m, marks.MEMORY, used=True))) == 2 * len(m.t)


def test_jumps_are_marked_with_guards_and_values_after_and_then_used_up():
    m = bouncing_ball.build()
    assert [(g.name, v) for g, v in marks.marked(m, marks.GUARD)] == [(f'impact[{t}].guard', True) for t in m.t]
    assert [x.name for x, _ in marks.marked(m, marks.RESET)] == [f'v[{t}]' for t in m.t]
    move(m, 3, 2)
    assert not list(marks.marked(m, marks.GUARD))
    assert len(list(marks.marked(m, marks.GUARD, used=True))) == len(m.t)


def test_marks_do_not_reach_the_solver_file():
    m = move(weir.build(), 3)
    for c in m.component_data_objects(Complementarity):
        c.deactivate()
    stream = io.StringIO()
    NLWriter().write(m, stream)
    assert not [line for line in stream.getvalue().splitlines() if line.startswith('S')]


@pytest.mark.parametrize('build', [signum.build, sliding.build])
def test_marks_survive_a_clone_between_the_transformations(build):
    m = dcs(build())
    copy = m.clone()
    for name in (marks.CONTINUOUS, marks.SELECTOR, marks.INDICATOR):
        ours, theirs = ([c for c, _ in marks.marked(model, name)] for model in (m, copy))
        assert [c.name for c in ours] == [c.name for c in theirs]
        assert all(c.model() is copy for c in theirs)


def test_a_user_may_mark_a_variable_of_his_own_as_continuous():
    # an algebraic level, as continuous as the state that it follows from
    m = weir.build(level='algebraic')
    marks.mark(m, marks.CONTINUOUS, m.h, m.cylinder)
    move(m, 5, 2)
    pyo.assert_optimal_termination(pyo.SolverFactory('mpec_hybrid').solve(m))
    (switch,) = pyomo_fesd.switches(m)
    assert switch.time == pytest.approx(weir.SWITCH, abs=1e-9)
