"""Cross complementarity: an active set that does not change inside an element (theory, eq. 11).

Takes: the active Complementarities over time, whoever wrote them.
Leaves: ``cross`` (aggregated pairs by family and element), ``nonnegative`` (signs of sides that bounds do not imply),
``left_limit`` (Gauss only); the sources are switched off, except at the first time, where they hold as they are.
Does not apply: to complementarities without time.
"""

import logging
from dataclasses import dataclass, field

from pyomo.common.autoslots import AutoSlots
from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.contrib.fbbt.expression_bounds_walker import ExpressionBoundsVisitor
from pyomo.core import Block, Constraint, ConstraintList, RangeSet, Set, quicksum
from pyomo.core.expr.visitor import identify_variables
from pyomo.mpec import Complementarity, complements

from pyomo_fesd import marks
from pyomo_fesd.complementarity import Mixed, read
from pyomo_fesd.elements.continuity import read_continuity
from pyomo_fesd.errors import FesdError
from pyomo_fesd.timeindex import TimeIndex, strip_time

logger = logging.getLogger('pyomo_fesd')

#: The three forms of eq. (11), with the number of point indices of each pair.
FORMS = {'element': 0, 'stage': 1, 'full': 2}


class _Sources(AutoSlots.Mixin):
    """Private data of the block of a moving grid: the grid, and the conditions that each aggregated pair stands for."""

    __slots__ = ('conditions', 'grid')

    def __init__(self):
        self.conditions = ComponentMap()
        self.grid = None


Block.register_private_data_initializer(_Sources, scope='pyomo_fesd.elements')


def sources(block):
    """ComponentMap from the aggregated pairs on ``block`` to lists of the conditions that they stand for."""
    return block.private_data('pyomo_fesd.elements').conditions


def set_grid(block, grid):
    """Remember the ``Grid`` of a moving grid on its block."""
    block.private_data('pyomo_fesd.elements').grid = grid


