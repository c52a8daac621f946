"""Events between two elements: a mode with hysteresis ends, a state jumps.

Both happen where a function that must not become negative arrives at zero from above: a condition of the active mode, a guard.
An element ends at the latest where the function is zero at one of its collocation points.

A *position* counts the points (left boundary, labels of the element): 0 is the left boundary, the last one the right boundary.
"""

from collections.abc import Hashable, Sequence
from itertools import accumulate

from pyomo.core import Block, value
from pyomo.core.base.var import VarData

from pyomo_fesd.core import FesdError, MovingGrid, StateJumps
from pyomo_fesd.finite_elements import LEFT, RIGHT

#: A function below this part of its largest value so far is zero.
ZERO = 1e-7


class ZeroArrivals:
    """Finds where functions fall to zero, relative to their largest values so far."""

    def __init__(self):
        self._largest = {}

    def at_least(self, key: Hashable, size: float) -> None:
        """Let ``size`` count among the values of the function ``key``: one that is zero throughout has none of its own."""
        self._largest[key] = max(self._largest.get(key, 0.0), size)

    def zero(self, key: Hashable, values: Sequence[float]) -> float:
        """Return the size below which the function ``key`` is zero."""
        self._largest[key] = max(self._largest.get(key, 0.0), *map(abs, values))
        return ZERO * self._largest[key]

    def first(self, key: Hashable, values: Sequence[float]) -> int | None:
        """Return the position of the first of ``values`` that is zero after one that was not; None if there is none."""
        zero = self.zero(key, values)
        return next((i for i in range(1, len(values)) if values[i] <= zero < values[i - 1]), None)


def read_hysteresis(moving: MovingGrid) -> list:
    """Return the ``HysteresisEvents`` of every Disjunction with hysteresis on a moving grid."""
    if moving.hysteresis is None:
        return []
    modes, block = moving.hysteresis.modes, moving.hysteresis.block
    return [HysteresisEvents([m for m in modes if m.system == s], block) for s in dict.fromkeys(m.system for m in modes)]


class HysteresisEvents:
    """The modes with hysteresis of one Disjunction, one of them active, and the block with their generated conditions."""

    def __init__(self, modes: list, block: Block):
        self.name = modes[0].system
        self._modes, self._block, self._active, self._arrivals, self._arrived = modes, block, None, ZeroArrivals(), []

    def begin(self, label: float) -> None:
        """Begin with the mode of the first time: the one that is fixed there, or the only one whose conditions hold.

        Raises
        ------
        FesdError
            if none or several can be the first
        """
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

    def mark(self):
        """Return the active mode."""
        return self._active

    def return_to(self, mark) -> None:
        """Return to a mark of this pass; the largest values so far remain."""
        self._active = mark

    def variables(self, label: float) -> list[VarData]:
        """Return the weights at one time that are variables of their own."""
        return [m.weights[label].expr for m in self._modes if m.weights[label].expr.is_variable_type()]

    def event_functions(self, element) -> dict[str, list]:
        """Return the conditions in an element by name, each for its mode only: nu c >= 0 at every label.

        No constant is added where the mode is off: it would be without the unit of c, and the size of the function.
        """
        return {
            f'{m.name} {k}': [m.weight(element) * c >= 0 for c in values]
            for m in self._modes
            for k, values in enumerate(zip(*(m.conditions[t] for t in element.own_labels)))
        }

    def equal_weights(self, element) -> list[tuple[VarData, float]]:
        """Return weights of an element with which no mode is off."""
        return [(m.weight(element).expr, 1 / len(self._modes)) for m in self._modes if m.independent]

    def set_weights(self, element) -> None:
        """Set the weights nu of an element."""
        for mode in self._modes:
            if mode.independent:
                mode.weight(element).expr.set_value(float(mode is self._active), skip_validation=True)

    def find_arrivals(self, element) -> list[int]:
        """Return the positions at which conditions of the active mode have fallen to zero."""
        self._arrived = []
        for mode in self._modes:
            values = [self._right_of(mode, element.n - 1, element.left), *(_conditions(mode, t) for t in element.own_labels)]
            # inactive modes count for the sizes of their conditions only
            found = [self._arrivals.first((mode.name, k), row) for k, row in enumerate(zip(*values))]
            if mode is self._active:
                self._arrived = [position for position in found if position is not None]
        return self._arrived

    def pass_boundary(self, element) -> list[str]:
        """Change the mode if the active one ends at the right boundary of ``element``; returns the names of events.

        It ends where a condition has just arrived at zero, or is negative right of the boundary.

        Raises
        ------
        FesdError
            if none or several modes can follow
        """
        boundary, label = element.n, element.right
        arrived = len(element.own_labels) in self._arrived
        if not arrived and all(c >= 0 for c in self._margins(self._active, boundary, label)):
            return []
        self._active = self._following(boundary, label)
        return [self.name]

    def _following(self, boundary, label):
        others = [(m, min(self._margins(m, boundary, label), default=1.0)) for m in self._modes if m is not self._active]
        possible = [m for m, margin in others if margin > 0] or [m for m, margin in others if margin >= 0]
        if len(possible) != 1:
            raise self._ambiguous(possible)
        return possible[0]

    def _ambiguous(self, possible):
        names = ', '.join(m.title for m in possible) or 'none'
        return FesdError(
            self._active.title,
            f"simulate: {len(possible)} modes can follow where this one ends ({names})",
            "state the regions so that where a mode ends the point lies in one other region",
        )

    def _right_of(self, mode, boundary, label):
        """Values of the conditions right of a boundary."""
        left = _conditions(mode, label)
        indices = ((mode.name, boundary, k) for k in range(1, len(left) + 1))
        beyond = self._block.beyond
        return [value(beyond[index]) if index in beyond else c for index, c in zip(indices, left)]

    def _margins(self, mode, boundary, label):
        """The same with 0 for those that are zero."""
        return [self._rounded(mode, k, c) for k, c in enumerate(self._right_of(mode, boundary, label))]

    def _rounded(self, mode, k, c):
        return 0.0 if abs(c) <= self._arrivals.zero((mode.name, k), [c]) else c

    def set_multipliers(self, grid, first: float) -> None:
        """Set n and m of the hysteresis conditions at every boundary to fit the conditions there."""
        labels = [first, *(e.right for e in grid.elements)]
        for mode in self._modes:
            for b, label in enumerate(labels):
                for side, values in ((LEFT, _conditions(mode, label)), (RIGHT, self._right_of(mode, b, label))):
                    rounded = [self._rounded(mode, k, c) for k, c in enumerate(values)]
                    _set(self._block.n, {(mode.name, b, k, side): max(-c, 0.0) for k, c in enumerate(rounded, start=1)})
                least = accumulate((max(c, 0.0) for c in rounded), min)
                _set(self._block.m, {(mode.name, b, k): positive for k, positive in enumerate(least, start=1)})


