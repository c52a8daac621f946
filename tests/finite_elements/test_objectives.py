"""Objectives that were changed after their declaration stay changed, with the integrals over the elements."""

import pyomo.dae as dae
import pyomo.environ as pyo
import pytest

import pyomo_fesd  # noqa: F401  registers the transformations

WEIGHT = 5.0


def ramps():
    """x' = s, x(0) = 0 for s = 1, 2 on [0, 1], and the integrals of x^2, s^2/3, by which the cost is declared."""
    m = pyo.ConcreteModel()
    m.t, m.s = dae.ContinuousSet(bounds=(0, 1)), pyo.Set(initialize=[1, 2])
    m.x = pyo.Var(m.s, m.t)
    m.dx = dae.DerivativeVar(m.x, wrt=m.t)
    m.rate = pyo.Constraint(m.s, m.t, rule=lambda m, s, t: m.dx[s, t] == s)
    m.each = dae.Integral(m.s, m.t, wrt=m.t, rule=lambda m, s, t: m.x[s, t] ** 2)
    m.first = dae.Integral(m.t, wrt=m.t, rule=lambda m, t: m.x[1, t] ** 2)
    m.cost = pyo.Objective(expr=m.first)
    return m


def discretised(m):
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, wrt=m.t, nfe=2, ncp=3)
    for s, t in m.x:
        m.x[s, t].set_value(s * t)
    return m


@pytest.mark.parametrize(
    'state, value',
    [
        (lambda m: None, 1 / 3),
        (lambda m: m.cost.set_value(WEIGHT * m.cost.expr), WEIGHT / 3),
        (lambda m: m.cost.set_value(m.first + WEIGHT * m.each[2]), 1 / 3 + WEIGHT * 4 / 3),
        (lambda m: m.cost.set_value(WEIGHT * m.x[2, 1]), WEIGHT * 2),
        (lambda m: m.cost.set_value(WEIGHT), WEIGHT),
    ],
    ids=['as declared', 'weighted', 'with an indexed integral', 'without an integral', 'a number'],
)
def test_a_changed_objective_stays_changed(state, value):
    m = ramps()
    state(m)
    assert pyo.value(discretised(m).cost) == pytest.approx(value)


def test_a_changed_sense_stays_changed():
    m = ramps()
    m.cost.sense = pyo.maximize
    assert discretised(m).cost.sense == pyo.maximize


def test_one_of_several_objectives_is_changed():
    m = ramps()
    m.costs = pyo.Objective(m.s, rule=lambda m, s: m.each[s])
    m.costs.deactivate()
    m.costs[2].set_value(WEIGHT * m.each[2])
    m = discretised(m)
    assert [pyo.value(m.costs[s].expr) for s in m.s] == pytest.approx([1 / 3, WEIGHT * 4 / 3])
