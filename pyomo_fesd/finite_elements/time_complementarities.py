"""The complementarity conditions of a model over time, each with the continuity of its two sides.

Takes: the active Complementarities over time, whoever wrote them.
Leaves: nothing on the model; a warning where switches may go unnoticed, or a slide cannot be followed.
Does not apply: to complementarities without time.
"""

import logging
from collections import Counter, defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, field

from pyomo.core import Block
from pyomo.core.expr.visitor import identify_variables
from pyomo.mpec import Complementarity

from pyomo_fesd.core import (
    Element,
    FesdError,
    Mixed,
    MovingGrid,
    TimeIndex,
    discretised,
    is_generated,
    public_name,
    read_complementarity,
    strip_time,
    sum_of,
)
from pyomo_fesd.finite_elements.algebraic_graph import rule_of
from pyomo_fesd.finite_elements.continuity import Continuity, inner_label

logger = logging.getLogger('pyomo_fesd')


@dataclass(frozen=True)
class TimeComplementarity:
    """One complementarity condition over time.

    Attributes
    ----------
    name : str
    conditions : dict label -> ComplementarityData
    sides : dict label -> Pair
        jumping side first: the selector nu of eq. (11), then lam
    continuous : tuple of bool
        for each side, whether it is continuous in time and so enters with its boundary values too
    jumps_with_controls : tuple of bool
        for each continuous side, whether it contains a control that is held on each control stage: not continuous from one control
        stage to the next
    swapped : bool
        whether these are the sides of ``conditions`` in the other order
    follows : bool
        both sides are functions of multipliers that jump: it switches only where the conditions of these do
    starts : dict element number -> Pair
        the sides after the left boundary of an element, where a state jumps there
    departures : dict element number -> VarData
        of a contact force: a further term of the second side at the left boundary of an element (eq. 21)
    from_left : bool
        whether a continuous side enters an element with its value at the left boundary too
    has_right_limits : bool
        its argument jumps with the modes or with controls; ``starts`` holds its sides after these boundaries
    """

    name: str
    conditions: dict
    sides: dict
    continuous: tuple
    jumps_with_controls: tuple = (False, False)
    swapped: bool = False
    follows: bool = False
    starts: dict = field(default_factory=dict)
    departures: dict = field(default_factory=dict)
    from_left: bool = True
    has_right_limits: bool = False
    _sums: dict = field(default_factory=dict, init=False, repr=False, compare=False)

    def points(self, element: Element) -> list[float]:
        """Return the labels of the collocation points of ``element`` at which the condition exists."""
        return [t for t in element.points if t in self.sides]

    def values(self, element: Element, side: int) -> list:
        """Return side 0 or 1 at the labels of ``element``: collocation points, and boundaries if it is continuous."""
        values = [self.sides[t][side] for t in self.points(element)]
        if not self.continuous[side]:
            return values
        left = self.from_left and not (element.inputs_change and self.jumps_with_controls[side])
        if left and element.left in self.sides:
            values.append(self.starts.get(element.n, self.sides[element.left])[side])
        if element.right not in element.points and element.right in self.sides:
            values.append(self.sides[element.right][side])
        if side == 1 and element.n in self.departures:
            values.append(self.departures[element.n])
        return values

    def sums(self, element: Element) -> tuple:
        """Return the sums G_n and H_n of the two sides over ``element`` (theory, eq. 11a); pairs and activities share them."""
        if element.n not in self._sums:
            self._sums[element.n] = sum_of(self.values(element, 0)), sum_of(self.values(element, 1))
        return self._sums[element.n]


def conditions_over_time(block: Block, times: TimeIndex) -> tuple[dict, dict, dict]:
    """Return the active conditions over time on ``block``, each as name -> {time: ...}: pairs, mixed conditions, sides of pairs."""
    pairs, mixed, sides = {}, {}, {}
    for name, by_time in times.families_in(block.component_objects(Complementarity, active=True, descend_into=Block)).items():
        for t, data in ((t, data) for t, data in by_time.items() if data.active):
            condition = read_complementarity(data)
            if isinstance(condition, Mixed):
                mixed.setdefault(name, {})[t] = data
            else:
                pairs.setdefault(name, {})[t] = data
                sides.setdefault(name, {})[t] = condition
    return pairs, mixed, sides


def refuse_lists_of_times(block: Block, times: TimeIndex) -> None:
    """Refuse conditions written out for every time without a time index: new times would get none.

    Raises
    ------
    FesdError
        naming the component, e.g. a ComplementarityList filled in a loop over the times
    """
    labels = set(times.wrt) - ({times.wrt.first()} if discretised(times.wrt) else set())
    for component in block.component_objects(Complementarity, active=True, descend_into=Block):
        if any(covered >= labels for covered in _times_covered(component, times)):
            raise FesdError(
                component,
                "conditions for every time that are not indexed by time: elements that move would not see their switches",
                f"declare Complementarity({times.wrt.name}, rule=...), or a ComplementarityList in a Block over time",
            )


