"""Residuals of elements: what makes them incomplete, and their factors."""

import gas_liquid_tank
import numpy as np
import pyomo.environ as pyo
import pytest
from pyomo.common.timing import HierarchicalTimer
from pyomo.gdp import Disjunction

from pyomo_fesd.core import TimeIndex, moving_grids
from pyomo_fesd.simulation.element_residuals import ElementResiduals
from pyomo_fesd.simulation.element_solver import ElementSolver
from pyomo_fesd.simulation.progress import Progress
from tests.problems.running import SCHEMES, transform
from tests.problems.states import over_time


def pattern(m, element=2):
    """The equations of one element, and the collocation points."""
    moving = moving_grids(m)[m.t]
    solver = ElementSolver(m, TimeIndex(m.t), (), {}, HierarchicalTimer(), Progress(m.t, moving.grid.stages, None))
    return solver._read(moving.grid.elements[element - 1]), moving.grid.tau


def scaled(unit):
    """y falls like exp(-t), in some unit."""
    m = over_time(2, y=unit)
    below = 0.3 * unit
    m.mode = Disjunction(m.t, rule=lambda m, t: [[m.y[t] >= below, m.dy[t] == -m.y[t]], [m.y[t] <= below, m.dy[t] == -unit]])
    return transform(m, 4, 2)


@pytest.mark.parametrize('scheme', SCHEMES)
def test_jacobian(scheme):
    equations, tau = pattern(transform(gas_liquid_tank.build(), 4, 3, scheme=scheme))
    f = ElementResiduals(equations, tau)
    assert f.complete
    f.set_known([v.value for v in equations.known])
    w = f.point([v.value for v in equations.unknown]) + 0.1
    V, J = (found.copy() for found in f.evaluate(w))
    dense = np.zeros((V.size, w.size))
    dense[f.rows, f.columns] = J
    for j in range(w.size):
        beside = [f.evaluate(np.where(np.arange(w.size) == j, w + h, w))[0].copy() for h in (1e-6, -1e-6)]
        used = np.concatenate([f.equations, f.functions.ravel()])
        assert (beside[0] - beside[1])[used] / 2e-6 == pytest.approx(dense[used, j], rel=1e-5, abs=1e-5)


@pytest.mark.parametrize('unit', [1e-9, 1.0, 1e9])
def test_values_are_of_order_one_in_the_scale(unit):
    equations, tau = pattern(scaled(unit))
    f = ElementResiduals(equations, tau)
    states = [k for k, v in enumerate(equations.unknown) if v.parent_component().local_name == 'y']
    before = [v.value for v in equations.unknown]
    w = f.point([unit if k in states else number for k, number in enumerate(before)])
    assert f.values(w, before)[states[0]] == pytest.approx(unit, rel=1e-12)
    assert sum(0.5 < number < 2.1 for number in w) >= len(states)


def test_a_function_that_casadi_has_not_is_left_to_the_mpcc():
    m = over_time(1, y=2.0)
    m.law = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == pyo.acosh(m.y[t]))
    assert not ElementResiduals(*pattern(transform(m, 4, 2))).complete
