"""Arrivals: surfaces that are reached exactly at the first or the last time, or touched at the boundary of a control stage.

A trajectory that reaches a surface at the last time has not switched yet, or switches there: an element of length zero in the next
mode belongs to the same solution.  No small step lets it grow, because the elements show the mode before the switch only; so such a
point can be a minimum of the discretised problem only.  The same holds for a trajectory that starts on a surface, and for one that
a control turns back where it touches a surface: there an element on either side of the boundary belongs to the solution.  Whether
the elements can grow with descent decides whether the solution is one.

Takes: the pairs of the moving grid, and which conditions switch together.
Leaves: an ``Arrival`` for each system and end in the block's ``HomotopyHints``; ``mpec_hybrid`` looks at it before it certifies.
Does not apply: to conditions neither side of which is known to be continuous; to state jumps at the first time and to hysteresis
and jumps that are touched, as the trajectories with them are others; to impacts of bodies that must not slip.
"""

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass

from pyomo_fesd.core import Arrival, Element, MovingGrid, Option, Place, Toggle, homotopy_hints
from pyomo_fesd.finite_elements.changes import PairsByPlace, pairs_of_events

#: Directions from the inside to the two ends.
TO_FIRST, TO_LAST = -1, 1
#: Numbers of the sides of a pair.
FIRST_SIDE, SECOND_SIDE = 0, 1


@dataclass(frozen=True)
class _End:
    """One end of a control stage: the direction towards it, the element beside it and the number of the boundary."""

    step: int
    element: Element
    boundary: int

    @property
    def label(self):
        """Its time."""
        return self.element.left if self.step is TO_FIRST else self.element.right

    @property
    def inner(self):
        """The number of the boundary on the other side of its element."""
        return self.boundary - self.step


def add_arrivals(moving: MovingGrid, names: dict[str, str]) -> None:
    """Add the arrivals at both ends, of the families of conditions that ``switching_together`` returns by their ``names``."""
    places, arrivals, families = PairsByPlace(moving), homotopy_hints(moving.block).arrivals, _families(moving, names)
    elements, pairs = moving.grid.elements, _pairs_of_elements(moving)
    for end in (_End(TO_FIRST, elements[0], 0), _End(TO_LAST, elements[-1], len(elements))):
        row, contacts = _row(moving, places, end), _contacts(moving, end)
        # a contact that closes without a velocity has an impact without an impulse
        others = [family for family in families if not all(condition.name in contacts for condition in family)]
        arrivals += [Arrival(row, toggles) for toggles in _toggles(others, pairs, end) if toggles]
        if len(elements) > 1:
            options = [*_by_hysteresis(moving, end), *_by_jumps(moving, end), *_by_impacts(moving, pairs, contacts, end)]
            arrivals += [Arrival(row, options=some) for some in options if some]
    for before, after in zip(elements, elements[1:]):
        if after.opens_stage:
            ends = _End(TO_LAST, before, before.n), _End(TO_FIRST, after, before.n)
            row, opposite = (_row(moving, places, end) for end in ends)
            arrivals += [Arrival(row, some, opposite=opposite) for some in _toggles(families, pairs, *ends) if some]


def _families(moving, names):
    """The time complementarities that switch together."""
    found = defaultdict(list)
    for condition in moving.complementarities:
        found[names[condition.name]].append(condition)
    return list(found.values())


def _row(moving, places, end):
    """The elements of the control stage at an end, from there inwards."""
    stage = moving.grid.stages[end.element.stage]
    inner, events = stage[1:] if end.step is TO_FIRST else stage[-2::-1], pairs_of_events(moving)
    elements = moving.grid.elements
    found = [Place(moving.r[end.element.n])]
    for e in inner:
        inside, between = places.inwards(e, end.step)
        if len(found) == 1:
            # what happens at the boundary itself stays there
            between = [(pair, None if pair.parent_component() in events else source) for pair, source in between]
        # the boundary of the element towards the end
        happening = places.happening(e if end.step is TO_LAST else elements[e.n - 2])
        found.append(Place(moving.r[e.n], tuple(inside), tuple(between), tuple(happening)))
    return tuple(found)


# conditions that elements sum up


def _pairs_of_elements(moving):
    """The pairs by condition and element."""
    found = defaultdict(list)
    for (name, n, *_), pair in moving.pairs.items():
        found[name, n].append(pair)
    return found


def _toggles(families, pairs, *ends) -> Iterator[tuple]:
    """For each family its pairs in the elements at an end, with the values of continuous sides there."""
    for family in families:
        yield tuple(_toggle(condition, pairs, ends) for condition in family if _is_seen(condition, ends))


def _is_seen(condition, ends):
    """Whether a condition has a value at an end that all its elements share."""
    if not condition.continuous[1] or ends[0].label not in condition.sides:
        return False
    return all(condition.points(end.element) for end in ends) and not (len(ends) > 1 and any(condition.jumps_with_controls))


