"""Elements that have collapsed into a point are told."""

import signum

from pyomo_fesd.collapsed import collapsed
from pyomo_fesd.elements.lengths import LEAST
from tests.problems.running import transform


def messages(m):
    return list(collapsed(m, m.t, []))


def test_elements_of_a_length_are_not_mentioned():
    assert not messages(transform(signum.build(), 4))


def test_the_first_element_of_the_least_length_is_named_with_its_time():
    m = transform(signum.build(), 4)
    r = m._pyomo_fesd_elements_t.r
    r[1].value, r[2].value, r[3].value = 2 - 2 * LEAST, LEAST, LEAST
    (message,) = messages(m)
    assert message.startswith('t: element 2 has collapsed into a point at time 0.999999')


def test_an_element_that_is_short_without_being_the_shortest_is_none():
    m = transform(signum.build(), 4)
    m._pyomo_fesd_elements_t.r[2].value = 10 * LEAST
    assert not messages(m)