def grid_of(block):
    """The ``Grid`` of a moving grid, by its block."""
    return block.private_data('pyomo_fesd.elements').grid


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
    rule : Constraint or None
        what ties the continuous side to the states, where it is a marked variable
    starts : dict element number -> Pair
        the sides after the left boundary of an element, where a state jumps there
    jumps_with_controls : bool
        the continuous side contains a control that is held on each stage: no continuity from one stage to the next
    """

    name: str
    conditions: dict
    sides: dict
    continuous: tuple
    rule: object = None
    jumps_with_controls: bool = False
    starts: dict = field(default_factory=dict)

    def points(self, element):
        """Stage labels of ``element`` at which the condition exists."""
        return [t for t in element.points if t in self.sides]

    def values(self, element, side, right_is_stage):
        """Side 0 or 1 at the labels that take part in ``element``: its stages, and its boundaries if it is continuous."""
        values = [self.sides[t][side] for t in self.points(element)]
        if not self.continuous[side]:
            return values
        if not (element.opens_stage and self.jumps_with_controls) and element.left in self.sides:
            values.append(self.starts.get(element.n, self.sides[element.left])[side])
        if not right_is_stage and element.right in self.sides:
            values.append(self.sides[element.right][side])
        return values


def read_families(block, wrt, controls, told=()):
    """The complementarities over ``wrt`` on ``block``, by family.

    Parameters
    ----------
    controls : list of Var
        held constant on each stage
    told : list of Var
        variables of which the user says that they are continuous in time

    Raises
    ------
    FesdError
        for conditions with two bounds on one side (mixed complementarity) over time
    """
    times = TimeIndex(wrt)
    datas = list(block.component_data_objects(Complementarity, active=True, descend_into=Block))
    written = not all(map(marks.is_generated, datas))
    continuity = read_continuity(block.model(), times, ComponentSet(controls), told, trace=written)
    families = []
    for name, conditions in times.families(datas).items():
        sides = {t: read(c) for t, c in conditions.items()}
        mixed = next((c for t, c in conditions.items() if isinstance(sides[t], Mixed)), None)
        if mixed is not None:
            raise FesdError(
                mixed,
                "a complementarity over time with two bounds on one side is not supported yet",
                "write it as two conditions: l <= x perp F+ and x <= u perp F-, with F = F+ - F-",
            )
        inner = next((t for t in wrt if t in sides and t != wrt.first()), None)
        smooth = tuple(map(continuity.holds, sides[inner])) if inner is not None else (False, False)
        if inner is not None and not any(smooth):
            logger.warning(
                "%s: neither side is known to be continuous in time, so a switch inside an element may go unnoticed. Write one "
                "side by differential states, or by variables that equations tie to them; or name its variables with the keyword "
                "continuous.",
                _public_name(name),
            )
        if smooth == (True, False):
            sides, smooth = {t: (H, G) for t, (G, H) in sides.items()}, (False, True)
        lam = sides[inner][1] if smooth[1] else None
        rule, jumps = (continuity.rule(lam), continuity.jumps_at_stages(lam)) if smooth[1] else (None, False)
        families.append(Family(_public_name(name), conditions, sides, smooth, rule, jumps))
    return families


def warn_gauss_on_curved_surfaces(families):
    """With Gauss, a slide on a curved surface has K + 1 conditions for K multipliers (theory, section 2): say so by name."""
    named = ComponentSet()
    for family in families:
        rule = family.rule
        if rule is not None and rule not in named and any(c.body.polynomial_degree() not in (0, 1) for c in rule.values()):
            named.add(rule)
            logger.warning(
                "%s: the surface is curved. LAGRANGE-LEGENDRE can cross it but not slide on it; if the solver finds no feasible "
                "point, use LAGRANGE-RADAU.",
                _public_name(rule.name),
            )


def _public_name(name):
    """A family's name as shown in reports: without time and without the package's own blocks."""
    name = strip_time(name)
    return '.'.join(part for part in name.split('.') if not part.startswith(marks.GENERATED))


def add_cross_complementarity(block, families, grid, wrt, form):
    """Put the aggregated pairs on ``block`` and switch the sources off."""
    block.family = Set(initialize=[f.name for f in families], ordered=True)
    points = RangeSet(len(grid.tau) + 2)  # the stages, and both boundaries of a continuous side
    block.cross = Complementarity(block.family, block.element, *[points] * FORMS[form])
    for family in families:
        for element in grid.elements:
            for index, (G, H) in _pairs(family, element, grid.right_is_stage, form):
                pair = block.cross.add((family.name, element.n, *index), complements(G >= 0, H >= 0))
                sources(block)[pair] = [family.conditions[t] for t in family.points(element)]
    _add_signs(block, families)
    if not grid.right_is_stage:
        _hold_left_limits(block, families, grid, wrt)
    for family in families:
        for t, condition in family.conditions.items():
            if t != wrt.first():
                condition.deactivate()


def _pairs(family, element, right_is_stage, form):
    """The pairs of eq. (11) for one family and element, with their point indices."""
    if not family.points(element):
        return
    G = family.values(element, 0, right_is_stage)
    H = family.values(element, 1, right_is_stage)
    if form == 'element':
        yield (), (quicksum(G), quicksum(H))
    elif form == 'stage':
        for r, G_r in enumerate(G, start=1):
            yield (r,), (G_r, quicksum(H))
    else:
        for r, G_r in enumerate(G, start=1):
            for s, H_s in enumerate(H, start=1):
                yield (r, s), (G_r, H_s)


def _add_signs(block, families):
    """G >= 0 and H >= 0 at every point and after every jump, where the bounds of the variables do not say so already."""
    block.nonnegative = ConstraintList()
    block.sign_after = Constraint(block.family, block.element, [1, 2])
    for family in families:
        for pair in family.sides.values():
            for expr in filter(_may_be_negative, pair):
                block.nonnegative.add(expr >= 0)
        for n, pair in family.starts.items():
            for side, expr in enumerate(pair, start=1):
                if _may_be_negative(expr):
                    block.sign_after.add((family.name, n, side), expr >= 0)


def _may_be_negative(expr):
    low = expr.lb if expr.is_variable_type() else ExpressionBoundsVisitor().walk_expression(expr)[0]
    return low is None or low < 0


def _hold_left_limits(block, families, grid, wrt):
    """Gauss: the copies of nu at element boundaries belong to no stage; they keep the value of the last stage before.

    Without this they would be free, and an objective at the final time could exploit it.
    """
    block.left_limit = ConstraintList()
    selectors = ComponentSet(c for c, _ in marks.marked(block.model(), marks.SELECTOR))
    held = ComponentSet()
    for family in families:
        if family.continuous[0]:
            continue
        for element in grid.elements:
            if element.right in family.sides and family.points(element):
                _hold(block, family, element, selectors, held)


def _hold(block, family, element, selectors, held):
    right, last = family.sides[element.right][0], family.sides[family.points(element)[-1]][0]
    own = [(v, w) for v, w in zip(identify_variables(right), identify_variables(last))]
    chosen = [(v, w) for v, w in own if v in selectors or v.parent_component() in selectors]
    for v, w in chosen:
        if v not in held:
            held.add(v)
            block.left_limit.add(v == w)
    if not chosen and not any(v in held for v, _ in own):
        if not _generated(own):
            block.left_limit.add(right == last)


def _generated(variables):
    return any(marks.is_generated(v) for v, _ in variables)
