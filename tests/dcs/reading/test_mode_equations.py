"""Mode equations in any writing become v = sum nu_i f_i (theory, eq. 7)."""

import pyomo.environ as pyo
import pytest
from pyomo import dae
from pyomo.core.expr.visitor import identify_variables

from tests.models import above, add_modes, below, dcs, form_of, modes_on, rate, residual, scalar_ode, tank
from tests.problems.forms_of import form_block

MIXED = 0.25 * 3 + 0.75 * 1  # the sliding rate of dx = 3 and dx = 1 at nu = 1/4

WRITINGS = {
    'dx == 3': lambda m, t: m.dx[t] == 3,
    '3 == dx': lambda m, t: 3 == m.dx[t],
    'dx - 3 == 0': lambda m, t: m.dx[t] - 3 == 0,
    '2*dx == 6': lambda m, t: 2 * m.dx[t] == 6,
    '0 == 6 - 2*dx': lambda m, t: 0 == 6 - 2 * m.dx[t],
    '-dx/4 == -3/4': lambda m, t: -m.dx[t] / 4 == -0.75,
    'x + dx == x + 3': lambda m, t: m.x[t] + m.dx[t] == m.x[t] + 3,
    '3*dx == dx + 6': lambda m, t: 3 * m.dx[t] == m.dx[t] + 6,
    'k*dx == 3*k': lambda m, t: m.k * m.dx[t] == 3 * m.k,
    '(dx - 3)*y**2 == 0': lambda m, t: (m.dx[t] - 3) * m.y[t] ** 2 == 0,
    'dx**3 == 27': lambda m, t: m.dx[t] ** 3 == 27,
}


def with_first_mode(equation, **keywords):
    """Below zero ``equation``, above zero dx == 1."""
    m = scalar_ode(**keywords)
    m.k = pyo.Param(initialize=5.0, mutable=True)
    return add_modes(m, lambda m, t: [m.x[t] <= 0, equation(m, t)], above)


def sliding_rate(m, v, nu=0.25, disjunction=None):
    """dv/dt at nu = 1/4 of the first of two modes, copies of v set to their mode's rate of 3."""
    disjunction = disjunction or m.sgn[0]
    block, index = form_of(disjunction)
    block.alpha[index or None].value = nu
    for copy in (block.component('own') or {}).values():
        copy.value = 3.0
    return rate(disjunction, v)


def own_residuals(m):
    """Residuals at t0 of the equations imposed on copies of the defined variables."""
    equations = m._pyomo_fesd_dcs.sgn.component('own_equation') or {}
    return [residual(con) for key, con in equations.items() if key[0] == 0]


def mode_equations(m, name='sgn'):
    return {key: str(con.expr) for key, con in m.component('_pyomo_fesd_dcs').component(name).mode.items()}


@pytest.mark.parametrize('writing', WRITINGS)
def test_the_sliding_rate_does_not_depend_on_how_the_equation_is_written(writing):
    m = dcs(with_first_mode(WRITINGS[writing]))
    assert sliding_rate(m, m.dx[0]) == pytest.approx(MIXED)
    assert own_residuals(m) == pytest.approx([0] * len(own_residuals(m)))


@pytest.mark.parametrize('writing', [w for w in WRITINGS if w not in ('(dx - 3)*y**2 == 0', 'dx**3 == 27')])
def test_an_equation_with_a_constant_factor_needs_no_copy_of_its_variable(writing):
    m = dcs(with_first_mode(WRITINGS[writing]))
    assert m._pyomo_fesd_dcs.sgn.component('own') is None


def test_a_mutable_param_in_a_mode_equation_stays_mutable():
    m = dcs(with_first_mode(lambda m, t: m.k * m.dx[t] == 30))
    m.k.value = 10.0
    assert sliding_rate(m, m.dx[0]) == pytest.approx(MIXED)


def test_a_mutable_param_on_the_right_hand_side_stays_mutable():
    m = dcs(with_first_mode(lambda m, t: m.dx[t] == m.k))
    m.k.value = 3.0
    assert sliding_rate(m, m.dx[0]) == pytest.approx(MIXED)


def test_a_right_hand_side_may_depend_on_the_states():
    m = dcs(with_first_mode(lambda m, t: m.dx[t] == m.y[t] * pyo.exp(m.x[t]) + m.x[t]))
    m.x[0].value, m.y[0].value = 0.5, 2.0
    assert sliding_rate(m, m.dx[0]) == pytest.approx(0.25 * (2 * pyo.exp(0.5) + 0.5) + 0.75)


