"""Missed crossings: between collocation points, an element's polynomials leave the region of its mode, condition or guard.

Two crossings between neighbouring collocation points leave no trace in the signs at these points.

After a slide that ends smoothly (its multiplier has arrived at that of the next element, so the function leaves zero without a
slope), the error of the polynomials decides their sign next to the boundary: there a wrong one tells nothing.  Nor does it before
the first collocation point where bodies part at the boundary.

Takes: a solved model with a moving grid.
Leaves: messages.
Does not apply: to sides of a hand-written Complementarity.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial

import numpy as np
from pyomo.common.collections import ComponentMap
from pyomo.core import Block, value
from pyomo.dae import ContinuousSet
from scipy.interpolate import BarycentricInterpolator

from pyomo_fesd.core import interpolation_weights, kept_values, moving_grids, number_of, numbers_of, variables_of
from pyomo_fesd.results import SwitchingFunction, jumps_that_happen, largest_value

#: A function below this part of its largest value is zero all along an element.
ZERO = 1e-7
#: A missed crossing counts if it is larger than this part of the function's largest value in the element; for gaps the second one,
#: as those of bodies that part without a velocity are as small as the error of a long element.
SIGNIFICANT, PENETRATION = 1e-6, 1e-2
#: A slide ends smoothly if its multiplier arrives within this distance of its value in the next element.
ARRIVED = 1e-2
#: Relative times at which a function is evaluated, and those between them at which its interpolant is.
NODES = tuple((1 - np.cos(np.pi * (np.arange(12) + 0.5) / 12)) / 2)
INSIDE = tuple(np.linspace(0.0, 1.0, 202)[1:-1].tolist())


def missed_crossings(
    model: Block, wrt: ContinuousSet, functions: list[SwitchingFunction], largest: dict | None = None
) -> Iterator[str]:
    """Yield messages for elements in which a function has the wrong sign between collocation points.

    ``largest`` has the largest value of each function in elements before those on the grid, by its number, and is updated: where a
    few elements march, all of them may lie in a slide, in which a function has values of round-off only.
    """
    moving = moving_grids(model)[wrt]
    after, largest = _values_after_jumps(model, wrt), {} if largest is None else largest
    for number, function in enumerate(_kept(moving, functions)):
        f = replace(function, before=largest.get(number, 0.0))
        largest[number] = f.largest
        found = next(filter(None, (_crossing(f, element, moving.grid, after) for element in moving.new_elements)), None)
        if found is not None:
            (element, crossing), time = found, moving.physical_time()
            when = time[element.left] + crossing * (time[element.right] - time[element.left])
            yield (
                f"{f.name}: near time {when:.6g} the solution leaves its region between two collocation points and comes back, "
                "which the elements do not detect. Take more elements (nfe)."
            )


def _values_after_jumps(model, wrt):
    """Element number -> the states that jump at its left boundary, with their values after the jump."""
    return {before.n + 1: ComponentMap(values) for before, _, _, values in jumps_that_happen(model, wrt)}


@dataclass(frozen=True)
class _Kept:
    """A function that has one sign in an element.

    Attributes
    ----------
    name : str
    by_label : dict label -> expression
    numbers : dict label -> value
    sign : callable (kept, element) -> 1, -1, or 0 where the function slides or is not kept
    nu : dict label -> VarData or None
        the multiplier of a switching function
    before : float
        its largest value in elements before those on the grid
    rates : dict number of a boundary -> expression, or None
        the rate of a gap after each boundary; a gap has no slope where a force ends
    """

    name: str
    by_label: dict
    numbers: dict
    sign: Callable
    nu: dict | None = None
    before: float = 0.0
    rates: dict | None = None

    @property
    def is_gap(self):
        """Whether it is the gap of a contact."""
        return self.rates is not None

    @cached_property
    def largest(self):
        """The largest value so far."""
        return max(largest_value(self.numbers), self.before)

    @property
    def zero(self):
        """The size below which the function is zero."""
        return ZERO * self.largest

    def leaves_smoothly(self, element, grid):
        """Whether a slide ends at the left boundary of ``element`` and its multiplier arrives there, or bodies part."""
        first = grid.elements[0]
        if (self.nu is None and not self.is_gap) or element is first:
            return False
        before = grid.elements[element.n - first.n - 1]
        if self.is_gap:
            return not self.sign(self, before)
        if self.sign(self, before) or any(t not in self.nu for t in (*before.points, element.points[0])):
            return False
        weights = interpolation_weights(grid.tau, np.ones(len(grid.tau)))
        end = sum(weight * self.nu[t].value for weight, t in zip(weights, before.points))
        return abs(end - self.nu[element.points[0]].value) <= ARRIVED

    def parts(self, element):
        """Whether bodies part at the left boundary of ``element``."""
        rate = self.rates.get(element.n - 1) if self.is_gap else None
        return rate is not None and value(rate) * value(element.length) >= -self.zero


def _kept(moving, functions):
    """Switching functions, conditions of modes with hysteresis, guards, and gaps of contacts."""
    for s in functions:
        yield _Kept(s.name, s.c, s.values, _sign, s.nu)
    for mode in [] if moving.hysteresis is None else moving.hysteresis.modes:
        for k in range(min(map(len, mode.conditions.values()))):
            by_label = {t: conditions[k] for t, conditions in mode.conditions.items()}
            sign = partial(_sign_of_mode, mode)
            yield _Kept(mode.title, by_label, _numbers(by_label), sign)
    for jump in [] if moving.state_jumps is None else moving.state_jumps.laws:
        yield _Kept(jump.name, jump.guards, _numbers(jump.guards), lambda _, element: 1)
    impacts = None if moving.state_jumps is None else moving.state_jumps.impacts
    for law in [] if impacts is None else impacts.laws:
        yield _Kept(law.name, law.gaps, _numbers(law.gaps), _sign_of_gap, rates=_rates(impacts, law.name))


def _rates(impacts, name):
    """P - N at each boundary: a positive multiple of the normal velocity after it (eq. 21), or 0 after an impact."""
    return {b: impacts.above[contact, b] - N for (contact, b), N in impacts.below.items() if contact == name}


def _numbers(by_label):
    return {label: number_of(function) for label, function in by_label.items()}


def _sign_of_mode(mode, kept, element):
    """1 where a mode is on; else its conditions do not count."""
    return int(value(mode.weight(element)) > 0.5)


def _sign(kept, element):
    """The sign of c at the collocation points of an element; 0 if it slides."""
    largest = max((kept.numbers[t] for t in element.points if t in kept.numbers), key=abs, default=0.0)
    return 0 if abs(largest) <= kept.zero else int(np.sign(largest))


def _sign_of_gap(kept, element):
    """1 where the bodies are apart, 0 where they touch all along an element."""
    return int(any(kept.numbers[t] > kept.zero for t in element.points if t in kept.numbers))


def _crossing(kept, element, grid, after):
    """The element and the relative time at which sign c is clearly negative inside it; None if it is not."""
    labels, sign = (element.left, *element.points), kept.sign(kept, element)
    if sign == 0 or any(t not in kept.by_label for t in labels):
        return None
    at_points = [sign * kept.numbers[t] for t in element.points]
    low, high = min(at_points), max(at_points)
    largest = max(-low, high)
    if largest <= kept.zero or low > 2 * (high - low):
        return None  # zero throughout, or far from zero
    functions, jumping = [kept.by_label[t] for t in labels], after.get(element.n, ComponentMap())
    at_nodes = _interpolated_between_points(functions, (0.0, *grid.tau), jumping)
    values = sign * _interpolation(NODES, INSIDE) @ at_nodes
    if kept.leaves_smoothly(element, grid):
        values = np.where(np.logical_or.accumulate(values >= 0), values, 0.0)
    if kept.parts(element):
        values = np.where(np.array(INSIDE) < grid.tau[0], 0.0, values)
    worst, part = int(np.argmin(values)), PENETRATION if kept.is_gap else SIGNIFICANT
    return (element, INSIDE[worst]) if values[worst] < -part * max(largest, np.abs(values).max()) else None


def _interpolated_between_points(functions, tau, after):
    """A function at the relative times ``NODES``, its variables interpolated between the points of an element.

    Parameters
    ----------
    functions : list of expressions
        the function at the left boundary and at the collocation points
    tau : tuple of float
        their relative times
    after : ComponentMap
        values on the left of states that have just jumped
    """
    rows = [list(variables_of([f])) for f in functions]
    points = [[after.get(v, v.value) for v in rows[0]], *([v.value for v in row] for row in rows[1:])]
    columns = np.array(list(zip(*points)), dtype=float).reshape(-1, len(tau))
    at_nodes = columns @ _interpolation(tau, NODES).T
    found = numbers_of(functions[-1], dict(zip(map(id, rows[-1]), at_nodes)))
    return _one_by_one(functions[-1], rows[-1], at_nodes) if found is None else np.broadcast_to(found, len(NODES))


def _one_by_one(function, variables, values):
    """A function at the values (columns) of its variables (rows)."""
    found = []
    with kept_values(variables):
        for numbers in values.T.tolist():
            for v, number in zip(variables, numbers):
                v.set_value(number, skip_validation=True)
            found.append(number_of(function))
    return np.array(found)


@cache
def _interpolation(nodes, others):
    """The matrix that gives values of a polynomial at ``others`` by those at its ``nodes``."""
    return BarycentricInterpolator(nodes, np.eye(len(nodes)))(others)
