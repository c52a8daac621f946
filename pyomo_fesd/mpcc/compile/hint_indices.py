"""Records of ``HomotopyHints`` by positions of pairs and variables, as the algorithm reads them."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class MoveIndices:
    """Pairs that change if a change moves; ``targets`` get the zero sides of ``sources``, the first side of ``ended`` becomes 0."""

    targets: np.ndarray
    sources: np.ndarray
    ended: np.ndarray


@dataclass(frozen=True, eq=False)
class ChangeIndices:
    """A ``Change`` by positions of pairs.

    Attributes
    ----------
    pairs, partners : int arrays
    later, earlier : MoveIndices
    happening : int array
    """

    pairs: np.ndarray
    partners: np.ndarray
    later: MoveIndices
    earlier: MoveIndices
    happening: np.ndarray

    def moved(self, later: bool) -> MoveIndices:
        """The pairs that change if it comes later, or earlier."""
        return self.later if later else self.earlier


@dataclass(frozen=True, eq=False)
class NeighbourIndices:
    """A ``NeighbourBranch`` by positions of pairs and variables.

    Attributes
    ----------
    changes : tuple of ChangeIndices
    later : bool
    short : int array
        variables; unless one of them is at its lower bound the branch is not tried (none: always)
    starts : int array, variables that start elsewhere
    at : array, their start values
    """

    changes: tuple
    later: bool
    short: np.ndarray
    starts: np.ndarray
    at: np.ndarray


@dataclass(frozen=True, eq=False)
class CoincidenceIndices:
    """A ``Coincidence`` by positions of pairs and variables (None: there is no such place)."""

    changes: tuple
    later: int | None
    earlier: int | None
    fixed: bool
    before: int | None = None
    after: int | None = None
    beyond_later: ChangeIndices | None = None
    beyond_earlier: ChangeIndices | None = None
    by_values_later: MoveIndices | None = None
    by_values_earlier: MoveIndices | None = None


@dataclass(frozen=True, eq=False)
class PartIndices:
    """A ``Part`` by positions of variables.

    Attributes
    ----------
    extent : int
    own, gate : int arrays
    places : int array
        of all own variables, in the same order for all parts of a chain; -1 where one is given
    first, last : int arrays
        the same quantities at its beginning and at its end
    ends : int array
        all variables at its end
    chain, number : int
        its chain, and its place in it
    alike : bool
        whether those of its variables are given that are given in a part beside it
    whole : bool
        whether, besides, those of its first values are given that are given of its last ones
    copies : bool
    """

    extent: int
    own: np.ndarray
    gate: np.ndarray
    places: np.ndarray
    first: np.ndarray
    last: np.ndarray
    ends: np.ndarray
    chain: int
    number: int
    alike: bool
    whole: bool
    copies: bool


@dataclass(frozen=True, eq=False)
class PlaceIndices:
    """A ``Place`` by positions; ``extent`` is None where it is given."""

    extent: int | None
    inside: MoveIndices
    between: MoveIndices
    happening: np.ndarray


@dataclass(frozen=True, eq=False)
class ToggleIndices:
    """A ``Toggle`` by positions of pairs and gauges; ``first`` and ``second`` may be None; ``swapped`` belongs to ``with_them``."""

    pairs: np.ndarray
    first: int | None
    second: int | None
    with_them: np.ndarray
    swapped: np.ndarray


@dataclass(frozen=True, eq=False)
class OptionIndices:
    """An ``Option`` by positions: gauges, pairs with the side that is required, pairs with the side they get, open pairs."""

    gauges: np.ndarray
    required: np.ndarray
    required_sides: np.ndarray
    pairs: np.ndarray
    sides: np.ndarray
    either: np.ndarray


@dataclass(frozen=True, eq=False)
class ArrivalIndices:
    """An ``Arrival`` by positions; arrivals at one end share their ``rows``, one or two tuples of PlaceIndices."""

    rows: tuple
    toggles: tuple
    options: tuple


@dataclass(frozen=True)
class FollowerIndices:
    """All ``Follower`` by positions of pairs.

    Attributes
    ----------
    pairs, leaders : int arrays
    swapped : bool array
    """

    pairs: np.ndarray
    leaders: np.ndarray
    swapped: np.ndarray


@dataclass(frozen=True, eq=False)
class ImpactIndices:
    """An ``ImpactSides`` by positions of pairs, variables and its row."""

    boundary: int
    pairs: np.ndarray
    above: int
    below: int
    room: int
    within: np.ndarray
    before: np.ndarray


@dataclass(frozen=True, eq=False)
class StickingIndices:
    """A ``StickingSides`` by positions of its pair and variables."""

    pair: int
    meeting: np.ndarray
    after: np.ndarray


@dataclass(frozen=True, eq=False)
class DriftIndices:
    """A ``DriftSides`` by positions of variables and of its row."""

    drift: int
    rate: int
    row: int
    distances: np.ndarray
    forces: np.ndarray


@dataclass(frozen=True, eq=False)
class FillingIndices:
    """A ``Filling`` by positions of pairs and variables; ``coefficients`` are those of the scaled variables ``extents``.

    ``scales`` are the factors of the variables ``shares``.
    """

    pairs: np.ndarray
    shares: np.ndarray
    scales: np.ndarray
    extents: np.ndarray
    coefficients: np.ndarray
    amount: float
