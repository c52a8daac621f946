"""pyomo.dae's discretisation with hybrid components over time: what gets its new indices, what is refused, what an error leaves."""

import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
import signum
from pyomo.dae.diffvar import DAE_Error
from pyomo.gdp import Disjunct, Disjunction
from pyomo.mpec import Complementarity, complements

import pyomo_fesd
from pyomo_fesd import FesdError
from pyomo_fesd.core import restored_on_error
from pyomo_fesd.finite_elements.expansion import discretise
from tests.models import dcs
from tests.problems import free_start
from tests.problems.running import RADAU, SCHEMES, move, seen, solve

WARNINGS = 'pyomo_fesd'


def states(points=(0, 2)):
    """x over time and its derivative; no dynamics."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=points)
    m.x = pyo.Var(m.t, initialize=-2)
    m.dx = dae.DerivativeVar(m.x)
    m.x[points[0]].fix(-2)
    return m


def expand(m, nfe=3, ncp=2, scheme=RADAU):
    """Discretise without making anything movable; returns the model."""
    with restored_on_error(m, m.t):
        discretise(m, m.t, [nfe], ncp, scheme)
    return m


def texts(container):
    """The constraints of a Disjunct or Block data, as text."""
    return [str(c.expr) for c in container.component_data_objects(pyo.Constraint, descend_into=(pyo.Block, Disjunct))]


# What is expanded


@pytest.mark.parametrize('scheme', SCHEMES)
def test_a_disjunct_over_time_gets_every_new_time_by_its_rule(scheme):
    m = expand(signum.build(), 3, 2, scheme)
    assert list(m.below) == list(m.t) and len(m.t) == (7 if scheme == RADAU else 10)
    for t in m.t:
        assert texts(m.below[t]) == [f'x[{t}]  <=  0', f'dx[{t}]  ==  3']
    assert m.below.ctype is Disjunct and all(d.ctype is Disjunct and d.active for d in m.below.values())


def test_a_disjunction_over_time_gets_every_new_time_by_its_rule():
    m = expand(signum.build())
    assert set(m.sgn) == set(m.t)
    for t in m.t:
        assert m.sgn[t].disjuncts == [m.below[t], m.above[t]]
        assert m.sgn[t].active and m.sgn[t].xor


def test_modes_written_as_lists_of_expressions_are_made_at_new_times():
    m = expand(free_start.build())
    assert set(m.sgn) == set(m.t)
    for t in m.t:
        assert [texts(d) for d in m.sgn[t].disjuncts] == [
            [f'x[{t}]  <=  0', f'dx[{t}]  ==  3'],
            [f'0  <=  x[{t}]', f'dx[{t}]  ==  1'],
        ]


def test_a_disjunction_that_skips_a_time_skips_it_after_discretisation_too():
    m = states()
    m.sgn = Disjunction(
        m.t, rule=lambda m, t: Disjunction.Skip if t in (0, 1) else [[m.x[t] <= 0, m.dx[t] == 3], [m.x[t] >= 0, m.dx[t] == 1]]
    )
    expand(m, 2, 1)
    assert list(m.t) == [0, 1, 2] and list(m.sgn) == [2]


def test_a_disjunction_with_further_indices_gets_all_combinations():
    m = states()
    m.i = pyo.Set(initialize=['a', 'b'])

    @m.Disjunct(m.t, m.i)
    def low(d, t, i):
        d.region = pyo.Constraint(expr=m.x[t] <= {'a': 0, 'b': 1}[i])

    @m.Disjunct(m.i, m.t)
    def high(d, i, t):
        d.region = pyo.Constraint(expr=m.x[t] >= {'a': 0, 'b': 1}[i])

    @m.Disjunction(m.i, m.t)
    def level(m, i, t):
        return [m.low[t, i], m.high[i, t]]

    expand(m)
    assert set(m.level) == {(i, t) for i in m.i for t in m.t}
    assert all(m.level[i, t].disjuncts == [m.low[t, i], m.high[i, t]] for i in m.i for t in m.t)
    assert texts(m.high['b', m.t.at(2)]) == [f'1  <=  x[{m.t.at(2)}]']


def test_a_logical_constraint_over_time_gets_every_new_time_by_its_rule():
    m = signum.build()
    m.i = pyo.Set(initialize=['a', 'b'])
    literals = {'a': lambda m, t: m.below[t].indicator_var, 'b': lambda m, t: m.sgn[t].disjuncts[1].indicator_var}
    m.logic = pyo.LogicalConstraint(
        m.i, m.t, rule=lambda m, i, t: pyo.LogicalConstraint.Skip if t == 0 else literals[i](m, t).lor(m.above[t].indicator_var)
    )
    expand(m)
    assert set(m.logic) == {(i, t) for i in m.i for t in m.t if t != 0}
    assert m.logic.ctype is pyo.LogicalConstraint and all(c.active for c in m.logic.values())
    t = m.t.at(2)
    assert str(m.logic['a', t].expr) == f'below[{t}].indicator_var ∨ above[{t}].indicator_var'


def test_a_complementarity_over_time_gets_every_new_time_by_its_rule():
    m = states()
    m.i = pyo.RangeSet(2)
    m.F = pyo.Var(m.t, m.i, bounds=(0, None))
    m.full = Complementarity(m.t, m.i, rule=lambda m, t, i: complements(m.F[t, i] >= 0, i - m.x[t] >= 0))
    expand(m)
    assert set(m.full) == {(t, i) for t in m.t for i in m.i}
    assert m.full.ctype is Complementarity
    for t in m.t:
        assert [str(side) for side in m.full[t, 2]._args] == [f'0  <=  F[{t},2]', f'0  <=  2 - x[{t}]']


def test_a_complementarity_that_skips_the_first_time_still_skips_it():
    m = states()
    m.F = pyo.Var(m.t, bounds=(0, None))
    m.full = Complementarity(m.t, rule=lambda m, t: Complementarity.Skip if t == 0 else complements(m.F[t] >= 0, 1 - m.x[t] >= 0))
    expand(m)
    assert set(m.full) == set(m.t) - {0}


def test_nested_blocks_with_hybrid_components_are_expanded_at_every_level():
    m = states()

    @m.Block(['a', 'b'])
    def unit(u, name):
        @u.Block(m.t)
        def pipe(b, t):
            b.F = pyo.Var(bounds=(0, None))
            b.open, b.shut = Disjunct(), Disjunct()
            b.open.flow = pyo.Constraint(expr=b.F == 1)
            b.shut.flow = pyo.Constraint(expr=b.F == 0)
            b.valve = Disjunction(expr=[b.open, b.shut])
            b.full = Complementarity(expr=complements(b.F >= 0, 1 - m.x[t] >= 0))

        u.own = Disjunction(m.t, rule=lambda u, t: [[m.x[t] <= 0], [m.x[t] >= 0]])

    expand(m)
    for name in ('a', 'b'):
        assert set(m.unit[name].pipe) == set(m.unit[name].own) == set(m.t)
        for t in m.t:
            pipe = m.unit[name].pipe[t]
            assert pipe.valve.disjuncts == [pipe.open, pipe.shut]
            assert texts(pipe.open) == [f'unit[{name}].pipe[{t}].F  ==  1']
            assert pipe.full._args is not None


def test_a_constraint_over_time_inside_a_disjunct_without_time_is_expanded():
    m = states()
    m.fast, m.slow = Disjunct(), Disjunct()
    m.fast.ode = pyo.Constraint(m.t, rule=lambda d, t: m.dx[t] == 2)
    m.slow.ode = pyo.Constraint(m.t, rule=lambda d, t: m.dx[t] == 1)
    m.speed = Disjunction(expr=[m.fast, m.slow])
    expand(m)
    assert set(m.fast.ode) == set(m.slow.ode) == set(m.t)
    assert m.fast.ctype is Disjunct and m.speed.active and m.speed.disjuncts == [m.fast, m.slow]


def test_a_disjunction_inside_a_disjunct_over_time_is_expanded():
    m = states()

    @m.Disjunct(m.t)
    def high(d, t):
        d.region = pyo.Constraint(expr=m.x[t] >= 0)
        d.inner = Disjunction(expr=[[m.x[t] <= 1], [m.x[t] >= 1]])

    @m.Disjunct(m.t)
    def low(d, t):
        d.region = pyo.Constraint(expr=m.x[t] <= 0)

    m.outer = Disjunction(m.t, rule=lambda m, t: [m.high[t], m.low[t]])
    expand(m)
    assert set(m.outer) == set(m.t)
    for t in m.t:
        assert [texts(d) for d in m.high[t].inner.disjuncts] == [[f'x[{t}]  <=  1'], [f'1  <=  x[{t}]']]


def test_what_pyomo_dae_expands_by_itself_is_expanded_as_ever():
    m = states()
    m.z = pyo.Var(m.t, bounds=(-9, 9))
    m.twice = pyo.Expression(m.t, rule=lambda m, t: 2 * m.x[t])
    m.line = pyo.Constraint(m.t, rule=lambda m, t: m.z[t] == m.twice[t])
    m.size = pyo.Var(m.t)
    m.absolute = pyo.Piecewise(
        m.t, m.size, m.z, pw_pts=[-9.0, 0.0, 9.0], f_rule=lambda m, t, z: abs(z), pw_constr_type='EQ', pw_repn='INC'
    )
    m.gain = pyo.Param(m.t, default=3.0)
    expand(m)
    for component in (m.z, m.twice, m.line, m.size, m.absolute):
        assert set(component) == set(m.t), component.name


def test_a_disjunction_that_is_switched_off_stays_off_at_new_times():
    m = signum.build()
    m.second = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 0, m.dx[t] == 7], [m.x[t] >= 0, m.dx[t] == 8]])
    m.second.deactivate()
    move(dcs(m), 10)
    assert not any(d.active for d in m.second.values())
    assert not any(d.transformation_block for dj in m.second.values() for d in dj.disjuncts)
    assert pyomo_fesd.report(m)['pairs'] == 22  # two a time at the beginning and in each element, of 'sgn' alone


def test_a_mode_that_is_switched_off_stays_off_at_new_times():
    m = signum.build()
    m.above.deactivate()
    m.x[0].fix(-9)  # so far below zero that the other mode does for all times
    move(dcs(m), 10)
    assert not any(d.active for d in m.above.values())
    assert pyomo_fesd.report(m)['pairs'] == 0
    assert solve(m).x[2].value == pytest.approx(-3, abs=1e-9)


def test_a_mode_that_is_switched_off_in_one_unit_stays_off_there_only():
    m = states()
    m.i = pyo.Set(initialize=['a', 'b'])
    rates = {'low': 3, 'high': 1}

    @m.Disjunct(m.t, m.i, ['low', 'high'])
    def mode(d, t, i, side):
        d.region = pyo.Constraint(expr=m.x[t] <= 0 if side == 'low' else m.x[t] >= 0)
        d.rate = pyo.Constraint(expr=m.dx[t] == rates[side])

    m.dj = Disjunction(m.t, m.i, rule=lambda m, t, i: [m.mode[t, i, 'low'], m.mode[t, i, 'high']])
    for t in m.t:
        m.mode[t, 'a', 'high'].deactivate()
    expand(m)
    assert {index[1:] for index, d in m.mode.items() if not d.active} == {('a', 'high')}
    assert sum(not d.active for d in m.mode.values()) == len(m.t)


def test_a_mode_that_is_switched_off_in_every_block_stays_off_at_new_times():
    m = states()

    @m.Block(m.t)
    def pipe(b, t):
        b.low, b.high = Disjunct(), Disjunct()
        b.low.region = pyo.Constraint(expr=m.x[t] <= 0)
        b.high.region = pyo.Constraint(expr=m.x[t] >= 0)
        b.dj = Disjunction(expr=[b.low, b.high])

    for t in m.t:
        m.pipe[t].high.deactivate()
    expand(m)
    assert not any(b.high.active for b in m.pipe.values())
    assert all(b.low.active for b in m.pipe.values())


def test_a_complementarity_that_is_switched_off_stays_off_at_new_times():
    m = states()
    m.wall = Complementarity(m.t, rule=lambda m, t: complements(m.dx[t] >= 0, m.x[t] >= 5))
    m.wall.deactivate()
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == 1)
    assert solve(move(m, 3)).x[2].value == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize('transformed', [False, True], ids=['as declared', 'after fesd.dcs'])
def test_components_keep_their_place_in_the_model(transformed):
    m = signum.build()
    m.last = pyo.Var(m.t)
    if transformed:
        dcs(m)
    names = [c.local_name for c in m.component_objects(descend_into=False)]
    expand(m)
    assert [c.local_name for c in m.component_objects(descend_into=False)][: len(names)] == names


# Inputs


def test_an_input_that_was_fixed_at_every_time_is_named(caplog):
    m = states()
    m.u, m.w, m.z = pyo.Var(m.t), pyo.Var(m.t, ['a']), pyo.Var(m.t)
    m.u.fix(1)
    m.w.fix(1)
    m.z[0].fix(1)
    move(m, 3)
    (record,) = [r for r in caplog.records if 'fixed at every time' in r.message]
    assert record.name == WARNINGS and record.levelname == 'WARNING'
    assert 'u, w[a].' in record.message and 'z' not in record.message.split(':')[1].split('.')[0]
    assert all(v.fixed and v.value == 1 for v in (*m.u.values(), *m.w.values()))
    assert [t for t in m.t if m.z[t].fixed] == [0]


def test_an_input_that_is_fixed_to_different_values_is_refused():
    m = states()
    m.u = pyo.Var(m.t, initialize=lambda m, t: 1 + t)
    m.u.fix()
    with pytest.raises(FesdError, match=r'u\[0\]: it is fixed at every time .* to 1 at 0 and 3 at 2(.|\n)*pyomo_fesd.signal'):
        move(m, 3)
    assert list(m.t) == [0, 2] and len(m.u) == 2


@pytest.mark.parametrize('mutable', [True, False])
def test_a_param_without_values_at_new_times_is_refused(mutable):
    m = states()
    m.p = pyo.Param(m.t, initialize=lambda m, t: 1 + t, mutable=mutable)
    m.y = pyo.Var(m.t)
    m.use = pyo.Constraint(m.t, rule=lambda m, t: m.y[t] == m.p[t])
    with pytest.raises(FesdError, match=r'p: it has no value at .*that discretisation adds(.|\n)*pyomo_fesd.signal'):
        move(m, 3)
    assert list(m.t) == [0, 2]


def test_a_mutable_param_of_one_value_has_it_at_new_times():
    m = states()
    m.p = pyo.Param(m.t, initialize=3.0, mutable=True)
    m.y = pyo.Var(m.t)
    m.use = pyo.Constraint(m.t, rule=lambda m, t: m.y[t] == m.p[t])
    move(m, 3)
    assert {pyo.value(m.p[t]) for t in m.t} == {3.0}


def test_a_param_over_time_that_no_rule_asks_for_may_be_there():
    m = states()
    m.p = pyo.Param(m.t, initialize=lambda m, t: 1 + t, mutable=True)
    m.cost = pyo.Objective(expr=m.p[2] * m.x[2])
    move(m, 3)


def test_of_many_fixed_inputs_five_are_named(caplog):
    m = states()
    m.u = pyo.Var(m.t, range(8))
    m.u.fix(1)
    move(m, 3)
    (message,) = [r.message for r in caplog.records if 'fixed at every time' in r.message]
    assert message.count('u[') == 5 and 'and 3 more' in message


def test_fixed_initial_and_final_states_are_no_inputs(caplog):
    m = states()
    m.x[2].fix(0)
    move(m, 3)
    assert not [r for r in caplog.records if 'fixed' in r.message]


# What is refused


def over_time(ctype, rule=None):
    return lambda m: setattr(m, 'bad', ctype(m.t, **({} if rule is None else {'rule': rule})))


def hand_filled_disjunct(m):
    m.bad = Disjunct(m.t)
    for t in m.t:
        m.bad[t].region = pyo.Constraint(expr=m.x[t] >= 0)


def hand_filled_disjunction(m):
    m.bad = Disjunction(m.t)
    for t in m.t:
        m.bad[t] = [[m.x[t] >= 0], [m.x[t] <= 0]]


def hand_filled_logic(m):
    m.bad = pyo.LogicalConstraint(m.t)
    for t in m.t:
        m.bad[t] = m.below[t].indicator_var


def hand_filled_complementarity(m):
    m.bad = Complementarity(m.t)
    for t in m.t:
        m.bad[t] = complements(m.x[t] >= -9, m.x[t] <= 9)


REFUSED = {
    'Objective': (over_time(pyo.Objective, lambda m, t: m.x[t]), 'write one Objective'),
    'SOSConstraint': (
        lambda m: setattr(m, 'bad', pyo.SOSConstraint(m.t, rule=lambda m, t: ([m.x[t]], [1]), sos=1)),
        'declare it after the discretisation',
    ),
    'BooleanVar': (over_time(pyo.BooleanVar), 'regions of a Disjunction'),
    'Set': (lambda m: setattr(m, 'bad', pyo.Set(m.t, initialize=[1])), 'a Set that does not depend on time'),
    'hand-filled Disjunct': (hand_filled_disjunct, 'declare it with a rule'),
    'hand-filled LogicalConstraint': (hand_filled_logic, 'declare it with a rule'),
    'hand-filled Disjunction': (hand_filled_disjunction, 'declare it with a rule'),
    'hand-filled Complementarity': (hand_filled_complementarity, 'declare it with a rule'),
}


@pytest.mark.parametrize('kind', REFUSED)
def test_what_cannot_be_expanded_is_refused_by_name_and_leaves_the_model_as_it_was(kind):
    spoil, fix = REFUSED[kind]
    m = signum.build()
    spoil(m)
    before = seen(m)
    with pytest.raises(FesdError) as error:
        expand(m)
    assert error.value.component == 'bad' and kind.split()[-1] in error.value.cause and fix in error.value.fix
    assert seen(m) == before
    forget(m, 'bad', 'bad_disjuncts')
    exact(solve(move(dcs(m), 10)))


@pytest.mark.parametrize('kind', ['Objective', 'hand-filled Disjunct'])
def test_what_cannot_be_expanded_is_found_in_nested_blocks(kind):
    spoil, _ = REFUSED[kind]
    m = pyo.ConcreteModel()
    m.plant = pyo.Block(['a'])
    m.plant['a'].unit = signum.build()
    spoil(m.plant['a'].unit)
    with pytest.raises(FesdError, match=r'^plant\[a\].unit.bad: '):
        discretise(m, m.plant['a'].unit.t, [3], 2, RADAU)


def test_a_hybrid_component_by_hand_that_holds_nothing_is_no_reason_to_refuse():
    m = signum.build()
    m.empty, m.void = Disjunction(m.t), Complementarity(m.t)
    exact(solve(move(dcs(m), 10)))


# What an error in a rule leaves


def fails(t):
    """1 at the times that the model has from the beginning, an error at every other."""
    if t in (0, 2):
        return 1
    raise ArithmeticError(f'no value at {t}')


def failing_variable(m):
    m.bad = pyo.Var(m.t, initialize=lambda m, t: fails(t))


def failing_constraint(m):
    m.bad = pyo.Constraint(m.t, rule=lambda m, t: m.x[t] <= 9 * fails(t))


def failing_expression(m):
    m.bad = pyo.Expression(m.t, rule=lambda m, t: m.x[t] * fails(t))


def failing_block(m):
    def rule(b, t):
        b.y = pyo.Var()
        b.line = pyo.Constraint(expr=b.y == m.x[t] * fails(t))

    m.bad = pyo.Block(m.t, rule=rule)


def failing_disjunct(m):
    def rule(d, t):
        d.region = pyo.Constraint(expr=m.x[t] <= fails(t))

    m.bad = Disjunct(m.t, rule=rule)


def failing_disjunction(m):
    m.bad = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= fails(t)], [m.x[t] >= 1]])


def failing_logic(m):
    m.bad = pyo.LogicalConstraint(m.t, rule=lambda m, t: pyo.atleast(fails(t), m.below[t].indicator_var, m.above[t].indicator_var))


def failing_complementarity(m):
    m.bad = Complementarity(m.t, rule=lambda m, t: complements(m.x[t] >= -9 * fails(t), m.x[t] <= 9))


def failing_reference(m):
    m.pipe = pyo.Block(m.t, rule=lambda b, t: b.add_component('y', pyo.Var()))
    m.view = pyo.Reference(m.pipe[:].y)
    failing_constraint(m)


def missing_name(m):
    """An AttributeError, for which pyomo.dae tries again and again."""
    m.bad = pyo.Constraint(m.t, rule=lambda m, t: m.x[t] <= (9 if t in (0, 2) else m.no_such_component))


def missing_index(m):
    """A KeyError: data that the user has for the times that there were."""
    limit = {0: 9, 2: 9}
    m.bad = pyo.Constraint(m.t, rule=lambda m, t: m.x[t] <= limit[t])


def failing_integral(m):
    m.integral = dae.Integral(m.t, wrt=m.t, rule=lambda m, t: m.x[t] * fails(t))
    m.bad = pyo.Objective(expr=m.integral)


FAILING = (
    failing_variable,
    failing_constraint,
    failing_expression,
    failing_block,
    failing_disjunct,
    failing_disjunction,
    failing_logic,
    failing_complementarity,
    failing_reference,
    missing_name,
    missing_index,
    failing_integral,
)


@pytest.mark.parametrize('transformed', [False, True], ids=['as declared', 'after fesd.dcs'])
@pytest.mark.parametrize('spoil', FAILING, ids=lambda f: f.__name__)
def test_an_error_in_a_rule_at_a_new_time_leaves_the_model_as_it_was(spoil, transformed, caplog):
    m = signum.build()
    if transformed:
        dcs(m)
    spoil(m)
    before = seen(m)
    with pytest.raises((ArithmeticError, DAE_Error, FesdError, KeyError)):
        move(m, 10) if transformed else expand(m)
    assert seen(m) == before
    forget(m, 'bad', 'bad_disjuncts', 'view', 'pipe', 'integral')
    if not transformed:
        dcs(m)
    exact(solve(move(m, 10)))


def test_an_error_leaves_the_order_of_declaration_as_it_was():
    m = signum.build()
    failing_constraint(m)
    before = [c.local_name for c in m.component_objects(descend_into=False)]
    with pytest.raises(ArithmeticError):
        expand(m)
    assert [c.local_name for c in m.component_objects(descend_into=False)] == before


def test_an_error_after_the_expansion_leaves_the_model_as_it_was():
    m = unbounded(dcs(signum.build()))
    before = seen(m)
    with pytest.raises(FesdError, match='have 0 finite bounds'):
        move(m, 10)
    assert seen(m) == before


def test_after_an_error_behind_the_expansion_the_modes_are_still_transformed_at_new_times():
    m = unbounded(dcs(signum.build()))
    with pytest.raises(FesdError):
        move(m, 10)
    forget(m, 'bad', 'z')
    exact(solve(move(m, 10)))


def test_an_error_at_a_new_time_in_the_modes_leaves_the_model_as_it_was():
    m = states()

    @m.Disjunction(m.t)
    def sgn(m, t):
        second = [m.dx[t] == 1] if t in (0, 2) else []  # later it says nothing
        return [[m.x[t] <= 0, m.dx[t] == 3], [m.x[t] >= 0, *second]]

    dcs(m)
    before = seen(m)
    with pytest.raises(FesdError, match=r'sgn_disjuncts\[\d+\]'):
        move(m, 10)
    assert seen(m) == before


def test_an_error_in_an_integrand_of_a_sub_block_leaves_the_model_as_it_was():
    m = pyo.ConcreteModel()
    m.fs = signum.build()
    m.fs.integral = dae.Integral(m.fs.t, wrt=m.fs.t, rule=lambda b, t: b.x[t] * fails(t))
    dcs(m)
    before = seen(m)
    with pytest.raises(ArithmeticError):
        move(m, 10)
    assert seen(m) == before


def test_an_integral_survives_an_error_after_the_expansion():
    m = unbounded(dcs(signum.build()))
    m.integral = dae.Integral(m.t, wrt=m.t, rule=lambda m, t: m.x[t] ** 2)
    m.cost = pyo.Objective(expr=m.integral)
    before, value = seen(m), pyo.value(m.cost)
    with pytest.raises(FesdError):
        move(m, 10)
    assert seen(m) == before
    assert pyo.value(m.cost) == value
    forget(m, 'bad', 'z')
    solve(move(m, 10))
    assert pyo.value(m.cost) == pytest.approx(8 / 9 + 64 / 81, abs=1e-8)


def unbounded(m):
    """Adds a complementarity of sides without bounds, which is refused after the expansion."""
    m.z = pyo.Var(m.t, initialize=0)
    m.bad = Complementarity(m.t, rule=lambda m, t: complements(m.z[t], m.x[t] - 5))
    return m


def forget(m, *names):
    for name in names:
        if m.component(name) is not None:
            m.del_component(name)


def exact(m):
    (switch,) = pyomo_fesd.switches(m)
    assert switch.time == pytest.approx(2 / 3, abs=1e-9)
    assert m.x[2].value == pytest.approx(4 / 3, abs=1e-9)
