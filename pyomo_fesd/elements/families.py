"""The complementarity conditions of a model, each as one family over time, with what is known of its sides.

Takes: the active Complementarities over time, whoever wrote them.
Leaves: nothing on the model; a warning where switches may go unnoticed, or a slide cannot be followed.
Does not apply: to complementarities without time.
"""

import logging
from collections import Counter, defaultdict
from dataclasses import dataclass, field

from pyomo.core import Block
from pyomo.core.expr.visitor import identify_variables
from pyomo.mpec import Complementarity

from pyomo_fesd import marks
from pyomo_fesd.complementarity import Mixed, read
from pyomo_fesd.elements.continuity import inner_label
from pyomo_fesd.elements.equations import rule_of
from pyomo_fesd.elements.mixed import source
from pyomo_fesd.errors import FesdError
from pyomo_fesd.timeindex import discretised, strip_time

logger = logging.getLogger('pyomo_fesd')


@dataclass(frozen=True)
class Family:
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
        for each continuous side, whether it contains a control that is held on each stage: no continuity from one stage to the
        next
    follows : bool
        both sides are functions of multipliers that jump: it switches only where the conditions of these do
    starts : dict element number -> Pair
        the sides after the left boundary of an element, where a state jumps there
    """

    name: str
    conditions: dict
    sides: dict
    continuous: tuple
    jumps_with_controls: tuple = (False, False)
    follows: bool = False
    starts: dict = field(default_factory=dict)

    def points(self, element):
        """Stage labels of ``element`` at which the condition exists."""
        return [t for t in element.points if t in self.sides]

    def values(self, element, side, right_is_stage):
        """Side 0 or 1 at the labels that take part in ``element``: its stages, and its boundaries if it is continuous."""
        values = [self.sides[t][side] for t in self.points(element)]
        if not self.continuous[side]:
            return values
        if not (element.opens_stage and self.jumps_with_controls[side]) and element.left in self.sides:
            values.append(self.starts.get(element.n, self.sides[element.left])[side])
        if not right_is_stage and element.right in self.sides:
            values.append(self.sides[element.right][side])
        return values


def conditions_over_time(block, times):
    """The active conditions over time on ``block`` by family: the pairs, and those with two bounds on one side.

    Returns
    -------
    two dicts name -> {time: ComplementarityData}
    """
    found = {False: {}, True: {}}
    for name, family in times.families(_active(block)).items():
        for t, data in family.items():
            found[isinstance(read(data), Mixed)].setdefault(name, {})[t] = data
    return found[False], found[True]


def _active(block):
    return block.component_data_objects(Complementarity, active=True, descend_into=Block)


def refuse_lists_of_times(block, times):
    """Refuse conditions written out for every time: they are not over time, and new times get none.

    Raises
    ------
    FesdError
        naming the component, e.g. a ComplementarityList filled in a loop over the times
    """
    labels = set(times.wrt) - ({times.wrt.first()} if discretised(times.wrt) else set())
    for component in block.component_objects(Complementarity, active=True, descend_into=Block):
        covered = defaultdict(set)
        for data in component.values():
            if times.time(data) is None:
                variables = list(_variables(data))
                at = {times.time(v) for v in variables} - {None}
                covered[frozenset(id(v.parent_component()) for v in variables)] |= at if len(at) == 1 else set()
        if any(found >= labels for found in covered.values()):
            raise FesdError(
                component,
                "conditions for every time that are not indexed by time: elements that move would not see their switches",
                f"declare Complementarity({times.wrt.name}, rule=...), or a ComplementarityList in a Block over time",
            )


def _variables(condition):
    sides = (side for side in getattr(condition, '_args', None) or () if hasattr(side, 'is_expression_type'))
    return (v for side in sides for v in identify_variables(side))


def read_families(conditions, continuity, times):
    """What is known of each family of pairs.

    Parameters
    ----------
    conditions : dict name -> {time: ComplementarityData}
    continuity : Continuity
        read at the inner label of each family
    times : TimeIndex
    """
    families, unknown, names = [], set(), _distinct_names(conditions)
    for name, family in conditions.items():
        sides, inner = {t: read(c) for t, c in family.items()}, inner_label(family, times.wrt)
        smooth = tuple(map(continuity.holds, sides[inner])) if inner is not None else (False, False)
        if smooth == (True, False):
            sides, smooth = {t: (H, G) for t, (G, H) in sides.items()}, (False, True)
        jumps = tuple(s and continuity.jumps_at_stages(sides[inner][i]) for i, s in enumerate(smooth))
        follows = inner is not None and not any(smooth) and all(_of_multipliers(side, continuity) for side in sides[inner])
        families.append(Family(names[name], family, sides, smooth, jumps, follows))
        if inner is not None and not any(smooth) and not follows:
            unknown.add(_source_name(family[inner], times))
    for name in sorted(unknown):
        logger.warning(
            "%s: neither side is known to be continuous in time, so a switch inside an element may go unnoticed. Write one side "
            "by differential states, or by variables that equations tie to them; or name its variables with the keyword "
            "continuous.",
            name,
        )
    return families


def _of_multipliers(expr, continuity):
    """Whether a side contains multipliers nu only: generated variables that nothing ties to the states."""
    return all(marks.is_generated(v) and rule_of(v, continuity.rules) is None for v in identify_variables(expr))


def _distinct_names(names):
    """Public names; where two families would have the same, those with the package's own blocks, which are different."""
    public = {name: public_name(name) for name in names}
    often = Counter(public.values())
    return {name: short if often[short] == 1 else strip_time(name) for name, short in public.items()}


def warn_gauss_on_curved_surfaces(families, continuity, times):
    """With Gauss, a slide on a curved surface has K + 1 conditions for K multipliers (theory, section 2): say so by name."""
    curved = {}
    for family in families:
        inner = inner_label(family.sides, times.wrt)
        if family.continuous == (False, True) and continuity.curved(family.sides[inner][1]):
            rule = continuity.rule(family.sides[inner][1])
            curved[_source_name(family.conditions[inner], times) if rule is None else public_name(rule.name)] = True
    for name in curved:
        logger.warning(
            "%s: the surface is curved. LAGRANGE-LEGENDRE can cross it but not slide on it; if the solver finds no feasible "
            "point, use LAGRANGE-RADAU.",
            name,
        )


def _source_name(condition, times):
    """The name that the user knows a condition by."""
    return public_name(times.split(source(condition))[1])


def public_name(name):
    """A family's name as shown in reports: without time and without the package's own blocks."""
    name = strip_time(name)
    return '.'.join(part for part in name.split('.') if not part.startswith(marks.GENERATED))
