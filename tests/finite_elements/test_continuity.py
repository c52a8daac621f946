"""Which variables are continuous in time: found from the equations, or told."""

import numpy as np
import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyomo.core.expr.visitor import identify_variables
from pyomo.mpec import Complementarity, complements

import pyomo_fesd
from pyomo_fesd import FesdError
from pyomo_fesd.core import add_positive_part, declare_positive_part
from pyomo_fesd.core.complementarity import read_complementarity
from pyomo_fesd.core.time_index import TimeIndex
from pyomo_fesd.finite_elements import algebraic_graph as module
from pyomo_fesd.finite_elements.continuity import read_continuity
from pyomo_fesd.finite_elements.expansion import discretise
from tests.models import dcs
from tests.problems import setpoint, weir
from tests.problems.running import LEGENDRE, RADAU, SCHEMES, move, seen, solve


def plant(points=(0, 2), scheme=RADAU):
    """Two states x and w, algebraic variables a, b, c and an input u over time, no equations yet; two elements."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=points)
    m.x, m.w = pyo.Var(m.t, initialize=1), pyo.Var(m.t, initialize=1)
    m.dx, m.dw = dae.DerivativeVar(m.x), dae.DerivativeVar(m.w)
    for name in 'abcu':
        m.add_component(name, pyo.Var(m.t, initialize=1))
    pyo.TransformationFactory('dae.collocation').apply_to(m, wrt=m.t, nfe=2, ncp=2, scheme=scheme)
    return m


def found(m, held=(), told=(), at=None):
    """What is continuous at one time, the first inner one if none is given."""
    at = list(m.t)[1] if at is None else at
    return read_continuity(m, TimeIndex(m.t), {at}, list(held), list(told), trace=True)


def equation(m, name, rule):
    m.add_component(name, pyo.Constraint(m.t, rule=rule))


def continuous(m, *names, held=(), told=()):
    """Which of these variables are continuous inside stages, and which at their boundaries too."""
    at = list(m.t)[1]
    c = found(m, held, told)
    inside = {n for n in names if c.holds(m.component(n)[at])}
    return inside, {n for n in inside if not c.jumps_at_stages(m.component(n)[at])}


# Found from the equations


def test_states_are_continuous_and_their_rates_are_not():
    m = plant()
    equation(m, 'ode', lambda m, t: m.dx[t] == m.u[t])
    assert continuous(m, 'x', 'w', 'dx', 'u', 'a') == ({'x', 'w'}, {'x', 'w'})


def test_a_rate_that_equations_tie_to_states_is_continuous():
    m = plant()
    equation(m, 'ode', lambda m, t: m.dx[t] == -m.x[t])
    assert 'dx' in continuous(m, 'dx')[0]


def test_a_chain_of_equations_is_followed():
    m = plant()
    equation(m, 'first', lambda m, t: m.a[t] == 2 * m.x[t])
    equation(m, 'second', lambda m, t: m.b[t] * m.a[t] == m.w[t])
    assert continuous(m, 'a', 'b', 'c')[0] == {'a', 'b'}


def test_coupled_equations_are_solved_together():
    m = plant()
    equation(m, 'sum', lambda m, t: m.a[t] + m.b[t] == m.x[t])
    assert continuous(m, 'a', 'b')[0] == set()
    equation(m, 'difference', lambda m, t: m.a[t] - m.b[t] == m.w[t])
    assert continuous(m, 'a', 'b')[0] == {'a', 'b'}


def test_one_equation_with_two_unknowns_ties_neither():
    m = plant()
    equation(m, 'sum', lambda m, t: m.a[t] + m.u[t] == m.x[t])
    equation(m, 'next', lambda m, t: m.b[t] == m.a[t])
    equation(m, 'other', lambda m, t: m.c[t] == m.x[t])
    assert continuous(m, 'a', 'b', 'c', 'u')[0] == {'c'}


def test_inequalities_and_inactive_equations_tie_nothing():
    m = plant()
    equation(m, 'bound', lambda m, t: m.a[t] >= m.x[t])
    equation(m, 'off', lambda m, t: m.b[t] == m.x[t])
    m.off.deactivate()
    assert continuous(m, 'a', 'b')[0] == set()


def test_an_expression_is_continuous_if_all_its_variables_are():
    m = plant()
    c, t = found(m), list(m.t)[1]
    assert c.holds(m.x[t] * m.w[t]) and c.holds(pyo.exp(-m.x[t]))
    assert not c.holds(m.x[t] + m.u[t]) and not c.holds(5) and not c.holds(5.0 * 1)


def test_variables_in_blocks_over_time_are_followed_too():
    m = plant()

    @m.Block(m.t)
    def b(b, t):
        b.y = pyo.Var(initialize=0)
        b.tie = pyo.Constraint(expr=b.y == b.model().x[t] ** 2)

    c, t = found(m), list(m.t)[1]
    assert c.holds(m.b[t].y)


RANDOM = plant()


@settings(max_examples=80, deadline=None)
@given(st.lists(st.lists(st.booleans(), min_size=5, max_size=5), min_size=1, max_size=5), st.integers(0, 10**6))
def test_tied_are_just_the_variables_that_the_equations_determine(pattern, seed):
    # the columns are x, a, b, c, u of one time, x known; coefficients are random, so that rank is a matter of the pattern
    m, t = RANDOM, list(RANDOM.t)[1]
    A = np.random.default_rng(seed).uniform(1, 2, (len(pattern), 5)) * np.array(pattern)
    for k in range(5):
        m.del_component(f'row{k}')
    for k, row in enumerate(A):
        if row[1:].any():
            body = sum(f * v[t] for f, v in zip(row, (m.x, m.a, m.b, m.c, m.u)) if f)
            m.add_component(f'row{k}', pyo.Constraint([t], rule=lambda m, t, body=body: body == 0))
    unknown = A[:, 1:]
    c = read_continuity(m, EveryIndexIsTime(m.t), {t}, [], [], trace=True)
    for k, v in enumerate((m.a, m.b, m.c, m.u)):
        e = np.eye(4)[k]
        determined = np.linalg.matrix_rank(np.vstack([unknown, e])) == np.linalg.matrix_rank(unknown)
        assert c.holds(v[t]) == determined


class EveryIndexIsTime(TimeIndex):
    """Lets the constraints of the random systems, which stand at one time only, count as constraints over time."""

    def _read_place(self, component):
        return super()._read_place(component)._replace(position=0 if component.is_indexed() else None)


# At which time


def test_only_equations_of_one_time_are_read(monkeypatch):
    m = plant()
    equation(m, 'tie', lambda m, t: m.a[t] == 2 * m.x[t])
    bodies = []
    monkeypatch.setattr(module, 'identify_variables', lambda e, **k: bodies.append(e) or identify_variables(e, **k))
    found(m)
    assert len(bodies) == 1


def warned(caplog):
    return [r.message.split(':')[0] for r in caplog.records if 'continuous in time' in r.message]


@pytest.mark.parametrize('discretised', [False, True])
def test_a_condition_that_begins_late_is_recognised_too(discretised, caplog):
    m = weir.build(level='algebraic')
    m.del_component(m.overflow)
    if discretised:
        pyo.TransformationFactory('dae.collocation').apply_to(m, wrt=m.t, nfe=4, ncp=1)
    m.overflow = Complementarity(
        m.t, rule=lambda m, t: Complementarity.Skip if t <= 1 else complements(2 * weir.V_MAX - m.h[t] >= 0, m.F[t] >= 0)
    )
    move(m, 4, 1)
    assert warned(caplog) == []
    pair = m.component('_pyomo_fesd_elements_t').cross['overflow', 4]
    assert labels_of(read_complementarity(pair).H, m.h) == [1.5, 2.0]


def labels_of(expr, component):
    return sorted(v.index() for v in identify_variables(expr) if v.parent_component() is component)


def test_conditions_that_begin_at_different_times_are_asked_each_at_its_own(caplog):
    m = weir.build(level='coupled')
    m.late = Complementarity(
        m.t, rule=lambda m, t: Complementarity.Skip if t <= 1 else complements(m.foam[t] + 1 >= 0, m.F[t] + 1 >= 0)
    )
    move(m, 4, 2)
    assert warned(caplog) == []


# Held controls and given inputs


def test_a_held_control_is_continuous_inside_a_stage_and_jumps_at_its_end():
    m = plant()
    assert continuous(m, 'u', held=[m.u]) == ({'u'}, set())


def test_what_follows_from_a_held_control_jumps_with_it():
    m = plant()
    equation(m, 'first', lambda m, t: m.a[t] == m.u[t] + m.x[t])
    equation(m, 'second', lambda m, t: m.b[t] == 2 * m.a[t])
    equation(m, 'third', lambda m, t: m.c[t] == 2 * m.x[t])
    assert continuous(m, 'a', 'b', 'c', held=[m.u]) == ({'a', 'b', 'c'}, {'c'})


def test_an_input_that_is_fixed_is_continuous_inside_a_stage():
    m = plant()
    m.u.fix(3)
    equation(m, 'tie', lambda m, t: m.a[t] == m.u[t] * m.x[t])
    assert continuous(m, 'a', 'u') == ({'a', 'u'}, {'a', 'u'})
    m.u[2].fix(4)
    assert continuous(m, 'a', 'u') == ({'a', 'u'}, set())


def test_a_param_is_continuous_inside_a_stage_and_at_its_end_if_it_does_not_change():
    m = plant()
    m.p = pyo.Param(m.t, initialize=2.0, mutable=True)
    equation(m, 'tie', lambda m, t: m.a[t] == m.p[t] * m.x[t])
    equation(m, 'alone', lambda m, t: m.b[t] == m.p[t])
    assert continuous(m, 'a', 'b') == ({'a', 'b'}, {'a', 'b'})
    m.p[2] = 3.0
    assert continuous(m, 'a', 'b') == ({'a', 'b'}, set())


@pytest.mark.parametrize('scheme', SCHEMES)
def test_a_mode_may_change_at_a_stage_boundary_because_of_what_follows_from_a_control(scheme):
    m = setpoint.build(handed_on=True)
    solve(move(dcs(m), 4, 2, scheme=scheme, piecewise_constant=[m.u]))
    assert m.x[1].value == pytest.approx(setpoint.MIDDLE, abs=1e-9)
    assert m.x[2].value == pytest.approx(setpoint.FINAL, abs=1e-9)
    (switch,) = pyomo_fesd.switches(m)
    assert switch.time == pytest.approx(setpoint.SWITCH, abs=1e-9)


@pytest.mark.parametrize('given', ['Param', 'Var'])
def test_inputs_that_are_given_time_by_time_may_change_the_mode_at_a_stage_boundary_too(given):
    m = setpoint.build_given() if given == 'Param' else setpoint.build()
    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    fill = (lambda t, value: m.p[t].set_value(value)) if given == 'Param' else (lambda t, value: m.u[t].fix(value))
    discretise(m, m.t, [2, 2], 2, RADAU)
    for t in m.t:
        fill(t, setpoint.SETPOINTS[0 if t <= 1 else 1])
    solve(move(m, stages=[1]))
    assert m.x[2].value == pytest.approx(setpoint.FINAL, abs=1e-9)
    assert pyomo_fesd.switches(m)[0].time == pytest.approx(setpoint.SWITCH, abs=1e-9)


def test_a_hand_written_side_with_a_held_control_does_not_reach_into_the_next_stage(caplog):
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=[0, 1, 2])
    m.V, m.F = pyo.Var(m.t, initialize=0), pyo.Var(m.t, bounds=(0, None), initialize=0)
    m.height = pyo.Var(m.t, initialize={1: 0.5, 2: 0.75})
    m.dV = dae.DerivativeVar(m.V)
    m.V[0].fix(0)
    for t in (1, 2):
        m.height[t].fix()
    m.balance = pyo.Constraint(m.t, rule=lambda m, t: m.dV[t] == 1 - m.F[t])
    m.overflow = Complementarity(m.t, rule=lambda m, t: complements(m.height[t] - m.V[t] >= 0, m.F[t] >= 0))
    solve(move(m, 6, 2, piecewise_constant=[m.height]))
    assert warned(caplog) == []
    assert [s.time for s in pyomo_fesd.switches(m)] == pytest.approx([0.5, 1.0, 1.25], abs=1e-9)
    assert m.V[2].value == pytest.approx(0.75, abs=1e-9)


# Kinks


def positive_part(m, name, z):
    """A kink s = max(0, z(t)) over time, on a block of its own."""
    m.add_component(name, pyo.Block())
    block = m.component(name)
    declare_positive_part(block, m.t)
    for t in m.t:
        add_positive_part(block, (t,), z(t))
    return block.s


def test_a_kink_of_a_state_is_continuous():
    m = plant()
    s = positive_part(m, 'one', lambda t: m.x[t] - 1)
    c, t = found(m), list(m.t)[1]
    assert c.holds(s[t]) and c.holds(s[t] - m.x[t]) and not c.jumps_at_stages(s[t])


def test_kinks_and_equations_are_followed_through_each_other():
    m = plant()
    inner = positive_part(m, 'inner', lambda t: m.x[t] - 1)
    equation(m, 'tie', lambda m, t: m.a[t] == 2 * inner[t])
    outer = positive_part(m, 'outer', lambda t: m.a[t] - m.w[t])
    equation(m, 'next', lambda m, t: m.b[t] == outer[t] + m.c[t])
    c, t = found(m), list(m.t)[1]
    assert c.holds(outer[t]) and c.holds(m.a[t]) and not c.holds(m.b[t])


def test_a_kink_of_what_jumps_jumps():
    m = plant()
    s = positive_part(m, 'one', lambda t: m.x[t] - m.u[t])
    c, t = found(m), list(m.t)[1]
    assert not c.holds(s[t])
    held = found(m, held=[m.u])
    assert held.holds(s[t]) and held.jumps_at_stages(s[t])


# Told


def test_what_is_told_is_continuous_and_so_is_what_follows_from_it():
    m = plant()
    equation(m, 'tie', lambda m, t: m.a[t] + m.u[t] == m.x[t])
    assert continuous(m, 'a', 'u', told=[m.a]) == ({'a', 'u'}, {'a', 'u'})


def test_a_reference_into_blocks_can_be_told(caplog):
    m = weir.build()
    m.del_component(m.overflow)

    @m.Block(m.t)
    def crest(b, t):
        b.foam = pyo.Var(initialize=0)

    m.foam = pyo.Reference(m.crest[:].foam)
    m.overflow = Complementarity(m.t, rule=lambda m, t: complements(weir.V_MAX - m.V[t] - m.foam[t] >= 0, m.F[t] >= 0))
    move(m.clone(), 4, 2)
    assert warned(caplog) == ['overflow']
    caplog.clear()
    move(m, 4, 2, continuous=[m.foam])
    assert warned(caplog) == []


@pytest.mark.parametrize(
    'wrong, message',
    [
        (lambda m: 'F', 'F: continuous: not a Var'),
        (lambda m: m.size, 'size: continuous: not a Var'),
        (lambda m: m.balance, 'balance: continuous: not a Var'),
        (lambda m: m.F[0], 'continuous: not a Var'),
    ],
    ids=['name', 'no time', 'equation', 'one time'],
)
def test_what_cannot_be_continuous_in_time_is_refused(wrong, message):
    m = weir.build()
    m.size = pyo.Var()
    before = seen(m)
    with pytest.raises(FesdError, match=message):
        move(m, 4, 2, continuous=wrong(m))
    assert seen(m) == before


def test_what_is_held_cannot_be_continuous():
    m = weir.build()
    with pytest.raises(FesdError, match='^F: continuous: it is held on each control stage'):
        move(m, 4, 2, continuous=m.F, piecewise_constant=m.F)


# Curved


@pytest.mark.parametrize(
    'side, curved',
    [
        (lambda m, t: m.x[t] - 1, False),
        (lambda m, t: m.x[t] ** 2 - 1, True),
        (lambda m, t: m.a[t], False),
        (lambda m, t: m.b[t], True),
        (lambda m, t: m.a[t] + m.b[t], True),
    ],
)
def test_a_side_is_curved_if_it_or_what_it_follows_from_is(side, curved):
    m = plant(scheme=LEGENDRE)
    equation(m, 'line', lambda m, t: m.a[t] == 2 * m.x[t] + m.w[t])
    equation(m, 'product', lambda m, t: m.c[t] == m.x[t] * m.w[t])
    equation(m, 'next', lambda m, t: m.b[t] == m.c[t] - 1)
    equation(m, 'flow', lambda m, t: m.dw[t] == pyo.sqrt(m.a[t]))  # uses a, but does not define it
    assert found(m).curved(side(m, list(m.t)[1])) is curved
