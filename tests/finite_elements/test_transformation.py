"""fesd.finite_elements as a user meets it: exact answers, its keywords, what it refuses, copies."""

from math import exp

import gas_liquid_tank
import oscillator
import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
import signum
from pyomo.gdp import Disjunction
from pyomo.mpec import Complementarity, complements

import pyomo_fesd
from pyomo_fesd import FesdError
from tests.models import dcs
from tests.problems import clock, crossing, free_start, sliding, two_systems, weir
from tests.problems.running import (
    EXACT_SCHEMES,
    LEGENDRE,
    RADAU,
    SCHEMES,
    lengths,
    move,
    multipliers,
    run,
    seen,
    solve,
    transform,
)

FORMS = ('element', 'point', 'full')


def switch_time(m):
    """Time of the only switch."""
    (switch,) = pyomo_fesd.switches(m)
    return switch.time


# Exact answers


@pytest.mark.parametrize('scheme, ncp', EXACT_SCHEMES)
def test_signum_is_exact_with_ten_elements(scheme, ncp):
    m = run(signum.build(), nfe=10, ncp=ncp, scheme=scheme)
    assert switch_time(m) == pytest.approx(2 / 3, abs=1e-9)
    assert m.x[2].value == pytest.approx(4 / 3, abs=1e-9)


@pytest.mark.parametrize('scheme, ncp', EXACT_SCHEMES)
def test_a_crossing_is_exact(scheme, ncp):
    m = run(crossing.build(), nfe=5, ncp=ncp, scheme=scheme)
    assert switch_time(m) == pytest.approx(crossing.SWITCH, abs=1e-9)
    assert m.x[1.5].value == pytest.approx(crossing.FINAL, abs=1e-9)


@pytest.mark.parametrize('scheme, ncp', EXACT_SCHEMES)
def test_a_slide_is_entered_at_its_time_and_held_with_both_modes_at_one_half(scheme, ncp):
    m = run(sliding.build(), nfe=5, ncp=ncp, scheme=scheme)
    assert switch_time(m) == pytest.approx(sliding.SWITCH, abs=1e-9)
    slide = pyomo_fesd.trajectory(m).query('element > 2 and time > 0.5')
    assert slide['x'].abs().max() <= 1e-9
    assert (slide['friction: rising'] - sliding.NU).abs().max() <= 1e-8


@pytest.mark.parametrize('ncp', [2, 3])
def test_a_slide_on_a_curved_surface_is_exact_with_radau(ncp):
    m = run(sliding.build_curved(), nfe=4, ncp=ncp, scheme=RADAU)
    assert switch_time(m) == pytest.approx(sliding.CURVED['switch'], abs=1e-9)
    assert m.x[0.45].value == pytest.approx(sliding.CURVED['x'], abs=1e-9)


@pytest.mark.parametrize('scheme', SCHEMES)
def test_two_systems_switch_each_at_its_own_time(scheme):
    m = run(two_systems.build(), nfe=8, ncp=2, scheme=scheme)
    found = [(s.time, s.disjunction) for s in pyomo_fesd.switches(m)]
    assert [name for _, name in found] == [name for _, name in two_systems.SWITCHES]
    assert [time for time, _ in found] == pytest.approx([time for time, _ in two_systems.SWITCHES], abs=1e-8)
    assert m.x[2].value == pytest.approx(two_systems.FINAL_X, abs=1e-8)
    assert m.y[2].value == pytest.approx(two_systems.FINAL_Y, abs=1e-8)


@pytest.mark.parametrize('scheme, ncp', [(RADAU, 3), (LEGENDRE, 2)])
def test_time_dependence_by_a_clock_state_is_exact(scheme, ncp):
    m = run(clock.build(), nfe=5, ncp=ncp, scheme=scheme)
    assert switch_time(m) == pytest.approx(clock.SWITCH, abs=1e-9)
    assert m.x[2].value == pytest.approx(clock.FINAL, abs=1e-8)
    frame = pyomo_fesd.trajectory(m)
    assert (frame['c'] - frame.index).abs().max() <= 1e-9


@pytest.mark.parametrize('build', [gas_liquid_tank.build, gas_liquid_tank.build_in_blocks, gas_liquid_tank.build_eliminated])
def test_the_tank_is_right_however_it_is_written(build):
    m = run(build(), nfe=20, ncp=3)
    for name, number in gas_liquid_tank.found(m).items():
        assert number == pytest.approx(gas_liquid_tank.EXACT[name], rel=1e-7), name


