"""Sizes of quantities that are 0 at the start."""

import pytest
from problems import contacts
from problems.running import move
from pyomo.common.timing import HierarchicalTimer

from pyomo_fesd.core import TimeIndex, moving_grids
from pyomo_fesd.simulation.element_solver import ElementSolver
from pyomo_fesd.simulation.progress import Progress


def sizes(m):
    """The sizes that a simulation of ``m`` begins with."""
    moving = moving_grids(m)[m.t]
    solver = ElementSolver(m, TimeIndex(m.t), (), {}, HierarchicalTimer(), Progress(m.t, moving.grid.stages, None))
    solver._learn_sizes()
    return solver._sizes


@pytest.mark.parametrize('L, T', [(1, 1), (1e-9, 1), (1, 1e6)])
def test_a_ball_at_rest_has_the_sizes_of_a_fall(L, T):
    m = contacts.incline(0.5, speed=0.0, L=L, T=T)
    found = sizes(move(m, 3, 2))
    # within an element of 0.5; the weight is 2 g
    for v, size in ((m.dw, 10 * L / T**2), (m.w, 5 * L / T), (m.n, 2.5 * L)):
        assert 0.3 < found.size(v[1.5 * T]) / size < 30
    assert 0.3 < found.size(m.plane[0].normal) / (20 * L / T**2) < 30


def test_round_off_is_no_size():
    m = contacts.incline(0.5, speed=1e-17)
    found = sizes(move(m, 3, 2))
    assert found.size(m.v[0]) > 0.1


def test_forces_that_cancel_at_equal_weights_have_no_huge_size():
    m = contacts.puck(0.0, 8)
    assert sizes(move(m, 3, 2)).size(m.ice[0].normal) < 1e4


def test_factors_are_powers_of_two_but_not_one():
    m = contacts.ball(0.5, height=1.0)
    found = sizes(move(m, 3, 2))
    assert found.factor(m.q[0]) == 2.0 and TimeIndex(m.t).time(m.q[0]) == 0