def test_named_expressions_stand_for_their_contents():
    m = scalar_ode()
    m.gap = pyo.Expression(m.t, rule=lambda m, t: m.x[t] - 1)
    m.speed = pyo.Expression(m.t, rule=lambda m, t: 3 - m.dx[t])
    add_modes(m, lambda m, t: [m.gap[t] <= 0, m.speed[t] == 0], lambda m, t: [m.x[t] >= 1, m.dx[t] == 1])
    dcs(m)
    assert form_block(m)[0] == ''
    assert sliding_rate(m, m.dx[0]) == pytest.approx(MIXED)


def test_the_modes_may_define_a_second_derivative():
    m = scalar_ode()
    m.ddx = dae.DerivativeVar(m.x, wrt=(m.t, m.t))
    add_modes(m, lambda m, t: [m.x[t] <= 0, 2 * m.ddx[t] == 6], lambda m, t: [m.x[t] >= 0, m.ddx[t] == 1])
    dcs(m)
    assert sliding_rate(m, m.ddx[0]) == pytest.approx(MIXED)


def test_coupled_equations_are_solved_before_they_are_blended():
    m = scalar_ode()
    add_modes(
        m,
        lambda m, t: [m.x[t] <= 0, m.dx[t] + m.dy[t] == 7, m.dx[t] - m.dy[t] == m.x[t]],
        lambda m, t: [m.x[t] >= 0, m.dx[t] == 1, m.dy[t] == 2],
    )
    dcs(m)
    m.x[0].value = -1.0
    assert sliding_rate(m, m.dx[0]) == pytest.approx(0.25 * 3 + 0.75 * 1)
    assert sliding_rate(m, m.dy[0]) == pytest.approx(0.25 * 4 + 0.75 * 2)


def test_coupled_equations_with_mutable_factors_follow_the_factor():
    m = scalar_ode()
    m.k = pyo.Param(initialize=1.0, mutable=True)
    add_modes(
        m,
        lambda m, t: [m.x[t] <= 0, m.dx[t] + m.k * m.dy[t] == 11, m.dx[t] - m.dy[t] == -1],
        lambda m, t: [m.x[t] >= 0, m.dx[t] == 1, m.dy[t] == 2],
    )
    dcs(m)
    m.k.value = 2.0  # now dx = 3, dy = 4
    own = m._pyomo_fesd_dcs.sgn.own
    own[0, 1, 1].value, own[0, 1, 2].value = 3.0, 4.0
    assert [residual(m._pyomo_fesd_dcs.sgn.own_equation[0, 1, j]) for j in (1, 2)] == pytest.approx([0, 0])


def test_algebraic_variables_are_blended_like_derivatives():
    m = dcs(tank())
    m.M[0].value = 6.0
    assert sliding_rate(m, m.L[0], disjunction=m.outlet[0]) == pytest.approx(0.25 * 0.6)
    assert sliding_rate(m, m.G[0], disjunction=m.outlet[0]) == pytest.approx(0.75 * 1.2)


def test_equations_are_matched_by_the_variable_that_they_define():
    m = scalar_ode()
    add_modes(
        m,
        lambda m, t: [m.x[t] <= 0, m.dx[t] == 3, m.dy[t] == 10],
        lambda m, t: [m.dy[t] == 20, m.x[t] >= 0, m.dx[t] == 1],
    )
    dcs(m)
    assert sliding_rate(m, m.dx[0]) == pytest.approx(MIXED)
    assert sliding_rate(m, m.dy[0]) == pytest.approx(0.25 * 10 + 0.75 * 20)


def test_names_of_the_equations_do_not_matter():
    # in tank() 'first' defines L in one mode and G in the other
    m = dcs(tank())
    for M, mode, L, G in ((8.0, m.full[0], 0.8, 0.0), (2.0, m.empty[0], 0.0, 0.4)):
        m.M[0].value = M
        assert modes_on(m.outlet[0]) == [mode]
        assert [rate(m.outlet[0], v) for v in (m.L[0], m.G[0])] == pytest.approx([L, G])


def test_the_variable_alone_on_a_side_is_the_one_defined():
    m = scalar_ode()
    m.F, m.P = pyo.Var(m.t), pyo.Var(m.t, initialize=4.0)
    add_modes(m, lambda m, t: [m.x[t] <= 0, m.F[t] == 3 * m.P[t]], lambda m, t: [m.x[t] >= 0, m.P[t] == m.F[t]])
    dcs(m)
    assert sliding_rate(m, m.F[0]) == pytest.approx(0.25 * 12 + 0.75 * 4)


