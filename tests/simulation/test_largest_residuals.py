"""A simulation that cannot go on names violated equations; prescribed states and static equations are taken into account."""

import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
from pyomo.mpec import Complementarity, complements

import pyomo_fesd
from pyomo_fesd.core import TimeIndex, moving_grids
from pyomo_fesd.simulation.equation_reader import EquationReader
from pyomo_fesd.simulation.largest_residuals import largest_residuals

START = 0.75e6


def drained(wall=False):
    """A tank that loses 1 per unit of time and flows out with level**0.5; after t = 0.75 no level is left.  Its scale is 1e6."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 3))
    m.tank = pyo.Block()
    m.tank.level, m.tank.flow = pyo.Var(m.t, initialize=START), pyo.Var(m.t, initialize=START**0.5)
    m.tank.rate = dae.DerivativeVar(m.tank.level, wrt=m.t)
    m.tank.level[0].fix(START)
    m.tank.balance = pyo.Constraint(m.t, rule=lambda b, t: b.rate[t] == -1e6)
    m.tank.outlet = pyo.Constraint(m.t, rule=lambda b, t: b.flow[t] ** 2 == b.level[t])
    if wall:
        # nothing would determine a reaction that no equation contains, and the wall would be left out
        m.tank.lam, m.tank.strain = pyo.Var(m.t, bounds=(0, None)), pyo.Var(m.t, initialize=0)
        m.tank.elastic = pyo.Constraint(m.t, rule=lambda b, t: b.strain[t] + 1e6 == 1e6 + 1e-9 * b.lam[t])
        m.tank.wall = Complementarity(m.t, rule=lambda b, t: complements(b.level[t] >= 0, b.lam[t] >= 0))
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=4, ncp=2)
    return m


def test_a_failed_element_names_its_time_block_and_equations():
    m = drained()
    m.tank.flow.setlb(500.0)  # at a level of 0.25e6, which is there at t = 0.5
    with pytest.raises(pyomo_fesd.FesdError) as error:
        pyomo_fesd.simulate(m)
    message = str(error.value)
    assert 'no step is possible from time 0.5; where one is forced, largest residuals in tank: tank.outlet[' in message
    assert message.index('tank.outlet') < message.index('Fix:')
    assert m.tank.level[0.75].value == pytest.approx(0.25e6, rel=1e-6)  # the values up to there


def reader(m):
    moving = moving_grids(m)[m.t]
    return moving.grid, EquationReader(m, moving, TimeIndex(m.t), ())


def let_it_run(m, rate):
    """Values that solve everything but the balance, where the rate is another."""
    for t in m.t:
        m.tank.rate[t].value, m.tank.level[t].value = rate, START + rate * t
        m.tank.flow[t].value = max(0.0, START + rate * t) ** 0.5


def message_for_the_first_element(m):
    grid, read = reader(m)
    equations = read.element(grid.elements[0], {})
    return largest_residuals(m, TimeIndex(m.t), equations, [v.value for v in equations.unknown])


def test_equations_that_hold_are_not_named():
    m = drained(wall=True)
    let_it_run(m, -1e6)
    m.tank.lam.set_values(dict.fromkeys(m.t, 0.0))
    assert message_for_the_first_element(m) == ''


def test_residuals_count_relative_to_their_terms():
    """Missed by 10 of 1e6, and by 1e-2 of 1: the second comes first."""
    m = drained()
    let_it_run(m, -1e6 + 10)
    m.tank.small = pyo.Var(m.t, initialize=1.01)
    m.tank.one = pyo.Constraint(m.t, rule=lambda b, t: b.small[t] == 1 if t == m.t.at(2) else pyo.Constraint.Skip)
    message = message_for_the_first_element(m)
    assert message.startswith('largest residuals in tank: tank.one[0.25] (0.01), tank.balance[') and '(10)' in message


def test_conditions_are_named_too():
    m = drained(wall=True)
    let_it_run(m, -1e6)
    m.tank.lam.set_values(dict.fromkeys(m.t, 1e7))
    assert message_for_the_first_element(m).startswith('largest residuals in tank: tank.wall[')
    assert m.tank.lam[0.25].value == 1e7


def test_a_state_that_is_fixed_throughout_is_an_input():
    """x is a state that somebody prescribes as 4 - t; y follows it: y' = x."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 3))
    m.x, m.y, m.z = pyo.Var(m.t), pyo.Var(m.t), pyo.Var(m.t)
    m.dx, m.dy = dae.DerivativeVar(m.x), dae.DerivativeVar(m.y)
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == m.x[t])
    m.out = pyo.Constraint(m.t, rule=lambda m, t: m.z[t] == m.dx[t])
    m.y[0].fix(0)
    m.dx[0].fix(-1)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=4, ncp=2)
    for t in m.t:
        m.x[t].fix(4 - t)
    table = pyomo_fesd.simulate(m)
    assert table['y'].iloc[-1] == pytest.approx(7.5, abs=1e-9) and table['z'].iloc[-1] == pytest.approx(-1, abs=1e-9)
    assert table['x'].iloc[-1] == 1


def pipe():
    """x' = -area x, the area follows from a diameter that does not depend on time."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 1))
    m.x, m.diameter, m.area = pyo.Var(m.t, initialize=1), pyo.Var(initialize=2), pyo.Var(initialize=77)
    m.dx = dae.DerivativeVar(m.x)
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == -m.area * m.x[t])
    m.geometry = pyo.Constraint(expr=m.area == m.diameter**2 / 4)
    m.x[0].fix(1)
    return m


def test_equations_without_time_are_solved_first():
    m = pipe()
    m.diameter.fix()
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=8, ncp=3)
    pyomo_fesd.simulate(m)
    assert m.area.value == pytest.approx(1, abs=1e-9)
    assert m.x[1].value == pytest.approx(pyo.exp(-1), abs=1e-8)


def test_values_without_time_that_fit_each_other_stay():
    m = pipe()
    m.area.value = 1
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=8, ncp=3)
    pyomo_fesd.simulate(m)
    assert (m.area.value, m.diameter.value) == (1, 2)


def test_equations_without_time_that_contradict_are_named():
    m = pipe()
    m.diameter.fix()
    m.other = pyo.Constraint(expr=m.area == 5)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=2, ncp=2)
    with pytest.raises(pyomo_fesd.FesdError, match=r"(?s)geometry: simulate: this equation without time.*1 equation\(s\) too many"):
        pyomo_fesd.simulate(m)
