"""``fesd.smooth_to_complementarity`` on models, without solving."""

import logging

import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
from pyomo.mpec import Complementarity, complements

import pyomo_fesd
from pyomo_fesd import FesdError
from pyomo_fesd.core.complementarity import read_complementarity
from tests.smoothing.support import conditions, exact, settle, smooth_abs, smooth_max, smooth_min

NAME = 'fesd.smooth_to_complementarity'


@pytest.fixture
def m():
    m = pyo.ConcreteModel()
    m.x, m.y, m.v = pyo.Var(initialize=0.5), pyo.Var(initialize=-2.0), pyo.Var(initialize=0.0)
    m.inside = pyo.Var(bounds=(1, 3), initialize=2)
    return m


def row(m, expr):
    """``v == expr`` as the constraint ``c``."""
    m.c = pyo.Constraint(expr=m.v == expr)
    return m


def right(m):
    """Right side of ``c``, without the names of generated blocks."""
    return str(m.c.expr.args[1]).replace('_pyomo_fesd_kinks.c.', '')


def decay(expression):
    """x over [0, 2] with dx = expression(m, t), from 0."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2))
    m.x = pyo.Var(m.t, initialize=0)
    m.dx = dae.DerivativeVar(m.x)
    m.x[0].fix(0)
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == expression(m, t))
    return m


# What comes out


@pytest.mark.parametrize(
    'write, written',
    [
        (lambda m: abs(m.x), '2*s[1] - x'),
        (lambda m: smooth_abs(m.x - m.y), '2*s[1] - x + y'),
        (lambda m: smooth_max(m.x, m.y), 'y + s[1]'),
        (lambda m: smooth_min(m.x, m.y), 'x - s[1]'),
        (lambda m: smooth_max(m.x, 0), 's[1]'),
        (lambda m: smooth_min(smooth_max(m.x, 0), 1), 's[1] - s[2]'),
        (lambda m: (m.x + m.y + pyo.sqrt((m.x - m.y) ** 2 + 1e-8)) / 2, 'y + s[1]'),
        (lambda m: 3 * smooth_max(m.x, m.y) - m.y, '2*y + 3*s[1]'),
        (lambda m: m.y * smooth_max(m.x, 0), 'y*s[1]'),
        (lambda m: pyo.exp(smooth_max(m.x, 0) + m.x), 'exp(s[1] + x)'),
        (lambda m: smooth_max(m.x, 0) ** 2, 's[1]**2'),
        (lambda m: smooth_max(m.x, 0) - smooth_max(m.x, 0), '0'),
    ],
)
def test_the_smallest_form_comes_out(m, write, written):
    exact(row(m, write(m)))
    assert right(m) == written


def test_limits_of_mutable_params_are_collected_too(m):
    m.low, m.high = pyo.Param(initialize=0, mutable=True), pyo.Param(initialize=1, mutable=True)
    exact(row(m, smooth_min(smooth_max(m.x, m.low), m.high)))
    assert right(m) == 'low + s[1] - s[2]'


def test_equal_arguments_and_opposite_ones_share_one_variable(m):
    inner = [smooth_max(m.x, m.y) for _ in range(2)]  # equal, not the same object
    summary = exact(row(m, inner[0] * abs(m.y - m.x) + abs(inner[1] - 3) * abs(inner[0] - 3)))
    assert (summary.replaced, summary.pairs) == (6, 2)
    m.x.value, m.y.value = -1.0, 4.0
    assert pyo.value(settle(m).c.expr.args[1]) == pytest.approx(4 * 5 + 1)


def test_where_declared_bounds_tell_the_sign_nothing_is_left(m):
    summary = exact(row(m, abs(m.inside) + smooth_max(m.inside - 4, 0) + abs(m.x)))
    assert right(m) == 'inside + 2*s[3] - x'
    assert (summary.replaced, summary.pairs) == (3, 1)


def test_a_mutable_param_or_a_fixed_variable_may_change_so_the_pair_stays(m):
    m.p = pyo.Param(initialize=1, mutable=True)
    m.x.fix(2)
    assert exact(row(m, abs(m.x) + abs(m.inside + m.p))).pairs == 2


def test_one_variable_and_one_pair_a_nonsmooth_term_and_no_equation(m):
    before = pyomo_fesd.report(row(m, smooth_max(m.x, m.y) * smooth_abs(m.x)))
    exact(m)
    after = pyomo_fesd.report(m)
    assert {k: after[k] - before[k] for k in ('variables', 'constraints', 'pairs')} == {
        'variables': 2,
        'constraints': 0,
        'pairs': 2,
    }


# What is left alone


def left(summary):
    """``{name: beginning of the reason}``."""
    return {name: reason.split(',')[0] for reason, names in summary.left.items() for name in names}


def test_a_large_eps_is_physics(m):
    summary = exact(row(m, pyo.sqrt(m.x**2 + 1)))
    assert right(m) == 'sqrt(x**2 + 1)' and not conditions(m)
    assert left(summary) == {'c': 'eps is larger than largest_eps'}


@pytest.mark.parametrize('eps, largest, pairs', [(1e-2, 1e-2, 1), (1.01e-2, 1e-2, 0), (1e-8, 0, 0), (0, 0, 1), (1, 1, 1)])
def test_largest_eps(m, eps, largest, pairs):
    m.eps = pyo.Param(initialize=eps, mutable=True)
    assert exact(row(m, (m.x**2 + m.eps**2) ** 0.5), largest_eps=largest).pairs == pairs


@pytest.mark.parametrize(
    'write',
    [
        lambda m: pyo.sqrt(smooth_max(m.x, 0)),
        lambda m: pyo.log(smooth_max(m.x, 1e-4)),
        lambda m: smooth_max(m.x, 1) ** 0.25,
        lambda m: m.y / smooth_abs(m.x),
        lambda m: m.y * smooth_abs(m.x) ** -1,
        lambda m: pyo.log(1 + m.y * smooth_abs(m.x)),
        lambda m: pyo.sqrt(abs(m.x)),
    ],
)
def test_smoothing_that_protects_stays_unless_asked(m, write):
    summary = exact(row(m, write(m)))
    assert summary.pairs == 0 and left(summary) == {'c': 'inside a root'}
    assert exact(m, protective=True).pairs == 1


def test_a_guard_ends_with_its_argument(m):
    summary = exact(row(m, pyo.log(smooth_max(m.x, 1)) * smooth_max(m.y, 0) + m.y / (1 + abs(m.x)) + abs(m.y)))
    assert (summary.replaced, sum(summary.left.popitem()[1].values())) == (2, 2)


def test_inside_a_pattern_that_stays_the_inner_one_stays_too(m):
    assert exact(row(m, pyo.sqrt(smooth_abs(m.x) ** 2 + 4))).pairs == 0


def test_functions_that_jump_are_not_entered(m):
    m.p = pyo.Param(initialize=1, mutable=True)
    row(m, pyo.Expr_if(IF_=abs(m.x) >= 1, THEN_=abs(m.y), ELSE_=0))
    assert exact(m).replaced == 0


@pytest.mark.parametrize('what', ['c', 'x', 'b', 'd', 'e'])
def test_exclude(m, what):
    """A Constraint, a Var in z, a Block, one data object, or a named Expression."""
    m.e = pyo.Expression(expr=abs(m.y) + m.y)
    m.b = pyo.Block()
    m.b.c = pyo.Constraint(expr=m.v == abs(m.y - m.x))
    m.d = pyo.Constraint([1, 2], rule=lambda m, i: m.v >= abs(m.y) * i)
    row(m, abs(m.x) + m.e)
    excluded = {'c': m.c, 'x': m.x, 'b': m.b, 'd': m.d[1], 'e': m.e}[what]
    expected = {'c': {'c'}, 'x': {'c', 'b.c'}, 'b': {'b.c'}, 'd': {'d'}, 'e': {'e'}}[what]
    summary = exact(m, exclude=excluded)
    assert set(left(summary)) == expected
    assert summary.pairs == 5 - (2 if what in 'cx' else 1)
    assert exact(m, exclude=[excluded]).replaced == 0


def test_what_only_an_excluded_constraint_uses_is_left_too(m):
    m.e = pyo.Expression(expr=abs(m.y))
    row(m, m.e + 1)
    assert exact(m, exclude=m.c).replaced == 0


def test_inactive_constraints_are_left_and_stay_inactive(m):
    m.d = pyo.Constraint([1, 2], rule=lambda m, i: m.v >= i * abs(m.y))
    m.d[1].deactivate()
    assert exact(m).pairs == 1
    assert [m.d[i].active for i in (1, 2)] == [False, True] and 'abs' in str(m.d[1].expr)


# Sources


def test_objectives_and_both_sides_and_limits(m):
    m.cost = pyo.Objective(expr=abs(m.x) + m.y**2, sense=pyo.maximize)
    m.c = pyo.Constraint(expr=smooth_max(m.x, 0) == abs(m.y))
    m.d = pyo.Constraint(expr=(-1, abs(m.x - m.y), 5))
    summary = exact(m)
    assert dict(summary.changed) == {'c': 1, 'd': 1, 'cost': 1}
    assert m.cost.sense == pyo.maximize and (m.d.lower, m.d.upper) == (-1, 5)
    settle(m)
    assert [pyo.value(e) for e in (m.cost, m.c.body, m.d.body)] == [4.5, 0.5 - 2, 2.5]


def test_both_sides_of_a_condition(m):
    m.pair = Complementarity(expr=complements(abs(m.x) - 1 >= 0, smooth_max(m.y, 0)))
    summary = exact(m)
    assert dict(summary.changed) == {'pair': 1} and summary.pairs == 2
    settle(m)
    assert [pyo.value(side) for side in (m.pair._args[0].args[1], m.pair._args[1])] == [-0.5, 0.0]


def test_arguments_of_the_functions_with_nonsmooth_terms_of_their_own(m):
    row(m, pyomo_fesd.maximum(m, abs(m.x), smooth_max(m.y, 1)))
    # |x| occurs in the constraint and in the condition, each has its own
    assert exact(m).pairs == 3 and exact(m).replaced == 0
    m.x.value = -4.0
    for _ in range(2):  # the outer nonsmooth term was made first, and its value needs that of the inner ones
        settle(m)
    assert pyo.value(m.c.expr.args[1]) == 4


def test_an_empty_condition_is_passed_over(m):
    m.pair = Complementarity([1])
    m.pair[1]
    assert exact(m).replaced == 0


def test_a_named_expression_is_changed_once_for_all_that_use_it(m):
    m.e = pyo.Expression(expr=smooth_max(m.x, m.y))
    row(m, m.e * m.x)
    m.d = pyo.Constraint(expr=m.e >= m.v)
    summary = exact(m)
    assert dict(summary.changed) == {'e': 1} and summary.pairs == 1
    assert str(m.e.expr) == 'y + _pyomo_fesd_kinks.e.s[1]' and right(m) == '(y + _pyomo_fesd_kinks.e.s[1])*x'


def test_a_named_expression_that_nobody_uses_is_left(m):
    m.e = pyo.Expression(expr=abs(m.x))
    assert exact(m).replaced == 0
    assert exact(m, targets=[m.e]).pairs == 1


def test_a_named_expression_that_is_guarded_somewhere_is_left_with_all_in_it(m):
    m.inner = pyo.Expression(expr=smooth_max(m.x, 0))
    m.outer = pyo.Expression(expr=m.inner + abs(m.y))
    row(m, m.outer)
    m.d = pyo.Constraint(expr=pyo.sqrt(m.outer) >= 0)
    assert set(left(exact(m))) == {'inner', 'outer'}
    assert exact(m, protective=True).pairs == 2


@pytest.mark.parametrize('target, pairs', [('b', 2), ('c', 1), ('d', 2), ('d1', 1), ('cost', 1), (None, 6)])
def test_targets(m, target, pairs):
    m.b = pyo.Block([1, 2], rule=lambda b, i: b.add_component('c', pyo.Constraint(expr=b.model().v == abs(b.model().x))))
    m.d = pyo.Constraint([1, 2], rule=lambda m, i: m.v >= i * abs(m.y))
    m.cost = pyo.Objective(expr=abs(m.v))
    row(m, abs(m.x))
    targets = {'b': m.b, 'c': m.c, 'd': m.d, 'd1': m.d[1], 'cost': m.cost, None: None}[target]
    assert exact(m, targets=targets).pairs == pairs


def test_unsuitable_targets_are_refused(m):
    row(m, abs(m.x))
    other = m.clone()
    with pytest.raises(FesdError, match='must be a Block, Constraint, Objective, Complementarity or Expression, not a Var'):
        exact(m, targets=[m.x])
    with pytest.raises(FesdError, match='another model'):
        exact(m, targets=[m.c, other.c])
    assert not conditions(m) and right(m) == 'abs(x)'


def test_wrt_must_be_a_continuous_set(m):
    m.i = pyo.Set(initialize=[1])
    with pytest.raises(FesdError, match='must be a pyomo.dae.ContinuousSet'):
        exact(m, wrt=m.i)


def test_an_unknown_option_is_an_error(m):
    with pytest.raises(ValueError, match='eps'):
        exact(m, eps=1e-3)


def test_index_sets_without_end(m):
    m.c = pyo.Constraint(pyo.Any)
    for i in ('a', (1, 2)):
        m.c[i] = m.v == abs(m.x - m.y)
    m.rows = pyo.ConstraintList()
    m.rows.add(abs(m.x) <= 1)
    assert exact(m).pairs == 3
    assert exact(m).replaced == 0


# Maps, copies, summaries


def test_the_source_of_a_condition_also_in_a_clone(m):
    m.e = pyo.Expression(expr=abs(m.y))
    m.d = pyo.Constraint([1, 2], rule=lambda m, i: m.v >= i * abs(m.x) + m.e)
    m.cost = pyo.Objective(expr=abs(m.x))
    exact(m)
    transformation = pyo.TransformationFactory(NAME)
    for model in (m, m.clone()):
        sources = {transformation.get_src_constraint(c).name for c in conditions(model)}
        assert sources == {'d[1]', 'd[2]', 'e', 'cost'}
        assert all(transformation.get_src_constraint(c).model() is model for c in conditions(model))


def test_create_using_leaves_the_original(m):
    row(m, abs(m.x))
    new = pyo.TransformationFactory(NAME).create_using(m, exclude=[m.y])
    assert right(m) == 'abs(x)' and not conditions(m)
    assert right(new) == '2*s[1] - x' and new.c.expr.args[1].args[1].args[1] is new.x


def test_a_second_application_changes_nothing(m):
    row(m, smooth_min(smooth_max(m.x, 0), 1) + pyo.sqrt(smooth_abs(m.y)))
    exact(m)
    before = right(m)
    summary = exact(m)
    assert (summary.replaced, summary.pairs, len(conditions(m)), right(m)) == (0, 0, 2, before)


def test_a_later_application_continues_the_numbers(m):
    row(m, abs(m.x) * abs(m.y))
    exact(m, exclude=m.y)
    exact(m)
    assert right(m) == '(2*s[1] - x)*(2*s[2] - y)'


def test_the_summary_prints_and_is_logged(m, caplog):
    m.b = pyo.Block([1, 2], rule=lambda b, i: b.add_component('c', pyo.Constraint(expr=b.model().v == abs(b.model().x))))
    row(m, pyo.sqrt(m.x**2 + 1) + pyo.log(smooth_max(m.y, 1)))
    with caplog.at_level(logging.INFO, 'pyomo_fesd'):
        summary = exact(m)
    assert str(summary) == '\n'.join(
        [
            '2 absolute values replaced, 2 pairs',
            '    b.c: 2 changed',
            'left alone: eps is larger than largest_eps',
            '    c: 1',
            'left alone: inside a root, a logarithm, a denominator or a power, where smoothing may protect',
            '    c: 1',
        ]
    )
    assert str(summary) in caplog.text


def test_values_are_complementary_at_once(m):
    exact(row(m, smooth_max(m.x, m.y)))
    (pair,) = map(read_complementarity, conditions(m))
    assert (pyo.value(pair.G), pyo.value(pair.H)) == (2.5, 0.0)


# Over time


def nonsmooth(m, t):
    """A clip and an absolute value."""
    return 1 - smooth_min(smooth_max(m.x[t], 0.25), 0.5) + abs(m.x[t] - 1)


@pytest.mark.parametrize('first', ['transformed', 'discretised'])
def test_before_and_after_discretisation_give_the_same(first):
    m = decay(nonsmooth)
    if first == 'discretised':
        pyo.TransformationFactory('dae.collocation').apply_to(m, nfe=4, ncp=2)
    exact(m)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=4, ncp=2)
    assert len(m._pyomo_fesd_kinks.ode.complementarity) == 3 * len(m.t)
    for t in m.t:
        s = [f'_pyomo_fesd_kinks.ode.s[{t},{k}]' for k in (1, 2, 3)]
        assert str(m.ode[t].expr.args[1]) == f'- {s[0]} + {s[1]} + 2*{s[2]} - x[{t}] + 1.75'
    assert pyomo_fesd.report(m)['pairs'] == 3 * 4 + 3  # for each nonsmooth term one an element, and the first time


def test_the_names_of_constraints_and_their_rule_stay():
    m = decay(nonsmooth)
    ode, datas = m.ode, {t: m.ode[t] for t in m.t}
    exact(m)
    assert m.ode is ode and all(m.ode[t] is data for t, data in datas.items()) and ode.rule is not None


def test_a_clone_made_before_discretisation_goes_its_own_way():
    m = decay(lambda m, t: 1 - abs(m.x[t]))
    exact(m)
    clone = m.clone()
    pyo.TransformationFactory('fesd.finite_elements').apply_to(clone, nfe=3, ncp=2)
    assert len(conditions(m)) == 2
    assert {c.model() for c in conditions(clone)} == {clone}
    assert len(clone._pyomo_fesd_kinks.ode.complementarity) == len(clone.t) > 2


def test_options_hold_for_the_times_that_are_added():
    m = decay(lambda m, t: 1 - abs(m.x[t]) - pyo.sqrt(m.x[t] ** 2 + 4))
    m.other = pyo.Constraint(m.t, rule=lambda m, t: abs(m.x[t] - 1) <= 9)
    exact(m, exclude=m.other, largest_eps=3)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=3, ncp=2)
    assert all('abs' in str(m.other[t].expr) and 'sqrt' not in str(m.ode[t].expr) for t in m.t)


def test_nonsmooth_terms_of_some_indices_only():
    m = pyo.ConcreteModel()
    m.t, m.i = dae.ContinuousSet(bounds=(0, 2)), pyo.RangeSet(2)
    m.x = pyo.Var(m.t, m.i, initialize=0)
    m.dx = dae.DerivativeVar(m.x, wrt=m.t)
    m.ode = pyo.Constraint(m.t, m.i, rule=lambda m, t, i: m.dx[t, i] == 1 - (abs(m.x[t, i]) if i == 2 else 0))
    exact(m)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=3, ncp=2)
    assert set(m._pyomo_fesd_kinks.ode.complementarity) == {(t, 2, 1) for t in m.t}


def test_blocks_over_time_as_in_idaes():
    m = pyo.ConcreteModel()
    m.fs = pyo.Block()
    m.fs.time = dae.ContinuousSet(bounds=(0, 2))
    m.fs.x = pyo.Var(m.fs.time, initialize=0)
    m.fs.dx = dae.DerivativeVar(m.fs.x)
    m.fs.x[0].fix(0)

    @m.fs.Block(m.fs.time, ['a', 'b'])
    def state(b, t, i):
        fs = b.model().fs
        b.flow = pyo.Var()
        b.level = pyo.Expression(expr=fs.x[t] + (1 if i == 'b' else 0))
        b.law = pyo.Constraint(expr=b.flow == smooth_max(b.level, 1))

    m.fs.ode = pyo.Constraint(m.fs.time, rule=lambda fs, t: fs.dx[t] == fs.state[t, 'a'].flow - fs.state[t, 'b'].flow)
    summary = exact(m.fs, wrt=m.fs.time)
    assert dict(summary.changed) == {'fs.state.law': 4}
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m.fs, wrt=m.fs.time, nfe=3, ncp=2)
    assert sum('_pyomo_fesd_kinks' in str(b.law.expr) for b in m.fs.state.values()) == 2 * 7


def test_after_the_elements_were_made_movable_it_is_too_late_and_nothing_changes():
    m = decay(nonsmooth)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=3, ncp=2)
    with pytest.raises(FesdError, match="the elements over 't' are movable already"):
        exact(m)
    assert m.component('_pyomo_fesd_kinks') is None and 'abs' in str(m.ode[2].expr)


def test_a_second_application_after_the_elements_finds_nothing_to_do():
    m = decay(nonsmooth)
    exact(m)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=3, ncp=2)
    assert exact(m).replaced == 0


def test_an_integrand_needs_an_expression_over_time():
    m = decay(lambda m, t: 1)
    m.loss = pyo.Expression(m.t, rule=lambda m, t: abs(m.x[t] - 1))
    m.lost = dae.Integral(m.t, rule=lambda m, t: abs(m.x[t]) + m.loss[t])
    m.cost = pyo.Objective(expr=m.lost)
    summary = exact(m)
    assert dict(summary.changed) == {'loss': 2}
    assert left(summary) == {'lost': 'inside an Integral'}
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=3, ncp=2)
    assert len(m._pyomo_fesd_kinks.loss.complementarity) == len(m.t)


def test_an_objective_of_final_values_has_a_pair_without_time():
    m = decay(lambda m, t: 1)
    m.cost = pyo.Objective(expr=abs(m.x[2] - 1))
    exact(m)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=3, ncp=2)
    assert [c.name for c in m.component_data_objects(Complementarity, active=True)] == ['_pyomo_fesd_kinks.cost.complementarity[1]']


@pytest.mark.parametrize('first', [NAME, 'fesd.dcs'])
def test_modes_of_a_disjunction_are_treated_after_fesd_dcs(first):
    from pyomo.gdp import Disjunction

    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2))
    m.x = pyo.Var(m.t, initialize=0)
    m.dx = dae.DerivativeVar(m.x)
    m.sgn = Disjunction(
        m.t,
        rule=lambda m, t: [
            [abs(m.x[t]) <= 1, m.dx[t] == 1 + smooth_max(m.x[t], 0)],
            [abs(m.x[t]) >= 1, m.dx[t] == 2],
        ],
    )
    if first == NAME:
        assert left(exact(m)) == {'sgn_disjuncts.constraint': 'inside a Disjunct: apply fesd.dcs first'}
    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    assert exact(m).pairs == 4  # of the mode equation and of the switching function, at two times
