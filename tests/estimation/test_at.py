"""States at physical times against closed forms; refusals."""

import numpy as np
import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
from pyomo.gdp import Disjunction

import pyomo_fesd
from pyomo_fesd import FesdError, at
from pyomo_fesd.core import moving_grids

#: x0 = -2, dx = 3 below 0, 1 above: x reaches 0 at 2/3.
EXACT = {0.0: -2.0, 0.1: -1.7, 0.5: -0.5, 2 / 3: 0.0, 0.68: 0.68 - 2 / 3, 1.0: 1 / 3, 1.9: 1.9 - 2 / 3, 2.0: 4 / 3}


def ramp(boundaries=(0, 2), nfe=6, solve=False, **kwds):
    """dx = slope below the surface, 1 above."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=boundaries)
    m.slope, m.surface = pyo.Var(initialize=3.0, bounds=(0.5, 6)), pyo.Var(initialize=0.0, bounds=(-1, 1))
    m.slope.fix()
    m.surface.fix()
    m.x, m.z = pyo.Var(m.t, initialize=-2.0), pyo.Var(m.t, initialize=0.0)
    m.dx = dae.DerivativeVar(m.x)
    m.x[0].fix(-2)
    m.double = pyo.Constraint(m.t, rule=lambda m, t: m.z[t] == 2 * m.x[t])
    rule = lambda m, t: [[m.x[t] <= m.surface, m.dx[t] == m.slope], [m.x[t] >= m.surface, m.dx[t] == 1]]  # noqa: E731
    m.s = Disjunction(m.t, rule=rule)
    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=nfe, ncp=2, **kwds)
    return m


def found(m, times):
    """Values at ``times``, after a solve in which constraints contain them."""
    times = list(times)
    m.y = pyo.Var(range(len(times)), initialize=0.0)
    m.measured = pyo.Constraint(range(len(times)), rule=lambda m, i: m.y[i] == at(m.x, times[i]))
    results = pyo.SolverFactory('mpec_hybrid').solve(m)
    assert results.solver.termination_condition == 'optimal'
    return [m.y[i].value for i in m.y]


@pytest.mark.parametrize('scheme', ['LAGRANGE-RADAU', 'LAGRANGE-LEGENDRE'])
@pytest.mark.parametrize('boundaries', [(0, 2), (0, 0.5, 2)])
def test_agrees_with_the_closed_form(scheme, boundaries):
    m = ramp(boundaries, scheme=scheme)
    assert found(m, EXACT) == pytest.approx(list(EXACT.values()), abs=1e-8)


def test_only_the_elements_of_a_control_stage_get_shares():
    m = ramp((0, 0.5, 2), nfe=[1, 3])
    for time in (0.2, 0.5, 1.0):
        at(m.x, time)
    assert {t: list(i.shares) for t, i in moving_grids(m)[m.t].instants.items()} == {0.2: [1], 0.5: [], 1.0: [2, 3, 4]}


def test_variables_at_one_time_share_the_element():
    m = ramp()
    m.w = pyo.Var(m.t, m.t)  # another variable does not matter
    before = pyomo_fesd.report(m)['pairs']
    at(m.x, 0.3), at(m.x, 0.3)
    assert pyomo_fesd.report(m)['pairs'] == before + 5


def test_the_element_is_part_of_the_solution():
    # the surface and the slope from values on both sides of the switch; at the start both switches lie elsewhere
    m = ramp(nfe=4)
    m.slope.unfix(), m.surface.unfix()
    m.slope, m.surface = 2.0, 0.5
    times = [0.2, 0.4, 0.6, 0.9, 1.3, 1.8]
    exact = [min(-2 + 3 * t, t - 2 / 3) for t in times]
    m.misfit = pyo.Objective(expr=sum((at(m.x, t) - x) ** 2 for t, x in zip(times, exact)))
    assert pyo.SolverFactory('mpec_hybrid').solve(m).solver.stationarity == 'B'
    assert (m.slope.value, m.surface.value) == pytest.approx((3, 0), abs=1e-4)


def test_derivatives_by_the_lengths_are_exact():
    m = ramp()
    values = {t: at(m.x, t) for t in (0.3, 1.2)}
    pyo.SolverFactory('mpec_hybrid').solve(m)
    # x(t) = surface + t - t_s after the switch, t_s = (surface + 2)/slope
    exact = np.array([[0, 0.3], [1 - 1 / 3, 2 / 9]])
    assert pyomo_fesd.sensitivity(m, [m.surface, m.slope], values).to_numpy() == pytest.approx(exact, abs=1e-8)


def test_simulate_sets_the_shares_and_clones_have_their_own():
    m = ramp()
    m.y = pyo.Var(initialize=0.0)
    m.measured = pyo.Constraint(expr=m.y == at(m.x, 1.0))
    clone = m.clone()
    pyomo_fesd.simulate(clone)
    assert clone.y.value == pytest.approx(1 / 3, abs=1e-8)
    assert pyomo_fesd.certify(clone).certified
    assert m.y.value == 0.0


def test_slices_and_several_indices():
    m = pyo.ConcreteModel()
    m.t, m.i = dae.ContinuousSet(bounds=(0, 1)), pyo.Set(initialize=['A', 'B'])
    m.x = pyo.Var(m.t, m.i, initialize=1.0)
    m.dx = dae.DerivativeVar(m.x)
    m.x[0, :].fix(1.0)
    m.rate = {'A': 1.0, 'B': -2.0}
    m.ode = pyo.Constraint(m.t, m.i, rule=lambda m, t, i: m.dx[t, i] == {'A': 1.0, 'B': -2.0}[i])
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=3, ncp=2)
    pyomo_fesd.simulate(m)
    values = [pyo.value(at(m.x[:, i], 0.4)) for i in m.i]
    assert values == pytest.approx([1.4, 0.2], abs=1e-9)


def test_refuses_what_it_cannot_evaluate():
    m = ramp()
    for variable, time, message in (
        (m.z, 0.5, 'not a state'),
        (m.slope, 0.5, 'not a Var over one'),
        (m.x, 2.5, 'outside of'),
        (m.x, -0.5, 'outside of'),
        (m.x, m.slope, 'not a number'),
        (m.x, float('nan'), 'not a number'),
    ):
        with pytest.raises(FesdError, match=message):
            at(variable, time)
    assert not moving_grids(m)[m.t].instants


def test_refuses_states_that_jump_and_models_without_elements():
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 1))
    m.q, m.v = pyo.Var(m.t, initialize=1), pyo.Var(m.t, initialize=0)
    m.dq, m.dv = dae.DerivativeVar(m.q), dae.DerivativeVar(m.v)
    m.q[0].fix(1)
    m.v[0].fix(0)
    m.kinematics = pyo.Constraint(m.t, rule=lambda m, t: m.dq[t] == m.v[t])
    m.fall = pyo.Constraint(m.t, rule=lambda m, t: m.dv[t] == -9.81)
    m.impact = pyomo_fesd.state_jump(m.t, guard=lambda m, t: m.q[t], reset=lambda m, t: [(m.v[t], -m.v[t])])
    with pytest.raises(FesdError, match='not known yet'):
        at(m.q, 0.5)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=6, ncp=2)
    with pytest.raises(FesdError, match='may jump'):
        at(m.v, 0.5)
    pyomo_fesd.simulate(m)
    height = at(m.q, 0.6)  # the ball has bounced at sqrt(2/g) = 0.4515
    first = np.sqrt(2 / 9.81)
    assert pyo.value(height) == pytest.approx(9.81 * first * (0.6 - first) - 9.81 * (0.6 - first) ** 2 / 2, abs=1e-8)
