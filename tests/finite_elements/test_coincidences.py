"""Coinciding switches: every order of them is tried before a point is certified."""

import numpy as np
import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
from pyomo.gdp import Disjunction
from pyomo.mpec import Complementarity

import pyomo_fesd
from pyomo_fesd.core import all_hints, moving_grids
from pyomo_fesd.finite_elements.changes import switching_together
from tests.models import dcs
from tests.problems import carried, events_together, impact_at_stage, kink_at_stage, landing_at_stage, two_experiments
from tests.problems.running import move, transform


def coincidences(m):
    return all_hints(m).coincidences


# What is written


@pytest.mark.parametrize('form', ['heaviside', 'stewart'])
def test_each_experiment_switches_for_itself(form):
    m = transform(two_experiments.build(), 4, form=form)
    families = switching_together(moving_grids(m)[m.t])
    assert len(families) == 4 and len(set(families.values())) == 2


def test_modes_with_hysteresis_switch_with_their_disjunction():
    m = two_experiments.build()
    move(dcs(m, hysteresis=[m.law]), 4, 2)
    assert sorted(set(switching_together(moving_grids(m)[m.t]).values())) == ['law[1]', 'law[2]']


def test_a_change_takes_over_the_pairs_of_its_family():
    m = transform(two_experiments.build(), 4, form='heaviside')
    second = coincidences(m)[1]
    assert not second.fixed and len(second.changes) == 2
    for i, change in enumerate(second.changes, start=1):
        assert {pair.ctype for pair, _ in change.differing} == {Complementarity}
        assert [(pair.index()[1], source.index()[1]) for pair, source in change.later] == [(3, 2), (3, 2)]
        assert [(pair.index()[1], source.index()[1]) for pair, source in change.earlier] == [(2, 3), (2, 3)]
        assert all(f'[{i},' in pair.index()[0] for pair, _ in change.differing)


def test_where_no_element_is_left_there_is_no_place():
    m = transform(two_experiments.build(), 3)
    r = moving_grids(m)[m.t].r
    first, last = coincidences(m)
    assert first.earlier is None and first.later is r[2]
    assert last.earlier is r[2] and last.later is None


def test_a_single_system_has_them_at_boundaries_of_control_stages_only():
    m = transform(carried.build(), 6)
    (found,) = coincidences(m)
    assert found.fixed and found.earlier is moving_grids(m)[m.t].r[3]


# What they find


def simulated(m, theta):
    m.theta.fix(theta)
    pyomo_fesd.simulate(m)
    m.theta.unfix()


def solved(m, **options):
    results = pyo.SolverFactory('mpec_hybrid').solve(m, **options)
    return pyo.value(m.misfit), results.solver.stationarity


@pytest.mark.parametrize('warm_start', [True, False])
@pytest.mark.parametrize('start', [0.4, 0.8, 1.0])
@pytest.mark.parametrize('nfe', [3, 4, 6])
@pytest.mark.parametrize('form', ['heaviside', 'stewart'])
def test_a_fit_passes_the_point_where_switches_coincide(form, nfe, start, warm_start):
    m = transform(two_experiments.build(start), nfe, form=form)
    simulated(m, start)
    results = pyo.SolverFactory('mpec_hybrid').solve(m, warm_start=warm_start).solver
    # a branch with an element of no extent is degenerate: Ipopt may end it with a violation, which the results report
    known = max(1e-8, results.violation)
    assert results.stationarity == 'B' and results.violation < 1e-6
    assert m.theta.value == pytest.approx(two_experiments.TRUE, abs=known) and pyo.value(m.misfit) < 1e-12


def test_with_hysteresis():
    m = two_experiments.build(1.0)
    move(dcs(m, hysteresis=[m.law]), 4, 2)
    simulated(m, 1.0)
    misfit, stationarity = solved(m, warm_start=True)
    assert stationarity == 'B' and misfit < 1e-12


def test_without_a_spare_element_the_verdict_says_so():
    m = transform(two_experiments.build(), 2)
    simulated(m, 1.0)
    results = pyo.SolverFactory('mpec_hybrid').solve(m, warm_start=True)
    if pyo.value(m.misfit) > 1e-9:
        assert results.solver.stationarity == 'not certified' and 'order' in results.solver.reason
        assert not pyomo_fesd.certify(m).certified


def test_certify_looks_at_the_orders_too():
    m = transform(two_experiments.build(), 4)
    simulated(m, 1.0)
    assert pyo.value(m.misfit) == pytest.approx(two_experiments.FALSE_MISFIT)
    assert not pyomo_fesd.certify(m).certified
    solved(m, warm_start=True)
    assert pyomo_fesd.certify(m).certified


