"""Neighbouring branches of a solution, in which a switch passes an element boundary.

Boundaries of control stages keep their physical time and elements their least length.  To carry a switch from one control stage
into the next, an element has to appear on one side and to vanish on the other.  No small step does that, so a solution whose switch
lies on such a boundary can be a local minimum of the discretised problem only.  Nor can a switch pass an element that has its least
length.  Each inner boundary has two neighbouring branches: the element after it takes over the active set of the element before it,
or the other way round; inside a control stage only where that element has its least length.

Only what changes at the boundary moves: another system keeps the sides of its pairs.  ``mpec_hybrid`` lets everything there move
only where no certified point is found so.

Takes: the changes at the boundaries.
Leaves: a ``NeighbourBranch`` for each of the two in the block's ``HomotopyHints``: ``mpec_hybrid`` tries these branches too.
Does not apply: to a single element.
"""

from pyomo_fesd.core import Change, MovingGrid, NeighbourBranch, homotopy_hints


def add_neighbour_branches(moving: MovingGrid, changes: list[dict[str, Change]]) -> None:
    """Add the two neighbouring branches of every inner boundary, with its ``changes``."""
    branches, elements = homotopy_hints(moving.block).neighbour_branches, moving.grid.elements
    for before, after, at_boundary in zip(elements, elements[1:], changes):
        # the element that changes, and the direction in which the switch passes the boundary
        for changed, later in ((before, False), (after, True)):
            starts = _start_lengths(moving, changed) if after.opens_stage else ()
            short = () if after.opens_stage else (moving.r[changed.n],)
            branches.append(NeighbourBranch(starts, short, tuple(at_boundary.values()), later))


def _start_lengths(moving, changed):
    """Start lengths: the least one for the element that takes over; the others of its control stage share the rest."""
    stage = moving.grid.stages[changed.stage]
    if len(stage) == 1:
        return ()
    least = moving.r[changed.n].lb
    share = (stage[-1].right - stage[0].left - changed.length * least) / (len(stage) - 1)
    return tuple((moving.r[e.n], least if e is changed else share / e.length) for e in stage)
