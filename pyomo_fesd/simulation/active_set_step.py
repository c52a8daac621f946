"""One element with a given active set: smooth collocation, a system of equations without complementarity.

With Z the side of every condition that is zero in the element and P the other one,

    equations = 0,   Z = 0 at all points of the element,   r given;          then check P >= 0 and all event functions

* All hold: the element is accepted, unless the polynomial of a function falls below zero between two points and comes back: then
  the element ends at its first root, if there is such an element.
* One becomes negative inside: it arrives at zero.  The same system with r free and P(1) = 0 (or the event function) gives the
  element that ends there, P(1) by the polynomial through the collocation points where P jumps (theory, eq. 13a).
* One is negative from the beginning, or has just arrived at zero: P is a zero side from here on.  If that is all, it slides (or a
  nonsmooth point is passed); if one side of another condition of the same switching system becomes zero too, the other mode
  begins.  All these active sets are tried; exactly one must be consistent.

Does not apply: where Newton's method does not converge, the system is singular, a bound of another variable is violated, or not
exactly one active set is consistent.  Then the answer is None, and the MPCC decides.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from itertools import islice, product

import numpy as np

from pyomo_fesd.finite_elements import TINY
from pyomo_fesd.simulation.element_residuals import ElementResiduals
from pyomo_fesd.simulation.element_signs import ABSOLUTE, AT_ONCE, ElementSigns, zero_sides
from pyomo_fesd.simulation.newton import NewtonSystem

#: Largest number of active sets tried at once, and of arrivals in one element; how often further sets are looked for.
TRIED, ROUNDS = 8, 2
#: Largest number of bisections until Newton's method finds the first arrival.
BISECTIONS = 30


@dataclass(frozen=True)
class ActiveSetStep:
    """A solved element.

    Attributes
    ----------
    w : array
    length : float
        length multiplier
    active : bool array
        for each condition whether its H is zero in the element (else its G)
    end : array
        values of all functions at the right boundary; nan where the next element may begin with others
    activity : bytes
        for each condition whether its G (else its H) is positive
    event : int or None
        the function that arrives at zero there
    """

    w: np.ndarray
    length: float
    active: np.ndarray
    end: np.ndarray
    activity: bytes
    event: int | None = None


class ActiveSetStepper:
    """Solves elements of one class with the collocation points ``tau``."""

    def __init__(self, residuals: ElementResiduals, tau: tuple[float, ...]):
        self._f, self._signs, self._systems = residuals, ElementSigns(residuals, tau), {}

    @property
    def unknown_values(self) -> np.ndarray:
        """Values on the left of which none is known."""
        return np.full(self._f.functions.shape[0], np.nan)

    def values_on_left(self, w: np.ndarray) -> np.ndarray:
        """Return the values of all functions where every point has the values ``w`` of the left boundary; nan where they jump."""
        return np.where(self._f.continuous, self._f.evaluate(w)[0][self._f.functions[:, 0]], np.nan)

    @property
    def names(self) -> list[str]:
        """The conditions of an active set."""
        return self._f.names

    def active_set(self, w: np.ndarray) -> np.ndarray:
        """Return the active set of a solution: the smaller side of every condition is zero."""
        values = self._f.evaluate(w)[0][self._f.functions]
        self._signs.grow(values)
        G, H = self._signs.sums(values)
        return G >= H

    def guess(self, w: np.ndarray) -> np.ndarray:
        """Return an active set by the sides H only, as the multipliers at ``w`` are a first guess."""
        sides = self._f.evaluate(w)[0][self._f.functions][: 2 * len(self.names)].sum(axis=1)
        return sides[1::2] <= ABSOLUTE

    def step(
        self, w: np.ndarray, active: np.ndarray, most: float | None, left: np.ndarray, event: int | None = None
    ) -> ActiveSetStep | None:
        """Return an element of at most the length ``most``; None if another method has to find it.

        Parameters
        ----------
        w : array
            start
        active : bool array
        left : array
            values of all functions on the left; nan where they are unknown
        event : int, optional
            the side that is zero from there on
        """
        wrong = [event]
        if event is None:
            step, wrong = self._try(w, active, most, left)
            if step is not None or not wrong:
                return step
        # in another mode discontinuous functions have other values
        left, sets, tried = np.where(self._f.continuous, left, np.nan), self._others(active, wrong), {active.tobytes()}
        for _ in range(ROUNDS):
            found, further = [], []
            for other in sets[:TRIED]:
                if other.tobytes() not in tried:
                    tried.add(other.tobytes())
                    step, wrong = self._try(w, other, most, left)
                    found += [] if step is None else [step]
                    further += self._others(other, wrong)
            if found:
                return found[0] if len(found) == 1 else None
            sets = further
        return None

    def _try(self, w, active, most, left):
        """The element with one active set, or None; and functions that are negative from its beginning."""
        start = w.copy()
        if self._f.length is not None:
            start[self._f.length] = most
        found = self._system(active).solve(start)
        if found is None:
            return None, []
        values, negative = self._signs.negative(found, active)
        if not negative:
            return self._cut_at_dip(found, active, most, left, values) or self._accept(found, most, active, values), []
        begins = {k: self._signs.begins(k, values[k], left[k]) for k in negative}
        wrong = [k for k, part in begins.items() if part is None]
        return (None, wrong) if wrong else (self._arrive(found, active, most, left, begins), [])

    def _cut_at_dip(self, w, active, most, left, values):
        """The element that ends where a function falls below zero between two points; None without such a function."""
        if self._f.length is None:
            return None
        dips = self._signs.dips(values, left, active)
        begins = {k: part for k in dips if (part := self._signs.begins(k, values[k], left[k])) is not None}
        return self._arrive(w, active, most, left, begins) if begins else None

    def _others(self, active, wrong):
        """Active sets in which the ``wrong`` sides are zero: a slide, or with another condition of the component the other mode."""
        if not wrong or max(wrong) >= 2 * active.size:
            return []
        first = _with_zero(active, wrong)
        choices = [(None, *(i for i in self._siblings[k // 2] if 2 * i not in wrong and 2 * i + 1 not in wrong)) for k in wrong]
        some = islice(product(*choices), TRIED)
        return [_with_zero(first, [2 * i + 1 - first[i] for i in more if i is not None]) for more in some]

    @cached_property
    def _siblings(self):
        """For each condition the others of the same system, in which the last index counts; without any those of the component."""
        of_system, of_component = (_alike([place(name) for name in self.names]) for place in (_system_of, _component_of))
        return [near or others for near, others in zip(of_system, of_component)]

    def _system(self, active, event=None):
        key = active.tobytes(), event
        if key not in self._systems:
            f, zero = self._f, zero_sides(active)
            # a repeated entry at the right boundary is zero there already
            held = [f.functions[k, :-1] if f.repeated[k] else f.functions[k] for k in zero]
            starts = f.starts[zero]
            arriving = [] if event is None else [f.ends[[event]]]
            rows, columns = np.concatenate([f.equations, *held, starts[starts >= 0], *arriving]), np.arange(f.lower.size)
            if event is None and f.length is not None:
                columns = np.delete(columns, f.length)
            self._systems[key] = NewtonSystem(f, rows, columns)
        return self._systems[key]

    def _arrive(self, w, active, most, left, begins):
        """The element that ends where the first function arrives at zero; after the parts ``begins`` they are negative."""
        for _ in range(TRIED):
            event = min(begins, key=begins.get)
            found = self._end_at(w, active, event, most * begins[event])
            if found is None or not AT_ONCE * most < found[self._f.length] <= most:
                found = self._first_arrival(w, active, event, most)
            if found is None:
                return None
            values, negative = self._signs.negative(found, active)
            if not negative:
                return self._accept(found, found[self._f.length], active, values, event)
            w, most = found, found[self._f.length]
            begins = {k: self._signs.begins(k, values[k], left[k]) for k in negative}
            if None in begins.values():
                return None
        return None

    def _end_at(self, w, active, event, length):
        """The element with a zero of the function ``event`` at its end, by Newton's method from an element of this ``length``."""
        start = w.copy()
        start[self._f.length] = length
        found = self._system(active).solve(start)
        return self._system(active, event).solve(start if found is None else found)

    def _first_arrival(self, w, active, event, most):
        """As ``_end_at``, with a length that bisection has enclosed.

        A function that falls below zero and rises again has two zeros, of which Newton's method may find the later one, beyond the
        element.
        """
        low, high = 0.0, most
        for _ in range(BISECTIONS):
            w = w.copy()
            w[self._f.length] = length = 0.5 * (low + high)
            w = self._system(active).solve(w)
            if w is None:
                return None
            V = self._f.evaluate(w)[0]
            if min(V[self._f.functions[event]].min(), V[self._f.ends[event]]) < 0:
                high = length
            else:
                low = length
            found = self._end_at(w, active, event, length)
            if found is not None and max(low, AT_ONCE * most) <= found[self._f.length] <= high:
                return found
        return None

    def _accept(self, w, length, active, values, event=None):
        """The element, if everything else holds; values of discontinuous functions are unknown after an ``event``."""
        if not self._signs.others_hold(w):
            return None
        self._signs.grow(values)
        end = values[:, -1].copy()
        if event is not None:
            end[~self._f.continuous], end[event] = np.nan, 0.0
        G, H = self._signs.sums(values)
        return ActiveSetStep(w, length, active, end, (G > H + TINY).tobytes(), event)


def _component_of(name: str) -> str:
    return name.rpartition('[')[0] or name


def _system_of(name: str) -> str:
    component, _, index = name.rpartition('[')
    return f"{component}[{index.rpartition(',')[0]}" if component else name


def _alike(places: list[str]) -> list[list[int]]:
    """For each of the ``places`` the numbers of the others that are equal."""
    return [[i for i, other in enumerate(places) if other == own and i != j] for j, own in enumerate(places)]


def _with_zero(active: np.ndarray, functions: Iterable[int]) -> np.ndarray:
    """The active set in which these sides are zero."""
    active = active.copy()
    for k in functions:
        active[k // 2] = bool(k % 2)
    return active
