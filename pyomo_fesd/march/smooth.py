"""An element without complementarity: its active set is given, so it is smooth collocation, a system of equations.

With Z the side of every condition that is zero in the element and P the other one,

    equations = 0,   Z = 0 at all points of the element,   r given;          then P >= 0 and all limits are looked at

* All hold: the element is accepted.
* One is negative at the end only: it has an arrival.  The same system with r free and P(1) = 0 (or the limit) gives the element that
  ends there, P(1) by the polynomial through the stage values where P jumps (theory, eq. 13a).  From there on P is the zero side.
* One is negative from the beginning: another active set holds.  P becomes the zero side, and again (pivoting).

Takes: ``Functions``, the active set and the end of the element before.
Leaves: nothing.
Does not apply: where Newton's method does not converge, the system is singular, a bound of another variable is violated, or the
pivots come back to where they were.  Then it is None, and the window decides.
"""

from dataclasses import dataclass

import numpy as np

from pyomo_fesd.march.newton import System

#: What is negative by less than this part of its size, and than this in the solver's scale, is not negative.
RELATIVE, ABSOLUTE = 1e-10, 1e-12
#: Aggregated pairs are zero below this.
ZERO = 1e-8
#: So many active sets are tried, and so many arrivals in one element.
TRIED = 6
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
        for each condition whether its H is zero (else its G) from the end on
    inside : bool array
        the same inside the element
    end : array
        values of all functions at the right boundary; nan where the next element may begin with others
    """

    w: np.ndarray
    length: float
    active: np.ndarray
    inside: np.ndarray
    end: np.ndarray


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
        self._stages = np.array(tau)
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
        sums = values[: 2 * len(self.names), : self._stages.size].sum(axis=1).reshape(-1, 2)
        return sums[:, 0] >= sums[:, 1]

    def step(self, w, active, most, left):
        """An element of at most the length ``most``; None if another method has to find it.

        Parameters
        ----------
        w : array
            start
        active : bool array
        left : array
            values of all functions on the left; nan where they are not known
        """
        tried = set()
        while active.tobytes() not in tried and len(tried) < TRIED:
            tried.add(active.tobytes())
            w[self._f.length] = most
            w = self._system(active).solve(w)
            if w is None:
                return None
            values, negative = self._look(w, active)
            if not negative:
                return self._accept(w, most, active, active, values, values[:, -1].copy())
            begins = {k: self._begins(k, values[k], left[k]) for k in negative}
            wrong = [k for k in negative if begins[k] is None]
            if not wrong:
                return self._arrive(w, active, most, left, values, negative)
            if any(k >= 2 * active.size for k in wrong):
                return None
            active = _flipped(active, wrong)
        return None

    def _system(self, active, event=None):
        key = active.tobytes(), event
        if key not in self._systems:
            f = self._f
            zero = np.arange(active.size) * 2 + active
            rows = f.signed[zero]
            # what is repeated at the right boundary is zero there already
            held = np.concatenate([row[:-1] if f.repeated[k] else row for k, row in zip(zero, rows)]) if zero.size else zero
            columns = np.arange(f.lower.size)
            vanishing = np.concatenate([f.vanishing, held]).astype(int)
            if event is None:
                columns, arrival = np.delete(columns, f.length), None
            else:
                arrival = self._arrival(event)
            self._systems[key] = System(f, vanishing, columns, arrival)
        return self._systems[key]

    def _arrival(self, k):
        """Rows and weights of the value of function k at the end of an element."""
        row = self._f.signed[k]
        if not self._f.repeated[k]:
            return row[-1:], np.ones(1)
        return row[:-1], np.linalg.solve(np.vander(self._stages, increasing=True).T, np.ones(self._stages.size))

    def _look(self, w, active):
        """Values of all functions, and which of them are negative at some point."""
        values = self._f.at(w)[0][self._f.signed]
        low = values.min(axis=1, initial=np.inf)
        for k in np.flatnonzero(self._f.repeated):
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
        repeated = self._f.repeated[k]
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

    @property
    def _points(self):
        return self._stages if self._stages[-1] == 1 else np.append(self._stages, 1.0)

    def _arrive(self, w, active, most, left, values, negative):
        """The element that ends where the first of the ``negative`` functions arrives at zero."""
        places = {k: self._begins(k, values[k], left[k]) for k in negative}
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
                after = _flipped(active, [event]) if event < 2 * active.size else active
                end = np.full(self._size.size, np.nan)
                end[event] = 0.0
                return self._accept(found, found[self._f.length], after, active, values, end)
            w, most = found, found[self._f.length]
            places = {k: self._begins(k, values[k], left[k]) for k in negative}
            if None in places.values():
                return None
        return None

    def _accept(self, w, length, active, inside, values, end):
        """The element, if nothing else is violated."""
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
        return Step(w, length, active, inside, end)


def _flipped(active, functions):
    """The active set in which these sides are zero."""
    active = active.copy()
    for k in functions:
        active[k // 2] = bool(k % 2)
    return active
