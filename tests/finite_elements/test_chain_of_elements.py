"""Elements as parts of a chain, and what inserted parts show where switches coincide."""

import numpy as np
import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
from pyomo.common.collections import ComponentSet
from pyomo.mpec import Complementarity, complements

import pyomo_fesd
from pyomo_fesd.core import TimeIndex, all_hints, moving_grids
from tests.models import dcs, tank
from tests.problems import coupled_relays, two_carts, two_experiments
from tests.problems.running import move, transform

# What is written


def chain(m):
    (found,) = all_hints(m).chains
    return found


def test_each_element_is_a_part_with_its_own_variables():
    m = two_carts.build(3, 2)
    parts, grid = chain(m), moving_grids(m)[m.t]
    assert [part.extent for part in parts] == [grid.r[n] for n in grid.r]
    third, element = parts[2], grid.grid.elements[2]
    own = ComponentSet(third.own)
    assert all(v in own for v in (*(m.q[1, t] for t in element.points), m.touch[element.right].normal, grid.r[3]))
    assert m.q[1, element.left] not in own
    assert not any(v.parent_component() is m.u for v in own), "a control belongs to its stage"
    assert all('impulse' in v.name or 'above' in v.name or 'below' in v.name for v in third.gate)
    first, last = next(both for both in third.ends if both[0].parent_component() is m.v)
    assert (first.index()[1], last.index()[1]) == (element.left, element.right)


def test_own_variables_correspond_from_part_to_part():
    m = two_carts.build(3, 2)
    times = TimeIndex(m.t)
    names = [[times.split(v)[1] if times.time(v) else v.parent_component().name for v in part.own] for part in chain(m)]
    assert all(some == names[1] for some in names[1:])


def test_nothing_is_inserted_between_modes_with_hysteresis():
    m = two_experiments.build()
    move(dcs(m, hysteresis=[m.law]), 4, 2)
    assert not any(part.copies for part in chain(m))
    assert all(part.copies for part in chain(transform(two_experiments.build(), 4)))


# What inserted parts show

#: Random problems whose coincidence is a local minimum, and others.
MINIMA, OTHERS = (9, 14), (0, 1)


def at_the_coincidence(relays, nfe, form, *more):
    m = transform(coupled_relays.build(relays, *more), nfe, form=form)
    m.theta.fix(1)
    pyomo_fesd.simulate(m)
    m.theta.unfix()
    assert pyo.value(m.cost) == pytest.approx(relays.objective(1))
    return m


@pytest.mark.parametrize('nfe', [2, 4])
@pytest.mark.parametrize('form', ['heaviside', 'stewart'])
@pytest.mark.parametrize('seed', MINIMA + OTHERS)
def test_coupled_switches_are_certified_where_both_orders_cost_more_and_nowhere_else(seed, form, nfe):
    relays = coupled_relays.Relays.draw(seed)
    assert pyomo_fesd.certify(at_the_coincidence(relays, nfe, form)).certified == relays.is_minimum


def bounds_at_the_end(m, least):
    for i in m.i:
        m.x[coupled_relays.END, i].setlb(least[i - 1])


def row_at_the_end(m, least):
    m.end = pyo.Constraint(m.i, rule=lambda m, i: m.x[coupled_relays.END, i] >= least[i - 1])


def path_and_end(m, least):
    m.path = pyo.Constraint(m.t, m.i, rule=lambda m, t, i: m.x[t, i] >= -1)
    row_at_the_end(m, least)


def nonlinear_row_at_the_end(m, least):
    m.end = pyo.Constraint(expr=m.x[coupled_relays.END, 1] * m.x[coupled_relays.END, 2] >= least.prod() * m.theta)


def equations_at_the_end(m, _):
    m.z = pyo.Var(m.i)
    m.end = pyo.Constraint(m.i, rule=lambda m, i: m.z[i] == m.x[coupled_relays.END, i])


def clock_with_given_end(m, _):
    m.y = pyo.Var(m.t, initialize=0)
    m.dy = dae.DerivativeVar(m.y, wrt=m.t)
    m.speed = pyo.Var(initialize=1)
    m.tick = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == m.speed)
    m.y[0].fix(0)
    m.y[coupled_relays.END].fix(1)


def pair_at_the_end(m, least):
    m.v = pyo.Var(bounds=(0, None), initialize=0)
    m.end = Complementarity(expr=complements(m.x[coupled_relays.END, 1] >= least[0], m.v >= 0))


@pytest.mark.parametrize(
    'more, known',
    [
        (bounds_at_the_end, True),
        (row_at_the_end, True),
        (path_and_end, True),
        (nonlinear_row_at_the_end, True),
        (equations_at_the_end, True),
        (clock_with_given_end, False),
        (pair_at_the_end, False),
    ],
)
@pytest.mark.parametrize('seed', MINIMA + OTHERS)
def test_conditions_at_the_end_do_not_hold_between_switches(seed, more, known):
    # on two elements the part that is copied is the last one
    relays = coupled_relays.Relays.draw(seed)
    least = relays.last(1) - 0.01
    for nfe in (2, 3):
        found = pyomo_fesd.certify(at_the_coincidence(relays, nfe, 'auto', lambda m: more(m, least))).certified
        assert found == relays.is_minimum if known else found <= relays.is_minimum


