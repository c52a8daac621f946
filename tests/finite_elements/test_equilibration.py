"""Step equilibration: equal lengths where nothing switches (theory, eq. 12 and 13)."""

from math import exp

import numpy as np
import oscillator
import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
import signum
from pyomo.mpec import Complementarity, complements

import pyomo_fesd
from tests.problems import crossing, free_start, held_control, sliding, two_systems, weir
from tests.problems.running import SCHEMES, lengths, move, run, solve, transform


def block(m):
    """The block of the only moving grid."""
    return m.component('_pyomo_fesd_elements_t')


def stretches(m):
    """Lengths of the elements of each switch-free stretch."""
    cuts = [s.time for s in pyomo_fesd.switches(m)]
    found = [[]]
    for element in pyomo_fesd.element_lengths(m).itertuples():
        if any(abs(element.start - cut) <= 1e-7 for cut in cuts):
            found.append([])
        found[-1].append(element.length)
    return found


def plant(build):
    """Name of a model's file."""
    return build.__module__.split('.')[-1]


def spread(m):
    """Largest difference of two lengths on one stretch."""
    return max(max(part) - min(part) for part in stretches(m))


SWITCHES = {
    signum.build: [signum.SWITCH],
    crossing.build: [crossing.SWITCH],
    sliding.build: [sliding.SWITCH],
    two_systems.build: [time for time, _ in two_systems.SWITCHES],
}
PLANTS = [*SWITCHES, oscillator.build]


@pytest.mark.parametrize('scheme', SCHEMES)
@pytest.mark.parametrize('build', PLANTS, ids=plant)
def test_lengths_are_equal_on_each_switch_free_stretch(build, scheme):
    m = run(build(), nfe=12, ncp=2, scheme=scheme)
    parts = stretches(m)
    assert len(parts) == 1 + len(pyomo_fesd.switches(m))
    assert max(map(len, parts)) >= 4
    assert spread(m) <= 1e-8


@pytest.mark.parametrize('slack_first', [True, False])
def test_lengths_are_equal_around_a_switch_of_the_users_own_condition(slack_first):
    m = solve(move(weir.build(slack_first=slack_first), 9, 2))
    boundary = pyomo_fesd.element_lengths(m)['end']
    before = int((boundary <= weir.SWITCH + 1e-7).sum())
    first, last = lengths(m)[:before], lengths(m)[before:]
    assert first == pytest.approx([weir.SWITCH / before] * before, abs=1e-8)
    assert last == pytest.approx([(2 - weir.SWITCH) / (9 - before)] * (9 - before), abs=1e-8)


def test_elements_of_different_stages_need_not_be_equal():
    m = free_start.build(-2)
    m.t.add(1.5)
    run(m, nfe=8)
    first, last = lengths(m)[:4], lengths(m)[4:]
    assert last == pytest.approx([0.125] * 4, abs=1e-9)
    assert max(first) > 0.2
    before = int((pyomo_fesd.element_lengths(m)['end'] <= 2 / 3 + 1e-7).sum())
    assert first == pytest.approx([2 / 3 / before] * before + [(1.5 - 2 / 3) / (4 - before)] * (4 - before), abs=1e-8)


def test_without_a_switch_all_elements_are_equal():
    m = run(free_start.build(-8), nfe=6)
    assert lengths(m) == pytest.approx([1 / 3] * 6, abs=1e-9)


@pytest.mark.parametrize('scheme', SCHEMES)
@pytest.mark.parametrize('build', SWITCHES, ids=plant)
def test_the_penalty_makes_lengths_nearly_equal(build, scheme):
    m = run(build(), nfe=12, ncp=2, scheme=scheme, equilibration='penalty')
    assert spread(m) <= 1e-4
    assert [s.time for s in pyomo_fesd.switches(m)] == pytest.approx(SWITCHES[build], abs=1e-8)


@pytest.mark.parametrize('mode', ['none', 'complementarity'])
@pytest.mark.parametrize('scheme', SCHEMES)
@pytest.mark.parametrize('build', [signum.build, crossing.build, sliding.build], ids=plant)
def test_other_modes_are_right_where_they_solve(build, scheme, mode):
    m = transform(build(), nfe=6, ncp=2, scheme=scheme, equilibration=mode)
    if pyo.check_optimal_termination(pyo.SolverFactory('mpec_hybrid').solve(m)):
        assert [s.time for s in pyomo_fesd.switches(m)] == pytest.approx(SWITCHES[build], abs=1e-7)
        assert mode == 'none' or spread(m) <= 1e-3


@pytest.mark.parametrize('mode', ['none', 'complementarity'])
def test_other_modes_solve_signum(mode):
    m = run(signum.build(), nfe=10, ncp=2, equilibration=mode)
    assert m.x[2].value == pytest.approx(4 / 3, abs=1e-8)


