"""Coinciding switches: independent switches at one boundary, of which each could come first.

Systems over one time share the elements.  Where two switches fall on one boundary there is no element between them, so no small
step changes their order: the point can be a minimum of the discretised problem only.  The same holds for a switch on the boundary
of a control stage, which keeps its time.  An element of length zero beside the boundary, in which some of them have switched and
others not, belongs to the same solution; whether it can grow with descent decides whether the solution is one.

Takes: the pairs of the moving grid, and which conditions switch together.
Leaves: a ``Coincidence`` for each inner boundary in the block's ``HomotopyHints``; ``mpec_hybrid`` looks at it before it certifies.
Does not apply: to a single element, and inside a control stage to a single system.
"""

from collections import defaultdict
from collections.abc import Iterator

from pyomo.core.expr.visitor import identify_variables

from pyomo_fesd.core import Change, Coincidence, MovingGrid, all_switched_systems, homotopy_hints
from pyomo_fesd.finite_elements.algebraic_graph import rule_of
from pyomo_fesd.finite_elements.continuity import inner_label
from pyomo_fesd.finite_elements.hysteresis import LEFT, RIGHT
from pyomo_fesd.finite_elements.neighbour_branches import PairsByPlace


def add_coincidences(moving: MovingGrid) -> None:
    """Add the coincidences at every inner boundary."""
    families, places, found = switching_together(moving), PairsByPlace(moving), homotopy_hints(moving.block).coincidences
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
            changes = tuple(_changes(places, before, families, left_out))
            beside = moving.r[before.n], moving.r[after.n]
            beyond = (None if v is None else _all_changes(places, elements[k]) for v, k in ((later, n + 1), (earlier, n - 1)))
            by_values = (tuple(_by_values(moving, before.n, step)) for step in (1, -1))
            found.append(Coincidence(changes, later, earlier, after.opens_stage, *beside, *beyond, *by_values))


def _jumping_between_stages(moving):
    """Names of conditions and modes that may jump from one control stage to the next."""
    names = {c.name for c in moving.complementarities if any(c.jumps_with_controls) or c.has_right_limits or not any(c.continuous)}
    return names | (set() if moving.hysteresis is None else {name for name, *_ in moving.hysteresis.beyond})


def _changes(places, before, families, left_out) -> Iterator[Change]:
    """The change of each family at the boundary after ``before``."""
    compared = _by_family(places.compared(before), families)
    happening = _by_family([(pair, None) for pair in places.happening(before)], families)
    later, earlier = (_by_family(places.moved(before, step), families) for step in (1, -1))
    for family in dict.fromkeys([*compared, *happening]):
        if family not in left_out:
            jumps = tuple(pair for pair, _ in happening[family])
            yield Change(tuple(compared[family]), tuple(later[family]), tuple(earlier[family]), jumps)


def _all_changes(places, before):
    """All that changes at the boundary after ``before``."""
    return Change(tuple(places.compared(before)), (), (), tuple(places.happening(before)))


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


def _by_family(pairs, families):
    found = defaultdict(list)
    for pair, partner in pairs:
        found[families[pair.index()[0]]].append((pair, partner))
    return found


def switching_together(moving: MovingGrid) -> dict[str, str]:
    """Return the family of each condition, mode with hysteresis and law of jumps, all by name.

    A family has one selector, or its multipliers add up to 1: its conditions switch together.
    """
    families, owner, rules = {}, {}, all_switched_systems(moving.block.model()).continuous
    for condition in moving.complementarities:
        families[condition.name] = condition.name
        for key in _shared(condition, inner_label(condition.sides, moving.wrt), rules):
            _join(families, condition.name, owner.setdefault(key, condition.name))
    for mode in [] if moving.hysteresis is None else moving.hysteresis.modes:
        families[mode.name] = mode.system
    for law in [] if moving.state_jumps is None else moving.state_jumps.laws:
        families[law.name] = law.name
    impacts = None if moving.state_jumps is None else moving.state_jumps.impacts
    names = {id(condition): c.name for c in moving.complementarities for condition in c.conditions.values()}
    for law in [] if impacts is None else impacts.laws:
        families[law.name] = families[names[id(next(iter(law.touching.values())))]]
    return families


def _join(families, one, other):
    one, other = families[one], families[other]
    families.update((name, other) for name, family in families.items() if family == one)


def _shared(condition, label, rules) -> Iterator:
    """By id, the selectors of a condition, and the multipliers in the rule of its other side that have the same rule."""
    if label is None:
        return
    jumping, other = condition.sides[label]
    if not condition.continuous[0]:
        yield from map(id, identify_variables(jumping, include_fixed=True))
    rule = rule_of(other, rules) if other.is_variable_type() else None
    if rule is not None and other.index() in rule:
        yield from (id(v) for v in identify_variables(rule[other.index()].expr) if rule_of(v, rules) is rule)
