"""Cross complementarity: an active set that does not change inside an element (theory, eq. 11).

Takes: the active Complementarities over time, whoever wrote them.
Leaves: ``cross`` (aggregated pairs by family and element), ``nonnegative`` (signs of sides that bounds do not imply),
``left_limit`` (Gauss only); the sources are switched off, except at the first time, where they hold as they are.
Does not apply: to complementarities without time.
"""

import logging
from dataclasses import dataclass

import numpy as np
from pyomo.common.autoslots import AutoSlots
from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.contrib.fbbt.expression_bounds_walker import ExpressionBoundsVisitor
from pyomo.core import Block, Constraint, ConstraintList, RangeSet, Set, quicksum
from pyomo.core.expr.visitor import identify_variables
from pyomo.mpec import Complementarity, complements
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import maximum_bipartite_matching

from pyomo_fesd import marks
from pyomo_fesd.complementarity import Mixed, read
from pyomo_fesd.errors import FesdError
from pyomo_fesd.timeindex import DISCRETISATION, TimeIndex, derivatives, strip_time

logger = logging.getLogger('pyomo_fesd')

#: The three forms of eq. (11), with the number of point indices of each pair.
FORMS = {'element': 0, 'stage': 1, 'full': 2}


class _Sources(AutoSlots.Mixin):
    """Private data of the block of a moving grid: the conditions that each aggregated pair stands for."""

    __slots__ = ('conditions',)

    def __init__(self):
        self.conditions = ComponentMap()


Block.register_private_data_initializer(_Sources, scope='pyomo_fesd.elements')


def sources(block):
    """ComponentMap from the aggregated pairs on ``block`` to lists of the conditions that they stand for."""
    return block.private_data('pyomo_fesd.elements').conditions


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
    jumps_with_controls : bool
        the switching function contains a control that is held on each stage: no continuity from one stage to the next
    """

    name: str
    conditions: dict
    sides: dict
    continuous: tuple
    rule: object = None
    jumps_with_controls: bool = False

    def points(self, element):
        """Stage labels of ``element`` at which the condition exists."""
        return [t for t in element.points if t in self.sides]

    def values(self, element, side, right_is_stage):
        """Side 0 or 1 at the labels that take part in ``element``: its stages, and its boundaries if it is continuous."""
        labels = self.points(element)
        if self.continuous[side]:
            left = () if element.opens_stage and self.jumps_with_controls else (element.left,)
            boundaries = left if right_is_stage else (*left, element.right)
            labels = labels + [t for t in boundaries if t in self.sides]
        return [self.sides[t][side] for t in labels]


def read_families(block, wrt, controls):
    """The complementarities over ``wrt`` on ``block``, by family.

    Parameters
    ----------
    controls : list of Var
        held constant on each stage

    Raises
    ------
    FesdError
        for conditions with two bounds on one side (mixed complementarity) over time
    """
    times = TimeIndex(wrt)
    rules = ComponentMap(marks.marked(block.model(), marks.CONTINUOUS))
    continuous = ComponentSet(rules)
    continuous.update(d.get_state_var() for d in derivatives(block.model(), wrt))
    held = ComponentSet(controls)
    datas = list(block.component_data_objects(Complementarity, active=True, descend_into=Block))
    if not all(map(marks.is_generated, datas)):
        continuous.update(_defined_by_states(block.model(), times, wrt, continuous))
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
        smooth = tuple(_is_continuous(s, continuous) for s in sides[inner]) if inner is not None else (False, False)
        if inner is not None and not any(smooth):
            logger.warning(
                "%s: neither side is known to be continuous in time, so a switch inside an element may go unnoticed. Write one "
                "side by differential states, or by a variable that one equation ties to them.",
                _public_name(name),
            )
        if smooth == (True, False):
            sides, smooth = {t: (H, G) for t, (G, H) in sides.items()}, (False, True)
        rule = _rule(sides[inner][1], rules) if smooth[1] else None
        families.append(Family(_public_name(name), conditions, sides, smooth, rule, _contains(rule, held)))
    return families


def _defined_by_states(model, times, wrt, continuous):
    """Algebraic variables at one inner time that equations tie to continuous ones: such a variable is continuous itself.

    They are the unknowns of the equations that are not under-determined (Dulmage and Mendelsohn): those that no alternating path
    connects with an unmatched unknown.
    """
    t = list(wrt)[1]

    def unknown(v):
        return times.time(v) is not None and v not in continuous and v.parent_component() not in continuous

    rows = [
        [v for v in identify_variables(c.body) if unknown(v)]
        for c in model.component_data_objects(Constraint, active=True, descend_into=Block)
        if c.equality and times.time(c) == t and not c.parent_component().local_name.endswith(DISCRETISATION)
    ]
    columns = ComponentMap()
    for row in rows:
        for v in row:
            columns.setdefault(v, len(columns))
    places = [(i, columns[v]) for i, row in enumerate(rows) for v in row]
    if not places:
        return ComponentSet()
    incidence = csr_matrix((np.ones(len(places)), tuple(zip(*places))), shape=(len(rows), len(columns)))
    row_of = maximum_bipartite_matching(incidence, perm_type='row')  # of each column, -1 if unmatched
    column_of = {i: j for j, i in enumerate(row_of) if i >= 0}
    by_column, loose = incidence.tocsc(), {j for j, i in enumerate(row_of) if i < 0}
    waiting = list(loose)
    while waiting:
        j = waiting.pop()
        for i in by_column.indices[by_column.indptr[j] : by_column.indptr[j + 1]]:
            if column_of[i] not in loose:
                loose.add(column_of[i])
                waiting.append(column_of[i])
    return ComponentSet(v for v, j in columns.items() if j not in loose)


def _rule(side, rules):
    """The Constraint that ties a marked variable to the states."""
    return rules.get(side.parent_component()) if side.is_variable_type() else None


def _contains(rule, components):
    """Whether a Constraint over time contains variables of ``components``."""
    data = next(iter(rule.values()), None) if rule is not None else None
    return data is not None and any(v.parent_component() in components for v in identify_variables(data.body))


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


def _is_continuous(expr, continuous):
    variables = list(identify_variables(expr, include_fixed=True)) if hasattr(expr, 'is_expression_type') else []
    return bool(variables) and all(v in continuous or v.parent_component() in continuous for v in variables)


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
    """G >= 0 and H >= 0 at every point, where the bounds of the variables do not say so already."""
    block.nonnegative = ConstraintList()
    lower = ExpressionBoundsVisitor()
    for family in families:
        for pair in family.sides.values():
            for expr in pair:
                low = expr.lb if expr.is_variable_type() else lower.walk_expression(expr)[0]
                if low is None or low < 0:
                    block.nonnegative.add(expr >= 0)


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