def _set(variables, values):
    """Set those of the ``values`` whose variables exist."""
    for index, number in values.items():
        if index in variables:
            variables[index].set_value(number, skip_validation=True)


def _conditions(mode, label):
    return [value(c) for c in mode.conditions[label]]


class JumpEvents:
    """The state jumps on a moving grid; None without."""

    def __init__(self, state_jumps: StateJumps | None):
        self._laws = [] if state_jumps is None else state_jumps.laws
        self._block = None if state_jumps is None else state_jumps.block
        self._arrivals, self._arrived, self._just = ZeroArrivals(), {}, set()

    def begin(self) -> None:
        """Begin without a jump."""
        self._just = set()

    def mark(self) -> set[str]:
        """Return the names of the jumps at the last boundary."""
        return self._just

    def return_to(self, mark: set[str]) -> None:
        """Return to a mark of this pass; the largest values so far remain."""
        self._just = mark

    def event_functions(self, element) -> dict[str, list]:
        """Return the guards in an element by name, at every label."""
        return {law.name: [law.guards[t] >= 0 for t in element.own_labels] for law in self._laws}

    def find_arrivals(self, element) -> list[int]:
        """Return the positions at which guards have fallen to zero.

        The left boundary does not count for a jump that has just happened there: its guard is zero on the left of the boundary,
        but not on the right.
        """
        self._arrived = {law.name: self._position(law, element) for law in self._laws}
        return [position for position in self._arrived.values() if position is not None]

    def _position(self, law, element):
        skipped = int(law.name in self._just)
        values = [value(law.guards[t]) for t in (element.left, *element.own_labels)]
        position = self._arrivals.first(law.name, values[skipped:])
        return None if position is None else position + skipped

    def pass_boundary(self, element) -> list[str]:
        """Jump at the right boundary of ``element`` where guards have arrived there; returns the names of these jumps."""
        self._just = {name for name, position in self._arrived.items() if position == len(element.own_labels)}
        for law in self._laws:
            if element.n in self._block.boundary:
                self._block.e[law.name, element.n].set_value(float(law.name in self._just))
        return sorted(self._just)
