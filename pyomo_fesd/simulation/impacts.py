"""Impacts between two elements: where a gap has closed, the laws of impact at that boundary are solved (theory, eq. 20 and 21).

At all other boundaries there is no impulse, and the parts of the normal velocities follow from their values.
"""

from collections.abc import Callable

from pyomo.core import value
from pyomo.core.expr.visitor import identify_variables

from pyomo_fesd.core import Impacts, StateJumps, TimeIndex
from pyomo_fesd.simulation.events import ZeroArrivals

#: The gap of a contact that is always closed is as exact as this part of the positions in it.
ROUND_OFF = 1e-3


class ImpactEvents:
    """The impacts on a moving grid; nothing without contacts.

    Parameters
    ----------
    state_jumps : StateJumps or None
    times : TimeIndex
    solve : function of a boundary and the names of closed contacts
        solves the laws of impact there and writes the values
    """

    def __init__(self, state_jumps: StateJumps | None, times: TimeIndex, solve: Callable[[int, list], None]):
        self._state_jumps, self._times, self._solve = state_jumps, times, solve
        self._impacts: Impacts | None = None if state_jumps is None else state_jumps.impacts
        self._laws = [] if self._impacts is None else self._impacts.laws
        self._sizes, self._collided = ZeroArrivals(), False

    def begin(self) -> None:
        """Begin without an impact."""
        self._sizes, self._collided = ZeroArrivals(), False
        horizon = self._times.wrt.last() - self._times.wrt.first()
        for law in self._laws:
            positions = identify_variables(next(iter(law.gaps.values())), include_fixed=True)
            size = max(abs(v.value or 0.0) for v in positions) or 1.0
            self._sizes.at_least(law.name, ROUND_OFF * size)
            self._sizes.at_least((law.name, 'rate'), size / horizon)
        if self._laws:
            self._without_impulse(0)

    def mark(self) -> bool:
        """Return whether there was an impact at the last boundary."""
        return self._collided

    def return_to(self, mark: bool) -> None:
        """Return to a mark of this pass; the largest values so far remain."""
        self._collided = mark

    def event_functions(self, element) -> dict[str, list]:
        """Return no functions: the conditions of the contact forces keep the gaps from becoming negative."""
        return {}

    def find_arrivals(self, element) -> list[int]:
        """Return the positions at which gaps have closed."""
        self._follow_direction(element)
        labels = (element.left, *element.own_labels)
        found = (self._sizes.first(law.name, [value(law.gaps[t]) for t in labels]) for law in self._laws)
        return [position for position in found if position is not None]

    def pass_boundary(self, element) -> list[str]:
        """Let closed contacts that approach at the right boundary of ``element`` collide; returns their names."""
        if not self._laws:
            return []
        b = element.n
        self._without_impulse(b)
        closed = [law.name for law in self._laws if self._is_closed(law, element.right)]
        approaching = sorted(name for name in closed if self._approaches(name, b))
        self._collided = bool(approaching)
        if approaching:
            for name in closed:
                self._impacts.below[name, b].set_value(0.0)
            self._solve(b, closed)
            for law in self._laws:
                if law.name not in closed:
                    self._impacts.set_parts(law.name, b)
        return approaching

    def _is_closed(self, law, label):
        gap = value(law.gaps[label])
        return gap <= self._sizes.zero(law.name, [gap])

    def _approaches(self, name, b):
        """Whether the law of restitution needs an impulse: N without one is not 0."""
        rate = self._impacts.below[name, b].value
        return rate > self._sizes.zero((name, 'rate'), [rate])

    def _follow_direction(self, element):
        """Without an impulse at the left boundary, its direction is that of the friction force in ``element``."""
        if self._laws and not self._collided:
            for nu, beta in self._impacts.directions[element.n - 1].items():
                beta.set_value(self._times.at(nu, element.points[0]).value, skip_validation=True)

    def _without_impulse(self, b):
        """No impulse at boundary b: P, N and Q from the normal velocities."""
        for law in self._laws:
            if b:
                self._impacts.impulse[law.name, b].set_value(0.0)
        for v, after in self._state_jumps.velocities_after(b):
            if after.is_variable_type():
                after.set_value(v.value, skip_validation=True)
        for law in self._laws:
            self._impacts.set_parts(law.name, b)
