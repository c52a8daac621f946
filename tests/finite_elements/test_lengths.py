"""Element lengths as variables: what they add up to, and r_n in front of each derivative (theory, eq. 9 and 10)."""

import numpy as np
import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
import signum
from hypothesis import given, settings
from hypothesis import strategies as st
from pyomo.core.expr.visitor import identify_variables
from pyomo.gdp import Disjunction
from pyomo.mpec import Complementarity, complements

import pyomo_fesd
from pyomo_fesd import FesdError
from tests.models import dcs
from tests.problems import crossing, double_integrator, free_start, held_control, weir
from tests.problems.running import LEGENDRE, RADAU, SCHEMES, lengths, move, multipliers, run, solve, transform

# Sums


@pytest.mark.parametrize('scheme', SCHEMES)
@pytest.mark.parametrize('build', [signum.build, crossing.build, weir.build])
def test_lengths_sum_to_the_horizon(build, scheme):
    m = run(build(), nfe=5, scheme=scheme)
    assert sum(lengths(m)) == pytest.approx(m.t.last() - m.t.first(), abs=1e-10)
    assert min(lengths(m)) > 0
    assert max(lengths(m)) > min(lengths(m)) + 1e-3  # they did move


@pytest.mark.parametrize('scheme', SCHEMES)
def test_stage_boundaries_keep_their_physical_time(scheme):
    m = free_start.build(-2)
    m.t.add(0.5)
    m.t.add(1.3)
    run(m, nfe=9, scheme=scheme)
    times = pyomo_fesd.physical_time(m)
    assert [times[label] for label in (0, 0.5, 1.3, 2)] == pytest.approx([0, 0.5, 1.3, 2], abs=1e-10)
    starts = pyomo_fesd.element_lengths(m)['start']
    assert [starts[n] for n in (1, 4, 7)] == pytest.approx([0, 0.5, 1.3], abs=1e-10)
    (switch,) = pyomo_fesd.switches(m)
    assert switch.time == pytest.approx(2 / 3, abs=1e-9)


def test_a_stage_of_one_element_has_no_freedom():
    m = free_start.build(-2)
    m.t.add(2 / 3)
    transform(m, nfe=2)
    assert all(r.fixed and r.value == 1 for r in multipliers(m.t).values())
    assert solve(m).x[2].value == pytest.approx(4 / 3, abs=1e-9)


def test_each_stage_has_as_much_freedom_as_elements_less_one():
    m = held_control.build()
    transform(m, nfe=6)
    equations = m.component('_pyomo_fesd_elements_t').stage_length
    assert [len(list(identify_variables(e.body))) for e in equations.values()] == [3, 3]
    # in mean lengths
    assert [pyo.value(e.upper) for e in equations.values()] == [3, 3]


# r_n in the discretisation equations


@pytest.mark.parametrize('scheme, ncp', [(RADAU, 1), (RADAU, 3), (LEGENDRE, 2)])
@given(st.lists(st.floats(0.2, 1.8), min_size=3, max_size=3))
@settings(max_examples=15, deadline=None)
def test_equations_hold_for_any_lengths_on_the_path_that_they_discretise(scheme, ncp, shares):
    m = move(powers(ncp), 4, ncp, scheme=scheme)
    set_lengths(m, shares)
    times = pyomo_fesd.physical_time(m)
    for t, now in times.items():
        m.x[t].value, m.dx[t].value = now**ncp, ncp * now ** (ncp - 1)
    equations = [c for name in ('dx_disc_eq', 'x_t_cont_eq') if m.component(name) for c in m.component(name).values()]
    assert len(equations) == 4 * ncp + (4 if scheme == LEGENDRE else 0)
    for equation in equations:
        assert pyo.value(equation.body) == pytest.approx(pyo.value(equation.upper), abs=1e-9), equation.name


