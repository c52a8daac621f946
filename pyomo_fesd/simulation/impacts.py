"""Impacts between two elements: where a gap has closed, the laws of impact at that boundary are solved (theory, eq. 20 and 21).

At all other boundaries there is no impulse, and the parts of the normal velocities follow from their values.
"""

from collections.abc import Callable

from pyomo.core import value
from pyomo.core.expr.visitor import identify_variables

from pyomo_fesd.core import Impacts, StateJumps, TimeIndex
from pyomo_fesd.simulation.events import ZeroArrivals

#: A contact opens after an impact with more than this part of the normal velocity before it.
OPENS = 1e-7
#: The gap of a contact that is always closed is as exact as this part of the positions in it.
ROUND_OFF = 1e-3


class ImpactEvents:
    """The impacts on a moving grid; nothing without contacts.

    Parameters
    ----------
    state_jumps : StateJumps or None
    times : TimeIndex
    solve : function of a boundary
        solves the laws of impact there and writes the values
    """

    def __init__(self, state_jumps: StateJumps | None, times: TimeIndex, solve: Callable[[int], None]):
        self._state_jumps = state_jumps
        self._impacts: Impacts | None = None if state_jumps is None else state_jumps.impacts
        self._laws = [] if self._impacts is None else self._impacts.laws
        self._times, self._solve, self._arrivals, self._arrived, self._collided = times, solve, ZeroArrivals(), {}, False

    def begin(self) -> None:
        """Begin without an impact."""
        self._arrivals, self._collided = ZeroArrivals(), False
        for law in self._laws:
            positions = identify_variables(next(iter(law.gaps.values())), include_fixed=True)
            self._arrivals.at_least(law.name, ROUND_OFF * (max(abs(v.value or 0.0) for v in positions) or 1.0))
        if self._laws:
            self._without_impulse(0)

    def event_functions(self, element) -> dict[str, list]:
        """Return no functions: the conditions of the contact forces keep the gaps from becoming negative."""
        return {}

    def find_arrivals(self, element) -> list[int]:
        """Return the positions at which gaps have closed."""
        self._follow_direction(element)
        labels = (element.left, *element.own_labels)
        self._arrived = {law.name: self._arrivals.first(law.name, [value(law.gaps[t]) for t in labels]) for law in self._laws}
        return [position for position in self._arrived.values() if position is not None]

    def pass_boundary(self, element) -> list[str]:
        """Let the contacts whose gaps have closed at the right boundary of ``element`` collide; returns their names."""
        if not self._laws:
            return []
        collide = sorted(name for name, position in self._arrived.items() if position == len(element.own_labels))
        self._without_impulse(element.n)
        self._collided = bool(collide)
        if collide:
            self._solve(element.n)
        return collide

    def _follow_direction(self, element):
        """Without an impulse at the left boundary, its direction is that of the friction force in ``element``."""
        if self._laws and not self._collided:
            for nu, beta in self._impacts.directions[element.n - 1].items():
                beta.set_value(self._times.at(nu, element.points[0]).value, skip_validation=True)

    def closed(self, element) -> dict[str, bool]:
        """Return for each contact that touches at the right boundary of ``element`` whether it stays closed after it, by label."""
        found = {}
        for law in self._laws:
            gap = value(law.gaps[element.right])
            if abs(gap) <= self._arrivals.zero(law.name, [gap]):
                found[law.name] = self._departs(law, element.n) <= OPENS
        return found

    def _departs(self, law, b):
        """The part of the normal velocity with which a contact opens."""
        impacts, index = self._impacts, (law.name, b)
        Q = (impacts.leaving if index in impacts.leaving else impacts.above)[index].value
        return Q / max(1.0, abs(impacts.below[index].value), abs(impacts.impulse[index].value if b else 0.0))

    def _without_impulse(self, b):
        """No impulse at boundary b: P, N and Q from the normal velocities."""
        for law in self._laws:
            if b:
                self._impacts.impulse[law.name, b].set_value(0.0)
        for v, after in self._state_jumps.velocities_after(b):
            if after.is_variable_type():
                after.set_value(v.value, skip_validation=True)
        for law in self._laws:
            self._set_parts(law.name, b)

    def _set_parts(self, name, b):
        """The least N, and P and Q with it."""
        impacts, index = self._impacts, (name, b)
        variables = (impacts.above[index], impacts.below[index], impacts.leaving[index])
        for v in variables:
            v.set_value(0.0)
        rates = [value(impacts.parts[(*index, k)].body) for k in (1, 2) if (*index, k) in impacts.parts]
        if not b:
            rates = rates[:1]
        N = max(0.0, *(-rate for rate in rates))
        for v, number in zip(variables, (rates[0] + N, N, rates[-1] + N)):
            v.set_value(number)
