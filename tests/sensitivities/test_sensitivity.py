"""Derivatives against closed forms and finite differences, and refusals where there is none."""

import numpy as np
import oscillator
import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
from benchmarks.sensitivities.cases import controlled, overflowing, ramp, solved
from pyomo.gdp import Disjunction
from pyomo.mpec import Complementarity, complements
from scipy.linalg import expm

import pyomo_fesd
from pyomo_fesd import FesdError, sensitivity, switches

GRAVITY = 9.81


@pytest.mark.parametrize('seed', range(4))
def test_crossing_of_a_surface(seed):
    # x(1) = surface + fast (1 - t_s),  t_s = (surface - x0)/slow
    share, x0, slow, fast = np.random.default_rng(seed).uniform([0.2, -1, 0.5, 0.2], [0.8, 1, 4, 5])
    surface = x0 + slow * share
    m = solved(ramp(x0, surface, slow, fast), nfe=4, ncp=2)
    found = sensitivity(m, [m.x[0], m.surface, m.slow, m.fast], [m.x[1], *switches(m)])
    of_time = np.array([-1, 1, -share, 0]) / slow
    assert found.to_numpy()[1] == pytest.approx(of_time, abs=1e-9)
    assert found.loc['x[1]'].to_numpy() == pytest.approx([0, 1, 0, 1 - share] - fast * of_time, abs=1e-9)


def test_saltation_matrix_of_the_oscillator():
    m, _ = oscillator.solve(12, 5, 'LAGRANGE-RADAU')
    end, t_s = m.t.last(), oscillator.SWITCH
    found = sensitivity(m, [m.x[0, 1], m.x[0, 2]], {'x1': m.x[end, 1], 'x2': m.x[end, 2]})
    before, after = np.array(oscillator.A_INSIDE), np.array(oscillator.A_OUTSIDE)
    x = expm(before * t_s) @ oscillator.X0
    saltation = np.eye(2) + np.outer((after - before) @ x, x) / (x @ before @ x)
    assert found.to_numpy() == pytest.approx(expm(after * (end - t_s)) @ saltation @ expm(before * t_s), abs=1e-4)


def test_impacts_of_a_bouncing_ball():
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 1.2))
    m.e = pyo.Param(initialize=0.8, mutable=True)
    m.q, m.v = pyo.Var(m.t, initialize=0.8), pyo.Var(m.t, initialize=0)
    m.dq, m.dv = dae.DerivativeVar(m.q), dae.DerivativeVar(m.v)
    m.q[0].fix(0.8)
    m.v[0].fix(0)
    m.kinematics = pyo.Constraint(m.t, rule=lambda m, t: m.dq[t] == m.v[t])
    m.fall = pyo.Constraint(m.t, rule=lambda m, t: m.dv[t] == -GRAVITY)
    m.impact = pyomo_fesd.state_jump(m.t, guard=lambda m, t: m.q[t], reset=lambda m, t: [(m.v[t], -m.e * m.v[t])])
    solved(m, nfe=8, ncp=2)

    def exact(q, e):
        first = np.sqrt(2 * q / GRAVITY)
        second, speed = first * (1 + 2 * e), e**2 * GRAVITY * first
        since = 1.2 - second
        return np.array([speed * since - GRAVITY * since**2 / 2, speed - GRAVITY * since, first, second])

    found = sensitivity(m, [m.q[0], m.e], [m.q[1.2], m.v[1.2], *switches(m)])
    eps = 1e-6
    by_q, by_e = exact(0.8 + eps, 0.8) - exact(0.8 - eps, 0.8), exact(0.8, 0.8 + eps) - exact(0.8, 0.8 - eps)
    assert found.to_numpy() == pytest.approx(np.column_stack([by_q, by_e]) / (2 * eps), abs=1e-7)


