"""The records of the laws at element boundaries: state jumps, impacts and hysteresis."""

from collections.abc import Container
from dataclasses import dataclass

from pyomo.common.collections import ComponentMap
from pyomo.core import Block, Constraint, Expression, Var, quicksum, value
from pyomo.mpec import Complementarity

from pyomo_fesd.core.complementarity import Pair
from pyomo_fesd.core.grid import Element

#: An impulse below this number, or this part of the largest one of its contact, is none.
NO_IMPULSE = 1e-7


@dataclass(frozen=True)
class Impacts:
    """The impacts of rigid contacts at the boundaries of a moving grid (theory, eq. 20 and 21).

    Attributes
    ----------
    laws : list of ContactLaw
        one for each ``contact`` over time, with ``name``, ``gaps`` and ``touching`` by label
    block : Block
        the generated block that holds the components below
    impulse, second : Var over (contact, boundary)
        Lambda; of bodies that must not slip its parts along the first and the second edge of the friction cone
    above, below : Var over (contact, boundary)
        P and N: the parts of gamma(v+) + e gamma(v-)
    leaving : Var over (contact, boundary)
        Q: the part above 0 of gamma(v+), where e is not 0; without restitution it is ``above``
    parts : Constraint over (contact, boundary, number)
        the equations of these parts
    room : Constraint over (contact, boundary)
        what keeps N at 0 where the bodies meet
    impact : Complementarity over (contact, boundary, number)
        an impulse only where the gap is 0 and the law of restitution holds
    velocity : Var over (boundary, number)
        velocities after an impact where masses couple them
    balance : Constraint over (boundary, number)
        their equations
    direction : Var over (boundary, number)
        multipliers nu of the friction impulse, in place of those of the friction force
    weights : Constraint over (boundary, number)
        equations between these multipliers
    slip : Complementarity over (condition, boundary)
        the friction impulse is against the slip velocity after the impact
    directions : dict boundary -> ComponentMap VarData -> VarData
        multiplier nu at the boundary -> its ``direction``
    velocities : dict boundary -> list of VarData
        the states that jump, in the order of their values in ``StateJumps.after``
    """

    laws: list
    block: Block
    impulse: Var
    second: Var
    above: Var
    below: Var
    leaving: Var
    parts: Constraint
    room: Constraint
    impact: Complementarity
    velocity: Var
    balance: Constraint
    direction: Var
    weights: Constraint
    slip: Complementarity
    directions: dict
    velocities: dict

    @property
    def drift(self) -> Var | None:
        """mu of curved contacts."""
        return self.block.component('drift')

    @property
    def rate(self) -> Var | None:
        """gamma of curved contacts at the collocation points."""
        return self.block.component('rate')

    @property
    def rates(self) -> Constraint | None:
        """The equations of gamma there."""
        return self.block.component('rates')

    @property
    def turned(self) -> Constraint | None:
        """How far mu may turn the normal of the surface."""
        return self.block.component('turned')

    @property
    def closed(self) -> Constraint | None:
        """The equations of mu."""
        return self.block.component('closed')

    @property
    def sticking(self) -> list[str]:
        """The names of the contacts whose bodies must not slip, a condition on the controls."""
        return [law.name for law in self.laws if law.sticking]

    def impulses(self, name: str, b: int) -> list:
        """Return the impulses of a contact at boundary ``b``: one, or those along the two edges of the friction cone."""
        return [some[name, b] for some in (self.impulse, self.second) if (name, b) in some]

    def normal_impulse(self, name: str, b: int):
        """Return Lambda of a contact at boundary ``b``."""
        return quicksum(self.impulses(name, b))

    def active(self, n: int) -> list[str]:
        """Return the names of the contacts with an impact at the right boundary of element ``n``."""
        return [law.name for law in self.laws if self._size(law, n) > NO_IMPULSE * max(1.0, self._largest(law))]

    def unknown(self, b: int, closed: Container[str]) -> list:
        """Return the variables of the laws at boundary ``b`` that the ``closed`` contacts determine, with N = 0."""
        parts = [v for some in (self.impulse, self.second, self.above, self.leaving) for v in _at(some, b, closed)]
        return [*parts, *_at(self.velocity, b), *_at(self.direction, b)]

    def rows(self, b: int, closed: Container[str]) -> list:
        """Return the equations of the laws at boundary ``b`` for the ``closed`` contacts."""
        return [*_at(self.parts, b, closed), *_at(self.balance, b), *_at(self.weights, b)]

    def closed_pairs(self, b: int, closed: Container[str]) -> list[Pair]:
        """Return the law of restitution at boundary ``b`` for each of the ``closed`` contacts, 0 <= Lambda perp P >= 0."""
        return [Pair(v, self.above[v.index()]) for v in _at(self.impulse, b, closed)]

    def set_parts(self, name: str, b: int) -> None:
        """Set P, N and Q of a contact at boundary ``b`` from the velocities there, with the least N."""
        index = name, b
        variables = [some[index] for some in (self.above, self.below, self.leaving) if index in some]
        for v in variables:
            v.set_value(0.0)
        rates = [value(self.parts[(*index, k)].body) for k in range(1, len(variables))]
        N = max(0.0, *(-rate for rate in rates))
        for v, number in zip(variables, (rates[0] + N, N, rates[-1] + N)):
            v.set_value(number)

    def slip_pairs(self, b: int) -> list:
        """Return the pairs of friction impulses at boundary ``b``."""
        return _at(self.slip, b)

    def between(self, b: int) -> list:
        """Return the equations of the velocities that masses couple, and of the directions, at boundary ``b``."""
        return [*_at(self.balance, b), *_at(self.weights, b)]

    def _size(self, law, n):
        return sum(v.value or 0.0 for v in self.impulses(law.name, n))

    def _largest(self, law):
        return max((self._size(law, n) for name, n in self.impulse if name == law.name), default=0.0)


