"""Sign patterns of the modes of one Disjunction: each full pattern that some point has belongs to exactly one mode (eq. 4)."""

from dataclasses import dataclass
from functools import cached_property
from itertools import product

from pyomo_fesd.core import FesdError
from pyomo_fesd.dcs.reading.sampled_functions import SMALLEST_MARGIN, AffineDependence
from pyomo_fesd.dcs.reading.sign_implicants import sign_implicants

#: More switching functions than this in one Disjunction have too many sign patterns to enumerate.
MOST_FUNCTIONS = 12


@dataclass(frozen=True)
class SignPatterns:
    """The signs of the switching functions in each mode, and those that can occur: the same at all times.

    Attributes
    ----------
    signs : list of tuples
        the sign matrix S as stated, one row a mode: +1, -1, and 0 where the mode leaves the sign of c_k open
    patterns : list of lists of tuples
        for each mode the full sign patterns (+1, -1) of its region; one pattern unless the mode leaves signs open
    touchable : list of tuples
        the full sign patterns that some point has if c_k = 0 counts as either sign
    """

    signs: list
    patterns: list
    touchable: list

    @cached_property
    def implicants(self):
        """S with as many zeros as possible, None where that is not exact at every point."""
        return sign_implicants(self.signs, self.touchable)


@dataclass(frozen=True)
class Stated:
    """What the inequalities of the modes and declared bounds say.

    Attributes
    ----------
    signs : tuple of tuples
        one row a mode: +1, -1, and 0 where the mode states nothing on c_k
    yields : tuple of tuples of bool
        whether mode i yields to mode j: where they part, i has a disjunct without inequality and takes what j leaves
    bounds : tuple of int
        for each c_k the sign that it has wherever the declared bounds hold, 0 if it may have either
    """

    signs: tuple
    yields: tuple
    bounds: tuple

    def owners(self, pattern) -> list:
        """Return the numbers of the modes that a pattern belongs to, without those that yield to another one of them."""
        found = [i for i, row in enumerate(self.signs) if all(s in (0, p) for s, p in zip(row, pattern))]
        return [i for i in found if not any(self.yields[i][j] for j in found)]

    def excluded_by_bounds(self, pattern) -> bool:
        """Whether declared bounds allow the pattern on the boundary of its region at most."""
        return any(sign * bound < 0 for sign, bound in zip(pattern, self.bounds))


def read_sign_patterns(disjunction, modes, functions, dependence: AffineDependence, stated: Stated) -> SignPatterns:
    """Return the sign patterns of the ``modes``.

    A pattern that no mode states, and that declared bounds exclude, belongs to none.  A mode that takes what the others leave gets
    the signs that all its patterns share.

    Raises
    ------
    FesdError
        for too many functions, for regions that overlap or leave a gap, and for an empty region
    """
    if len(functions) > MOST_FUNCTIONS:
        raise FesdError(
            disjunction,
            f"{len(functions)} different switching functions give too many sign patterns",
            "split the Disjunction into independent ones, one for each equipment item that switches",
        )
    owned, touchable = [[] for _ in modes], []
    for pattern in product((1, -1), repeat=len(functions)):
        margin, owners = dependence.margin(pattern), stated.owners(pattern)
        if margin < -SMALLEST_MARGIN or (not owners and stated.excluded_by_bounds(pattern)):
            continue
        touchable.append(pattern)
        if margin > SMALLEST_MARGIN:
            owned[_only(disjunction, modes, functions, pattern, owners)].append(pattern)
    _refuse_empty(modes, owned, stated)
    signs = [_common(patterns) if any(rest) else row for row, rest, patterns in zip(stated.signs, stated.yields, owned)]
    return SignPatterns(signs, owned, touchable)


def _refuse_empty(modes, owned, stated):
    for mode, patterns, rest in zip(modes, owned, stated.yields):
        if not patterns:
            cause = "the other modes leave nothing to this one" if any(rest) else "no point satisfies its inequalities"
            raise FesdError(mode, f"the region is empty: {cause}", "correct the inequalities of this disjunct")


def _common(patterns):
    """The signs that all patterns share, 0 where they differ."""
    return tuple(column[0] if len(set(column)) == 1 else 0 for column in zip(*patterns))


def _only(disjunction, modes, functions, pattern, owners):
    """The number of the mode that a pattern belongs to; refuse a pattern that belongs to several modes, or to none."""
    if len(owners) == 1:
        return owners[0]
    where = ' and '.join(f"{c} {'>=' if p > 0 else '<='} 0" for c, p in zip(functions, pattern))
    fix = "make the inequalities of the disjuncts a partition of the state space"
    if not owners:
        raise FesdError(disjunction, f"the regions leave a gap: where {where}, no disjunct is active", fix)
    raise FesdError(
        disjunction,
        f"the regions overlap: where {where}, {', '.join(modes[i].name for i in owners)} are active at once",
        f"{fix}; for hysteresis, where the last mode goes on, name it in the keyword hysteresis of fesd.dcs",
    )
