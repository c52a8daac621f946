"""Phases of a run."""

import pytest
from pyomo.common.timing import HierarchicalTimer

from pyomo_fesd.core.phase import phase


def test_an_error_stops_the_timer_too():
    timer = HierarchicalTimer()
    with pytest.raises(ZeroDivisionError), phase(timer, 'compile'):
        raise ZeroDivisionError
    with phase(timer, 'compile'):
        pass
    assert timer.timers['compile'].n_calls == 2 and not timer.stack
