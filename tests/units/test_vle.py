"""The flash of ``examples/flash.py``, with compositions as Expressions."""

import flash
import pyomo.environ as pyo
import pytest

import pyomo_fesd
from pyomo_fesd.units import vle
from tests.units.support import added, solved, switching_times


def heated():
    m = flash.heated()
    for name in ('liquid', 'vapour', 'x', 'y'):
        m.del_component(name)
    m.phases = vle(m.t, components=m.i, fraction=m.v, composition=lambda m, t, i: flash.FEED[i], ratio=m.K)
    return m


def test_it_boils_and_is_dry_at_its_times_and_nobody_has_to_say_that_v_is_continuous():
    m = solved(heated(), nfe=20, ncp=2)
    assert switching_times(m) == pytest.approx(flash.EXACT, abs=1e-8)
    assert added(m.phases[0]) == (0, 0, 1)
    end = m.phases[flash.HORIZON]
    assert pyo.value(end.x['benzene']) < 0.5 == pytest.approx(pyo.value(end.y['benzene']), abs=1e-9)


def test_it_is_smaller_than_the_flash_with_variables():
    sizes = [pyomo_fesd.report(flash.transform(m))['variables'] for m in (heated(), flash.build())]
    points = 1 + 20 * 2
    assert sizes[1] - sizes[0] == 4 * points


def test_refused():
    m = flash.heated()
    with pytest.raises(pyomo_fesd.FesdError, match='pure component'):
        m.phases = vle(m.t, components=['water'], fraction=m.v, composition=None, ratio=m.K)