@pytest.mark.parametrize('number', [2, 3])
@pytest.mark.parametrize('common', [lambda theta: theta, lambda theta: theta * (theta + 1) / 2])
def test_equal_systems_stay_together_and_are_certified(common, number):
    assert solved(equal_systems(common, number), warm_start=True)[1] == 'B'


def equal_systems(common, number):
    """Equal systems, of which none switches first."""
    m = two_experiments.build(0.6, (common,) * number)
    m.misfit.set_value(m.misfit.expr + 0.1 * (m.theta - 1) ** 2)  # so that the objective has a slope
    transform(m, 3)
    simulated(m, 0.6)
    return m


@pytest.mark.parametrize('number', [3, 4])
@pytest.mark.parametrize('seed', range(3))
def test_three_switches_at_one_time_are_not_certified_where_a_slope_descends(number, seed):
    # each switch has its own time for another theta, so that no two of them stay together
    random = np.random.default_rng(seed)
    q, s, w = random.uniform(-1, 1, number), random.uniform(0.2, 3, number), random.uniform(-1, 1, number)
    assert abs(sum(w * q * (1 - s))) > 5e-3  # the slope of the objective by theta
    m = pyo.ConcreteModel()
    m.t, m.i = dae.ContinuousSet(bounds=(0, 2)), pyo.RangeSet(number)
    m.theta = pyo.Var(bounds=(0.5, 1.5), initialize=1)
    m.x, m.v = pyo.Var(m.t, m.i, initialize=0), pyo.Var(m.t, m.i, initialize=1)
    m.dx = dae.DerivativeVar(m.x, wrt=m.t)
    m.x[0, :].fix(0)
    m.rate = pyo.Constraint(m.t, m.i, rule=lambda m, t, i: m.dx[t, i] == m.v[t, i])

    def law(m, t, i):
        level = 1 + q[i - 1] * (m.theta - 1)
        return [[m.x[t, i] <= level, m.v[t, i] == 1], [m.x[t, i] >= level, m.v[t, i] == s[i - 1]]]

    m.law = Disjunction(m.t, m.i, rule=law)
    m.cost = pyo.Objective(expr=sum(w[i - 1] * m.x[2, i] for i in m.i))
    transform(m, 6)
    m.theta.fix(1)
    pyomo_fesd.simulate(m)
    m.theta.unfix()
    assert not pyomo_fesd.certify(m).certified


@pytest.mark.parametrize('warm_start', [True, False])
@pytest.mark.parametrize('A', [-0.3, 0.5, 4.0])
def test_a_kink_at_the_boundary_of_a_control_stage(A, warm_start):
    m = kink_at_stage.build(A)
    move(dcs(m), 4, 2, piecewise_constant=[m.u])
    pyomo_fesd.simulate(m)
    results = pyo.SolverFactory('mpec_hybrid').solve(m, warm_start=warm_start)
    u, fuel = kink_at_stage.best(A)
    assert results.solver.stationarity == 'B'
    assert pyo.value(m.fuel) == pytest.approx(fuel, abs=1e-8) and m.u[1].value == pytest.approx(u, abs=1e-5)


def test_with_one_element_in_each_control_stage_the_verdict_says_so():
    m = kink_at_stage.build(4.0)
    move(dcs(m), 2, 2, piecewise_constant=[m.u])
    results = pyo.SolverFactory('mpec_hybrid').solve(m)
    assert pyo.value(m.fuel) > kink_at_stage.best(4.0)[1] + 0.1
    assert results.solver.stationarity == 'not certified' and 'order' in results.solver.reason


# Events at one time; nothing can be inserted with hysteresis and jumps

KINDS = ['relay', 'hysteresis', 'jump']
#: Slopes nearer to 0 are not told from it.
CLEAR = 0.02
#: What coincides, and on how many elements.
TOGETHER = {
    'two': (lambda seed: events_together.Events.draw(seed, 2), (0, 2), 6),
    'three': (lambda seed: events_together.Events.draw(seed, 3), (0, 2), 6),
    'one at a stage': (lambda seed: events_together.Events.draw(seed, 1), (0, 1, 2), 6),
    'two at a stage': (lambda seed: events_together.Events.draw(seed, 2), (0, 1, 2), 6),
    'two, no element to spare': (lambda seed: events_together.Events.draw(seed, 3).with_last_after(), (0, 2), 3),
    'two at the end': (lambda seed: events_together.Events.draw(seed, 2, 2.0), (0, 2), 6),
    'three at the end': (lambda seed: events_together.Events.draw(seed, 3, 2.0), (0, 2), 6),
    'three, no element to spare': (lambda seed: events_together.Events.draw(seed, 4).with_last_after(), (0, 2), 3),
}