def _times_covered(component, times):
    """The times of the variables in conditions without a time index, for each set of components that conditions are about."""
    covered = defaultdict(set)
    for variables in (_variables(data) for data in component.values() if times.time(data) is None):
        at = {times.time(v) for v in variables} - {None}
        covered[frozenset(id(v.parent_component()) for v in variables)] |= at if len(at) == 1 else set()
    return covered.values()


def _variables(condition):
    sides = (side for side in getattr(condition, '_args', None) or () if hasattr(side, 'is_expression_type'))
    return [v for side in sides for v in identify_variables(side)]


def read_time_complementarities(
    moving: MovingGrid, conditions: dict, sides: dict, continuity: Continuity
) -> list[TimeComplementarity]:
    """Return the time complementarities of pairs over time.

    Parameters
    ----------
    moving : MovingGrid
    conditions : dict name -> {time: ComplementarityData}
    sides : dict name -> {time: Pair}
        those that are read already
    continuity : Continuity
        read at the inner label of each condition
    """
    names, wrt = _distinct_names(conditions), moving.wrt
    found = [
        _read_time_complementarity(names[name], by_time, sides.get(name), inner_label(by_time, wrt), continuity)
        for name, by_time in conditions.items()
    ]
    return found


def warn_unknown(moving: MovingGrid, conditions: Iterable[TimeComplementarity]) -> None:
    """Warn of conditions whose sides may jump anywhere: a switch between a boundary and the first point has no trace."""
    inner = ((c, inner_label(c.conditions, moving.wrt)) for c in conditions)
    unknown = {_source_name(moving, c.conditions[t]) for c, t in inner if t is not None and not any(c.continuous) and not c.follows}
    for name in sorted(unknown):
        logger.warning(
            "%s: neither side is known to be continuous in time, so a switch inside an element may go unnoticed. Write one side "
            "by differential states, or by variables that equations tie to them; or name its variables with the keyword "
            "continuous.",
            name,
        )


def _read_time_complementarity(name, by_time, sides, inner, continuity):
    """One time complementarity; without an inner label nothing is known of its sides."""
    sides = sides or {t: read_complementarity(c) for t, c in by_time.items()}
    if inner is None:
        return TimeComplementarity(name, by_time, sides, (False, False))
    continuous = tuple(map(continuity.holds, sides[inner]))
    swapped = continuous == (True, False)
    if swapped:
        sides, continuous = {t: (H, G) for t, (G, H) in sides.items()}, (False, True)
    jumps = tuple(known and continuity.jumps_at_stages(side) for known, side in zip(continuous, sides[inner]))
    follows = not any(continuous) and all(_of_multipliers(side, continuity) for side in sides[inner])
    return TimeComplementarity(name, by_time, sides, continuous, jumps, swapped, follows)


def _of_multipliers(expr, continuity):
    """Whether a side contains multipliers nu only: generated variables that nothing ties to the states."""
    return all(is_generated(v) and rule_of(v, continuity.rules) is None for v in identify_variables(expr))


def _distinct_names(names):
    """Public names; with the generated blocks, which are different, where two conditions would have the same."""
    public = {name: public_name(name) for name in names}
    often = Counter(public.values())
    return {name: short if often[short] == 1 else strip_time(name) for name, short in public.items()}


def warn_gauss_on_curved_surfaces(moving: MovingGrid, conditions: Iterable[TimeComplementarity], continuity: Continuity) -> None:
    """Warn where Gauss meets a curved surface: a slide on it has K + 1 conditions for K multipliers (theory, section 2)."""
    curved = {}
    for condition in conditions:
        inner = inner_label(condition.sides, moving.wrt)
        if condition.continuous == (False, True) and continuity.curved(condition.sides[inner][1]):
            rule = continuity.rule(condition.sides[inner][1])
            curved[_source_name(moving, condition.conditions[inner]) if rule is None else public_name(rule.name)] = True
    for name in curved:
        logger.warning(
            "%s: the surface is curved. LAGRANGE-LEGENDRE can cross it but not slide on it; if the solver finds no feasible "
            "point, use LAGRANGE-RADAU.",
            name,
        )


def _source_name(moving, condition):
    """The name by which the user knows a condition."""
    return public_name(TimeIndex(moving.wrt).split(moving.source(condition))[1])