def test_the_seeds_have_minima_and_others():
    found = [coupled_relays.Relays.draw(seed).is_minimum for seed in MINIMA + OTHERS]
    assert found == [True] * len(MINIMA) + [False] * len(OTHERS)


def logged(capsys, m, **options):
    results = pyo.SolverFactory('mpec_hybrid').solve(m, tee=True, **options)
    return results, capsys.readouterr().out


def test_a_minimum_needs_no_nlp_for_its_orders(capsys):
    relays = coupled_relays.Relays.draw(MINIMA[0])
    results, log = logged(capsys, at_the_coincidence(relays, 4, 'stewart'), warm_start=True)
    assert results.solver.stationarity == 'B' and 'cannot grow with descent' in log
    assert results.solver.nlps == 1, "that of the branch itself"


def pushed_then_pulled():
    """Two carts: the driven one is pushed against the other one up to the boundary of the control stages, and then pulled back."""
    m = two_carts.build(2, 3)
    first, second = m.t.at(m.t.find_nearest_index(1)), m.t.last()
    m.cost.set_value(-1000 * m.u[first] + 1000 * m.u[second] - m.q[2, second])
    m.u[first].fix(5)
    m.u[second].fix(-5)
    pyomo_fesd.simulate(m)
    m.u[first].unfix()
    m.u[second].unfix()
    return m


def test_contacts_that_would_pull_or_penetrate_are_not_possible(capsys):
    results, log = logged(capsys, pushed_then_pulled(), warm_start=True)
    assert results.solver.stationarity == 'B'
    assert log.count('not possible beside the point') + log.count('cannot grow with descent') == log.count(' order ') == 2


def dropped():
    """A ball that falls 1/2 with the acceleration -1 and bounces at t = 1, the boundary of two control stages; u = 0 is best."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=[0, 1, 2])
    m.y, m.v = pyo.Var(m.t, initialize=0.5), pyo.Var(m.t, initialize=0)
    m.u = pyo.Var(m.t, bounds=(0, 1), initialize=0)
    m.dy, m.dv = dae.DerivativeVar(m.y), dae.DerivativeVar(m.v)
    m.y[0].fix(0.5)
    m.v[0].fix(0)
    m.floor = pyomo_fesd.contact(m.t, gap=lambda m, t: m.y[t], restitution=0.9)
    m.way = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == m.v[t])
    m.fall = pyo.Constraint(m.t, rule=lambda m, t: m.dv[t] == -1 + m.u[t] + m.floor[t].normal)
    m.cost = pyo.Objective(expr=10 * (m.u[1] + m.u[2]) + m.y[2])
    move(m, 6, 2, piecewise_constant=[m.u])
    m.u[1].fix(0)
    m.u[2].fix(0)
    pyomo_fesd.simulate(m)
    m.u[1].unfix()
    m.u[2].unfix()
    return m


def test_a_bounce_at_the_boundary_of_a_control_stage_is_no_resting_contact(capsys):
    results, log = logged(capsys, dropped(), warm_start=True)
    assert results.solver.stationarity == 'B'
    assert 'not possible beside the point' in log


def test_a_certified_push_costs_least_in_an_exact_replay():
    stages = 6
    m = two_carts.build(stages, 3)
    results = pyo.SolverFactory('mpec_hybrid').solve(m)
    u = np.array([m.u[m.t.at(m.t.find_nearest_index(2 * k / stages))].value for k in range(1, stages + 1)])
    steps = 1e-2 * np.vstack([np.eye(stages), -np.eye(stages)])
    lowest = min(two_carts.replay(u + step) for step in steps)
    descends = lowest < two_carts.replay(u) - 2e-5
    assert not (results.solver.stationarity == 'B' and descends)


@pytest.mark.parametrize('seed', MINIMA + OTHERS)
def test_with_hysteresis_it_takes_an_element_to_spare(seed):
    relays = coupled_relays.Relays.draw(seed)
    for nfe, spare in ((2, False), (4, True)):
        m = coupled_relays.build(relays)
        move(dcs(m, hysteresis=[m.law]), nfe, 2)
        m.theta.fix(1)
        pyomo_fesd.simulate(m)
        m.theta.unfix()
        assert pyomo_fesd.certify(m).certified == (spare and relays.is_minimum)


# Indicators


def test_indicators_in_equations_of_a_user_are_variables_of_an_element():
    def build():
        m = tank()
        m.open = pyo.Var(m.t, initialize=0.5)
        m.shown = pyo.Constraint(m.t, rule=lambda m, t: m.open[t] == m.full[t].binary_indicator_var)
        return m

    m = transform(build(), 4)
    elements = moving_grids(m)[m.t].grid.elements
    for part, element in zip(chain(m), elements):
        own = ComponentSet(part.own)
        assert all(d[t].binary_indicator_var in own for d in (m.full, m.empty) for t in element.own_labels)
        ends = [(first.name, last.name) for first, last in part.ends]
        assert tuple(m.full[t].binary_indicator_var.name for t in (element.left, element.right)) in ends
    alike = [set(map(id, group)) for group in all_hints(m).alike]
    assert {id(m.full[t].binary_indicator_var) for t in m.t} in alike
