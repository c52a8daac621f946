"""Elements that have collapsed into a point are told."""

import pytest
import signum

from pyomo_fesd.core import moving_grids
from pyomo_fesd.diagnostics.collapsed_elements import collapsed_elements
from pyomo_fesd.finite_elements.lengths import LEAST
from tests.problems.running import transform


def messages(m):
    return list(collapsed_elements(m, m.t, []))


def test_elements_of_a_length_are_not_mentioned():
    assert not messages(transform(signum.build(), 4))


def test_the_first_element_of_the_least_length_is_named_with_its_time():
    m = transform(signum.build(), 4)
    r = m._pyomo_fesd_elements_t.r
    r[1].value, r[2].value, r[3].value = 2 - 2 * LEAST, LEAST, LEAST
    set_modes(m, (0, 1, 0, 0))
    (message,) = messages(m)
    assert message.startswith('t: element 2 has collapsed into a point at time 0.999999')


def shrunk(modes):
    """The relay on four elements with the second one collapsed; ``modes`` by element: nu of the upper side."""
    m = transform(signum.build(), 4)
    r = m._pyomo_fesd_elements_t.r
    r[1].value, r[2].value = 2 - LEAST, LEAST
    set_modes(m, modes)
    return m


def set_modes(m, modes):
    """Set the multipliers and the parts of the switching function in each element."""
    system, grid = m._pyomo_fesd_dcs.sgn, moving_grids(m)[m.t].grid
    for element, nu, following in zip(grid.elements, modes, (*modes[1:], modes[-1])):
        for t in (element.left, *element.points) if element.n == 1 else element.points:
            away = t != element.right or nu == following
            system.alpha[t].value = nu
            system.p[t].value, system.n[t].value = float(nu == 1 and away), float(nu == 0 and away)


@pytest.mark.parametrize(
    'modes, said',
    [((0, 0, 1, 1), False), ((0, 1, 1, 1), False), ((0, 1, 0, 0), True), ((0, 0.5, 1, 1), True), ((1, 1, 1, 1), False)],
)
def test_only_an_active_set_of_its_own_may_be_wrong(modes, said):
    assert bool(messages(shrunk(modes))) == said


def test_an_element_that_is_short_without_being_the_shortest_is_none():
    m = transform(signum.build(), 4)
    m._pyomo_fesd_elements_t.r[2].value = 10 * LEAST
    assert not messages(m)
