"""Neighbouring branches of a solution, in which a switch passes an element boundary.

Boundaries of control stages keep their physical time and elements their least length.  To carry a switch from one control stage
into the next, an element has to appear on one side and to vanish on the other.  No small step does that, so a solution whose switch
lies on such a boundary can be a local minimum of the discretised problem only.  Nor can a switch pass an element that has its least
length.  Each inner boundary has two neighbouring branches: the element after it takes over the active set of the element before it,
or the other way round; inside a control stage only where that element has its least length.

Takes: the pairs of the moving grid, by element and by boundary.
Leaves: a ``NeighbourBranch`` for each of the two in the block's ``HomotopyHints``: ``mpec_hybrid`` tries these branches too.
Does not apply: to a single element.
"""

from collections import defaultdict
from collections.abc import Iterator

from pyomo.common.collections import ComponentSet

from pyomo_fesd.core import Element, MovingGrid, NeighbourBranch, homotopy_hints


def add_neighbour_branches(moving: MovingGrid) -> None:
    """Add the two neighbouring branches of every inner boundary."""
    places, branches, elements = PairsByPlace(moving), homotopy_hints(moving.block).neighbour_branches, moving.grid.elements
    for before, after in zip(elements, elements[1:]):
        # the element that changes, and the direction in which the switch passes the boundary
        for changed, step in ((before, -1), (after, 1)):
            pairs = places.moved(before, step)
            branches.append(
                NeighbourBranch(
                    starts=_start_lengths(moving, changed) if after.opens_stage else (),
                    if_at_lower_bound=() if after.opens_stage else (moving.r[changed.n],),
                    takes_over=tuple((pair, source) for pair, source in pairs if source is not None),
                    first_side_zero=tuple(pair for pair, source in pairs if source is None),
                )
            )


def _start_lengths(moving, changed):
    """Start lengths: the least one for the element that takes over; the others of its control stage share the rest."""
    stage = moving.grid.stages[changed.stage]
    if len(stage) == 1:
        return ()
    least = moving.r[changed.n].lb
    share = (stage[-1].right - stage[0].left - changed.length * least) / (len(stage) - 1)
    return tuple((moving.r[e.n], least if e is changed else share / e.length) for e in stage)


class PairsByPlace:
    """The pairs of a moving grid by their element or boundary."""

    def __init__(self, moving: MovingGrid):
        self._of_elements = _by_number(moving.pairs_of_elements())
        self._of_boundaries = _by_number(moving.pairs_of_boundaries())
        self._of_events = pairs_of_events(moving)
        self._of_jumps = _by_number(_pairs_of_jumps(moving.state_jumps))

    def moved(self, before: Element, step: int) -> list[tuple]:
        """Return the pairs that change if all switches at the boundary after ``before`` move by one element, with their sources.

        Parameters
        ----------
        step : int
            1 where they come one element later, -1 where they come earlier
        """
        changed = before.n + max(step, 0)
        # nothing happens at the boundary any longer, though it may at the one whose conditions it takes over
        between = _matching(self._of_boundaries, before.n, before.n - step)
        return [
            *_matching(self._of_elements, changed, changed - step),
            *_matching(self._of_boundaries, before.n + step, before.n),
            *((pair, None if pair.parent_component() in self._of_events else source) for pair, source in between),
        ]

    def inwards(self, element: Element, step: int) -> tuple[list[tuple], list[tuple]]:
        """Return pairs with sources for an element, and for its boundary towards the end, to take over what lies one place on.

        Parameters
        ----------
        step : int
            1 towards the last time, -1 towards the first
        """
        boundary = element.n - (step < 0)
        inside = _matching(self._of_elements, element.n, element.n + step)
        return list(inside), list(_matching(self._of_boundaries, boundary, boundary + step))

    def compared(self, before: Element) -> list[tuple]:
        """Return the pairs that differ if modes switch at the boundary after ``before``, with their partners."""
        return list(_matching(self._of_elements, before.n + 1, before.n))

    def happening(self, before: Element) -> list:
        """Return the pairs whose first side is not zero if states jump at the boundary after ``before``."""
        return [pair for pairs in self._of_jumps for pair in pairs[before.n].values()]


def pairs_of_events(moving: MovingGrid) -> ComponentSet:
    """Return the pairs whose first side is 0 at boundaries where no mode with hysteresis ends and no state jumps."""
    hysteresis, jumps = moving.hysteresis, moving.state_jumps
    return ComponentSet([*([hysteresis.leaving] if hysteresis else []), *([jumps.happens, jumps.binary] if jumps else [])])


def _pairs_of_jumps(jumps):
    if jumps is None:
        return []
    return [jumps.binary, *([] if jumps.impacts is None else [jumps.impacts.impact])]


def _by_number(components) -> list[dict]:
    """For each component, its pairs by their element or boundary, then by the rest of their index."""
    found = []
    for component in components:
        pairs = defaultdict(dict)
        for (name, number, *rest), pair in component.items():
            pairs[number][(name, *rest)] = pair
        found.append(pairs)
    return found


def _matching(components, number, other) -> Iterator[tuple]:
    """Pairs of one element or boundary, each with the pair of the other whose zero side it takes over; None outside the horizon."""
    for pairs in components:
        yield from ((pair, pairs[other].get(rest)) for rest, pair in pairs[number].items())
