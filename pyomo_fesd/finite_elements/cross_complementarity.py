"""Cross complementarity: an active set that does not change inside an element (theory, eq. 11).

Takes: the time complementarities.
Leaves: ``cross`` (aggregated pairs by condition and element), ``nonnegative`` and ``sign_after`` (signs of sides that bounds do not
imply), ``left_limit`` (Gauss only); the sources are deactivated, except at the first time, where they are imposed unchanged.
Does not apply: to complementarities without time.
"""

from collections.abc import Iterator

from pyomo.common.collections import ComponentSet
from pyomo.contrib.fbbt.expression_bounds_walker import ExpressionBoundsVisitor
from pyomo.core import Constraint, ConstraintList, RangeSet, Set
from pyomo.core.expr.visitor import identify_variables
from pyomo.mpec import Complementarity, complements

from pyomo_fesd.core import (
    Follower,
    MovingGrid,
    all_switched_systems,
    expression_key,
    homotopy_hints,
    insert,
    is_generated,
    leaves_of,
    sum_of,
)
from pyomo_fesd.finite_elements.mixed_complementarity import repeats_other_side
from pyomo_fesd.finite_elements.time_complementarities import TimeComplementarity

#: The three forms of eq. (11), with the number of point indices of each pair.
FORMS = {'element': 0, 'point': 1, 'full': 2}


def add_cross_complementarity(moving: MovingGrid, conditions: list[TimeComplementarity], form: str) -> None:
    """Add the aggregated pairs in one of ``FORMS``, or 'auto', and deactivate their sources."""
    block, grid = moving.block, moving.grid
    form = _chosen(moving) if form == 'auto' else form
    moving.complementarities = list(conditions)
    block.condition = Set(initialize=[c.name for c in conditions], ordered=True)
    points = RangeSet(len(grid.tau) + 2)  # the collocation points, and both boundaries of a continuous side
    block.cross = moving.pairs = Complementarity(block.condition, block.element, *[points] * FORMS[form])
    for condition in conditions:
        for element in grid.elements:
            for index, (G, H) in _pairs(condition, element, form):
                pair = insert(block.cross, (condition.name, element.n, *index), complements(G >= 0, H >= 0))
                moving.sources[pair] = [moving.source(condition.conditions[t]) for t in condition.points(element)]
    _lead_first_time(moving, form)
    _add_signs(moving)
    if not grid.right_is_collocated:
        _equate_left_limits(moving)
    for condition in conditions:
        for t, source in condition.conditions.items():
            if t != moving.wrt.first():
                source.deactivate()


def _chosen(moving):
    """The form for a model: with contacts that must not slip, relaxations of sums lead to worse minima."""
    impacts = None if moving.state_jumps is None else moving.state_jumps.impacts
    return 'full' if impacts is not None and any(law.sticking for law in impacts.laws) else 'element'


def _lead_first_time(moving, form):
    """Let the first element decide its left boundary, where multipliers nu are free as long as lam is zero.

    A value of nu that is neither 0 nor 1 would tie the initial state to lam = 0.
    """
    first, free, hints = moving.grid.elements[0], _free_components(moving), homotopy_hints(moving.block)
    for condition in moving.complementarities:
        if first.left not in condition.sides or not condition.points(first):
            continue
        nu, lam = condition.sides[first.left]
        continuous = any(lam is value for value in condition.values(first, 1))
        if continuous and all(v.parent_component() in free for v in identify_variables(nu)):
            leader = moving.pairs[(condition.name, first.n, *[1] * FORMS[form])]
            hints.followers.append(Follower(condition.conditions[first.left], leader, condition.swapped))


def _free_components(moving):
    """Components of the multipliers of modes; not of the parts of mixed conditions, which have an equation at every time."""
    parts = ComponentSet(v.parent_component() for split in moving.splits.values() for v in (split.p, split.n) if v is not None)
    return ComponentSet(v.parent_component() for v in all_switched_systems(moving.block.model()).selectors) - parts