def powers(degree):
    """x = t^degree, with its derivative; no equations."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2))
    m.x = pyo.Var(m.t, initialize=1)
    m.dx = dae.DerivativeVar(m.x)
    return m


def set_lengths(m, shares):
    """Lengths in proportion 1 : shares, of four elements of nominal length 1/2 each."""
    r = multipliers(m.t)
    for n, share in enumerate([1, *shares], start=1):
        r[n].set_value(4 * share / (1 + sum(shares)), skip_validation=True)


def test_names_and_number_of_the_discretisation_equations_stay():
    m, fixed = move(powers(1), 3, 2), powers(1)
    pyo.TransformationFactory('dae.collocation').apply_to(fixed, wrt=fixed.t, nfe=3, ncp=2)
    assert set(m.dx_disc_eq) == set(fixed.dx_disc_eq)


def test_lengths_at_their_nominal_values_change_nothing():
    m, fixed = move(powers(1), 3, 2), powers(1)
    pyo.TransformationFactory('dae.collocation').apply_to(fixed, wrt=fixed.t, nfe=3, ncp=2)
    for model in (m, fixed):
        for k, v in enumerate([*model.x.values(), *model.dx.values()]):
            v.value = np.sin(k)
    for index in fixed.dx_disc_eq:
        one, other = (pyo.value(model.dx_disc_eq[index].body) for model in (m, fixed))
        assert one == pytest.approx(other, abs=1e-12)


def test_an_equation_that_was_rescaled_before_still_gets_the_length():
    m = free_start.build(-2, discretise=lambda m: pyo.TransformationFactory('dae.collocation').apply_to(m, nfe=5, ncp=2))
    for equation in m.dx_disc_eq.values():
        left, right = equation.expr.args
        equation.set_value(1e-3 * left - 1e-3 * right == 0)
    solve(move(dcs(m)))
    (switch,) = pyomo_fesd.switches(m)
    assert switch.time == pytest.approx(2 / 3, abs=1e-8)


@pytest.mark.parametrize('scheme', SCHEMES)
def test_second_derivatives_are_right_on_elements_that_moved(scheme):
    m = run(double_integrator.build(), nfe=5, ncp=3, scheme=scheme)
    (switch,) = pyomo_fesd.switches(m)
    assert switch.time == pytest.approx(double_integrator.SWITCH, abs=1e-9)
    assert m.q[2].value == pytest.approx(double_integrator.FINAL_Q, abs=1e-9)
    assert m.v[2].value == pytest.approx(double_integrator.FINAL_V, abs=1e-9)
    assert abs(lengths(m)[0] - 0.4) > 1e-3
    frame = pyomo_fesd.trajectory(m)
    inside = frame[frame['label'].isin(list(m.ddq_disc_eq))]
    expected = np.where(inside.index <= 1 + 1e-9, *double_integrator.ACCELERATIONS)
    assert np.abs(inside['ddq'] - expected).max() <= 1e-7


def test_states_with_further_indices_and_in_blocks_get_the_length_of_their_element():
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2))
    m.i = pyo.Set(initialize=['a', 'b'])
    m.x = pyo.Var(m.i, m.t)
    m.dx = dae.DerivativeVar(m.x, wrt=m.t)
    m.unit = pyo.Block(m.i)
    for i in m.i:
        m.unit[i].y = pyo.Var(m.t)
        m.unit[i].dy = dae.DerivativeVar(m.unit[i].y)
    move(m, 2, 2)
    r = multipliers(m.t)
    points = {1: list(m.t)[1:3], 2: list(m.t)[3:5]}
    for n, labels in points.items():
        for t in labels:
            for equation in (*(m.dx_disc_eq[i, t] for i in m.i), *(m.unit[i].dy_disc_eq[t] for i in m.i)):
                found = [v for v in identify_variables(equation.expr, include_fixed=True) if v.parent_component() is r]
                assert found == [r[n]], equation.name


def test_derivatives_in_space_stay_as_they_are():
    m = pyo.ConcreteModel()
    m.t, m.z = dae.ContinuousSet(bounds=(0, 2)), dae.ContinuousSet(bounds=(0, 1))
    m.T = pyo.Var(m.t, m.z)
    m.dTdt, m.dTdz = dae.DerivativeVar(m.T, wrt=m.t), dae.DerivativeVar(m.T, wrt=m.z)
    pyo.TransformationFactory('dae.finite_difference').apply_to(m, wrt=m.z, nfe=2, scheme='BACKWARD')
    move(m, 2, 1, wrt=m.t)
    r = multipliers(m.t)

    def has_length(equation):
        return any(v.parent_component() is r for v in identify_variables(equation.expr, include_fixed=True))

    assert all(has_length(e) for e in m.dTdt_disc_eq.values())
    assert not any(has_length(e) for e in m.dTdz_disc_eq.values())


# Backward difference


def backward(m):
    pyo.TransformationFactory('dae.finite_difference').apply_to(m, wrt=m.t, nfe=5, scheme='BACKWARD')


def test_a_backward_difference_on_a_discretised_model_is_made_movable():
    m = solve(move(dcs(free_start.build(-2, discretise=backward))))
    (switch,) = pyomo_fesd.switches(m)
    assert switch.time == pytest.approx(2 / 3, abs=1e-9)
    assert m.x[2].value == pytest.approx(4 / 3, abs=1e-9)


def test_a_second_backward_difference_joins_two_elements_and_is_refused():
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2))
    m.q = pyo.Var(m.t, initialize=1)
    m.ddq = dae.DerivativeVar(m.q, wrt=(m.t, m.t))
    backward(m)
    m.ground = Disjunction(m.t, rule=lambda m, t: [[m.q[t] >= 0.5, m.ddq[t] == -1], [m.q[t] <= 0.5, m.ddq[t] == -0.25]])
    with pytest.raises(FesdError, match='ddq'):
        move(dcs(m))


# Second and mixed derivatives


def falling():
    """d2q/dt2 = -1 above q = 1/2 and -1/4 below, by a second derivative."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2))
    m.q = pyo.Var(m.t, initialize=1)
    m.dq = dae.DerivativeVar(m.q)
    m.ddq = dae.DerivativeVar(m.q, wrt=(m.t, m.t))
    m.q[0].fix(1)
    m.dq[0].fix(0)
    m.ground = Disjunction(m.t, rule=lambda m, t: [[m.q[t] >= 0.5, m.ddq[t] == -1], [m.q[t] <= 0.5, m.ddq[t] == -0.25]])
    return dcs(m)


