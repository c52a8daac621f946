"""The records of the laws at element boundaries: state jumps and hysteresis."""

from dataclasses import dataclass

from pyomo.common.collections import ComponentMap
from pyomo.core import Block, Constraint, Expression, Var
from pyomo.mpec import Complementarity

from pyomo_fesd.core.grid import Element


@dataclass(frozen=True)
class StateJumps:
    """The state jumps at the inner boundaries of a moving grid (eq. E3).

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
    """

    laws: list
    block: Block
    e: Var
    happens: Complementarity
    binary: Complementarity
    after: Expression
    copy: Var
    copied: Constraint

    def jumping(self, label: float) -> ComponentMap:
        """Return the states that jump at ``label``: state -> [(law, value after)], in the order of ``after``."""
        found = ComponentMap()
        for law in self.laws:
            for x, J in law.resets.get(label, ()):
                found.setdefault(x, []).append((law.name, J))
        return found

    def values_after(self, before: Element) -> ComponentMap:
        """Return the values right of the boundary after element ``before``: state that jumps there -> expression."""
        states = self.jumping(before.right)
        return ComponentMap((x, self.after[before.n, j]) for j, x in enumerate(states, start=1))

    def active(self, n: int) -> list[str]:
        """Return the names of the laws that act at the right boundary of element ``n``."""
        return [law.name for law in self.laws if (law.name, n) in self.e and (self.e[law.name, n].value or 0.0) > 0.5]


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
