"""What happens between two elements of a march: a mode with memory ends, a state jumps.

Both happen where a function that must not become negative arrives at zero from above: a condition of the active mode, a guard.
An element ends at the latest where one of its stage points has arrived.
"""

from pyomo.core import value

from pyomo_fesd.elements.memory import LEFT, RIGHT
from pyomo_fesd.errors import FesdError
from pyomo_fesd.march.equations import own_labels

#: A function below this part of the largest value that it has had is zero.
ZERO = 1e-7


class Arrivals:
    """Where functions fall to zero; remembers how large each of them has been."""

    def __init__(self):
        self._largest = {}

    def zero(self, key, values):
        """The size below which the function is zero."""
        self._largest[key] = max(self._largest.get(key, 0.0), *map(abs, values))
        return ZERO * self._largest[key]

    def first(self, key, values):
        """Place of the first of ``values`` that is zero after one that was not; None if there is none."""
        zero = self.zero(key, values)
        return next((i for i in range(1, len(values)) if values[i] <= zero < values[i - 1]), None)


class Memory:
    """The modes with memory of one Disjunction.

    Parameters
    ----------
    modes : list of elements.memory.Mode
    home : Block
        what ``fesd.finite_elements`` made of them
    """

    def __init__(self, modes, home):
        self.name = modes[0].system
        self._modes, self._home, self._active, self._arrivals = modes, home, None, Arrivals()

    def begin(self, label):
        """The mode at the first time: the one that is fixed there, or the only one whose conditions hold."""
        on = [m for m in self._modes if value(m.weights[label]) > 0.5]
        fixed = all(v.fixed for v in self.variables(label))
        possible = on if fixed else [m for m in self._modes if all(c >= 0 for c in _conditions(m, label))]
        if len(possible) != 1:
            raise FesdError(
                self.name,
                f"simulate: {len(possible)} modes are possible at the first time",
                "fix the indicator of the one that comes first, e.g. m.heating[0].indicator_var.fix(True), before fesd.dcs",
            )
        self._active = possible[0]

    def variables(self, label):
        """The weights at one time that are variables of their own."""
        return [m.weights[label].expr for m in self._modes if m.weights[label].expr.is_variable_type()]

    def limits(self, element):
        """The conditions in an element by name, each for its mode only: nu c + (1 - nu) >= 0 at every label."""
        return {
            f'{m.name} {k}': [m.weight(element) * c + (1 - m.weight(element)) >= 0 for c in values]
            for m in self._modes
            for k, values in enumerate(zip(*(m.conditions[t] for t in own_labels(element))))
        }

    def set_weights(self, element):
        """Give nu its value in an element."""
        for mode in self._modes:
            if mode.independent:
                mode.weight(element).expr.set_value(float(mode is self._active), skip_validation=True)

    def arrived(self, element):
        """For each condition of the active mode the place in (left, own labels) where it has fallen to zero, or None."""
        found = []
        for mode in self._modes:
            values = [self._after(mode, element.n - 1, element.left), *(_conditions(mode, t) for t in own_labels(element))]
            for k, row in enumerate(zip(*values)):
                place = self._arrivals.first((mode.name, k), row)
                found += [place] if mode is self._active else []
        return found

    def ends_beyond(self, boundary, label):
        """Whether a condition of the active mode, zero or not on the left of a boundary, is negative on its right."""
        return any(c < 0 for c in self._room(self._active, boundary, label))

    def end(self, boundary, label):
        """The active mode has ended at a boundary: another one begins.

        Raises
        ------
        FesdError
            if none or several can follow
        """
        room = [(m, min(self._room(m, boundary, label), default=1.0)) for m in self._modes if m is not self._active]
        inside = [m for m, space in room if space > 0]
        possible = inside or [m for m, space in room if space >= 0]
        if len(possible) != 1:
            names = ', '.join(m.title for m in possible) or 'none'
            raise FesdError(
                self._active.title,
                f"simulate: {len(possible)} modes can follow where this one ends ({names})",
                "state the regions so that where a mode ends the point lies in one other region",
            )
        self._active = possible[0]

    def _after(self, mode, boundary, label):
        """Values of the conditions right of a boundary."""
        left = _conditions(mode, label)
        places = ((mode.name, boundary, k) for k in range(1, len(left) + 1))
        beyond = self._home.beyond
        return [value(beyond[place]) if place in beyond else c for place, c in zip(places, left)]

    def _room(self, mode, boundary, label):
        """The same with 0 for those that are zero."""
        return [self._rounded(mode, k, c) for k, c in enumerate(self._after(mode, boundary, label))]

    def _rounded(self, mode, k, c):
        return 0.0 if abs(c) <= self._arrivals.zero((mode.name, k), [c]) else c

    def settle(self, grid, first):
        """What the law of switching between elements says at the values of the march: n and d at every boundary."""
        labels = [first, *(e.right for e in grid.elements)]
        for mode in self._modes:
            weights = [value(mode.weight(e)) for e in grid.elements]
            for b, label in enumerate(labels):
                left = 0 < b < len(grid.elements) and weights[b - 1] > weights[b]
                for side, values in ((LEFT, _conditions(mode, label)), (RIGHT, self._after(mode, b, label))):
                    for k, c in enumerate(values, start=1):
                        index, c = (mode.name, b, k, side), self._rounded(mode, k - 1, c)
                        if index in self._home.n:
                            self._home.n[index].set_value(max(-c, 0.0), skip_validation=True)
                        if index in self._home.d:
                            self._home.d[index].set_value(float(left and c <= 0), skip_validation=True)


def _conditions(mode, label):
    return [value(c) for c in mode.conditions[label]]


class Jumps:
    """The laws of reset of a model.

    Parameters
    ----------
    jumps : list of elements.jumps.Jump
    home : Block or None
        what ``fesd.finite_elements`` made of them
    """

    def __init__(self, jumps, home):
        self._jumps, self._home, self._arrivals, self._just = jumps, home, Arrivals(), set()

    def begin(self):
        """No jump yet."""
        self._just = set()

    def limits(self, element):
        """The guards in an element by name, at every label."""
        return {j.name: [j.guards[t] >= 0 for t in own_labels(element)] for j in self._jumps}

    def arrived(self, element):
        """For each law the place in (left, own labels) where its guard has fallen to zero, or None.

        Where a law has just reset the state the guard is zero on the left, but not after the jump: the left does not count.
        """
        return [self._place(jump, element) for jump in self._jumps]

    def _place(self, jump, element):
        skipped = int(jump.name in self._just)
        values = [value(jump.guards[t]) for t in (element.left, *own_labels(element))]
        place = self._arrivals.first(jump.name, values[skipped:])
        return None if place is None else place + skipped

    def end(self, element, arrived):
        """Jump at the right boundary where the guard has arrived there; returns the names of the laws that do."""
        last = len(own_labels(element))
        self._just = {j.name for j, place in zip(self._jumps, arrived) if place == last}
        for jump in self._jumps:
            if element.n in self._home.boundary:
                self._home.e[jump.name, element.n].set_value(float(jump.name in self._just))
        return sorted(self._just)