def _among(v, selectors):
    return v in selectors or v.parent_component() in selectors


def _pairs(condition, element, form) -> Iterator[tuple]:
    """The pairs of eq. (11) for one time complementarity and element, with their point indices."""
    if not condition.points(element):
        return
    if form == 'element':
        yield (), condition.sums(element)
        return
    G, H = condition.values(element, 0), condition.values(element, 1)
    if form == 'point':
        yield from (((r,), (G_r, sum_of(H))) for r, G_r in enumerate(G, start=1))
    else:
        yield from (((r, s), (G_r, H_s)) for r, G_r in enumerate(G, start=1) for s, H_s in enumerate(H, start=1))


def _add_signs(moving):
    """G >= 0 and H >= 0 at every point and after every jump, where the bounds of the variables do not imply it."""
    block, signs = moving.block, _Signs()
    block.nonnegative = moving.nonnegative = ConstraintList()
    block.sign_after = moving.sign_after = Constraint(block.condition, block.element, [1, 2])
    for condition in moving.complementarities:
        for expr in (expr for pair in condition.sides.values() for expr in pair):
            if not signs.never_negative(expr):
                block.nonnegative.add(expr >= 0)
        for n, pair in condition.starts.items():
            for side, expr in enumerate(pair, start=1):
                if not signs.never_negative(expr):
                    block.sign_after.add((condition.name, n, side), expr >= 0)


class _Signs:
    """Whether bounds imply a sign; of expressions that are built alike from variables with the same bounds one is examined."""

    def __init__(self):
        self._visitor, self._known = ExpressionBoundsVisitor(), {}

    def never_negative(self, expr):
        """Return whether the bounds of the variables imply expr >= 0 for all values of mutable Params."""
        if expr.is_variable_type():
            bounds = _bounds(expr)
            return bounds is not None and bounds[0] is not None and bounds[0] >= 0
        key, _ = expression_key([expr], _bounds)
        if key is None or key not in self._known:
            self._known[key] = self._is_implied(expr)
        return self._known[key]

    def _is_implied(self, expr):
        if any(leaf.is_parameter_type() or (leaf.is_variable_type() and _bounds(leaf) is None) for leaf in leaves_of(expr)):
            return False
        low, _ = self._visitor.walk_expression(expr)
        return low is not None and low >= 0


def _bounds(v):
    """The bounds of a variable; None if they may change."""
    low, high = v.lower, v.upper
    return None if _may_change(low) or _may_change(high) else (low, high)


def _may_change(bound):
    return hasattr(bound, 'is_expression_type')


def _equate_left_limits(moving):
    """Gauss: nu at an element boundary, which is not a collocation point, equals nu at the last collocation point before it.

    Without these equations it would be free, and an objective at the final time could exploit it.
    """
    moving.block.left_limit = moving.left_limit = ConstraintList()
    selectors, equated = all_switched_systems(moving.block.model()).selectors, ComponentSet()
    for condition in moving.complementarities:
        if condition.continuous[0] or _repeats_other_side(moving, condition):
            continue
        for element in moving.grid.elements:
            if element.right in condition.sides and condition.points(element):
                right, last = (condition.sides[t][0] for t in (element.right, condition.points(element)[-1]))
                _equate(moving.left_limit, right, last, selectors, equated)


def _repeats_other_side(moving, condition):
    t, (jumping, _) = next(iter(condition.sides.items()))
    return repeats_other_side(moving, condition.conditions[t], jumping)


def _equate(left_limit, right, last, selectors, equated):
    """Equate the independent multipliers of two sides, each once; the sides themselves where they have none."""
    variables = list(zip(identify_variables(right), identify_variables(last)))
    chosen = [(v, w) for v, w in variables if _among(v, selectors)]
    for v, w in chosen:
        if v not in equated:
            equated.add(v)
            left_limit.add(v == w)
    if not chosen and not any(v in equated or is_generated(v) for v, _ in variables):
        left_limit.add(right == last)