def test_overflow_time_of_a_tank():
    m = solved(overflowing(2.0, 0.5, 1.5), nfe=6, ncp=3)
    found = sensitivity(m, [m.F, m.k, m.most], [*switches(m), m.V[2], m.w[2]]).to_numpy()
    F, k, most = 2.0, 0.5, 1.5
    rest = 1 - k * most / F
    t_o = -np.log(rest) / k
    assert found[0] == pytest.approx([-most / F**2 / rest, -t_o / k + most / F / k / rest, 1 / F / rest], abs=1e-4)
    assert found[1:] == pytest.approx(np.array([[0, 0, 1], [1, -most, -k]]), abs=1e-7)


def by_differences(m, parameters, outputs, eps=1e-4):
    """Central finite differences of certified solutions."""
    solver = pyo.SolverFactory('mpec_hybrid')
    solver.set_instance(m, parameters)

    def at(p, value):
        p.set_value(value)
        assert solver.solve(m, warm_start=True).solver.termination_condition == 'optimal'
        return np.array([*map(pyo.value, outputs), *(s.time for s in switches(m))])

    columns = []
    for p in parameters:
        now = pyo.value(p)
        columns.append((at(p, now + eps) - at(p, now - eps)) / (2 * eps))
        at(p, now)
    return np.column_stack(columns)


@pytest.mark.parametrize('upper', [2.0, -0.1])
def test_optimal_control_agrees_with_finite_differences(upper):
    m = controlled(upper)
    parameters = [m.surface, m.goal, m.most, m.x[0]]
    outputs = [m.x[2], m.u[1], m.u[2], m.cost, m.miss, m.x[2] * m.goal]
    found = sensitivity(m, parameters, [*outputs, *switches(m)])
    assert found.columns.tolist() == ['surface', 'goal', 'most', 'x[0]']
    assert found.to_numpy() == pytest.approx(by_differences(m, parameters, outputs), abs=1e-6)
    assert found.loc["u[1]", "most"] == pytest.approx(float(upper < 0), abs=1e-9)


def test_the_model_is_as_it_was():
    m = solved(ramp(-1.0, 0.0, 2.0, 1.0), nfe=4, ncp=2)
    before = {v.name: (v.value, v.fixed) for v in m.component_data_objects(pyo.Var)}
    sensitivity(m, m.x[0], m.x)
    assert before == {v.name: (v.value, v.fixed) for v in m.component_data_objects(pyo.Var)}


def static(a, b, sense=pyo.minimize):
    """min (x - a)^2 + (y - b)^2, 0 <= x perp y >= 0."""
    m = pyo.ConcreteModel()
    m.a, m.b = pyo.Param(initialize=a, mutable=True), pyo.Param(initialize=b, mutable=True)
    m.x, m.y = pyo.Var(bounds=(0, None), initialize=0.5), pyo.Var(bounds=(0, None), initialize=0.5)
    m.c = Complementarity(expr=complements(m.x >= 0, m.y >= 0))
    m.o = pyo.Objective(expr=sense * ((m.x - m.a) ** 2 + (m.y - m.b) ** 2), sense=sense)
    pyo.SolverFactory('mpec_hybrid').solve(m)
    return m


@pytest.mark.parametrize('sense', [pyo.minimize, pyo.maximize])
def test_pairs_without_time(sense):
    m = static(2, 1, sense)
    found = sensitivity(m, [m.a, m.b], [m.x, m.y, m.o]).to_numpy()
    assert found == pytest.approx(np.array([[1, 0], [0, 0], [0, 2 * sense]]), abs=1e-8)


def test_a_biactive_pair_with_positive_multipliers_stays():
    m = static(-1, -1)
    assert sensitivity(m, [m.a, m.b], [m.x, m.y, m.o]).to_numpy() == pytest.approx(np.array([[0, 0], [0, 0], [-2, -2]]), abs=1e-8)