@pytest.mark.parametrize('scheme', SCHEMES)
def test_a_second_derivative_that_determines_the_motion_is_refused(scheme):
    m = falling()
    with pytest.raises(FesdError, match="^ddq: a derivative of order 2 .* 'ground.mode.*rates of 'q'") as error:
        move(m, 4, 3, scheme=scheme)
    assert 'make the first derivative a state' in str(error.value)
    assert len(m.t) == 2


def test_a_second_derivative_in_a_complementarity_is_refused():
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2))
    m.q = pyo.Var(m.t, initialize=1)
    m.ddq = dae.DerivativeVar(m.q, wrt=(m.t, m.t))
    m.contact = Complementarity(m.t, rule=lambda m, t: complements(m.q[t] >= 0, m.ddq[t] + 1 >= 0))
    with pytest.raises(FesdError, match="^ddq: .*'contact'"):
        move(m, 4, 3)


@pytest.mark.parametrize('way', ['simulate', 'solve'])
@pytest.mark.parametrize('determines', [False, True])
@pytest.mark.parametrize('time_first', [False, True])
def test_a_derivative_with_respect_to_time_and_space_has_one_factor(time_first, determines, way):
    """T = S(t) (1 + z) with dS/dt = 1 until T(t, 0) = 1 and 3 after, so d2T/dtdz = dS/dt."""
    m = pyo.ConcreteModel()
    m.t, m.z = dae.ContinuousSet(bounds=(0, 2)), dae.ContinuousSet(bounds=(0, 1))
    m.T, m.s = pyo.Var(m.t, m.z, initialize=0), pyo.Var(m.t, initialize=1)
    m.dT = dae.DerivativeVar(m.T, wrt=m.t)
    m.dTdz = dae.DerivativeVar(m.T, wrt=(m.t, m.z) if time_first else (m.z, m.t))
    pyo.TransformationFactory('dae.finite_difference').apply_to(m, wrt=m.z, nfe=3, scheme='BACKWARD')
    m.T[0, ...].fix(0)
    m.d = Disjunction(m.t, rule=lambda m, t: [[m.T[t, 0] <= 1, m.s[t] == 1], [m.T[t, 0] >= 1, m.s[t] == 3]])
    m.base = pyo.Constraint(m.t, rule=lambda m, t: m.dT[t, 0] == m.s[t])

    @m.Constraint(m.t, m.z)
    def above(m, t, z):
        if z == 0:
            return pyo.Constraint.Skip
        return m.dTdz[t, z] == m.s[t] if determines else m.dT[t, z] == m.s[t] * (1 + z)

    move(dcs(m, wrt=m.t), 3, 2, wrt=m.t)
    pyomo_fesd.simulate(m, m.t) if way == 'simulate' else solve(m)
    assert m.T[2, 1].value == pytest.approx(8, abs=1e-8)
    assert {round(m.dTdz[t, 1].value, 6) for t in m.t if t > 0} == {1, 3}


@pytest.mark.parametrize('late', [-1e-2, -1e-4, 1e-3])
def test_a_switch_nearer_to_a_stage_boundary_than_length_bounds_allow(late):
    """The path with elements of a tenth and more ends in nothing feasible; shorter ones come second."""
    m = crossing.build()
    m.t.add(0.5 - late)
    m.t.add(1)
    run(m, 12, 2)
    (switch,) = pyomo_fesd.switches(m)
    assert switch.time == pytest.approx(crossing.SWITCH, abs=1e-8)
    assert pyomo_fesd.element_lengths(m)['length'].min() < 0.1 * min(0.5 - late, 0.5 + late) / 4
