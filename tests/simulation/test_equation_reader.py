"""Equations of one element, and elements of the same class."""

import bouncing_ball
import gas_liquid_tank
import pyomo.environ as pyo
import pytest
import signum
from pyomo.common.collections import ComponentSet

from pyomo_fesd.core import TimeIndex, moving_grids
from pyomo_fesd.simulation.equation_reader import EquationReader
from tests.models import scalar_ode, snapshot
from tests.problems import air_friction, held_control, threshold
from tests.problems.running import LEGENDRE, SCHEMES, move, transform


def problems(m, given=()):
    """The problems of all elements."""
    moving = moving_grids(m)[m.t]
    reader = EquationReader(m, moving, TimeIndex(m.t), ComponentSet(v for u in given for v in u.values()))
    return [reader.element(e, {}) for e in moving.grid.elements]


def names(variables):
    return {v.name.split('[')[0].split('.')[-1] for v in variables}


def classes(m, given=()):
    """The classes of all elements, numbered."""
    found = [p.element_class for p in problems(m, given)]
    return [found.index(number) for number in found]


@pytest.mark.parametrize('scheme', SCHEMES)
@pytest.mark.parametrize('build', [signum.build, gas_liquid_tank.build])
def test_all_elements_of_a_plain_system_are_of_one_class(build, scheme):
    assert set(classes(transform(build(), 6, 2, scheme=scheme))) == {0}


def test_the_element_that_starts_at_the_first_time_differs_where_states_jump():
    assert classes(move(bouncing_ball.build(), 5, 2)) == [0, 1, 1, 1, 1]
    assert classes(transform(air_friction.build(), 4, 2)) == [0, 1, 1, 1]


def test_elements_that_open_a_stage_differ_where_the_switching_function_jumps_there():
    m = threshold.build()
    transform(m, 9, 2, piecewise_constant=[m.w])
    assert classes(m, [m.w]) == [0, 0, 0, 3, 0, 0, 3, 0, 0]
    m = held_control.build()
    transform(m, 6, 2, piecewise_constant=[m.u])
    assert set(classes(m, [m.u])) == {0}


def test_numbers_of_a_control_stage_make_a_class():
    m = scalar_ode(end=2)
    m.t.add(1)
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == (1.0 if t <= 1 else -3.0))
    assert classes(move(m, 4, 2)) == [0, 0, 2, 2]


def test_bounds_and_fixed_variables_make_a_class():
    m = scalar_ode(end=2)
    m.z = pyo.Var(m.t, initialize=0)
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.z[t])
    m.tie = pyo.Constraint(m.t, rule=lambda m, t: m.z[t] == 1)
    move(m, 4, 2)
    assert classes(m) == [0, 0, 0, 0]
    m.z[2].setub(5)
    m.z[0.5].fix(1)
    # fixed at the end of the first element and on the left of the second; bounded in the last
    assert classes(m) == [0, 1, 1, 3]


def test_unknown_are_the_variables_at_the_own_labels_and_the_length():
    m = transform(signum.build(), 3, 2)
    first, second, _ = problems(m)
    element = moving_grids(m)[m.t].grid.elements[1]
    assert second.length is moving_grids(m)[m.t].r[2]
    assert names(second.unknown) == {'r', 'x', 'dx', 'alpha', 'p', 'n'}
    assert {v.index() for v in second.unknown if v is not second.length} == set(element.own_labels)
    assert {v.name for v in second.known} == {
        f'{name}[{element.left}]' for name in ('x', '_pyomo_fesd_dcs.sgn.p', '_pyomo_fesd_dcs.sgn.n')
    }


def test_given_variables_are_known():
    m = held_control.build()
    transform(m, 4, 2, piecewise_constant=[m.u])
    assert 'u' in names(problems(m)[0].unknown)
    assert 'u' in names(problems(m, [m.u])[0].known)


def test_states_have_no_bounds_and_are_unknown_though_fixed():
    m = transform(signum.build(), 3, 2)
    m.x.setlb(-5)
    m.x[2].fix(1.0)
    last = problems(m)[-1]
    place = next(k for k, v in enumerate(last.unknown) if v is m.x[2])
    assert last.bounds[place] == (None, None)


def test_inequalities_of_the_user_are_left_out():
    m = signum.build()
    m.cap = pyo.Constraint(m.t, rule=lambda m, t: m.x[t] <= 1)
    m.tie = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] >= 0)
    with_them = [len(p.rows) for p in problems(transform(m, 3, 2))]
    assert with_them == [len(p.rows) for p in problems(transform(signum.build(), 3, 2))]


def test_gauss_elements_have_their_end_too():
    m = transform(signum.build(), 3, 2, scheme=LEGENDRE)
    element, problem = moving_grids(m)[m.t].grid.elements[0], problems(m)[0]
    labels = {v.index() for v in problem.unknown if v is not problem.length}
    assert labels == {*element.points, element.right}
    # unknowns are determined at the collocation points
    assert {v.index() for v in problem.collocated} == set(element.points)


def test_reading_changes_nothing():
    m = transform(air_friction.build(), 4, 2)
    before = snapshot(m)
    problems(m)
    assert snapshot(m) == before
