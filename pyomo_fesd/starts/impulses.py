"""Impulses of contacts at element boundaries: those with which the velocities of a table jump.

The velocities after an impact are functions of the impulses and of their directions of friction (theory, eq. 20 and 23), and the
table has their values: a small problem of least squares at each boundary where the table jumps.

Takes: a moving grid whose states have their values, and a ``TimeTable``.
Leaves: impulses, velocities that masses couple, directions; then P, N and Q.
Does not apply: to velocities without a column.  At boundaries where the table does not jump there is no impulse.
"""

import numpy as np
from pyomo.core import value
from scipy.optimize import least_squares

from pyomo_fesd.core import Impacts, MovingGrid, TimeIndex, strip_time, value_or_nan
from pyomo_fesd.starts.boundary_values import jump_near
from pyomo_fesd.starts.element_placement import set_within_bounds
from pyomo_fesd.starts.time_table import TimeTable

#: An unknown is at a bound if it is nearer than this part of the largest one.
AT_BOUND = 1e-6
#: Tolerances of the least squares, and how far their start is within bounds.
EXACT, INSIDE = {'xtol': 1e-15, 'ftol': 1e-15, 'gtol': 1e-15}, 1e-3


def set_impulses(moving: MovingGrid, times: TimeIndex, table: TimeTable) -> None:
    """Set the impulses at all boundaries, and the velocities after them."""
    impacts = None if moving.state_jumps is None else moving.state_jumps.impacts
    if impacts is None:
        return
    physical = moving.physical_time()
    for element in moving.grid.elements[:-1]:
        b, right = element.n, {}
        time = jump_near(moving, table, physical[element.right])
        if time is not None:
            series = ((v, table.series(strip_time(times.split(v)[1]))) for v, _ in moving.state_jumps.velocities_after(b))
            right = {id(v): column.right_of(time) for v, column in series if column is not None}
        _without_impulse(moving, b)
        if right:
            _fit(moving, impacts, b, right)


def _without_impulse(moving, b):
    impacts = moving.state_jumps.impacts
    for law in impacts.laws:
        for impulse in impacts.impulses(law.name, b):
            impulse.set_value(0.0)
    for v, after in moving.state_jumps.velocities_after(b):
        if after.is_variable_type():
            set_within_bounds(after, value_or_nan(v))


def _fit(moving, impacts, b, right):
    """Set impulses and directions so that the velocities after boundary ``b`` are those ``right`` of the jump."""
    targets = []
    for v, after in moving.state_jumps.velocities_after(b):
        if after.is_variable_type():
            set_within_bounds(after, right.get(id(v)))
        elif id(v) in right:
            targets.append((after, right[id(v)]))
    unknown = [impulse for law in impacts.laws for impulse in impacts.impulses(law.name, b)]
    unknown += list(impacts.directions.get(b, {}).values())
    rows = impacts.between(b)

    def residuals(variables, x):
        for v, number in zip(variables, x):
            v.set_value(float(number), skip_validation=True)
        return [value(after) - number for after, number in targets] + [value(row.body) - value(row.upper) for row in rows]

    lower, upper = _bounds(unknown)
    start = np.clip([v.value or 0.0 for v in unknown], lower + INSIDE, np.maximum(upper - INSIDE, lower + INSIDE))
    x = least_squares(lambda x: residuals(unknown, x), start, bounds=(lower, upper), x_scale='jac', **EXACT).x
    near = AT_BOUND * max(1.0, float(np.abs(x).max()))
    x = np.where(x - lower < near, lower, np.where(upper - x < near, upper, x))
    residuals(unknown, x)
    # those between bounds once more, to round-off
    inner = [v for v, number, low, high in zip(unknown, x, lower, upper) if low < number < high]
    if inner:
        residuals(inner, least_squares(lambda x: residuals(inner, x), [v.value for v in inner], jac='3-point', **EXACT).x)


def _bounds(variables):
    low = [-np.inf if v.lb is None else v.lb for v in variables]
    return np.array(low, dtype=float), np.array([np.inf if v.ub is None else v.ub for v in variables], dtype=float)


def set_parts(moving: MovingGrid, times: TimeIndex) -> None:
    """Set P, N and Q everywhere, and the directions of boundaries without an impulse: those of the next element."""
    impacts: Impacts | None = None if moving.state_jumps is None else moving.state_jumps.impacts
    for element in moving.grid.elements if impacts is not None else ():
        b = element.n - 1
        if not any((impulse.value or 0.0) > 0 for law in impacts.laws for impulse in impacts.impulses(law.name, b)):
            for nu, beta in impacts.directions[b].items():
                set_within_bounds(beta, value_or_nan(times.at(nu, element.points[0])))
        for law in impacts.laws:
            if (law.name, b) in impacts.above:
                impacts.set_parts(law.name, b)
