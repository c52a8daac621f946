"""How long the elements of a march are to be: shares of what is left of a stage, or equal between two switches.

The first march does not know the switches: every element takes its share of what is left, the one before a switch is cut short.
Then the switches are known, and elements between two of them can be equal, as step equilibration (theory, eq. 13) asks for:

    h = (t_switch - t_begin)/number of elements,

where t_switch depends on h by the error of the discretisation only; so a few marches find both.

Takes: a march that is through, and where it has switched.
Leaves: nothing.
Does not apply: where step equilibration is switched off.
"""

from dataclasses import dataclass

from pyomo.core import value

#: eta above which nothing has switched, the default of ``eta_tol``.
UNCHANGED = 1e-3
#: How much longer than expected the element before a switch may be.
ROOM = 1.5


@dataclass(frozen=True)
class Even:
    """Even shares of what is left of a stage.

    Attributes
    ----------
    reserve : dict stage -> number of switches to be expected
    """

    reserve: dict

    def most(self, element, rest, left, switched):
        """The length to aim at.

        Parameters
        ----------
        rest : float
            of the stage
        left : int
            elements, this one included
        switched : int
            switches of the stage so far
        """
        return rest / max(1, left - max(0, self.reserve[element.stage] - switched))


@dataclass(frozen=True)
class Equal:
    """Equal lengths between switches.

    Attributes
    ----------
    lengths : dict element number -> length
    last : set of element numbers
        that end at a switch
    """

    lengths: dict
    last: set

    def most(self, element, rest, left, switched):
        """The length to aim at; elements that end at a switch have room."""
        return rest / left if left == 1 else self.lengths[element.n] * (ROOM if element.n in self.last else 1)


@dataclass(frozen=True)
class Passed:
    """What a march tells of an element.

    Attributes
    ----------
    theta : bytes or None
        the active set, as step equilibration sees it
    ends : bool
        whether a mode with memory ends at its right boundary, or a state jumps there
    """

    theta: bytes
    ends: bool


def wanted(block):
    """Whether step equilibration asks for equal lengths."""
    pairs = block.component('equilibration')
    return pairs is not None and any(pair.active for pair in pairs.values())


def equal_lengths(block, grid, passed):
    """The ``Equal`` lengths that belong to a march, and how much those of the march differ from them.

    Parameters
    ----------
    passed : dict element number -> Passed
    """
    lengths, last, differs = {}, set(), 0.0
    for elements in grid.stages.values():
        found = [e.length * block.r[e.n].value for e in elements]
        ends = [k for k, e in enumerate(elements[:-1], start=1) if _switches(block, passed, e.n)]
        last.update(elements[k - 1].n for k in ends)
        for a, b in zip([0, *ends], [*ends, len(elements)]):
            h = sum(found[a:b]) / (b - a)
            differs = max(differs, *(abs(x - h) / h for x in found[a:b]))
            lengths.update((e.n, h) for e in elements[a:b])
    return Equal(lengths, last), differs


def _switches(block, passed, n):
    before, after = passed[n], passed[n + 1]
    if before.ends or before.theta is None or after.theta is None:
        return before.ends or not value(block.eta[n]) > UNCHANGED
    return before.theta != after.theta