def test_refuses_without_strict_complementarity():
    m = static(0, 0)
    for p, v in ((m.a, m.x), (m.b, m.y)):
        with pytest.raises(FesdError, match='strict complementarity'):
            sensitivity(m, p, v)
    # exactly at the bound that only just holds: one-sided derivatives differ
    m = controlled(2.0)
    m.most.set_value(m.u[1].value)
    with pytest.raises(FesdError, match='strict complementarity'):
        sensitivity(m, m.most, m.u[1])


def pair_of_ramps(delay):
    """Two states that reach the surface 0 one ``delay`` after the other, or together; each is then driven by the other."""
    m = pyo.ConcreteModel()
    m.t, m.i = dae.ContinuousSet(bounds=(0, 2)), pyo.RangeSet(2)
    m.x = pyo.Var(m.t, m.i, initialize=-1)
    m.dx = dae.DerivativeVar(m.x)
    m.x[0, 1].fix(-1)
    m.x[0, 2].fix(-1 - delay)
    rule = lambda m, t, i: [[m.x[t, i] <= 0, m.dx[t, i] == 1], [m.x[t, i] >= 0, m.dx[t, i] == 2 + m.x[t, 3 - i]]]  # noqa: E731
    m.s = Disjunction(m.t, m.i, rule=rule)
    return solved(m, nfe=6, ncp=2)


def test_refuses_switches_that_coincide():
    m = pair_of_ramps(0.0)
    with pytest.raises(FesdError, match='contradict each other'):
        sensitivity(m, m.x[0, 1], m.x[2, 1])


def touching(x0):
    """x falls and rises again, with its minimum x0 - 1 at time 1."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2))
    m.c = pyomo_fesd.clock(m.t)
    m.x, m.y = pyo.Var(m.t, initialize=1), pyo.Var(m.t, initialize=0)
    m.dx, m.dy = dae.DerivativeVar(m.x), dae.DerivativeVar(m.y)
    m.x[0].fix(x0)
    m.y[0].fix(0)
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == 2 * (m.c[t] - 1))
    m.s = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 0, m.dy[t] == 1], [m.x[t] >= 0, m.dy[t] == 0]])
    return solved(m, nfe=6, ncp=2)


def test_refuses_a_surface_that_is_only_touched():
    m = touching(1.0)
    with pytest.raises(FesdError, match='strict complementarity|contradict'):
        sensitivity(m, m.x[0], m.y[2])
    m = touching(0.75)  # below for 1 = 2 sqrt(1 - x0) time units
    assert sensitivity(m, m.x[0], m.y[2]).iloc[0, 0] == pytest.approx(-2.0, abs=1e-8)


def test_refuses_an_output_that_is_not_determined():
    m = pyo.ConcreteModel()
    m.p = pyo.Param(initialize=1.0, mutable=True)
    m.x, m.y, m.z = pyo.Var(initialize=0.5), pyo.Var(initialize=0.5), pyo.Var(initialize=0.0)
    m.e = pyo.Constraint(expr=m.x + m.y == m.p)
    with pytest.raises(FesdError, match='do not determine it'):
        sensitivity(m, m.p, m.x)
    with pytest.raises(FesdError, match='no active constraint contains'):
        sensitivity(m, m.p, m.z)
    assert sensitivity(m, m.p, m.x + m.y).iloc[0, 0] == pytest.approx(1.0)


def test_refuses_values_that_are_no_solution():
    m = solved(ramp(-1.0, 0.0, 2.0, 1.0), nfe=4, ncp=2)
    m.x[0].fix(-0.9)
    with pytest.raises(FesdError, match='no certified solution'):
        sensitivity(m, m.x[0], m.x[1])


def test_refuses_what_is_no_parameter_and_no_output():
    m = static(2, 1)
    with pytest.raises(FesdError, match='not a parameter'):
        sensitivity(m, m.x, m.y)
    with pytest.raises(FesdError, match='not an output'):
        sensitivity(m, m.a, 'x')
