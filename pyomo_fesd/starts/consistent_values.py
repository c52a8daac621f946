"""Values that follow from other values: derivatives, multipliers and parts of switching functions, algebraic variables.

In this order, as far as one after the other is determined:

* derivatives from the equations of collocation;
* multipliers of modes from the weights that the table gives;
* the parts p and n, lam and mu, and the multipliers nu from the switching functions; a function that is 0 leaves nu open;
* positive parts from their conditions, and a side of a pair that is 0 because the other is not;
* any variable that is the only one left in an equation, first in those without derivatives;
* multipliers that are open at one point of an element, and derivatives that have no equation of collocation, from the point
  beside it.

Takes: a transformed model, the variables without a value of their own, and weights of modes.
Leaves: values; variables that only several equations together determine keep theirs.
"""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from pyomo.common.collections import ComponentSet
from pyomo.core import Block, Constraint
from pyomo.core.base.var import VarData
from pyomo.core.expr.visitor import identify_variables
from pyomo.mpec import Complementarity
from pyomo.util.calc_var_value import calculate_variable_from_constraint

from pyomo_fesd.core import (
    Mixed,
    MovingGrid,
    TimeIndex,
    all_switched_systems,
    derivatives,
    is_discretisation_equation,
    read_complementarity,
    value_or_nan,
    withheld_messages,
)
from pyomo_fesd.starts.element_placement import set_within_bounds

#: A side may be negative by this part of its value.
ROUNDING = 1e-9
#: A function below this is 0, and leaves the side open.
ZERO = 1e-8


@dataclass(eq=False)
class Relation:
    """What determines variables.

    Attributes
    ----------
    open : ComponentSet
        the variables that are not known yet
    targets : ComponentSet or None
        those that it determines; None if any one that is left
    solve : callable (VarData) -> iterable of (VarData, number)
        the values, nan where a variable remains open; called with one of those that are open
    tier : int
        relations of a lower one come first
    """

    open: ComponentSet
    targets: ComponentSet | None
    solve: Callable
    tier: int

    def ready(self) -> bool:
        """Whether nothing but what it determines is open."""
        return len(self.open) == 1 if self.targets is None else bool(self.open) and all(v in self.targets for v in self.open)


def make_consistent(moving: MovingGrid, weights: Iterable[tuple], unknown: ComponentSet) -> None:
    """Set the ``unknown`` variables that follow from the others.

    Parameters
    ----------
    weights : iterable of (expression, number)
        multipliers of modes with their values
    """
    model, times = moving.block.model(), TimeIndex(moving.wrt)
    rates = ComponentSet(v for d in derivatives(model, moving.wrt) for v in d.values())
    without, with_rates = [], []
    for equation in _equations(model, times):
        if is_discretisation_equation(equation):
            _solve_rates(equation, rates, unknown)
            continue
        variables = _variables_list(equation.body)
        (with_rates if any(v in rates for v in variables) else without).append((variables, None, _of_equation(equation)))
    # Gauss: multipliers at element boundaries; state jumps: variables after them
    limits = [] if moving.left_limit is None else list(moving.left_limit.values())
    copied = [] if moving.state_jumps is None else list(moving.state_jumps.copied.values())
    without += [(_variables_list(row.body), None, _of_equation(row)) for row in (*limits, *copied)]
    parts = [*_of_dependents(model), *_of_positive_parts(model, times), *_of_splits(moving), *_of_pairs(moving)]
    first = [*_of_weights(weights), *parts, *without]
    _solve_in_turn([first, with_rates, list(_of_neighbours(moving, times, rates))], unknown)


def _equations(model, times):
    for equation in model.component_data_objects(Constraint, active=True, descend_into=Block):
        if equation.equality and times.time(equation) is not None:
            yield equation


def _solve_rates(equation, rates, unknown):
    """Solve an equation of collocation for its derivative."""
    for v in identify_variables(equation.body, include_fixed=False):
        if v in rates:
            for rate, number in _of_equation(equation)(v):
                set_within_bounds(rate, number)
            unknown.discard(v)


def _of_equation(equation):
    """A function that solves an equation for one variable."""

    def solve(v):
        before = v.value
        # a value outside of the bounds is set to the bound later
        with suppress(ArithmeticError, ValueError, RuntimeError), withheld_messages('pyomo'):
            if before is None:
                v.set_value(0.0, skip_validation=True)
            calculate_variable_from_constraint(v, equation)
            return [(v, v.value)]
        v.set_value(before, skip_validation=True)
        return []

    return solve


def _variables_list(expr):
    return list(identify_variables(expr, include_fixed=False))


def _of_weights(weights) -> Iterator[tuple]:
    """The last unknown multiplier of a weight; weights are linear in each of them."""
    for weight, number in weights:
        yield _variables_list(weight), None, lambda v, weight=weight, number=number: [(v, _root(v, weight, number))]


def _root(v, expr, number):
    """The value of ``v`` at which ``expr``, linear in it, is ``number``; nan where it does not matter."""
    at_zero, slope = (line[0] for line in _lines(v, [expr]))
    if not abs(slope) > ROUNDING:
        return np.nan
    return (number - at_zero) / slope


def _lines(v, expressions):
    """Values at v = 0, and slopes, of expressions that are linear in ``v``."""
    before, found = v.value, []
    for number in (0.0, 1.0):
        v.set_value(number, skip_validation=True)
        found.append([value_or_nan(expr) for expr in expressions])
    v.set_value(before, skip_validation=True)
    return np.array(found[0]), np.subtract(found[1], found[0])