def test_halving_the_elements_divides_the_error_by_eight_at_order_three():
    coarse, fine = (oscillator.error(oscillator.solve(nfe, 2, RADAU)[0]) for nfe in (20, 40))
    assert 6 <= coarse / fine <= 11


@pytest.mark.parametrize('form', ['stewart', 'heaviside'])
@pytest.mark.parametrize('scheme', SCHEMES)
@pytest.mark.parametrize('cross', FORMS)
def test_every_form_gives_the_same_answer(form, scheme, cross):
    m = run(signum.build(), nfe=10, ncp=2, form=form, scheme=scheme, cross_complementarity=cross)
    assert switch_time(m) == pytest.approx(2 / 3, abs=1e-9)
    assert m.x[2].value == pytest.approx(4 / 3, abs=1e-9)


@pytest.mark.parametrize('form', ['stewart', 'heaviside'])
@pytest.mark.parametrize('cross', FORMS)
def test_every_form_gives_the_same_slide(form, cross):
    m = run(sliding.build(), nfe=5, ncp=2, form=form, cross_complementarity=cross)
    assert switch_time(m) == pytest.approx(sliding.SWITCH, abs=1e-9)
    assert pyomo_fesd.trajectory(m)['friction: rising'].iloc[-1] == pytest.approx(sliding.NU, abs=1e-8)


# Sensitivities


@pytest.mark.parametrize('scheme', SCHEMES)
def test_the_end_depends_on_the_start_as_it_should(scheme):
    step = 1e-3
    low, high = (run(free_start.build(-1 + d), nfe=10, ncp=2, scheme=scheme).x[2].value for d in (-step, step))
    assert (high - low) / (2 * step) == pytest.approx(free_start.SENSITIVITY, abs=1e-6)


@pytest.mark.parametrize('scheme', SCHEMES)
@pytest.mark.parametrize('guess', [-0.85, -1.3, -2.0])
def test_a_free_start_has_one_minimum_wherever_it_begins(scheme, guess):
    m = run(free_start.build_free(guess), nfe=10, ncp=3, scheme=scheme)
    assert m.x[0].value == pytest.approx(free_start.START, abs=1e-6)
    assert pyo.value(m.cost) == pytest.approx(free_start.VALUE, abs=1e-8)


# Order of the transformations


@pytest.mark.parametrize('scheme', SCHEMES)
def test_collocation_may_come_before_the_modes_are_declared(scheme):
    m = free_start.build(-2, discretise=lambda m: collocate(m, 10, scheme))
    solve(move(dcs(m)))
    other = run(signum.build(), nfe=10, ncp=2, scheme=scheme)
    assert switch_time(m) == pytest.approx(switch_time(other), abs=1e-9)
    assert m.x[2].value == pytest.approx(other.x[2].value, abs=1e-9)
    assert len(m.t) == len(other.t)


def test_elements_before_the_modes_are_transformed_are_refused():
    m = signum.build()
    refused(m, r'sgn\[0\]: an active Disjunction over time', nfe=10)
    assert switch_time(run(m, nfe=10)) == pytest.approx(2 / 3, abs=1e-9)


# Keywords


def test_without_keywords_there_are_ten_radau_elements_of_three_points():
    m = dcs(signum.build())
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m)
    info = m.t.get_discretization_info()
    assert (info['nfe'], info['ncp'], info['scheme']) == (10, 3, RADAU)


def test_keywords_may_come_as_options():
    m = dcs(signum.build())
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, options={'nfe': 6, 'ncp': 1})
    assert len(m.t) == 7


@pytest.mark.parametrize(
    'keywords',
    [
        {'scheme': 'LAGRANGE-LOBATTO'},
        {'nfe': 0},
        {'ncp': -1},
        {'cross_complementarity': 'points'},
        {'equilibration': 'hard'},
        {'length_bounds': 1},
        {'length_bounds': -0.1},
        {'rho': -1},
        {'number_of_elements': 10},
    ],
    ids=str,
)
def test_a_keyword_that_cannot_be_meant_is_refused(keywords):
    m = dcs(signum.build())
    before = seen(m)
    with pytest.raises(ValueError):
        pyo.TransformationFactory('fesd.finite_elements').apply_to(m, **keywords)
    assert seen(m) == before


