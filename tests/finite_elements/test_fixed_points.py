"""Fixed points: element boundaries that keep their time, where inputs do not change."""

import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
import signum

import pyomo_fesd
from pyomo_fesd import FesdError
from tests.models import above, add_modes, below, collocate, dcs, finite_elements, scalar_ode, snapshot
from tests.problems import fast_start, held_control, rest_to_rest


def test_they_keep_their_time_and_the_switch_is_found():
    m = finite_elements(dcs(signum.build()), fixed_points=[1.9, 0.6, 0.6], nfe=[3, 3, 2], ncp=2)
    pyomo_fesd.simulate(m)
    time = pyomo_fesd.physical_time(m)
    assert (time[0.6], time[1.9]) == pytest.approx((0.6, 1.9), abs=1e-12)
    assert pyomo_fesd.switches(m)[0].time == pytest.approx(signum.SWITCH, abs=1e-9)
    assert m.x[2].value == pytest.approx(signum.FINAL, abs=1e-9)


def test_elements_on_both_sides_have_different_lengths():
    m = finite_elements(dcs(signum.build()), fixed_points=[0.5], nfe=[5, 2], ncp=1)
    results = pyo.SolverFactory('mpec_hybrid').solve(m)
    time, boundaries = pyomo_fesd.physical_time(m), m.t.get_finite_elements()
    assert results.solver.stationarity == 'B'
    # equal before the point; behind it the switch lies between the two
    assert [time[t] for t in boundaries] == pytest.approx([0, 0.1, 0.2, 0.3, 0.4, 0.5, signum.SWITCH, 2], abs=1e-7)


def test_a_given_input_has_one_value_on_both_sides():
    m = dcs(fast_start.build((0, 0.4, 1), (0.5, 2)))
    finite_elements(m, fixed_points=[0.1, 0.7], nfe=[2] * 4, piecewise_constant=[m.u])
    assert {m.u[t].value for t in m.t if 0 < t <= 0.4} == {0.5} and {m.u[t].value for t in m.t if t > 0.4} == {2}
    assert all(m.u[t].fixed for t in m.t)


def test_a_free_control_has_one_value_on_both_sides():
    m = dcs(held_control.build())
    finite_elements(m, fixed_points=[0.3, 1.5], nfe=[2, 2, 2, 2], ncp=3, piecewise_constant=[m.u])
    results = pyo.SolverFactory('mpec_hybrid').solve(m)
    assert results.solver.stationarity == 'B'
    assert pyo.value(m.cost) == pytest.approx(held_control.VALUE, abs=1e-4)
    assert [m.u[t].value for t in m.t if 0 < t <= 1] == pytest.approx([m.u[1].value] * 12, abs=1e-8)
    assert [m.u[t].value for t in m.t if t > 1] == pytest.approx([m.u[2].value] * 12, abs=1e-8)


def test_one_number_is_shared_by_length():
    m = finite_elements(dcs(signum.build()), fixed_points=[0.5], nfe=8, ncp=1)
    assert sum(t <= 0.5 for t in m.t.get_finite_elements()) == 3


def test_a_free_final_time_moves_them_in_proportion():
    m = dcs(rest_to_rest.build((0, 3)))
    finite_elements(m, fixed_points=[1], nfe=[2, 4], ncp=2, final_time=m.T)
    assert pyo.SolverFactory('mpec_hybrid').solve(m).solver.stationarity == 'B'
    assert pyomo_fesd.physical_time(m)[1] == pytest.approx(m.T.value / 3, rel=1e-9)
    assert m.T.value == pytest.approx(rest_to_rest.SHORTEST, abs=1e-7)


def test_lengths_of_control_stages_do_not_count_them():
    m = rest_to_rest.build((0, 1, 2))
    m.cost.deactivate()
    m.length = pyo.Var([1, 2], bounds=(0.1, None), initialize=1)
    m.total = pyo.Objective(expr=m.length[1] + m.length[2])
    finite_elements(dcs(m), fixed_points=[0.25], nfe=[1, 1, 1], ncp=2, stage_lengths=m.length, piecewise_constant=[m.u])
    assert pyo.SolverFactory('mpec_hybrid').solve(m).solver.stationarity == 'B'
    expected = [2 / 3 * rest_to_rest.SHORTEST, rest_to_rest.SHORTEST / 3]
    assert [v.value for v in m.length.values()] == pytest.approx(expected, abs=1e-7)
    assert pyomo_fesd.physical_time(m)[0.25] == pytest.approx(expected[0] / 4, abs=1e-7)


def test_explicit_time_is_seen_across_them(caplog):
    m = signum.build()
    m.y = pyo.Var(m.t, initialize=1)
    m.extra = pyo.Constraint(m.t, rule=lambda m, t: m.y[t] == 2 * t)
    finite_elements(dcs(m), fixed_points=[0.2 * k for k in range(1, 10)], nfe=[1] * 10, ncp=1)
    assert 'depend on the time label' in caplog.text


def test_a_discretised_model_has_them_among_its_boundaries():
    m = collocate(scalar_ode(), nfe=6)
    dcs(add_modes(m, above, below))
    point = m.t.get_finite_elements()[3]
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, fixed_points=[point])
    results = pyo.SolverFactory('mpec_hybrid').solve(m)
    assert results.solver.stationarity == 'B'
    assert pyomo_fesd.physical_time(m)[point] == pytest.approx(point, abs=1e-9)
    assert pyomo_fesd.switches(m)[0].time == pytest.approx(2 / 3, abs=1e-7)


@pytest.mark.parametrize(
    'points, message',
    [
        ([0], 'is not inside of'),
        ([3.0], 'is not inside of'),
        ([0.5, 2], 'is not inside of'),
        ([float('nan')], 'not a list of numbers'),
        ('0.5', 'not a list of numbers'),
    ],
)
def test_refused(points, message):
    m = dcs(signum.build())
    before = snapshot(m)
    with pytest.raises((FesdError, ValueError), match=message):
        finite_elements(m, fixed_points=points)
    assert snapshot(m) == before


def test_boundaries_of_control_stages_are_refused():
    m = dcs(held_control.build())
    with pytest.raises(FesdError, match='a boundary of control stages'):
        finite_elements(m, fixed_points=[1])


def test_places_that_a_discretised_model_does_not_have_are_refused():
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 1))
    m.x = pyo.Var(m.t, initialize=1)
    m.dx = dae.DerivativeVar(m.x)
    pyo.TransformationFactory('dae.collocation').apply_to(m, nfe=4, ncp=2)
    with pytest.raises(FesdError, match='not element boundaries'):
        finite_elements(m, fixed_points=[0.4])
