"""What may change at the boundaries between elements: the pairs of each system, and where its modes switch or its states jump.

Systems over one time share the elements.  The conditions of a system switch together; another one may switch at the same boundary,
or at any other one.

Takes: the pairs of the moving grid, and which conditions switch together.
Leaves: for each inner boundary a ``Change`` of each system.
"""

from collections import defaultdict
from collections.abc import Iterator

from pyomo.common.collections import ComponentSet
from pyomo.core.expr.visitor import identify_variables

from pyomo_fesd.core import Change, Element, MovingGrid, all_switched_systems
from pyomo_fesd.finite_elements.algebraic_graph import rule_of
from pyomo_fesd.finite_elements.continuity import inner_label


def changes_at_boundaries(moving: MovingGrid, families: dict[str, str]) -> list[dict[str, Change]]:
    """Return the changes at each inner boundary, by family, of the ``families`` that ``switching_together`` returns."""
    places = PairsByPlace(moving)
    return [dict(_changes(places, before, families)) for before in moving.grid.elements[:-1]]


def _changes(places, before, families) -> Iterator[tuple[str, Change]]:
    """The change of each family at the boundary after ``before``."""
    compared = _by_family(places.compared(before), families)
    happening = _by_family([(pair, None) for pair in places.happening(before)], families)
    later, earlier = (_by_family(places.moved(before, step), families) for step in (1, -1))
    for family in dict.fromkeys([*compared, *happening]):
        jumps = tuple(pair for pair, _ in happening[family])
        yield family, Change(tuple(compared[family]), tuple(later[family]), tuple(earlier[family]), jumps)


def _by_family(pairs, families):
    found = defaultdict(list)
    for pair, partner in pairs:
        found[families[pair.index()[0]]].append((pair, partner))
    return found


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