def test_derivatives_and_algebraic_variables_are_defined_side_by_side():
    m = scalar_ode()
    m.F = pyo.Var(m.t)
    add_modes(
        m,
        lambda m, t: [m.x[t] <= 0, m.dx[t] == m.F[t], m.F[t] == 3],
        lambda m, t: [m.x[t] >= 0, m.F[t] == 1, m.dx[t] == 2 * m.F[t] - 1],
    )
    dcs(m)
    assert sliding_rate(m, m.F[0]) == pytest.approx(MIXED)
    assert sliding_rate(m, m.dx[0]) == pytest.approx(MIXED)


def test_an_implicit_equation_gets_its_own_copy_of_the_variable():
    m = dcs(with_first_mode(lambda m, t: m.dx[t] + m.dx[t] ** 3 == m.y[t]))
    block = m._pyomo_fesd_dcs.sgn
    block.own[0, 1, 1].value, m.y[0].value = 2.0, 10.0
    m.dx[0].value = 99.0
    assert residual(block.own_equation[0, 1, 1]) == pytest.approx(0)
    block.alpha[0].value = 0.25
    assert rate(m.sgn[0], m.dx[0]) == pytest.approx(0.25 * 2 + 0.75 * 1)


def test_the_explicit_mode_beside_an_implicit_one_gets_no_copy():
    m = dcs(with_first_mode(lambda m, t: m.dx[t] ** 3 == 27))
    assert {mode for _, mode, _ in m._pyomo_fesd_dcs.sgn.own} == {1}


def test_a_copy_starts_at_the_value_of_its_variable():
    m = with_first_mode(lambda m, t: m.dx[t] ** 3 == 27)
    m.dx[0].value = 2.5
    dcs(m)
    assert m._pyomo_fesd_dcs.sgn.own[0, 1, 1].value == 2.5


def test_a_factor_that_is_a_fixed_variable_may_be_freed_later():
    m = scalar_ode()
    m.a = pyo.Var(initialize=1.0)
    m.a.fix()
    add_modes(m, lambda m, t: [m.x[t] <= 0, m.a * m.dx[t] == 6], above)
    dcs(m)
    m.a.unfix()
    m.a.value = 2.0  # dx = 3 below
    block = m._pyomo_fesd_dcs.sgn
    assert any(v is m.a for v in identify_variables(block.own_equation[0, 1, 1].body))
    assert sliding_rate(m, m.dx[0]) == pytest.approx(MIXED)
    assert residual(block.own_equation[0, 1, 1]) == pytest.approx(0)


def test_an_equation_that_all_modes_share_is_not_blended():
    m = add_modes(
        scalar_ode(),
        lambda m, t: [*below(m, t), m.dy[t] == -m.x[t]],
        lambda m, t: [*above(m, t), m.dy[t] == -m.x[t]],
    )
    dcs(m)
    m.x[0].value = 0.5
    rates = [sliding_rate(m, m.dy[0], nu=nu) for nu in (0.0, 0.3, 1.0)]
    assert rates == pytest.approx([-0.5] * 3)
    shared = m._pyomo_fesd_dcs.sgn.mode[0, 2]
    assert not any(v is m._pyomo_fesd_dcs.sgn.alpha[0] for v in identify_variables(shared.body))


def test_equal_values_of_different_params_are_not_taken_for_a_shared_equation():
    m = scalar_ode()
    m.a, m.b = pyo.Param(initialize=1.0, mutable=True), pyo.Param(initialize=1.0, mutable=True)
    add_modes(m, lambda m, t: [m.x[t] <= 0, m.dx[t] == m.a], lambda m, t: [m.x[t] >= 0, m.dx[t] == m.b])
    dcs(m)
    m.a.value = 3.0
    assert sliding_rate(m, m.dx[0]) == pytest.approx(MIXED)


def test_a_derivative_fixed_at_the_initial_time_is_still_what_the_modes_define():
    free, fixed = with_first_mode(WRITINGS['2*dx == 6']), with_first_mode(WRITINGS['2*dx == 6'])
    fixed.dx[0].fix(0.0)
    assert mode_equations(dcs(fixed)) == mode_equations(dcs(free))
    assert fixed.dx[0].fixed and fixed.dx[0].value == 0.0


def test_a_state_fixed_at_the_initial_time_can_be_freed_later():
    free = with_first_mode(lambda m, t: m.dx[t] == 3 * m.x[t] * m.y[t])
    fixed = with_first_mode(lambda m, t: m.dx[t] == 3 * m.x[t] * m.y[t])
    free.x[0].unfix()
    fixed.y[0].fix(1.0)
    assert mode_equations(dcs(fixed)) == mode_equations(dcs(free))