def test_no_element_becomes_shorter_than_length_bounds_say_where_that_will_do():
    m = run(signum.build(), nfe=10, length_bounds=0.5)
    assert min(lengths(m)) >= 0.5 * 0.2 - 1e-9
    assert switch_time(m) == pytest.approx(2 / 3, abs=1e-9)


def test_elements_that_may_not_change_their_length_stay_where_they_are():
    m = run(crossing.build(), nfe=3, length_bounds=0)  # the switch at 0.5 is a boundary of this grid
    assert lengths(m) == pytest.approx([0.5] * 3)
    assert m.x[1.5].value == pytest.approx(crossing.FINAL, abs=1e-9)


def test_a_model_without_switches_keeps_its_elements():
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2))
    m.x = pyo.Var(m.t, initialize=1)
    m.dx = dae.DerivativeVar(m.x)
    m.x[0].fix(1)
    m.decay = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == -m.x[t])
    solve(move(m, nfe=8, ncp=3))
    assert lengths(m) == pytest.approx([0.25] * 8)
    assert m.x[2].value == pytest.approx(exp(-2), abs=1e-7)


def test_one_element_that_stays_in_one_mode_is_solved():
    m = run(free_start.build(-8.0), nfe=1)
    assert m.x[2].value == pytest.approx(-2, abs=1e-9)


def test_time_need_not_start_at_zero():
    m = free_start.build(-2, bounds=(5, 7))
    run(m, nfe=4)
    assert switch_time(m) == pytest.approx(5 + 2 / 3, abs=1e-9)
    assert m.x[7].value == pytest.approx(4 / 3, abs=1e-9)


def test_the_dynamic_part_may_be_a_sub_block_with_its_own_time():
    m = pyo.ConcreteModel()
    m.fs = crossing.build()
    dcs(m.fs, wrt=m.fs.t)
    move(m.fs, nfe=5, wrt=m.fs.t)
    solve(m)
    (switch,) = pyomo_fesd.switches(m)
    assert switch.time == pytest.approx(crossing.SWITCH, abs=1e-9)
    assert switch.disjunction == 'fs.zero'


# Refusals


def refused(m, message, **keywords):
    """Applying the elements raises an error that contains ``message`` and leaves the model as it was."""
    before = seen(m)
    with pytest.raises(FesdError, match=message) as error:
        move(m, **keywords)
    assert seen(m) == before
    assert 'Fix:' in str(error.value)