def test_without_equilibration_lengths_are_left_as_they_come():
    m = run(signum.build(), nfe=10, ncp=2, equilibration='none')
    assert spread(m) > 1e-3


# The pairs


@pytest.mark.parametrize(
    'mode, pairs, decided', [('two_stage', 22, 27), ('complementarity', 31, 0), ('penalty', 22, 0), ('none', 22, 0)]
)
def test_each_mode_costs_its_pairs(mode, pairs, decided):
    report = pyomo_fesd.report(transform(signum.build(), nfe=10, equilibration=mode))
    assert (report['pairs'], report['decided']) == (pairs, decided)


def test_stages_are_equilibrated_each_for_itself():
    m = transform(held_control.build(), nfe=6)
    assert list(block(m).equilibration) == list(block(m).equal_length) == [1, 2, 4, 5]


def test_one_element_a_stage_needs_no_equilibration():
    m = transform(held_control.build(), nfe=2)
    assert len(block(m).equilibration) == 0


@pytest.mark.parametrize('mode', ['two_stage', 'complementarity', 'penalty', 'none'])
def test_the_equations_of_equal_length_wait_for_the_branch(mode):
    m = transform(signum.build(), nfe=5, equilibration=mode)
    assert not any(c.active for c in block(m).equal_length.values())
    assert {c.active for c in block(m).equilibration.values()} == {mode in ('two_stage', 'complementarity')}


def test_the_reported_objective_carries_no_penalty():
    m = free_start.build_free()
    transform(m, nfe=10, ncp=3, rho=10.0)
    results = pyo.SolverFactory('mpec_hybrid').solve(m)
    pyo.assert_optimal_termination(results)
    assert results.problem.upper_bound == pytest.approx(free_start.VALUE, abs=1e-7)
    assert m.x[0].value == pytest.approx(free_start.START, abs=1e-5)


# The indicator


def set_multipliers(m, nu):
    """Put nu at every collocation point of each element of signum, lam in keeping with it at scale 1e-3."""
    modes = m.component('_pyomo_fesd_dcs').sgn
    for t in m.t:
        n = next((n for n, right in enumerate(list(m.t.get_finite_elements())[1:], start=1) if t <= right), 1)
        modes.alpha[t].value = nu[n - 1]
        modes.p[t].value = 1e-3 if nu[n - 1] == 1 else 0
        modes.n[t].value = 1e-3 if nu[n - 1] == 0 else 0


@pytest.mark.parametrize(
    'nu, eta',
    [
        ((1, 1, 1), (1, 1)),  # below all the time
        ((0, 0, 0), (1, 1)),  # above all the time
        ((0.5, 0.5, 0.5), (1, 1)),  # slides all the time
        ((1, 0.5, 0.5), (0, 1)),  # enters a slide
        ((0.5, 0.5, 0), (1, 0)),  # leaves it
    ],
)
def test_the_indicator_is_one_where_the_active_set_goes_on_and_zero_where_it_changes(nu, eta):
    m = transform(signum.build(), nfe=3, ncp=2)
    set_multipliers(m, nu)
    for n, expected in enumerate(eta, start=1):
        assert pyo.value(block(m).eta[n]) == pytest.approx(expected, abs=1e-2)


def test_the_indicator_is_defined_where_both_sides_vanish():
    m = transform(signum.build(), nfe=3)
    for v in m.component_data_objects(pyo.Var):
        if not v.fixed:
            v.set_value(0, skip_validation=True)
    assert all(np.isfinite(pyo.value(block(m).eta[n])) for n in (1, 2))


def test_a_model_without_conditions_gets_no_equilibration():
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2))
    m.x = pyo.Var(m.t)
    m.dx = dae.DerivativeVar(m.x)
    move(m)
    assert not list(m.component_data_objects(Complementarity))


def test_a_condition_may_be_there_in_one_stage_only():
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=[0, 1, 2])
    m.x = pyo.Var(m.t, initialize=-1.5)
    m.dx = dae.DerivativeVar(m.x)
    m.x[0].fix(-1.5)
    m.s = pyo.Var(m.t, bounds=(0, None), initialize=0)
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == 1 + m.s[t])
    m.off = pyo.Constraint(m.t, rule=lambda m, t: m.s[t] == 0 if t <= 1 else pyo.Constraint.Skip)
    m.on = Complementarity(m.t, rule=lambda m, t: complements(m.s[t] >= 0, m.s[t] - m.x[t] >= 0) if t > 1 else Complementarity.Skip)
    solve(move(m, 8, 3, continuous=[m.s]))
    # 0 at 1.5, then dx = 1 + x
    assert m.x[2].value == pytest.approx(exp(0.5) - 1, abs=1e-6)