def test_an_algebraic_variable_fixed_at_the_initial_time_is_still_defined_there():
    free, fixed = tank(), tank()
    fixed.L[0].fix(0.8)
    assert mode_equations(dcs(fixed), 'outlet') == mode_equations(dcs(free), 'outlet')


def test_units_with_different_numbers_of_equations_share_a_disjunction():
    m = scalar_ode()
    m.i = pyo.Set(initialize=['plain', 'with flow'])
    m.F = pyo.Var(m.t)
    extra = {'plain': lambda t, value: [], 'with flow': lambda t, value: [m.F[t] == value]}
    defined = {'plain': m.dx, 'with flow': m.dy}

    @m.Disjunction(m.i, m.t)
    def unit(m, i, t):
        return [
            [m.x[t] <= 0, defined[i][t] == 3, *extra[i](t, 3)],
            [m.x[t] >= 0, defined[i][t] == 1, *extra[i](t, 1)],
        ]

    dcs(m)
    assert sliding_rate(m, m.dx[0], disjunction=m.unit['plain', 0]) == pytest.approx(MIXED)
    assert sliding_rate(m, m.F[0], disjunction=m.unit['with flow', 0]) == pytest.approx(MIXED)


def test_each_unit_defines_the_variable_that_stands_alone_in_its_own_equations():
    m = scalar_ode()
    m.i = pyo.Set(initialize=['pump', 'valve'])
    m.flow = pyo.Var(m.i, ['in', 'out'], m.t, initialize=1.0)

    @m.Disjunction(m.i, m.t)
    def unit(m, i, t):
        a, b = m.flow[i, 'in', t], m.flow[i, 'out', t]
        low, high = {'pump': (a == 3 * b, a == b), 'valve': (3 * a == b, a == b)}[i]
        return [[m.x[t] <= 0, low], [m.x[t] >= 0, high]]

    dcs(m)
    assert sliding_rate(m, m.flow['pump', 'in', 0], disjunction=m.unit['pump', 0]) == pytest.approx(MIXED)
    assert sliding_rate(m, m.flow['valve', 'out', 0], disjunction=m.unit['valve', 0]) == pytest.approx(MIXED)


def test_a_mode_may_state_less_at_the_initial_time():
    m = scalar_ode()
    m.F = pyo.Var(m.t)

    def flow(m, t, value):
        return [m.F[t] == value] if t > 0 else []

    add_modes(m, lambda m, t: [*below(m, t), *flow(m, t, 3)], lambda m, t: [*above(m, t), *flow(m, t, 1)])
    dcs(m)
    assert sliding_rate(m, m.F[2], disjunction=m.sgn[2]) == pytest.approx(MIXED)


def test_equations_in_blocks_inside_a_disjunct_count():
    m = scalar_ode()

    @m.Disjunct(m.t)
    def low(d, t):
        d.region = pyo.Constraint(expr=m.x[t] <= 0)
        d.inner = pyo.Block()
        d.inner.ode = pyo.Constraint(expr=m.dx[t] == 3)

    @m.Disjunct(m.t)
    def high(d, t):
        d.region = pyo.Constraint(expr=m.x[t] >= 0)
        d.ode = pyo.Constraint([1], rule=lambda d, k: m.dx[t] == 1)

    @m.Disjunction(m.t)
    def sgn(m, t):
        return [m.low[t], m.high[t]]

    dcs(m)
    assert sliding_rate(m, m.dx[0]) == pytest.approx(MIXED)


def test_a_deactivated_constraint_in_a_disjunct_is_not_an_equation():
    m = scalar_ode()

    @m.Disjunct(m.t)
    def low(d, t):
        d.region = pyo.Constraint(expr=m.x[t] <= 0)
        d.old = pyo.Constraint(expr=m.dx[t] == 17)
        d.ode = pyo.Constraint(expr=m.dx[t] == 3)
        d.old.deactivate()

    @m.Disjunct(m.t)
    def high(d, t):
        d.region = pyo.Constraint(expr=m.x[t] >= 0)
        d.ode = pyo.Constraint(expr=m.dx[t] == 1)

    @m.Disjunction(m.t)
    def sgn(m, t):
        return [m.low[t], m.high[t]]

    dcs(m)
    assert sliding_rate(m, m.dx[0]) == pytest.approx(MIXED)
