"""Coinciding switches: independent switches at one boundary, of which each could come first.

Systems over one time share the elements.  Where two switches fall on one boundary there is no element between them, so no small
step changes their order: the point can be a minimum of the discretised problem only.  The same holds for a switch on the boundary
of a control stage, which keeps its time.  An element of length zero beside the boundary, in which some of them have switched and
others not, belongs to the same solution; whether it can grow with descent decides whether the solution is one.

Takes: the changes at the boundaries.
Leaves: a ``Coincidence`` for each inner boundary in the block's ``HomotopyHints``; ``mpec_hybrid`` looks at it before it certifies.
Does not apply: to a single element, and inside a control stage to a single system.
"""

from collections.abc import Iterator
from itertools import chain

from pyomo_fesd.core import Change, Coincidence, MovingGrid, homotopy_hints
from pyomo_fesd.finite_elements.hysteresis import LEFT, RIGHT


def add_coincidences(moving: MovingGrid, at_boundaries: list[dict[str, Change]], families: dict[str, str]) -> None:
    """Add the coincidences at every inner boundary, of the changes ``at_boundaries`` of ``families`` that switch together."""
    found = homotopy_hints(moving.block).coincidences
    names = _jumping_between_stages(moving)
    jumping = {family for name, family in families.items() if name in names}
    several = len(set(families.values())) > 1
    elements = moving.grid.elements
    for n, (before, after) in enumerate(zip(elements, elements[1:])):
        ends, begins = moving.grid.stages[before.stage], moving.grid.stages[after.stage]
        later = None if begins[-1] is after else moving.r[after.n]
        earlier = None if ends[0] is before else moving.r[before.n]
        # what jumps between control stages may switch there without an element to spare
        left_out = jumping if after.inputs_change and None in (later, earlier) else ()
        if several or after.opens_stage:
            changes = tuple(change for family, change in at_boundaries[n].items() if family not in left_out)
            beside = moving.r[before.n], moving.r[after.n]
            beyond = (None if v is None else _all(at_boundaries[k].values()) for v, k in ((later, n + 1), (earlier, n - 1)))
            by_values = (tuple(_by_values(moving, before.n, step)) for step in (1, -1))
            found.append(Coincidence(changes, later, earlier, after.opens_stage, *beside, *beyond, *by_values))


def _jumping_between_stages(moving):
    """Names of conditions and modes that may jump from one control stage to the next."""
    names = {c.name for c in moving.complementarities if any(c.jumps_with_controls) or c.has_right_limits or not any(c.continuous)}
    return names | (set() if moving.hysteresis is None else {name for name, *_ in moving.hysteresis.beyond})


def _all(changes):
    """All changes at one boundary as one, which does not move."""
    differing = chain.from_iterable(change.differing for change in changes)
    happening = chain.from_iterable(change.happening for change in changes)
    return Change(tuple(differing), (), (), tuple(happening))


def _by_values(moving, b, step) -> Iterator[tuple]:
    """The conditions of modes with hysteresis beside an element of length zero, with those of the same values at boundary ``b``.

    The element lies behind ``b`` if changes come later (``step`` 1), else before it.  A mode that is not active has any sign of its
    condition, which no other boundary shows.
    """
    hysteresis, jumps = moving.hysteresis, moving.state_jumps is not None
    for (name, _, k, side), pair in _at_boundary(hysteresis and hysteresis.parts, b):
        right = (name, b, k, RIGHT) in hysteresis.parts
        # right of b, and at the end of an element behind it, a state may not have jumped yet; so left of b with one before it
        if side == (LEFT if step > 0 else RIGHT) or not (jumps and right):
            yield pair, pair
        other = name, b + step, k, side
        if other in hysteresis.parts and (side == (RIGHT if step > 0 else LEFT) or not (jumps and right)):
            # what follows a set-point that changes at b has the new one
            follows = right and step > 0 and not jumps
            yield hysteresis.parts[other], hysteresis.parts[name, b, k, RIGHT if follows else side]
    for (name, _, k), pair in _at_boundary(hysteresis and hysteresis.least, b):
        right = (name, b, k, RIGHT) in hysteresis.parts
        if step < 0 or not (jumps and right):
            yield pair, pair
        if (name, b + step, k) in hysteresis.least and (step > 0 or not right):
            yield hysteresis.least[name, b + step, k], pair


def _at_boundary(component, b):
    return [] if component is None else [(index, pair) for index, pair in component.items() if index[1] == b]
