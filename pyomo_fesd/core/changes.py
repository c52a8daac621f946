"""Changes of pairs that may fall together in a solution, or arrive at an end of a row of places (theory, "Orders").

Takes: nothing; a transformation writes ``Coincidence`` and ``Arrival`` among the ``HomotopyHints`` of a block.
Leaves: records of what a certificate looks at: each order of the changes is a branch of its own.
"""

from dataclasses import dataclass

from pyomo.core.base.var import VarData
from pyomo.mpec.complementarity import ComplementarityData


@dataclass(frozen=True, eq=False)
class Change:
    """Pairs that change together between two places, one after the other.

    Attributes
    ----------
    differing : tuple of (ComplementarityData, ComplementarityData)
        a pair and its partner on the other side; the change is there if one of them has another zero side than its partner
    later, earlier : tuple of (ComplementarityData, ComplementarityData or None)
        the change comes one place later, or earlier, if each first pair takes the zero side that the second one has in the
        solution; with None its first side becomes zero
    happening : tuple of ComplementarityData
        the change is there, too, if the first side of one of them is not zero
    """

    differing: tuple[tuple[ComplementarityData, ComplementarityData], ...]
    later: tuple[tuple[ComplementarityData, ComplementarityData | None], ...]
    earlier: tuple[tuple[ComplementarityData, ComplementarityData | None], ...]
    happening: tuple[ComplementarityData, ...] = ()


@dataclass(frozen=True, eq=False)
class Coincidence:
    """Independent changes that may fall together in a solution although each of them could come before the others.

    Where they do, the branches of all orders meet in the solution, and no small step leads into them: a certificate looks at each.

    Attributes
    ----------
    changes : tuple of Change
    later, earlier : VarData or None
        the distance between changes if some come one place later, or earlier, than the rest: 0 in the solution, below its lower
        bound; None where there is no such place
    fixed : bool
        whether they also fall together with something that does not move, so that one change alone matters too
    before, after : VarData or None
        the extents of the places on both sides, whether changes can move past them or not
    beyond_later, beyond_earlier : Change or None
        all that changes on the other side of the place that gets the distance 0: without a change there this place is to spare
    by_values_later, by_values_earlier : tuple of (ComplementarityData, ComplementarityData)
        if changes come later, or earlier, the first pair has the values that the second one has in the solution, and its sides
        follow from them: the zero side of the second one where only one side of that is zero, else any side
    """

    changes: tuple[Change, ...]
    later: VarData | None
    earlier: VarData | None
    fixed: bool = False
    before: VarData | None = None
    after: VarData | None = None
    beyond_later: Change | None = None
    beyond_earlier: Change | None = None
    by_values_later: tuple[tuple[ComplementarityData, ComplementarityData], ...] = ()
    by_values_earlier: tuple[tuple[ComplementarityData, ComplementarityData], ...] = ()


@dataclass(frozen=True, eq=False)
class Place:
    """A place in a row of places between which changes happen; the first one of a row has an end of it on its other side.

    Attributes
    ----------
    extent : VarData
    inside, between : tuple of (ComplementarityData, ComplementarityData or None)
        pairs of the place, and pairs of the boundary towards the end.  If everything moves inwards by one place, the first pair
        takes the zero side that the second one has; with None its first side becomes zero
    happening : tuple of ComplementarityData
        something happens at that boundary if the first side of one of them is not zero
    """

    extent: VarData
    inside: tuple[tuple[ComplementarityData, ComplementarityData | None], ...] = ()
    between: tuple[tuple[ComplementarityData, ComplementarityData | None], ...] = ()
    happening: tuple[ComplementarityData, ...] = ()


@dataclass(frozen=True, eq=False)
class Toggle:
    """Pairs of the places at an end that have the same side at zero, and may have the other one beyond a change.

    Attributes
    ----------
    pairs : tuple of ComplementarityData
    first, second : NumericValue or None
        the sides at the end; None for one that may jump there
    with_them : tuple of (ComplementarityData, bool)
        pairs that get the same side as these, and whether their sides are swapped
    """

    pairs: tuple[ComplementarityData, ...]
    first: object
    second: object
    with_them: tuple[tuple[ComplementarityData, bool], ...] = ()


@dataclass(frozen=True, eq=False)
class Option:
    """A change that is possible at an end of a row of places.

    Attributes
    ----------
    gauges : tuple of NumericValue
        all zero where it is possible
    requires : tuple of (ComplementarityData, int)
        with the number (0 or 1) of the side that is zero in such a solution
    sides : tuple of (ComplementarityData, int)
        the zero sides where the change has come in, after everything else has moved inwards
    either : tuple of ComplementarityData
        pairs of which any side may be zero then
    """

    gauges: tuple
    requires: tuple[tuple[ComplementarityData, int], ...]
    sides: tuple[tuple[ComplementarityData, int], ...]
    either: tuple[ComplementarityData, ...] = ()


@dataclass(frozen=True, eq=False)
class Arrival:
    """Changes that a solution may have exactly at an end of a row of places, where it does not show them.

    The branches with and without such a change in the row meet in the solution, but the place beyond the change has no extent, so
    no small step leads there: a certificate looks at each.

    Attributes
    ----------
    row : tuple of Place
        from the end inwards, as far as changes can move
    toggles : tuple of Toggle
        pairs of one system: some of them change together
    options : tuple of Option
    opposite : tuple of Place
        the row on the other side of an end between two rows, from there inwards: changes come in on both sides
    """

    row: tuple[Place, ...]
    toggles: tuple[Toggle, ...] = ()
    options: tuple[Option, ...] = ()
    opposite: tuple[Place, ...] = ()

    def gauges(self) -> list:
        """Return all expressions whose values tell which changes are at the end."""
        of_toggles = [side for toggle in self.toggles for side in (toggle.first, toggle.second) if side is not None]
        return of_toggles + [gauge for option in self.options for gauge in option.gauges]
