"""Without time: problems with max, min and abs whose optimum is known."""

import numpy as np
import pyomo.environ as pyo
import pytest
from scipy.optimize import linprog

from pyomo_fesd import absolute, maximum, minimum
from tests.smoothing.support import exact, smooth_max


def certified(m):
    """Solve; the value of the objective."""
    results = pyo.SolverFactory('mpec_hybrid').solve(m)
    assert results.solver.stationarity == 'B'
    return pyo.value(m.f)


@pytest.mark.parametrize('seed', range(5))
def test_smallest_maximum_of_linear_functions_is_that_of_the_lp(seed):
    """min over -1 <= x <= 1 of max_i a_i x + b_i, a linear program."""
    random = np.random.default_rng(seed)
    a, b = random.uniform(-1, 1, (4, 2)), random.uniform(-1, 1, 4)
    lp = linprog([0, 0, 1], np.c_[a, -np.ones(4)], -b, bounds=[(-1, 1), (-1, 1), (None, None)])
    m = pyo.ConcreteModel()
    m.x = pyo.Var([0, 1], bounds=(-1, 1), initialize=0.3)
    m.f = pyo.Objective(expr=maximum(m, *(a[i, 0] * m.x[0] + a[i, 1] * m.x[1] + float(b[i]) for i in range(4))))
    assert certified(m) == pytest.approx(lp.fun, abs=1e-8)


def test_the_largest_minimum_is_that_of_the_mirrored_problem():
    m = pyo.ConcreteModel()
    m.x = pyo.Var(bounds=(-5, 5), initialize=-4)
    m.f = pyo.Objective(expr=minimum(m, 2 + m.x, 4 - m.x, 10), sense=pyo.maximize)
    assert certified(m) == pytest.approx(3) and m.x.value == pytest.approx(1)


@pytest.mark.parametrize('start, x, f', [(-3, -2, 0), (4.5, 4, -1)])
def test_a_minimum_of_maxima_has_two_local_optima(start, x, f):
    """min(|x + 2|, |x - 4| - 1): each valley has its own certified bottom."""
    m = pyo.ConcreteModel()
    m.x = pyo.Var(bounds=(-6, 6), initialize=start)
    m.f = pyo.Objective(expr=minimum(m, absolute(m, m.x + 2), absolute(m, m.x - 4) - 1))
    certified(m)
    # the solver may find the better valley from either start, never a point between
    assert (m.x.value, pyo.value(m.f)) in [pytest.approx((x, f), abs=1e-7), pytest.approx((4, -1), abs=1e-7)]


def test_a_sum_of_absolute_values_is_smallest_at_the_median():
    points = [0.3, 2.0, -1.0, 5.0, 0.9]
    m = pyo.ConcreteModel()
    m.x = pyo.Var(initialize=3)
    m.f = pyo.Objective(expr=sum(abs(m.x - p) for p in points))
    assert exact(m).pairs == 5
    certified(m)
    assert m.x.value == pytest.approx(0.9, abs=1e-8)


def test_the_limit_of_a_smooth_model_is_found_exactly():
    """min (x - 1)**2 + 3 max(0, x): the nonsmooth point 0 is the optimum; smoothed it lies beside it."""
    m = pyo.ConcreteModel()
    m.x = pyo.Var(initialize=1)
    m.f = pyo.Objective(expr=(m.x - 1) ** 2 + 3 * smooth_max(m.x, 0, 1e-2))
    pyo.SolverFactory('mpec_hybrid').solve(m)
    assert abs(m.x.value) > 1e-6
    exact(m)
    assert certified(m) == pytest.approx(1, abs=1e-9) and abs(m.x.value) < 1e-9
