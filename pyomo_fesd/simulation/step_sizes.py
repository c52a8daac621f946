"""Step-size plans: equal parts of the rest of a control stage, or equal lengths between two switches.

The first pass does not know the switches: every element takes its part of the rest, the one before a switch is cut short.
Then the switches are known, and elements between two of them can be equal, as step equilibration (theory, eq. 13) asks for:

    h = (t_switch - t_begin)/number of elements,

where t_switch depends on h by the error of the discretisation only; so a few passes find both.

Does not apply: where step equilibration is switched off.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from pyomo.core import value

from pyomo_fesd.core import MovingGrid

#: eta above which nothing has switched, the default of ``eta_tol``.
UNCHANGED = 1e-3
#: How much longer than expected the element before a switch may be.
MARGIN = 1.5


@dataclass(frozen=True)
class EvenSteps:
    """Equal parts of the rest of a control stage.

    Attributes
    ----------
    expected : dict stage -> number of switches
    """

    expected: Mapping[int, int]

    def longest(self, element, rest: float, number: int, switched: int) -> float:
        """Return the length to aim at, with the ``rest`` of the control stage, its ``number`` of elements left, and of switches."""
        return rest / max(1, number - max(0, self.expected[element.stage] - switched))


@dataclass(frozen=True)
class EqualSteps:
    """Equal lengths between switches.

    Attributes
    ----------
    lengths : dict element number -> length
    last : set of element numbers
        that end at a switch
    """

    lengths: Mapping[int, float]
    last: set[int]

    def longest(self, element, rest: float, number: int, switched: int) -> float:
        """Return the length to aim at, with a margin for elements that end at a switch."""
        return rest / number if number == 1 else self.lengths[element.n] * (MARGIN if element.n in self.last else 1)


@dataclass(frozen=True)
class SimulatedElement:
    """Result of one element.

    Attributes
    ----------
    length : float
    activity : bytes or None
        the active set, as step equilibration sees it; None if unknown
    events : list of str
        names of modes with hysteresis that end at its right boundary, and of jumps there
    """

    length: float
    activity: bytes | None
    events: list[str]


def equilibration_is_active(moving: MovingGrid) -> bool:
    """Return whether step equilibration asks for equal lengths."""
    pairs = moving.equilibration
    return pairs is not None and any(pair.active for pair in pairs.values())


def equal_steps(moving: MovingGrid, simulated: Mapping[int, SimulatedElement]) -> tuple[EqualSteps, float]:
    """Return the equal lengths that fit the switches of a pass, and their largest relative difference from its lengths."""
    lengths, last, difference = {}, set(), 0.0
    for elements in moving.grid.stages.values():
        found = [e.length * moving.r[e.n].value for e in elements]
        switches = [k for k, e in enumerate(elements[:-1], start=1) if _switches(moving, simulated, e.n)]
        last.update(elements[k - 1].n for k in switches)
        for a, b in zip([0, *switches], [*switches, len(elements)]):
            h = sum(found[a:b]) / (b - a)
            difference = max(difference, *(abs(x - h) / h for x in found[a:b]))
            lengths.update((e.n, h) for e in elements[a:b])
    return EqualSteps(lengths, last), difference


def _switches(moving, simulated, n):
    before, after = simulated[n], simulated[n + 1]
    if before.events:
        return True
    if before.activity is None or after.activity is None:
        return not value(moving.eta[n]) > UNCHANGED
    return before.activity != after.activity
