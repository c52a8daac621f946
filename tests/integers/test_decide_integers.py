"""The outer loop over integers: against enumeration by hand, its refusals, and what it leaves behind."""

from itertools import product

import numpy as np
import pyomo.environ as pyo
import pytest
import valve_schedule
from pyomo.gdp import Disjunction
from pyomo.mpec import Complementarity, complements
from scipy.integrate import solve_ivp

from pyomo_fesd import FesdError, decide_integers


def small(sense=pyo.minimize):
    """min (x - 1.2 a)^2 + (y - b)^2 + 0.3 b + (a - 1.6)^2, 0 <= x perp y >= 0: x = 1.2 a, y = 0, or x = 0, y = b."""
    m = pyo.ConcreteModel()
    m.a = pyo.Var(domain=pyo.Integers, bounds=(0, 3))
    m.b = pyo.Var(domain=pyo.Binary, initialize=1)
    m.x = pyo.Var(bounds=(0, None), initialize=0.5)
    m.y = pyo.Var(bounds=(0, None), initialize=0.5)
    m.c = Complementarity(expr=complements(m.x >= 0, m.y >= 0))
    m.o = pyo.Objective(expr=sense * cost(m.x, m.y, m.a, m.b), sense=sense)
    return m


def cost(x, y, a, b):
    return (x - 1.2 * a) ** 2 + (y - b) ** 2 + 0.3 * b + (a - 1.6) ** 2


def exact(a, b):
    return min(cost(1.2 * a, 0, a, b), cost(0, b, a, b))


@pytest.mark.parametrize('sense', [pyo.minimize, pyo.maximize])
def test_all_choices(sense):
    m = small(sense)
    found = decide_integers(m, lpec='full')
    assert len(found.table) == 8 and found.complete and found.table['certified'].all()
    expected = [sense * exact(a, b) for a, b in zip(found.table['a'], found.table['b'])]
    assert found.table['objective'].tolist() == pytest.approx(expected, abs=1e-6)
    assert (m.a.value, m.b.value) == (2, 0) and m.x.value == pytest.approx(2.4, abs=1e-6)
    assert pyo.value(m.o) == pytest.approx(found.table.loc[found.best, 'objective'])
    assert not m.a.fixed and m.a.is_integer()


def test_neighbours_find_the_best_one_with_fewer_solves():
    m = small()
    m.a.value = 0
    found = decide_integers(m, search='neighbours', lpec='full')
    assert (m.a.value, m.b.value) == (2, 0)
    choices = list(zip(found.table['a'], found.table['b']))
    assert choices[0] == (0, 1) and len(choices) == len(set(choices)) < 8 and not found.complete


def test_a_choice_without_a_solution_is_a_row():
    m = small()
    m.never = pyo.Constraint(expr=m.a <= 1)
    found = decide_integers(m, lpec='full')
    assert (found.table.loc[found.table['a'] > 1, 'outcome'] == 'infeasible').all() and found.complete
    assert (m.a.value, m.b.value) == (1, 0)


def values(m):
    return [(v.value, v.fixed, v.stale) for v in m.component_data_objects(pyo.Var)]


@pytest.mark.parametrize(
    'spoil, keywords, cause',
    [
        (lambda m: m.a.setub(None), {}, 'without bounds'),
        (lambda m: m.a.fix(1) or m.b.fix(0), {}, 'no integer variable'),
        (lambda m: None, {'most': 3}, '8 choices'),
        (lambda m: None, {'search': 'cuts'}, "search='cuts'"),
        (lambda m: None, {'no_such_option': 1}, 'no keyword'),
        (lambda m: m.add_component('never', pyo.Constraint(expr=m.a >= 5)), {}, 'no solution for any of 8'),
        (lambda m: m.add_component('either', Disjunction(expr=[[m.x <= 1], [m.x >= 2]])), {}, 'an active Disjunction'),
    ],
)
def test_refuses_and_leaves_the_model(spoil, keywords, cause):
    m = small()
    spoil(m)
    before = values(m)
    with pytest.raises(FesdError, match=cause):
        decide_integers(m, **keywords)
    assert values(m) == before


def test_the_solver_points_to_it():
    with pytest.raises(FesdError, match='decide_integers'):
        pyo.SolverFactory('mpec_hybrid').solve(small())


def simulated(schedule):
    """Costs of a schedule of the example by scipy."""
    e = valve_schedule

    def rates(t, x, y):
        spill = e.WEIR * max(0.0, x[0] - e.HEIGHT)
        return [e.INFLOW + e.SWING * np.sin(t) - e.VALVE * y * x[0] - spill, e.PENALTY * spill]

    x = [0.8, 0.0]
    for k, y in enumerate(schedule):
        x = solve_ivp(rates, (k, k + 1), x, args=(y,), rtol=1e-10, atol=1e-10, max_step=0.01).y[:, -1]
    return x[1] + np.dot(e.PRICES, schedule)


def test_example(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    valve_schedule.main()
    said = capsys.readouterr().out
    assert 'Of 32 schedules, 32 certified, the best is [0, 1, 1, 0, 0]' in said
    assert (tmp_path / 'valve_schedule.png').stat().st_size > 10_000
    costs = {schedule: simulated(schedule) for schedule in product((0, 1), repeat=valve_schedule.HOURS)}
    assert min(costs, key=costs.get) == (0, 1, 1, 0, 0)
    # elements of half an hour with three points
    assert float(said.split('best is')[1].split('costs ')[1].split()[0]) == pytest.approx(costs[0, 1, 1, 0, 0], abs=2e-3)
