"""An element without complementarity: its active set is given, so it is smooth collocation, a system of equations.

With Z the side of every condition that is zero in the element and P the other one,

    equations = 0,   Z = 0 at all points of the element,   r given;          then P >= 0 and all limits are looked at

* All hold: the element is accepted.
* One is negative at the end only: it has an arrival.  The same system with r free and P(1) = 0 (or the limit) gives the element
  that ends there, P(1) by the polynomial through the stage values where P jumps (theory, eq. 13a).
* One is negative from the beginning, or has just arrived at zero: P is a zero side from here on.  If that is all, it slides (or a
  kink is passed); if one side of another condition of the same origin becomes zero too, the other mode begins.  All these active
  sets are tried; if exactly one is consistent, it holds.

Takes: ``Functions``, the active set and the end of the element before.
Leaves: nothing.
Does not apply: where Newton's method does not converge, the system is singular, a bound of another variable is violated, or not
exactly one active set is consistent.  Then it is None, and the window decides.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import islice, product

import numpy as np

from pyomo_fesd.elements.equilibration import TINY
from pyomo_fesd.march.newton import System

#: What is negative by less than this part of its size, and than this in the solver's scale, is not negative.
RELATIVE, ABSOLUTE = 1e-10, 1e-12
#: Aggregated pairs are zero below this.
ZERO = 1e-8
#: So many active sets are tried at once, and so many arrivals in one element; so often others are looked for.
TRIED, ROUNDS = 8, 2
#: An element that would end before this part of its length ends at its beginning.
AT_ONCE = 1e-6


@dataclass(frozen=True)
class Step:
    """An element that was found.

    Attributes
    ----------
    w : array
    length : float
        length multiplier
    active : bool array
        for each condition whether its H is zero in the element (else its G)
    end : array
        values of all functions at the right boundary; nan where the next element may begin with others
    theta : bytes
        for each condition whether its G (else its H) is positive
    event : int or None
        the function that arrives at zero there
    """

    w: np.ndarray
    length: float
    active: np.ndarray
    end: np.ndarray
    theta: bytes
    event: int = None


class Smooth:
    """Elements of one kind.

    Parameters
    ----------
    functions : Functions
    tau : tuple of float
        stage points
    """

    def __init__(self, functions, tau):
        self._f, self._systems = functions, {}
        self._stages, self._points = np.array(tau), np.array([*tau, *([] if tau[-1] == 1 else [1.0])])
        self._repeated = ~functions.continuous & (tau[-1] != 1)
        self._size, self._size_of_others = np.zeros(functions.signed.shape[0]), 0.0

    @property
    def nothing(self):
        """Values on the left of which nothing is known."""
        return np.full(self._size.size, np.nan)

    @property
    def names(self):
        """The conditions of an active set."""
        return self._f.names

    def read(self, w):
        """The active set of a solution: the smaller side of every condition is zero."""
        V, _ = self._f.at(w)
        values = V[self._f.signed]
        self._grow(values)
        G, H = self._sums(values)
        return G >= H

    def guess(self, w):
        """An active set by the continuous sides only: the multipliers at ``w`` are a first guess."""
        V, _ = self._f.at(w)
        sides = V[self._f.signed][: 2 * len(self.names)].sum(axis=1)
        return sides[1::2] <= ABSOLUTE

    def _sums(self, values):
        """The sums of both sides of every condition over the stages."""
        return values[: 2 * len(self.names), : self._stages.size].sum(axis=1).reshape(-1, 2).T

    def step(self, w, active, most, left, event=None):
        """An element of at most the length ``most``; None if another method has to find it.

        Parameters
        ----------
        w : array
            start
        active : bool array
        left : array
            values of all functions on the left; nan where they are not known
        event : int, optional
            the side that is zero from there on
        """
        wrong = [event]
        if event is None:
            step, wrong = self._try(w, active, most, left)
            if step is not None or not wrong:
                return step
        # in another mode what jumps does not go on
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
        values, negative = self._look(found, active)
        if not negative:
            return self._accept(found, most, active, values), []
        places = {k: self._begins(k, values[k], left[k]) for k in negative}
        wrong = [k for k, place in places.items() if place is None]
        return (None, wrong) if wrong else (self._arrive(found, active, most, left, places), [])

    def _others(self, active, wrong):
        """Active sets in which the ``wrong`` sides are zero: a slide, or with a condition of the same origin the other mode."""
        if not wrong or max(wrong) >= 2 * active.size:
            return []
        first = _flipped(active, wrong)
        choices = [(None, *(i for i in self._siblings[k // 2] if 2 * i not in wrong and 2 * i + 1 not in wrong)) for k in wrong]
        some = islice(product(*choices), TRIED)
        return [_flipped(first, [2 * i + 1 - first[i] for i in more if i is not None]) for more in some]

    @cached_property
    def _siblings(self):
        """For each condition those of the same component."""
        homes = [name.rpartition('[')[0] or name for name in self.names]
        return [[i for i, other in enumerate(homes) if other == home and i != j] for j, home in enumerate(homes)]

    def _system(self, active, event=None):
        key = active.tobytes(), event
        if key not in self._systems:
            f = self._f
            zero = np.arange(active.size) * 2 + active
            # what is repeated at the right boundary is zero there already
            held = [f.signed[k, :-1] if self._repeated[k] else f.signed[k] for k in zero]
            starts = f.starts[zero]
            vanishing = np.concatenate([f.vanishing, *held, starts[starts >= 0]])
            columns = np.arange(f.lower.size)
            if event is None and f.length is not None:
                columns = np.delete(columns, f.length)
            self._systems[key] = System(f, vanishing, columns, None if event is None else self._arrival(event))
        return self._systems[key]

    def _arrival(self, k):
        """Rows and weights of the value of function k at the end of an element."""
        row = self._f.signed[k]
        if not self._repeated[k]:
            return row[-1:], np.ones(1)
        return row[:-1], np.linalg.solve(np.vander(self._stages, increasing=True).T, np.ones(self._stages.size))

    def _look(self, w, active):
        """Values of all functions, and which of them are negative at some point."""
        values = self._f.at(w)[0][self._f.signed]
        low = values.min(axis=1, initial=np.inf)
        for k in np.flatnonzero(self._repeated):
            rows, weights = self._arrival(k)
            low[k] = min(low[k], weights @ self._f.V[rows])
        negative = low < -(RELATIVE * self._sizes(values) + ABSOLUTE)
        negative[np.arange(active.size) * 2 + active] = False
        return values, np.flatnonzero(negative).tolist()

    def _sizes(self, values):
        return np.maximum(self._size, np.abs(values).max(axis=1, initial=0.0))

    def _grow(self, values):
        self._size = self._sizes(values)

    def _begins(self, k, values, left):
        """The part of the element after which a function that is negative somewhere becomes so; None if it begins negative."""
        repeated = self._repeated[k]
        nodes, row = (self._stages, values[: self._stages.size]) if repeated else (self._points, values)
        small = RELATIVE * max(self._size[k], np.abs(values).max()) + ABSOLUTE
        if np.isfinite(left):
            if left <= small and row[0] < 0:
                return None
            nodes, row = np.append(0.0, nodes), np.append(max(left, 0.0), row)
        polynomial = np.polynomial.Polynomial.fit(nodes, row, nodes.size - 1, domain=[0, 1], window=[0, 1])
        if not np.isfinite(left) and polynomial(0.0) <= small and row[0] < 0:
            return None
        return self._first_root(polynomial, nodes, row)

    @staticmethod
    def _first_root(polynomial, nodes, row):
        roots = polynomial.roots()
        real = np.sort(roots[np.abs(roots.imag) < 1e-9].real)
        falls = [x for x in real if AT_ONCE < x <= 1.0 and polynomial.deriv()(x) < 0]
        if falls:
            return falls[0]
        first = int(np.argmax(row < 0))
        return 0.5 * (nodes[max(first - 1, 0)] + nodes[first])

    def _arrive(self, w, active, most, left, places):
        """The element that ends where the first of the functions that become negative arrives at zero.

        Parameters
        ----------
        places : dict function -> part of the element after which it is negative
        """
        for _ in range(TRIED):
            event = min(places, key=places.get)
            start = w.copy()
            start[self._f.length] = most * places[event]
            found = self._system(active).solve(start)
            found = self._system(active, event).solve(start if found is None else found)
            if found is None or not AT_ONCE * most < found[self._f.length] <= most:
                return None
            values, negative = self._look(found, active)
            if not negative:
                return self._accept(found, found[self._f.length], active, values, event)
            w, most = found, found[self._f.length]
            places = {k: self._begins(k, values[k], left[k]) for k in negative}
            if None in places.values():
                return None
        return None

    def _accept(self, w, length, active, values, event=None):
        """The element, if nothing else is violated; what jumps is not known after an ``event``."""
        f, V = self._f, self._f.V
        others = V[f.others]
        self._size_of_others = np.maximum(self._size_of_others, np.abs(others))
        slack = RELATIVE * np.abs(w) + ABSOLUTE
        pairs = V[f.cross]
        sound = (
            (others >= -RELATIVE * self._size_of_others - ABSOLUTE).all()
            and (w >= f.lower - slack).all()
            and (w <= f.upper + slack).all()
            and (pairs.min(axis=0, initial=np.inf) <= ZERO * (1 + pairs.max(axis=0, initial=0.0))).all()
        )
        if not sound:
            return None
        self._grow(values)
        end = values[:, -1].copy()
        if event is not None:
            end[~f.continuous], end[event] = np.nan, 0.0
        G, H = self._sums(values)
        return Step(w, length, active, end, (G > H + TINY).tobytes(), event)


def _flipped(active, functions):
    """The active set in which these sides are zero."""
    active = active.copy()
    for k in functions:
        active[k // 2] = bool(k % 2)
    return active
