"""A second ContinuousSet: switches at every point of a rod, each at its own time."""

import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
from pyomo.core.expr.visitor import identify_variables
from pyomo.gdp import Disjunction

import pyomo_fesd

END = 2.0


def start(x):
    """Temperature of the rod at the first time."""
    return 0.4 + x


def rod():
    """u falls with rate 1 down to 0 and stays there; w is its slope in space.

    The exact solution is u(t, x) = max(0, 0.4 + x - t): it is 0 from t = 0.4 + x on.
    """
    m = pyo.ConcreteModel()
    m.t, m.x = dae.ContinuousSet(bounds=(0, END)), dae.ContinuousSet(bounds=(0, 1))
    m.u, m.w = pyo.Var(m.t, m.x, initialize=lambda m, t, x: start(x)), pyo.Var(m.t, m.x, initialize=1)
    m.ut, m.ux = dae.DerivativeVar(m.u, wrt=m.t), dae.DerivativeVar(m.u, wrt=m.x)
    m.slope = pyo.Constraint(m.t, m.x, rule=lambda m, t, x: pyo.Constraint.Skip if x == 0 else m.w[t, x] == m.ux[t, x])
    m.first = pyo.Constraint(m.x, rule=lambda m, x: m.u[0, x] == start(x))
    return m


def add_friction(m):
    m.friction = Disjunction(m.t, m.x, rule=lambda m, t, x: [[m.u[t, x] >= 0, m.ut[t, x] == -1], [m.u[t, x] <= 0, m.ut[t, x] == 1]])
    return m


def discretise_space(m):
    pyo.TransformationFactory('dae.finite_difference').apply_to(m, wrt=m.x, nfe=2, scheme='BACKWARD')
    return m


def move(m, **options):
    pyo.TransformationFactory('fesd.dcs').apply_to(m, wrt=m.t)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, wrt=m.t, **options)
    return m


@pytest.mark.parametrize('discretised', [False, True])
def test_each_point_switches_at_its_own_time(discretised):
    m = discretise_space(rod())
    if discretised:
        pyo.TransformationFactory('dae.collocation').apply_to(m, wrt=m.t, nfe=8, ncp=2)
        move(add_friction(m))
    else:
        move(add_friction(m), nfe=8, ncp=2)
    results = pyo.SolverFactory('mpec_hybrid').solve(m)
    assert results.solver.stationarity == 'B'
    assert [s.time for s in pyomo_fesd.switches(m, m.t)] == pytest.approx([0.4, 0.9, 1.4], abs=1e-8)
    assert [m.u[END, x].value for x in m.x] == pytest.approx([0, 0, 0], abs=1e-8)
    # the slope between 0.5 and 1 where only the left of them has arrived: u(1) / 0.5 at the time of the first point's arrival
    times = pyomo_fesd.physical_time(m, m.t)
    exact = {t: (max(0, 1.4 - times[t]) - max(0, 0.9 - times[t])) / 0.5 for t in m.t}
    assert [m.w[t, 1].value for t in m.t] == pytest.approx([exact[t] for t in m.t], abs=1e-7)


def test_every_discretisation_equation_moves():
    m = move(add_friction(discretise_space(rod())), nfe=2, ncp=2)
    grid = m.component('_pyomo_fesd_elements_t')
    assert len(m.ut_disc_eq) == 2 * 2 * 3
    for equation in m.ut_disc_eq.values():
        assert any(v.parent_component() is grid.r for v in identify_variables(equation.expr))


def test_space_that_waits_is_refused_and_nothing_has_changed():
    m = rod()
    before = len(m.t), [c.name for c in m.component_objects()]
    with pytest.raises(pyomo_fesd.FesdError, match="^x: it is not discretised yet, and 'ux' is over 't' as well"):
        pyo.TransformationFactory('fesd.finite_elements').apply_to(m, wrt=m.t, nfe=2, ncp=2)
    assert (len(m.t), [c.name for c in m.component_objects()]) == before


def test_a_profile_that_does_not_depend_on_time_may_wait():
    m = pyo.ConcreteModel()
    m.t, m.x = dae.ContinuousSet(bounds=(0, END)), dae.ContinuousSet(bounds=(0, 1))
    m.u, m.v = pyo.Var(m.t, initialize=1), pyo.Var(m.x)
    m.ut, m.vx = dae.DerivativeVar(m.u), dae.DerivativeVar(m.v)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, wrt=m.t, nfe=2, ncp=2)
    assert len(m.t) == 5 and len(m.x) == 2
