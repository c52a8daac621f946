"""Degrees of freedom and structural singularity, with the names of blocks."""

import bouncing_ball
import gas_liquid_tank
import oscillator
import pump_curve
import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
import saturating_valve
import signum
import thermostat
import toy_mpec
from pyomo.mpec import Complementarity, complements

import pyomo_fesd
from tests.problems.running import LEGENDRE, RADAU

#: Simulations of every kind of switch; an equation for each unknown.
SIMULATIONS = {
    'modes': (signum, {}),
    'algebraic variables': (gas_liquid_tank, {}),
    'surface': (oscillator, {}),
    'jumps': (bouncing_ball, {}),
    'nonsmooth terms': (saturating_valve, {}),
    'piecewise functions': (pump_curve, {}),
    'hysteresis': (thermostat, {'hysteresis': 'relay'}),
}


def names(components):
    return [c.name for c in components]


@pytest.mark.parametrize('scheme', [RADAU, LEGENDRE])
@pytest.mark.parametrize('kind', SIMULATIONS)
@pytest.mark.filterwarnings('ignore')
def test_a_simulation_has_an_equation_for_every_unknown(kind, scheme):
    module, options = SIMULATIONS[kind]
    m = module.build()
    modes = {key: [m.component(name)] for key, name in options.items()}
    pyo.TransformationFactory('fesd.dcs').apply_to(m, **modes)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=4, ncp=2, scheme=scheme)
    found = pyomo_fesd.structure(m)
    assert not found.problem and found.degrees_of_freedom == 0 and str(found).endswith('structurally sound')


def test_a_fixed_grid_counts_every_pair():
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 1))
    m.x, m.lam = pyo.Var(m.t, initialize=1), pyo.Var(m.t, bounds=(0, None))
    m.dx = dae.DerivativeVar(m.x)
    m.x[0].fix(1)
    pyo.TransformationFactory('dae.collocation').apply_to(m, wrt=m.t, nfe=3, ncp=2)
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.lam[t] - 2)
    m.wall = Complementarity(m.t, rule=lambda m, t: complements(m.x[t] >= 0, m.lam[t] >= 0))
    found = pyomo_fesd.structure(m)
    assert (found.unknowns, found.equations, found.problem) == (6 + 7 + 7, 6 + 7 + 7, '')


def plant():
    """Two units, each with y**2 = x, in a square system: x of one is y of the other or given."""
    m = pyo.ConcreteModel()
    m.feed, m.tank = pyo.Block(), pyo.Block([1, 2])
    m.feed.x = pyo.Var(initialize=4)
    m.feed.given = pyo.Constraint(expr=m.feed.x == 16)
    for i, b in m.tank.items():
        b.y = pyo.Var(initialize=2)
        b.root = pyo.Constraint(expr=b.y**2 == (m.feed.x if i == 1 else m.tank[1].y))
    return m


def test_a_sound_system():
    found = pyomo_fesd.structure(plant())
    assert repr(found) == 'the model: 3 unknowns, 3 equations, degrees of freedom 0\nstructurally sound'


def test_an_unknown_that_nothing_determines():
    m = plant()
    m.feed.given.deactivate()
    found = pyomo_fesd.structure(m)
    assert found.degrees_of_freedom == 1 and len(found.loose) == 1 and len(found.undetermined) == 3
    assert found.problem.startswith('1 unknown(s) that nothing determines, e.g. ')
    assert found.problem.endswith('among 3 in tank (2), feed (1)')


def test_with_an_objective_freedom_is_wanted():
    m = plant()
    m.feed.given.deactivate()
    m.cost = pyo.Objective(expr=m.feed.x)
    found = pyomo_fesd.structure(m)
    assert found.degrees_of_freedom == 1 and not found.problem


def test_an_equation_too_many():
    m = plant()
    m.tank[2].y.fix(2)
    found = pyomo_fesd.structure(m)
    assert (found.degrees_of_freedom, len(found.surplus), len(found.overdetermined)) == (-1, 1, 3)
    assert found.problem.startswith('1 equation(s) too many, e.g. ')