@pytest.mark.parametrize('discretised', [False, True])
def test_all_over_one_time_moves_together_whichever_block_is_asked(discretised):
    """The time stands above two blocks; elements are asked for on one of them, both have their switch."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2))
    for name, start in (('one', -1.0), ('two', -2.0)):
        b = pyo.Block()
        m.add_component(name, b)
        b.x = pyo.Var(m.t, initialize=start)
        b.dx = dae.DerivativeVar(b.x)
        b.x[0].fix(start)
    if discretised:
        pyo.TransformationFactory('dae.collocation').apply_to(m, wrt=m.t, nfe=6, ncp=2)
    for b in (m.one, m.two):
        b.sign = Disjunction(m.t, rule=lambda b, t: [[b.x[t] <= 0, b.dx[t] == 3], [b.x[t] >= 0, b.dx[t] == 1]])
    pyo.TransformationFactory('fesd.dcs').apply_to(m, wrt=m.t)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m.one, wrt=m.t, nfe=6, ncp=2)
    pyo.assert_optimal_termination(pyo.SolverFactory('mpec_hybrid').solve(m))
    assert [s.time for s in pyomo_fesd.switches(m)] == pytest.approx([1 / 3, 2 / 3], abs=1e-9)
    assert [m.one.x[2].value, m.two.x[2].value] == pytest.approx([5 / 3, 4 / 3], abs=1e-9)


def test_elements_that_cannot_be_shared_equally_among_the_stages_are_refused():
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=[0, 0.5, 1.5, 2])
    m.x = pyo.Var(m.t)
    m.dx = dae.DerivativeVar(m.x)
    refused(m, 'nfe=10 elements cannot be shared equally among 3 control stages', nfe=10)
    refused(m, 'cannot be shared', nfe=2)


def test_moving_elements_cannot_be_moved_again():
    m = transform(signum.build())
    refused(m, 't: its elements are movable already')
    refused(m.clone(), 't: its elements are movable already')


def test_a_horizon_below_the_resolution_of_labels_is_refused():
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(1e6, 1e6 + 5e-9))
    m.x = pyo.Var(m.t)
    m.dx = dae.DerivativeVar(m.x)
    refused(m, r't: .*finer than floating-point', nfe=4, ncp=2)


@pytest.mark.parametrize('scheme', ['CENTRAL', 'FORWARD'])
def test_equations_that_join_two_elements_are_refused(scheme):
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2))
    m.x = pyo.Var(m.t)
    m.dx = dae.DerivativeVar(m.x)
    pyo.TransformationFactory('dae.finite_difference').apply_to(m, wrt=m.t, nfe=4, scheme=scheme)
    refused(m, f"t: it is discretised with '{scheme} Difference', whose equations join two elements")


def test_a_model_without_time_is_refused():
    m = pyo.ConcreteModel()
    m.x = pyo.Var()
    refused(m, 'the model has no ContinuousSet')


def test_of_two_continuous_sets_one_must_be_named():
    m = signum.build()
    m.z = dae.ContinuousSet(bounds=(0, 1))
    with pytest.raises(FesdError, match=r'several ContinuousSets \(t, z\)'):
        move(m)
    solve(move(dcs(m, wrt=m.t), wrt=m.t))
    (switch,) = pyomo_fesd.switches(m, m.t)
    assert switch.time == pytest.approx(2 / 3, abs=1e-9)


@pytest.mark.parametrize('name', ['x', 'sgn'])
def test_time_must_be_a_continuous_set(name):
    m = signum.build()
    refused(m, f"{name}: .*'wrt' must be a pyomo.dae.ContinuousSet", wrt=m.component(name))


# Switches where something ends


@pytest.mark.parametrize('scheme', SCHEMES)
@pytest.mark.parametrize('points', [(0, 2 / 3, 2), (0, 2 / 3, 1, 2), (0, 0.5, 2 / 3, 2)], ids=str)
def test_a_switch_on_a_stage_boundary_is_told_once(points, scheme):
    m = free_start.build(-2)
    for point in points[1:-1]:
        m.t.add(point)
    run(m, nfe=6, ncp=2, scheme=scheme)
    assert switch_time(m) == pytest.approx(2 / 3, abs=1e-9)
    assert m.x[2].value == pytest.approx(4 / 3, abs=1e-9)


@pytest.mark.parametrize('scheme', SCHEMES)
def test_a_switch_on_a_stage_boundary_of_one_element_each_is_told_once(scheme):
    m = free_start.build(-2)
    m.t.add(2 / 3)
    assert switch_time(run(m, nfe=2, ncp=2, scheme=scheme)) == pytest.approx(2 / 3, abs=1e-12)


@pytest.mark.parametrize('scheme', SCHEMES)
@pytest.mark.parametrize('bounds, x0, end', [((0, 2 / 3), -2, 0), ((0, 2), 0, 2)], ids=['at the end', 'at the start'])
def test_a_switch_at_the_end_or_the_start_is_none(bounds, x0, end, scheme):
    m = run(free_start.build(x0, bounds=bounds), nfe=6, ncp=2, scheme=scheme)
    assert pyomo_fesd.switches(m) == []
    assert m.x[bounds[1]].value == pytest.approx(end, abs=1e-9)


@pytest.mark.parametrize('scheme', SCHEMES)
@pytest.mark.parametrize('full', [0.7, 1.0], ids=['inside', 'on a stage boundary'])
def test_a_hand_written_condition_switches_once_wherever_stages_end(full, scheme):
    m = weir.build()
    m.t.add(1.0)
    m.V_max = pyo.Param(initialize=full)
    m.del_component(m.overflow)
    m.overflow = Complementarity(m.t, rule=lambda m, t: complements(m.V[t] <= m.V_max, m.F[t] >= 0))
    solve(move(m, nfe=6, ncp=2, scheme=scheme))
    assert switch_time(m) == pytest.approx(full, abs=1e-9)


# Stages of a model that is discretised already


def test_a_discretised_model_is_one_stage():
    m = solve(move(dcs(collocated_signum())))
    assert sum(lengths(m)) == pytest.approx(2, abs=1e-12)
    assert switch_time(m) == pytest.approx(2 / 3, abs=1e-9)


def test_stages_of_a_discretised_model_keep_their_time():
    m = solve(move(dcs(collocated_signum()), stages=[0.4, 1.2]))
    times = pyomo_fesd.physical_time(m)
    assert [times[label] for label in (0, 0.4, 1.2, 2)] == pytest.approx([0, 0.4, 1.2, 2], abs=1e-12)
    assert switch_time(m) == pytest.approx(2 / 3, abs=1e-9)


def test_stages_that_are_no_boundaries_are_refused():
    m = dcs(collocated_signum())
    refused(m, r't: the control-stage boundaries \[0.5\] are not element boundaries', stages=[0.4, 0.5])
    assert switch_time(solve(move(m, stages=[0.4]))) == pytest.approx(2 / 3, abs=1e-9)


def test_stages_are_refused_before_discretisation():
    refused(dcs(signum.build()), 'stages= was given for a set that is not discretised yet', stages=[1])


def collocate(m, nfe, scheme=RADAU):
    """pyomo.dae's own collocation with two points an element."""
    pyo.TransformationFactory('dae.collocation').apply_to(m, wrt=m.t, nfe=nfe, ncp=2, scheme=scheme)


