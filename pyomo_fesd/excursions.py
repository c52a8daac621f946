"""Excursions: between its stage points, an element's polynomials go where its mode, condition or guard does not allow it.

So it is at an even root of the switching function, which stage points do not see.

Takes: a solved model with a moving grid.
Leaves: messages.
Does not apply: to sides of a hand-written Complementarity.
"""

import numpy as np
from pyomo.common.collections import ComponentMap
from pyomo.core import value
from pyomo.core.expr.visitor import identify_variables
from scipy.interpolate import BarycentricInterpolator

from pyomo_fesd.elements.cross import grid_of
from pyomo_fesd.elements.jumps import read_jumps
from pyomo_fesd.elements.memory import read_modes
from pyomo_fesd.records import records
from pyomo_fesd.switching import size
from pyomo_fesd.trajectory import jumps_that_happen, physical_time

#: A function below this part of its largest value is zero all along an element.
ZERO = 1e-7
#: An excursion counts if it is larger than this part of the function's largest value in the element.
EXCURSION = 1e-6
#: Relative times at which a function is evaluated, and those between them at which its interpolant is.
NODES = (1 - np.cos(np.pi * (np.arange(12) + 0.5) / 12)) / 2
INSIDE = np.linspace(0.0, 1.0, 202)[1:-1]


def excursions(model, wrt, functions):
    """Messages for elements between whose stage points a function goes where it must not."""
    grid, time = grid_of(records(model).grids[wrt]), physical_time(model, wrt)
    tau, after = np.array([0.0, *grid.tau]), _values_after_jumps(model, wrt)
    for name, kept, sign in _kept(model, wrt, functions):
        numbers = {label: value(function) for label, function in kept.items()}
        zero = ZERO * size(numbers)
        for element in grid.elements:
            jumping = after.get(element.n, ComponentMap())
            place = _excursion(kept, numbers, element, sign(numbers, element, zero), zero, tau, jumping)
            if place is not None:
                when = time[element.left] + place * (time[element.right] - time[element.left])
                yield (
                    f"{name}: near time {when:.6g} the solution leaves its region between two stage points and comes back, "
                    "which the elements do not see. Take more elements (nfe)."
                )
                break


def _values_after_jumps(model, wrt):
    """Element number -> the states that begin it with another value than the one on its left."""
    return {before.n + 1: ComponentMap(values) for before, _, _, values in jumps_that_happen(model, wrt)}


def _kept(model, wrt, functions):
    """``(name, {label: expression}, function (numbers, element, zero) -> sign)`` of what keeps its sign inside an element."""
    for s in functions:
        yield s.name, s.c, _sign
    for mode in read_modes(model, wrt):
        for k in range(min(map(len, mode.conditions.values()))):
            kept = {t: conditions[k] for t, conditions in mode.conditions.items()}
            yield mode.title, kept, lambda numbers, element, zero, mode=mode: int(value(mode.weight(element)) > 0.5)
    for jump in read_jumps(model, wrt):
        yield jump.name, jump.guards, lambda numbers, element, zero: 1


def _sign(numbers, element, zero):
    """The sign that c has at the stage points of an element; 0 if it slides."""
    largest = max((numbers[t] for t in element.points if t in numbers), key=abs, default=0.0)
    return 0 if abs(largest) <= zero else int(np.sign(largest))


def _excursion(functions, numbers, element, sign, zero, tau, after):
    """The relative time at which sign c is clearly negative inside an element; None if it is not."""
    labels = (element.left, *element.points)
    if sign == 0 or any(t not in functions for t in labels):
        return None
    at_stages = np.array([sign * numbers[t] for t in element.points])
    largest = np.abs(at_stages).max()
    if largest <= zero or at_stages.min() > 2 * np.ptp(at_stages):
        return None  # it rests at zero, or stays far from it
    values = sign * BarycentricInterpolator(NODES, _between([functions[t] for t in labels], tau, after))(INSIDE)
    worst = int(np.argmin(values))
    return INSIDE[worst] if values[worst] < -EXCURSION * max(largest, np.abs(values).max()) else None


def _between(functions, tau, after):
    """A function at the relative times ``NODES``, its variables interpolated between the points of an element.

    Parameters
    ----------
    functions : list of expressions
        the function at the left boundary and at the stage points
    tau : array
        their relative times
    after : ComponentMap
        values on the left of states that have just jumped
    """
    rows = [list(identify_variables(f, include_fixed=True)) for f in functions]
    points = [[after.get(v, v.value) for v in rows[0]], *([v.value for v in row] for row in rows[1:])]
    polynomials = [BarycentricInterpolator(tau, column)(NODES) for column in zip(*points)]
    kept = [(v, v.value, v.stale) for v in rows[-1]]
    try:
        found = []
        for k in range(len(NODES)):
            for v, polynomial in zip(rows[-1], polynomials):
                v.set_value(polynomial[k], skip_validation=True)
            found.append(value(functions[-1]))
    finally:
        for v, old, stale in kept:
            v.set_value(old, skip_validation=True)
            v.stale = stale
    return np.array(found)
