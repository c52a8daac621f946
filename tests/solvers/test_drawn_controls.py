"""Starts that vary the controls: what is drawn, and that the plant is simulated with it."""

import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
from problems import two_carts
from problems.running import move
from pyomo.common.timing import HierarchicalTimer
from pyomo.mpec import Complementarity, complements

import pyomo_fesd
from pyomo_fesd import FesdError
from pyomo_fesd.core import moving_grids
from pyomo_fesd.mpcc.nlp.deadline import Deadline
from pyomo_fesd.solvers.drawn_controls import draw_controls
from pyomo_fesd.solvers.persistent_model import PersistentModel
from pyomo_fesd.solvers.simulated_start import SimulatedStart

STAGES = 4


def tank(**bounds):
    """A tank that u fills and empties, held on each of four stages; it flows over at x = 0.6."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=range(STAGES + 1))
    m.x, m.u = pyo.Var(m.t, initialize=0.5), pyo.Var(m.t, initialize=1, **bounds)
    m.dx = dae.DerivativeVar(m.x)
    m.x[0].fix(0.5)
    m.F = pyo.Var(m.t, initialize=0, bounds=(0, None))
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.u[t] - m.F[t])
    m.overflow = Complementarity(m.t, rule=lambda m, t: complements(0.6 - m.x[t] >= 0, m.F[t] >= 0))
    m.cost = pyo.Objective(expr=m.x[STAGES] ** 2)
    return move(m, 2 * STAGES, piecewise_constant=[m.u])


def drawn(number, seed=0, **bounds):
    m = tank(**bounds)
    draw_controls(moving_grids(m)[m.t], seed, number)
    return [m.u[t].value for t in range(1, STAGES + 1)]


@pytest.mark.parametrize('number', range(1, 9))
def test_controls_stay_within_their_bounds(number):
    assert all(0.9 <= u <= 1.2 for u in drawn(number, bounds=(0.9, 1.2)))
    assert all(u >= 1 for u in drawn(number, bounds=(1, None)))


def test_even_starts_have_one_value_and_odd_ones_one_for_each_stage():
    assert len(set(drawn(2))) == 1 and len(set(drawn(3))) == STAGES


def test_a_start_is_a_function_of_seed_and_number():
    assert drawn(3) == drawn(3) != drawn(5)
    assert drawn(3) != drawn(3, seed=1)


def test_a_control_has_one_value_on_its_stage():
    m = tank()
    draw_controls(moving_grids(m)[m.t], 0, 1)
    for stage in range(STAGES):
        assert len({m.u[t].value for t in m.t if stage < t <= stage + 1}) == 1


def test_a_fixed_control_is_left():
    m = tank()
    m.u.fix()
    with pytest.raises(FesdError, match="no free variable over it is held constant"):
        pyo.SolverFactory('mpec_hybrid').solve(m, starts=2, starts_vary='controls')
    assert {v.value for v in m.u.values()} == {1}


def draw(m):
    """The function that draws starts, and the compiled model."""
    config = pyo.SolverFactory('mpec_hybrid').CONFIG({'starts': 3, 'starts_vary': 'controls', 'timer': HierarchicalTimer()})
    compiled = PersistentModel(m, config, HierarchicalTimer(), deadline=Deadline()).compiled
    return SimulatedStart(m, config, Deadline()).draw(compiled), compiled


def test_a_start_is_a_simulation_with_its_controls():
    m = tank(bounds=(-2, 2))
    points, compiled = draw(m)
    values = dict(zip([v.name for v in compiled.variables], compiled.values(points(1))))
    assert {v.value for v in m.u.values()} == {1} and m.x[STAGES].value == 0.5  # the model is as it was
    again = tank(bounds=(-2, 2))
    for t in again.t:
        again.u[t].set_value(values[f'u[{t}]'])
    pyomo_fesd.simulate(again)
    assert values[f'x[{STAGES}]'] == pytest.approx(again.x[STAGES].value, abs=1e-9)
    assert values['u[1]'] != values['u[2]']


def test_starts_of_an_impact_problem():
    m = two_carts.build(STAGES, 2)
    results = pyo.SolverFactory('mpec_hybrid').solve(m, starts=3, starts_vary='controls')
    assert [start.certified for start in results.solver.starts] == [True] * 3
    controls = [m.u[two_carts.END * (k + 1) / STAGES].value for k in range(STAGES)]
    assert pyo.value(m.cost) == pytest.approx(two_carts.replay(controls), abs=1e-4)


def test_a_model_without_a_moving_grid():
    m = pyo.ConcreteModel()
    m.x = pyo.Var(bounds=(0, 1))
    m.f = pyo.Objective(expr=m.x)
    with pytest.raises(FesdError, match="0 moving grids"):
        pyo.SolverFactory('mpec_hybrid').solve(m, starts=2, starts_vary='controls')