def _at(component, b, among=None):
    """The data of a component over (name, boundary, ...) or (boundary, number) at boundary ``b``, of some names only."""
    place = next(k for k, s in enumerate(component.index_set().subsets()) if s.local_name == 'left')
    return [data for index, data in component.items() if index[place] == b and (among is None or index[0] in among)]


@dataclass(frozen=True)
class StateJumps:
    """The state jumps at the inner boundaries of a moving grid (eq. E3), and those of velocities at impacts.

    Attributes
    ----------
    laws : list of JumpLaw
        one for each ``state_jump`` over time, with ``name``, ``guards`` and ``resets`` by label
    block : Block
        the generated block that holds the components below
    e : Var over (law, boundary)
        1 where a law acts at a boundary
    happens, binary : Complementarity over (law, boundary)
        a jump only where the guard is 0; e is 0 or 1
    after : Expression over (boundary, number)
        the states after the boundary
    copy : Var over (boundary, number)
        the algebraic variables after the boundary that depend on these states
    copied : Constraint over (boundary, number)
        the equations of ``copy``
    impacts : Impacts or None
    """

    laws: list
    block: Block
    e: Var
    happens: Complementarity
    binary: Complementarity
    after: Expression
    copy: Var
    copied: Constraint
    impacts: Impacts | None = None

    def jumping(self, label: float) -> ComponentMap:
        """Return the states that are reset at ``label``: state -> [(law, value after)], in the order of ``after``."""
        found = ComponentMap()
        for law in self.laws:
            for x, J in law.resets.get(label, ()):
                found.setdefault(x, []).append((law.name, J))
        return found

    def values_after(self, before: Element) -> ComponentMap:
        """Return the values right of the boundary after element ``before``: state that jumps there -> expression."""
        velocities = () if self.impacts is None else self.impacts.velocities[before.n]
        states = [*self.jumping(before.right), *velocities]
        return ComponentMap((x, self.after[before.n, j]) for j, x in enumerate(states, start=1))

    def velocities_after(self, b: int) -> list[tuple]:
        """Return the velocities that jump at impacts at boundary ``b``, with the expressions of their values after it."""
        velocities = [] if self.impacts is None else self.impacts.velocities.get(b, [])
        first = sum(1 for boundary, _ in self.after if boundary == b) - len(velocities) + 1
        return [(v, self.after[b, j].expr) for j, v in enumerate(velocities, start=first)]

    def active(self, n: int) -> list[str]:
        """Return the names of the laws that act at the right boundary of element ``n``."""
        resets = [law.name for law in self.laws if (law.name, n) in self.e and (self.e[law.name, n].value or 0.0) > 0.5]
        return resets + ([] if self.impacts is None else self.impacts.active(n))


@dataclass(frozen=True)
class Hysteresis:
    """The modes with hysteresis on a moving grid (eq. E1, E2).

    Attributes
    ----------
    modes : list of HysteresisLaw
        one for each mode over time, with ``name``, ``system``, ``title``, ``weights`` and ``conditions`` by label
    block : Block
        the generated block that holds the components below
    n : Var over (mode, boundary, number, side)
        the negative part of a condition
    m : Var over (mode, boundary, number)
        the least of the positive parts of the conditions 1 to number, from 2 on
    beyond : Expression over (mode, boundary, number)
        conditions right of a boundary, where they differ from those on the left
    binary : Complementarity over (mode, element)
        the weight is 0 or 1
    parts, region : Complementarity, indexed like ``n``
    least : Complementarity, indexed like ``m``
    leaving : Complementarity over (mode, boundary)
        a mode ends only where the least of the positive parts is 0
    """

    modes: list
    block: Block
    n: Var
    m: Var
    beyond: Expression
    binary: Complementarity
    parts: Complementarity
    region: Complementarity
    least: Complementarity
    leaving: Complementarity