def test_both_at_once_although_the_number_is_right():
    m = plant()
    m.loose = pyo.Var(initialize=1)
    m.sum = pyo.Constraint(expr=m.loose + 0 * m.feed.x == 1)
    m.feed.again = pyo.Constraint(expr=m.feed.x**2 == 256)
    m.tank[2].root.deactivate()
    m.use = pyo.Var()
    m.uses = pyo.Constraint(expr=m.use * m.tank[2].y == 1)
    found = pyomo_fesd.structure(m)
    assert found.degrees_of_freedom == 0
    assert sorted(names(found.overdetermined)) == ['feed.again', 'feed.given']
    assert sorted(names(found.undetermined)) == ['tank[2].y', 'use']


def test_one_example_of_each_kind():
    m = pyo.ConcreteModel()
    m.x, m.y = pyo.Var(range(5)), pyo.Var(range(2))
    m.b = pyo.Block(range(5), rule=lambda b, i: setattr(b, 'c', pyo.Constraint(expr=m.x[i] * m.y[0] * m.y[1] == 1)))
    problem = pyomo_fesd.structure(m).problem
    assert problem.startswith('2 unknown(s) that nothing determines, e.g. ')
    assert problem.endswith('among 7 in the model (7)')


def test_a_variable_times_zero_is_none():
    m = plant()
    m.zero = pyo.Param(initialize=0, mutable=True)
    m.other = pyo.Var()
    m.nothing = pyo.Constraint(expr=m.zero * m.other + m.feed.x == 16)
    assert pyomo_fesd.structure(m).degrees_of_freedom == -1


def test_fixed_values_that_contradict_are_an_equation_too_many():
    m = plant()
    m.feed.x.fix(15)
    found = pyomo_fesd.structure(m)
    assert names(found.surplus) == ['feed.given']
    m.feed.x.fix(16)
    assert not pyomo_fesd.structure(m).problem


def test_a_long_chain_is_matched_without_recursion():
    n = 1500
    m = pyo.ConcreteModel()
    m.x = pyo.Var(range(n + 2), initialize=1)
    m.link = pyo.Constraint(range(n, 0, -1), rule=lambda m, i: m.x[i] + m.x[i - 1] == 2)
    m.end = pyo.Constraint(expr=m.x[n] == 1)
    assert not pyomo_fesd.structure(m).problem
    m.again = pyo.Constraint(expr=m.x[0] + m.x[n] == 2)
    found = pyomo_fesd.structure(m)
    assert (len(found.surplus), len(found.overdetermined)) == (1, n + 2)


def test_a_block_alone():
    m = plant()
    found = pyomo_fesd.structure(m.tank[2])
    assert (found.block, found.unknowns, found.equations) == ('tank[2]', 2, 1)


def test_a_pair_that_stands_alone():
    assert pyomo_fesd.structure(toy_mpec.build()).degrees_of_freedom == 1


@pytest.mark.parametrize('solver, where', [('mpec_hybrid', 'reason'), ('casadi_ipopt', 'message')])
def test_a_failure_is_explained(solver, where):
    m = plant()
    m.tank[2].y.fix(1)
    results = pyo.SolverFactory(solver).solve(m)
    assert not pyo.check_optimal_termination(results)
    assert '1 equation(s) too many' in str(getattr(results.solver, where))


def test_equations_outside_of_the_block_are_told():
    """Arcs on the model, and a transformed flowsheet: its streams are equations that the block does not have."""
    m = pyo.ConcreteModel()
    m.fs = pyo.Block()
    m.fs.x, m.fs.y, m.fs.z = pyo.Var(), pyo.Var(), pyo.Var()
    m.fs.law = pyo.Constraint(expr=m.fs.x + m.fs.y == 1)
    m.stream = pyo.Constraint(expr=m.fs.x == m.fs.y)
    found = pyomo_fesd.structure(m.fs)
    assert found.degrees_of_freedom == 1 and names(found.outside) == ['stream']
    assert "1 active equation(s) outside 'fs' contain its unknowns and are not counted, e.g. stream" in str(found)
    assert not pyomo_fesd.structure(m).outside and 'outside' not in str(pyomo_fesd.structure(m))
