"""Cross complementarity: an active set that does not change inside an element (theory, eq. 11).

Takes: the families of conditions over time, whoever wrote them.
Leaves: ``cross`` (aggregated pairs by family and element), ``nonnegative`` (signs of sides that bounds do not imply),
``left_limit`` (Gauss only); the sources are switched off, except at the first time, where they hold as they are.
Does not apply: to complementarities without time.
"""

from pyomo.common.autoslots import AutoSlots
from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.contrib.fbbt.expression_bounds_walker import ExpressionBoundsVisitor
from pyomo.core import Block, Constraint, ConstraintList, RangeSet, Set, quicksum
from pyomo.core.expr.visitor import identify_variables
from pyomo.mpec import Complementarity, complements

from pyomo_fesd import marks
from pyomo_fesd.elements.mixed import repeats, source
from pyomo_fesd.values import mutable_parameters

#: The three forms of eq. (11), with the number of point indices of each pair.
FORMS = {'element': 0, 'stage': 1, 'full': 2}


class _Sources(AutoSlots.Mixin):
    """Private data of the block of a moving grid: the grid, the families, the conditions that each aggregated pair stands for."""

    __slots__ = ('conditions', 'grid', 'families')

    def __init__(self):
        self.conditions = ComponentMap()
        self.grid, self.families = None, []


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


def families_of(block):
    """The families of conditions on a moving grid, by its block."""
    return block.private_data('pyomo_fesd.elements').families


def add_cross_complementarity(block, families, grid, wrt, form):
    """Put the aggregated pairs on ``block`` and switch the sources off."""
    block.private_data('pyomo_fesd.elements').families = list(families)
    block.family = Set(initialize=[f.name for f in families], ordered=True)
    points = RangeSet(len(grid.tau) + 2)  # the stages, and both boundaries of a continuous side
    block.cross = Complementarity(block.family, block.element, *[points] * FORMS[form])
    for family in families:
        for element in grid.elements:
            for index, (G, H) in _pairs(family, element, grid.right_is_stage, form):
                pair = block.cross.add((family.name, element.n, *index), complements(G >= 0, H >= 0))
                sources(block)[pair] = [source(family.conditions[t]) for t in family.points(element)]
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
    lower = ExpressionBoundsVisitor()
    for family in families:
        for pair in family.sides.values():
            for expr in pair:
                if not _never_negative(expr, lower):
                    block.nonnegative.add(expr >= 0)
        for n, pair in family.starts.items():
            for side, expr in enumerate(pair, start=1):
                if not _never_negative(expr, lower):
                    block.sign_after.add((family.name, n, side), expr >= 0)


def _never_negative(expr, lower):
    """Whether the bounds of the variables say so, whatever values mutable Params will have."""
    if any(True for _ in mutable_parameters(expr)) or any(map(_bound_may_change, identify_variables(expr))):
        return False
    low = expr.lb if expr.is_variable_type() else lower.walk_expression(expr)[0]
    return low is not None and low >= 0


def _bound_may_change(v):
    return any(hasattr(bound, 'is_expression_type') for bound in (v.lower, v.upper))


def _hold_left_limits(block, families, grid, wrt):
    """Gauss: the copies of nu at element boundaries belong to no stage; they keep the value of the last stage before.

    Without this they would be free, and an objective at the final time could exploit it.
    """
    block.left_limit = ConstraintList()
    selectors = ComponentSet(c for c, _ in marks.marked(block.model(), marks.SELECTOR))
    held = ComponentSet()
    for family in families:
        if family.continuous[0] or _says_again(family):
            continue
        for element in grid.elements:
            if element.right in family.sides and family.points(element):
                _hold(block, family, element, selectors, held)


def _says_again(family):
    t, (jumping, _) = next(iter(family.sides.items()))
    return repeats(family.conditions[t], jumping)


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