def certified_and_minima(case, kind, seeds):
    """For each seed with clear slopes, whether the point is certified, and whether it is a minimum."""
    draw, times, nfe = TOGETHER[case]
    for seed in seeds:
        events = draw(seed)
        if min(map(abs, events.slopes)) > CLEAR:
            m = events_together.simulated(events, kind, nfe, times)
            assert pyo.value(m.cost) == pytest.approx(events.objective(1), abs=1e-6)
            yield pyomo_fesd.certify(m).certified, min(events.slopes) > 0


@pytest.mark.parametrize('kind', KINDS)
@pytest.mark.parametrize('case', TOGETHER)
def test_events_at_one_time_are_not_certified_where_a_slope_descends(case, kind):
    found = list(certified_and_minima(case, kind, range(4)))
    assert any(not minimum for _, minimum in found)
    assert all(minimum for certified, minimum in found if certified)


CERTIFIED = [(case, 'relay') for case in TOGETHER if case != 'one at a stage' and not case.endswith('end')]
CERTIFIED += [('two', 'hysteresis'), ('two', 'jump'), ('two at the end', 'hysteresis')]


@pytest.mark.parametrize('case, kind', CERTIFIED)
def test_events_are_certified_where_no_slope_descends(case, kind):
    found = list(certified_and_minima(case, kind, [0, 6, 13, 45]))
    assert any(minimum for _, minimum in found)
    assert all(certified == minimum for certified, minimum in found)


@pytest.mark.parametrize('early', [2e-6, 1e-3])
def test_orders_behind_a_short_element_are_judged(early):
    """Two relays switch at a stage, of which the first element is short: it ends where another relay has switched."""
    found = []
    for seed in (0, 3, 7, 18):
        events = events_together.Events.draw_after_early_one(seed, 2, early)
        assert min(map(abs, events.slopes)) > CLEAR
        m = events_together.simulated(events, 'relay', 4, (0, 1, 2))
        r = moving_grids(m)[m.t].r
        assert r[1].value < 0.01 * r[2].value
        found.append((pyomo_fesd.certify(m).certified, min(events.slopes) > 0))
    assert {minimum for _, minimum in found} == {False, True}
    assert all(certified == minimum for certified, minimum in found)


@pytest.mark.parametrize('kind', KINDS)
def test_two_equal_events_stay_certified(kind):
    events = events_together.Events.draw(0, 2)
    same = np.array([[1.0, 1.5, 1.5, 2.0]] * 2)
    events = events_together.Events(same, np.array([1.0, 1.0]), np.zeros(2), events.w)
    m = events_together.simulated(events, kind, 6)
    m.cost.set_value(m.cost.expr + (m.theta - 1) ** 2 + sum(m.x[2, i] for i in m.i) * 1e-3)
    assert pyomo_fesd.certify(m).certified


# A landing on the boundary of a control stage, of a body that must not slip


@pytest.mark.parametrize('before, after', [(3, 1), (1.5, 1), (1, 1.5), (2.5, 1.9)])
def test_a_landing_at_a_stage_is_not_certified_where_a_slope_descends(before, after):
    landing = landing_at_stage.Landing(before, after, 2)
    m = landing.solved(4)
    assert min(landing.slopes) < 0 and pyo.value(m.y[1]) == pytest.approx(0, abs=1e-7)
    assert not pyomo_fesd.certify(m).certified


def test_a_landing_at_a_stage_is_certified_where_nothing_can_move_it():
    m = landing_at_stage.Landing(3, 1, 2).solved(4)
    m.theta.fix(1)
    assert pyomo_fesd.certify(m).certified


# An impact on the boundary of a control stage, after which the bodies part; where it comes earlier they stay together until then


@pytest.mark.parametrize('nfe', [4, 6])
def test_an_impact_at_a_stage_is_not_certified_where_a_slope_descends(nfe):
    found = []
    for seed in range(12):
        impact = impact_at_stage.Impact.draw(seed)
        if min(map(abs, impact.slopes)) > CLEAR:
            m = impact.simulated(nfe)
            assert pyo.value(m.cost) == pytest.approx(impact.objective(1), abs=1e-7)
            found.append((pyomo_fesd.certify(m).certified, min(impact.slopes) > 0))
    assert {minimum for _, minimum in found} == {False, True}
    assert all(minimum for certified, minimum in found if certified)
