"""``refine`` places fixed points at fast starts: few elements, no new values of inputs, and the exact answer."""

import numpy as np
import pyomo.environ as pyo
import pytest
from hypothesis import given
from hypothesis import strategies as st

import pyomo_fesd
from pyomo_fesd.refinement import round_solver as solver
from pyomo_fesd.refinement.grading import Profile, with_worthy_points
from tests.models import dcs, snapshot
from tests.problems import fast_start

TOLERANCE = 1e-6


def inputs_of(m, first, last):
    """Values of the input in a control stage."""
    return {m.u[t].value for t in m.t if first < t <= last}


@pytest.mark.parametrize('rate', [1e3, 1e5])
def test_a_fast_start_before_a_switch(rate):
    m = dcs(fast_start.build(rate=rate))
    found = pyomo_fesd.refine(m, TOLERANCE, piecewise_constant=[m.u])
    assert found.reached and found.table['elements'].iloc[-1] <= 200
    assert pyomo_fesd.switches(m)[0].time == pytest.approx(fast_start.switch(rate=rate), abs=TOLERANCE)
    assert m.y[1].value == pytest.approx(fast_start.final(rate=rate), abs=TOLERANCE)
    # the shortest elements are at the start, and only there
    time = np.array(list(pyomo_fesd.physical_time(m).values()))
    assert np.diff(time)[0] < 1 / rate and np.max(np.diff(time)) > 0.01
    assert found.fixed_points[0] < 100 / rate


def test_a_transient_behind_a_jump_of_an_input():
    m = dcs(fast_start.build((0, 0.4, 1), (0, 1)))
    found = pyomo_fesd.refine(m, TOLERANCE, piecewise_constant=[m.u])
    assert found.reached and found.table['elements'].iloc[-1] <= 120
    assert pyomo_fesd.switches(m)[0].time == pytest.approx(fast_start.switch(begin=0.4), abs=TOLERANCE)
    assert m.y[1].value == pytest.approx(fast_start.final(begin=0.4), abs=TOLERANCE)
    assert min(found.fixed_points) > 0.4 and inputs_of(m, 0, 0.4) == {0} and inputs_of(m, 0.4, 1) == {1}


def test_fixed_points_give_a_control_no_more_values():
    m = dcs(fast_start.build(inputs=(None,)))
    m.cost = pyo.Objective(expr=(m.y[1] - 1.2) ** 2 + (m.u[1] - 1) ** 2 / 10)
    for t in m.t:
        m.u[t].set_value(0.8)
    found = pyomo_fesd.refine(m, TOLERANCE, piecewise_constant=[m.u])
    a = 2 * (1 - 1 / fast_start.RATE)
    exact = (1.4 * a + 0.1) / (a**2 + 0.1)
    assert found.reached and found.fixed_points
    assert m.u[1].value == pytest.approx(exact, abs=1e-5)
    assert max(inputs_of(m, 0, 1)) - min(inputs_of(m, 0, 1)) < 1e-9
    assert pyomo_fesd.switches(m)[0].time == pytest.approx(fast_start.switch(exact), abs=1e-5)


def test_labels_of_a_free_final_time():
    m = dcs(fast_start.build())
    m.T = pyo.Var(bounds=(0.1, 10), initialize=1.5)
    m.reached = pyo.Constraint(expr=m.y[1] == 1)
    m.cost = pyo.Objective(expr=m.T)
    found = pyomo_fesd.refine(m, TOLERANCE, piecewise_constant=[m.u], final_time=m.T)
    assert found.reached and found.fixed_points
    assert m.T.value == pytest.approx(fast_start.switch() + 0.4, abs=2e-6)
    point = found.fixed_points[0]
    assert pyomo_fesd.physical_time(m)[point] == pytest.approx(point * m.T.value, rel=1e-6)


def test_the_table_names_the_points_and_the_last_grid_has_them():
    m = dcs(fast_start.build())
    found = pyomo_fesd.refine(m, TOLERANCE, piecewise_constant=[m.u])
    notes = ' '.join(found.table['note'])
    assert found.fixed_points and all(f'{t:g}' in notes for t in found.fixed_points)
    assert set(found.fixed_points) < set(m.t.get_finite_elements())
    assert len(found.table['nfe'].iloc[-1]) == len(found.fixed_points) + 1


def test_given_points_are_kept():
    m = dcs(fast_start.build())
    found = pyomo_fesd.refine(m, 1e-4, piecewise_constant=[m.u], fixed_points=[0.005, 0.02])
    assert found.reached and {0.005, 0.02} <= set(found.fixed_points)
    assert pyomo_fesd.switches(m)[0].time == pytest.approx(fast_start.switch(), abs=1e-4)


def test_no_point_without_a_transient():
    m = dcs(fast_start.build(rate=3.0))
    found = pyomo_fesd.refine(m, 1e-6, piecewise_constant=[m.u])
    assert found.reached and found.fixed_points == ()


def test_the_last_rounds_are_left_for_comparison():
    m = dcs(fast_start.build(rate=1e5))
    found = pyomo_fesd.refine(m, TOLERANCE, piecewise_constant=[m.u], max_rounds=4)
    assert not found.reached and found.error > 0
    assert 'fixed points' not in ' '.join(found.table['note'].iloc[-2:])


def test_an_interruption_after_points_were_placed_leaves_the_model_as_it_was(monkeypatch):
    calls = []

    def interrupted(model, wrt, **options):
        calls.append(len(wrt))
        if len(calls) == 3:
            raise KeyboardInterrupt
        return pyomo_fesd.simulate(model, wrt, **options)

    monkeypatch.setattr(solver, 'simulate', interrupted)
    m = dcs(fast_start.build())
    before = snapshot(m)
    with pytest.raises(KeyboardInterrupt):
        pyomo_fesd.refine(m, TOLERANCE, piecewise_constant=[m.u])
    assert snapshot(m) == before and list(m.t) == [0, 1]


# Laws

PROFILES = st.lists(st.tuples(st.floats(0.01, 10), st.floats(1e-3, 1e3)), min_size=2, max_size=12)


def profile(elements):
    lengths, density = zip(*elements)
    return Profile(np.cumsum([0.0, *lengths]), np.array(density), 5)


@given(PROFILES)
def test_points_save_elements_and_never_more_than_a_mesh_that_follows_the_density(elements):
    p = profile(elements)
    ends = [p.nodes[0], p.nodes[-1]]
    chosen = with_worthy_points(p, ends, p.nodes[1:-1].tolist())
    least = p.density @ np.diff(p.nodes)
    assert least * (1 - 1e-9) <= p.weights(chosen).sum() <= p.weights(ends).sum() * (1 + 1e-9)
    assert p.weights(p.nodes).sum() == pytest.approx(least)


@given(st.floats(1e-6, 1e-2))
def test_a_layer_at_the_start_gets_a_point_behind_it(width):
    p = profile([(width, 1 / width), (0.5 - width, 1.0), (0.5, 1.0)])
    assert with_worthy_points(p, [0.0, 1.0], p.nodes[1:-1].tolist()) == [0.0, p.nodes[1], 1.0]