def _toggle(condition, pairs, ends):
    label = ends[0].label
    of_elements = tuple(pair for end in ends for pair in pairs[condition.name, end.element.n])
    # the condition at the first time itself belongs to the mode of the first element
    first = ((condition.conditions[label], condition.swapped),) if ends[0].boundary == 0 else ()
    sides = zip(condition.sides[label], condition.continuous)
    return Toggle(of_elements, *(side if known else None for side, known in sides), first)


# modes with hysteresis


def _by_hysteresis(moving, end) -> Iterator[tuple]:
    """For each system the changes between its modes for which a condition ends at the end of time."""
    systems = defaultdict(list)
    for mode in [] if moving.hysteresis is None else moving.hysteresis.modes:
        systems[mode.system].append(mode)
    for modes in systems.values():
        yield tuple(_options(moving, modes, end))


def _options(moving, modes, end):
    for active in modes:
        for other in modes:
            # at the last time another mode follows the active one; at the first time it precedes it
            leaving = active if end.step is TO_LAST else other
            conditions = leaving.conditions[end.label]
            if other is not active:
                for k, c in enumerate(conditions, start=1):
                    yield _option(moving.hysteresis, modes, (active, other, leaving), (k, c), end)


def _option(rows, modes, change, condition, end):
    active, other, leaving = change
    number, c = condition
    held = [(pair, FIRST_SIDE) for pair in _of_boundary(rows, leaving, end.inner)]
    least = [(rows.least[i], SECOND_SIDE if i[-1] == number else FIRST_SIDE) for i in _indices(rows.least, leaving, end.inner)]
    return Option(
        gauges=(c,),
        requires=tuple(_weights(rows, modes, active, end)),
        sides=(*_weights(rows, modes, other, end), *held, *least, (rows.leaving[leaving.name, end.inner], SECOND_SIDE)),
        either=tuple(_either(rows, leaving, end)),
    )


def _either(rows, leaving, end):
    """Pairs that follow from values at the boundaries that lie at the end: where no mode is left, a condition may hold or not."""
    for component in (rows.parts, rows.region, rows.least):
        for index, pair in component.items():
            if index[1] in (end.boundary, end.inner, end.inner - end.step) and index[:2] != (leaving.name, end.inner):
                yield pair


def _weights(rows, modes, active, end):
    """The sides that say which mode is active in the element at the end."""
    for mode in modes:
        if mode.independent:
            yield rows.binary[mode.name, end.element.n], SECOND_SIDE if mode is active else FIRST_SIDE


def _of_boundary(rows, mode, boundary):
    """The pairs of the conditions of a mode at a boundary."""
    for component in (rows.parts, rows.region):
        yield from (component[index] for index in _indices(component, mode, boundary))


def _indices(component, mode, boundary):
    return [index for index in component if index[:2] == (mode.name, boundary)]


# state jumps


def _by_jumps(moving, end) -> Iterator[tuple]:
    """For each law the jump at the last time."""
    jumps = moving.state_jumps
    for law in [] if jumps is None or end.step is TO_FIRST else jumps.laws:
        index = law.name, end.inner
        sides = ((jumps.happens[index], SECOND_SIDE), (jumps.binary[index], SECOND_SIDE))
        yield (Option(gauges=(law.guards[end.label],), requires=(), sides=sides),)


# rigid contacts


def _condition_of(moving, law, end):
    """The condition of a contact at an end; None where it has none."""
    touching = law.touching.get(end.label)
    found = (c for c in moving.complementarities if touching is not None and c.conditions.get(end.label) is touching)
    return next(found, None) if end.label in law.gaps else None


def _contacts(moving, end):
    """The contacts that may close at an end with an impact, by the names of their conditions: those at the last time."""
    impacts = None if moving.state_jumps is None else moving.state_jumps.impacts
    if impacts is None or end.step is TO_FIRST or len(moving.grid.elements) == 1:
        return {}
    conditions = ((_condition_of(moving, law, end), law) for law in impacts.laws if not law.sticking)
    return {condition.name: law for condition, law in conditions if condition is not None}


def _by_impacts(moving, pairs, contacts, end) -> Iterator[tuple]:
    """For each contact the impacts at an end, after which the bodies part or stay together."""
    for name, law in contacts.items():
        yield tuple(_impacts(moving.state_jumps.impacts, law, (name, pairs), end))


def _impacts(impacts, law, of_condition, end):
    name, pairs = of_condition
    at_boundary = {index: pair for index, pair in impacts.impact.items() if index[1] == end.inner}
    impact = [(pair, SECOND_SIDE) for index, pair in at_boundary.items() if index[0] == law.name]
    # an impact may go on through closed contacts, and change what slips
    either = [pair for index, pair in at_boundary.items() if index[0] != law.name]
    either += [pair for (_, b), pair in impacts.slip.items() if b == end.inner]
    if len(impacts.slip):
        either += [pair for (other, n), some in pairs.items() if n == end.element.n and other != name for pair in some]
    apart, together = (tuple((pair, side) for pair in pairs[name, end.element.n]) for side in (FIRST_SIDE, SECOND_SIDE))
    for after in (apart, together):
        yield Option(gauges=(law.gaps[end.label],), requires=apart, sides=(*impact, *after), either=tuple(either))
