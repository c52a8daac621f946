"""State jumps: guards, resets and their errors."""

import pyomo.dae as dae
import pyomo.environ as pyo
import pytest

import pyomo_fesd
from pyomo_fesd import FesdError
from pyomo_fesd.core import switched_systems
from pyomo_fesd.finite_elements.state_jumps import read_jumps
from tests.models import scalar_ode


def law(m, guard=lambda m, t: m.x[t], reset=lambda m, t: [(m.x[t], 1 - m.y[t])]):
    """One law over time."""
    return pyomo_fesd.state_jump(m.t, guard=guard, reset=reset)


def test_guard_and_values_after_stand_on_a_block_over_time():
    m = scalar_ode(discretised=True)
    m.hit = law(m)
    assert set(m.hit) == set(m.t)
    assert str(m.hit[0].guard.expr) == 'x[0]'
    (entry,) = switched_systems(m.hit[0]).resets
    ((state, after),) = entry.resets
    assert entry.guard is m.hit[0].guard
    assert state is m.x[0] and str(after.expr) == '1 - y[0]'


def test_the_guard_is_a_trajectory():
    m = scalar_ode(discretised=True)
    m.hit = law(m)
    m.x[...].set_value(3)
    assert set(pyomo_fesd.trajectory(m)['hit.guard']) == {3}


def test_rules_get_the_parent_block_and_all_indices():
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 1))
    m.b = pyo.Block([1, 2])
    for k in (1, 2):
        m.b[k].x = pyo.Var(['u', 'w'], m.t, initialize=k)
        m.b[k].dx = dae.DerivativeVar(m.b[k].x, wrt=m.t)
        m.b[k].hit = pyomo_fesd.state_jump(
            ['u', 'w'], m.t, guard=lambda b, i, t: b.x[i, t], reset=lambda b, i, t: [(b.x[i, t], 2 * b.x[i, t])]
        )
    found = {jump.name: jump for jump in read_jumps(m, m.t)}
    assert set(found) == {f'b[{k}].hit[{i}]' for k in (1, 2) for i in 'uw'}
    assert found['b[2].hit[w]'].guards[0] is m.b[2].x['w', 0]


def test_several_states_may_jump():
    m = scalar_ode()
    m.hit = law(m, reset=lambda m, t: [(m.x[t], m.y[t]), (m.y[t], m.x[t])])
    (jump,) = read_jumps(m, m.t)
    assert [(x.name, str(after)) for x, after in jump.resets[0]] == [('x[0]', 'y[0]'), ('y[0]', 'x[0]')]


def test_numbers_may_be_values_after():
    m = scalar_ode()
    m.hit = law(m, reset=lambda m, t: [(m.x[t], 5)])
    (jump,) = read_jumps(m, m.t)
    assert pyo.value(jump.resets[0][0][1]) == 5


def test_a_clone_has_its_own_law():
    m = scalar_ode()
    m.hit = law(m)
    copy = m.clone()
    (jump,) = read_jumps(copy, copy.t)
    assert jump.guards[0].model() is copy and jump.resets[0][0][0] is copy.x[0]


@pytest.mark.parametrize(
    'reset', [lambda m, t: (m.x[t], 1), lambda m, t: [m.x[t]], lambda m, t: None, lambda m, t: [], lambda m, t: {'x': 1}]
)
def test_a_reset_that_is_no_list_of_pairs_is_refused(reset):
    m = scalar_ode()
    with pytest.raises(FesdError, match=r'hit\[0\]: its reset is .*, not a list of \(state, value after\)'):
        m.hit = law(m, reset=reset)


def test_a_reset_of_an_expression_is_refused():
    m = scalar_ode()
    with pytest.raises(FesdError, match=r'hit\[0\]: its reset is'):
        m.hit = law(m, reset=lambda m, t: [(2 * m.x[t], 1)])


@pytest.mark.parametrize('guard', [lambda m, t: m.x[t] >= 0, lambda m, t: None])
def test_a_guard_that_is_no_expression_is_refused(guard):
    m = scalar_ode()
    with pytest.raises(FesdError, match=r'hit\[0\]: its guard is .*, not an expression') as error:
        m.hit = law(m, guard=guard)
    assert 'c for the condition c >= 0' in error.value.fix


def test_a_state_twice_in_one_law_is_refused():
    m = scalar_ode()
    with pytest.raises(FesdError, match=r"hit\[0\]: 'x\[0\]' is reset twice"):
        m.hit = law(m, reset=lambda m, t: [(m.x[t], 1), (m.x[t], 2)])