def collocated_signum():
    """Signum declared on a grid of ten Radau elements."""
    return free_start.build(-2, discretise=lambda m: collocate(m, 10))


# Copies


@pytest.mark.parametrize('build', [sliding.build, weir.build])
def test_create_using_leaves_the_original_as_it_was(build):
    m = dcs(build())
    before = seen(m)
    copy = pyo.TransformationFactory('fesd.finite_elements').create_using(m, wrt=m.t, nfe=5, ncp=2)
    assert seen(m) == before
    solve(copy)
    assert seen(m) == before
    assert switch_time(copy) == pytest.approx(build.__globals__['SWITCH'], abs=1e-9)


def test_controls_named_by_the_original_are_held_on_the_copy():
    m = dcs(sliding.build())
    m.u = pyo.Var(m.t, initialize=1)
    copy = pyo.TransformationFactory('fesd.finite_elements').create_using(m, wrt=m.t, nfe=5, ncp=2, piecewise_constant=[m.u])
    held = copy.component('_pyomo_fesd_elements_t').held
    assert len(held) == len(copy.t) - 1
    assert len(m.t) == 2


@pytest.mark.parametrize('build', [signum.build, sliding.build, weir.build])
def test_a_clone_of_a_moving_model_is_solved_without_the_original(build):
    m = transform(build())
    copy = m.clone()
    before = seen(m)
    solve(copy)
    assert seen(m) == before
    found = pyomo_fesd.switches(copy)
    solve(m)
    assert [s.time for s in found] == pytest.approx([s.time for s in pyomo_fesd.switches(m)], abs=1e-9)


def test_a_clone_taken_between_the_transformations_goes_its_own_way():
    m = dcs(sliding.build())
    copy = m.clone()
    run_times = [switch_time(solve(move(model, nfe=nfe))) for model, nfe in ((copy, 5), (m, 4))]
    assert run_times == pytest.approx([sliding.SWITCH] * 2, abs=1e-9)
    assert (len(copy.t), len(m.t)) == (11, 9)


def test_a_solved_clone_tells_its_modes():
    copy = solve(transform(signum.build()).clone())
    assert copy.below[2].indicator_var.value is False
    assert copy.above[2].indicator_var.value is True


# What can be asked afterwards


def test_element_lengths_are_those_of_the_multipliers():
    m = run(signum.build(), nfe=5)
    assert lengths(m) == pytest.approx([0.4 * r.value for r in multipliers(m.t).values()])


@pytest.mark.parametrize('cross', FORMS)
def test_each_pair_tells_the_conditions_that_it_stands_for(cross):
    m = transform(weir.build(), nfe=3, ncp=2, cross_complementarity=cross)
    elements = pyo.TransformationFactory('fesd.finite_elements')
    pairs = m.component('_pyomo_fesd_elements_t').cross
    named = {data.name for pair in pairs.values() for data in elements.get_src_complementarity(pair)}
    assert named == {m.overflow[t].name for t in m.t if t != 0}
    first = [elements.get_src_complementarity(pair) for index, pair in pairs.items() if index[1] == 1]
    assert all([c.index() for c in conditions] == list(m.t)[1:3] for conditions in first)
