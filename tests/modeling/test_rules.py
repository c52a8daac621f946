"""Rules of Blocks over time."""

import pytest

import pyomo_fesd
from pyomo_fesd import FesdError
from tests.models import scalar_ode


def gap(m, t):
    return m.x[t]


@pytest.mark.parametrize(
    'make, cause',
    [
        (lambda m: pyomo_fesd.contact(m.t, gap=1), 'contact: gap=1 is not a function'),
        (lambda m: pyomo_fesd.contact('ab', m.t, gap=gap), "contact: 'ab' is not a Set"),
        (lambda m: pyomo_fesd.contact(m.t, gap=gap, friction=1, slip=2), 'contact: slip=2 is not a function'),
        (lambda m: pyomo_fesd.friction(m.t, velocity=gap, limit=3), 'friction: limit=3 is not a function'),
    ],
)
def test_rules_that_are_no_functions_and_sets_that_are_none_are_refused(make, cause):
    with pytest.raises(FesdError, match=cause):
        make(scalar_ode())


def test_a_block_that_is_refused_is_not_there():
    m = scalar_ode()
    with pytest.raises(FesdError):
        m.floor = pyomo_fesd.contact(m.t, gap=gap, restitution=2)
    assert m.component('floor') is None
