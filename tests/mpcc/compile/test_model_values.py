"""Start values as users and other programs leave them."""

import numpy as np
import pyomo.environ as pyo
import pytest
from problems import small_mpccs
from pyomo.contrib.solver.common.factory import SolverFactory

from pyomo_fesd.core import FesdError


@pytest.mark.parametrize(
    'x, missing',
    [
        (None, 1),
        (np.nan, 1),
        (np.inf, 1),
        (-np.inf, 1),
        (np.float64(0.3), 0),
        (np.float32(0.3), 0),
        (np.int64(1), 0),
        (np.array(0.5), 0),
        (np.array([0.5]), 0),
        (1e300, 0),
        (-5.0, 0),
    ],
)
def test_any_start_value_is_taken_or_counted_as_missing(x, missing):
    m = small_mpccs.toy(0.3, 0.4)[0]
    m.x.set_value(x, skip_validation=True)
    results = SolverFactory('mpec_hybrid').solve(m)
    assert results.extra_info.stationarity == 'B'
    assert results.extra_info.missing_values == missing
    assert type(m.x.value) is float


def test_start_values_are_as_before_if_nothing_is_loaded():
    m = small_mpccs.toy(0.3, 0.4)[0]
    m.x.set_value(np.nan, skip_validation=True)
    SolverFactory('mpec_hybrid').solve(m, load_solutions=False)
    assert np.isnan(m.x.value) and m.y.value == 0.4


@pytest.mark.parametrize('number', [np.nan, np.inf])
def test_a_parameter_that_is_no_number_is_named(number):
    m = small_mpccs.toy(0.3, 0.4)[0]
    m.p = pyo.Param(mutable=True, initialize=number)
    m.f.set_value((m.x - m.p) ** 2)
    with pytest.raises(FesdError, match=f'p: its value is {number}'):
        SolverFactory('mpec_hybrid').solve(m)


def test_an_infinite_parameter_may_be_a_bound():
    m = small_mpccs.toy(0.3, 0.4)[0]
    m.p = pyo.Param(mutable=True, initialize=np.inf)
    m.x.setub(m.p)
    assert SolverFactory('mpec_hybrid').solve(m).extra_info.stationarity == 'B'