def _of_dependents(model) -> Iterator[tuple]:
    for one in all_switched_systems(model).dependents:
        arguments = [v for expr in one.arguments for v in _variables(expr)]
        yield [*one.variables, *arguments], ComponentSet(one.variables), lambda _, one=one: _dependent_values(one)


def _of_pairs(moving) -> Iterator[tuple]:
    """The last unknown of a pair: its side is 0 where the other is not."""
    for condition in moving.complementarities:
        for pair in condition.sides.values():
            variables = [v for side in pair for v in _variables(side)]
            yield variables, None, lambda v, pair=pair: [(v, _opposite(v, pair))]


def _opposite(v, pair):
    """The value of ``v`` at which its side is 0, if the other side is positive; else nan."""
    for side, other in (pair, reversed(pair)):
        if value_or_nan(other) > ZERO and not any(u is v for u in _variables(other)):
            return _root(v, side, 0.0)
    return np.nan


def _of_splits(moving) -> Iterator[tuple]:
    """p and n of a condition l <= x <= u perp F = p - n, and x where it is a variable: at the bound that the sign of F names."""
    for source, split in moving.splits.items():
        if split.p is not None:
            mixed = read_complementarity(source)
            targets = ComponentSet([split.p, split.n, *([mixed.body] if mixed.body.is_variable_type() else [])])
            yield [*targets, *_variables(mixed.F)], targets, lambda _, split=split, mixed=mixed: _split_values(split, mixed)


def _split_values(split, mixed):
    F = value_or_nan(mixed.F)
    bound = mixed.lower if F > ZERO else mixed.upper if F < -ZERO else None
    return [(split.p, max(F, 0.0)), (split.n, max(-F, 0.0)), (mixed.body, value_or_nan(bound))]


def _variables(expr):
    return identify_variables(expr, include_fixed=False) if hasattr(expr, 'is_expression_type') else ()


def _dependent_values(one):
    numbers = [value_or_nan(expr) for expr in one.arguments]
    return zip(one.variables, one.values(numbers)) if np.isfinite(numbers).all() else ()


def _of_neighbours(moving, times, rates) -> Iterator[tuple]:
    """A multiplier that is open at one point of an element is 0 or 1 where it is so at the point beside it; a rate is equal."""
    multipliers = ComponentSet(v for one in all_switched_systems(moving.block.model()).dependents for v in one.variables)
    for by_label in times.families([*multipliers, *rates]).values():
        for element in moving.grid.elements:
            first = [moving.wrt.first()] if element.n == 1 else []
            found = [by_label[t] for t in (*first, *element.own_labels) if t in by_label]
            for both in zip(found, found[1:]):
                yield [*both], None, lambda v, both=both: [(v, _as_beside(v, both, v in rates))]


def _as_beside(v, both, always):
    """The value of the other of two variables; unless ``always``, nan where it is neither 0 nor 1."""
    (other,) = (w.value for w in both if w is not v)
    return np.nan if other is None or not (always or other in (0.0, 1.0)) else other


def _of_positive_parts(model, times) -> Iterator[tuple]:
    """Variables that a condition ties to an argument: s = max(0, z), or a value between two bounds."""
    for component, rule in all_switched_systems(model).continuous.items():
        if rule.ctype is Complementarity:
            for v in component.values() if hasattr(component, 'values') else [component]:
                pair = rule if not rule.is_indexed() else rule[v.index()] if v.index() in rule else None
                if pair is not None and times.time(v) is not None:
                    variables = [u for side in read_complementarity(pair) for u in _variables(side)]
                    yield variables, ComponentSet([v]), lambda _, v=v, pair=pair: [(v, _complementary(v, pair))]


def solve_pair(v: VarData, pair) -> None:
    """Set a variable so that one side of its pair is 0 and none is negative, where there is such a value."""
    set_within_bounds(v, _complementary(v, pair))


def _complementary(v, pair):
    """The value of ``v`` that satisfies a condition whose sides are linear in it; nan without one."""
    sides = read_complementarity(pair)
    if isinstance(sides, Mixed):
        return float(np.clip(_root(v, sides.F, 0.0), value_or_nan(sides.lower), value_or_nan(sides.upper)))
    at_zero, slope = _lines(v, sides)
    if np.isfinite(at_zero + slope).all():
        for root in -at_zero[slope != 0] / slope[slope != 0]:
            if (at_zero + slope * root >= -ROUNDING * (1 + np.abs(at_zero))).all():
                return float(root)
    return np.nan


def _solve_in_turn(tiers, unknown):
    """Solve what is ready, relations of a later tier only where no earlier one is."""
    users, queues = {}, [deque() for _ in tiers]
    for tier, relations in enumerate(tiers):
        for variables, targets, solve in relations:
            relation = Relation(ComponentSet(v for v in variables if v in unknown), targets, solve, tier)
            for v in relation.open:
                users.setdefault(id(v), []).append(relation)
            if relation.ready():
                queues[tier].append(relation)
    while any(queues):
        relation = next(filter(None, queues)).popleft()
        if relation.ready():
            for other in _apply(relation, users):
                if other.ready():
                    queues[other.tier].append(other)


def _apply(relation, users):
    """Set what a relation determines; returns the relations for which these variables were open."""
    found = []
    for v, number in list(relation.solve(next(iter(relation.open)))):
        if v in relation.open and np.isfinite(number):
            set_within_bounds(v, number)
            found += users[id(v)]
            for other in users[id(v)]:
                other.open.discard(v)
    return found
