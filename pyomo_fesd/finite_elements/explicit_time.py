"""Warn of data that depend on time labels, which are not physical time once elements move: a clock state replaces them."""

import logging
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from math import isfinite
from operator import itemgetter

from pyomo.common.numeric_types import native_types
from pyomo.core import Block, Constraint, value
from pyomo.core.base.var import VarData
from pyomo.core.expr.relational_expr import RelationalExpression
from pyomo.core.expr.visitor import identify_variables
from pyomo.mpec import Complementarity

from pyomo_fesd.core import (
    MovingGrid,
    TimeIndex,
    is_discretisation_equation,
    kept_values,
    read_side,
    strip_time,
)
from pyomo_fesd.finite_elements.quadrature import Integrand

logger = logging.getLogger('pyomo_fesd')

#: About how many points of a constraint over time are compared.
COMPARED = 12
#: Values of variables at which expressions are compared: the first one, and how the others follow.
TRIALS = ((0.7, 0.11), (0.0, 0.0), (7.3, -0.19), (-3.1, 0.23))
#: Relative difference of numbers that are equal.
SAME = 1e-9
#: Types of numbers that are compared.
NUMBERS = {int, float}


def warn_explicit_time(moving: MovingGrid, expressions: Iterable[tuple]) -> None:
    """Warn once for each of ``expressions_over_time`` whose numbers change with time, and record its name.

    With every variable at one value, all points of a constraint without explicit time give the same number.  Control stages
    may have data of their own, so points are compared within a control stage.
    """
    stage = {t: k for k, elements in enumerate(moving.grid.control_stages) for e in elements for t in e.own_labels}
    moving.explicit_time = tuple(dict.fromkeys(name for name, by_time in expressions if _depends_on_time(by_time, stage)))
    for name in moving.explicit_time:
        logger.warning(
            "%s: its numbers depend on the time label (a Param over time, or t itself in a rule). Labels are not physical "
            "time once elements move. Take time from a clock state, pyomo_fesd.clock(m, m.%s)[t], give a time series with "
            "pyomo_fesd.signal, or name inputs that are constant on each control stage in piecewise_constant.",
            strip_time(name),
            moving.wrt.local_name,
        )


def _depends_on_time(by_time, stage):
    """Whether points of one control stage differ."""
    points = _spread([t for t in by_time if t in stage])
    return any(differ([by_time[t]() for t in points if stage[t] == s]) for s in {stage[t] for t in points})


def expressions_over_time(
    block: Block, moving: MovingGrid, integrands: list[Integrand], laws: Iterable[tuple]
) -> list[tuple[str, dict[float, Callable]]]:
    """Return ``(name, {label: function that gives expressions and relations})`` of all components over time that a rule made.

    Parameters
    ----------
    laws : iterable of (name, {time: tuple of expressions})
        guards and resets of state jumps, conditions of modes with hysteresis
    """
    components = block.component_objects((Constraint, Complementarity), active=True, descend_into=Block)
    by_name = TimeIndex(moving.wrt).families_in(c for c in components if not is_discretisation_equation(c))
    active = ((name, {t: partial(_stated, d) for t, d in by_time.items() if d.active}) for name, by_time in by_name.items())
    points = _spread([t for e in moving.grid.elements for t in e.points])
    found = [*filter(itemgetter(1), active), *((i.name, {t: partial(_alone, i, t) for t in points}) for i in integrands)]
    return found + [(name, {t: partial(tuple, parts) for t, parts in by_time.items()}) for name, by_time in laws]


def _alone(integrand, t):
    return (integrand.at(t),)


def _stated(data):
    """What a constraint or condition states, as it was written: to make an expression of it at every time would take longer."""
    if data.ctype is Complementarity:
        return [part for arg in getattr(data, '_args', None) or () for part in read_side(arg)]
    return (data.expr,)


def _spread(points):
    """At most about a dozen of many points, spread over all of them."""
    return points[:: max(1, len(points) // COMPARED)]


def differ(statements: list[Sequence]) -> bool:
    """Whether some expressions and relations differ from others where all variables have the same values."""
    by_length = defaultdict(list)
    for leaves in map(_leaves, statements):
        by_length[len(leaves)].append(leaves)
    # a factor of 1 or a term of 0 leaves an expression that is built otherwise
    pairs = ((first, other) for first, *others in by_length.values() for other in others)
    # most have the same numbers
    change = any(_unequal(a, b) for first, other in pairs if first != other for a, b in zip(first, other))
    if not change and len(by_length) == 1:
        return False
    bodies = list(map(_body, statements))
    compared = [numbers for numbers in (_at_trial(bodies, trial) for trial in TRIALS) if None not in numbers]
    return any(_unequal(numbers[0], number) for numbers in compared for number in numbers) if compared else change


def _unequal(a, b):
    return abs(a - b) > SAME * max(abs(a), abs(b))


def _leaves(stated):
    """The finite numbers in some expressions and relations, in their order."""
    found, waiting = [], list(stated)[::-1]
    while waiting:
        node = waiting.pop()
        if node.__class__ is VarData:
            # half of all nodes
            continue
        if node.__class__ not in native_types:
            if node.is_expression_type():
                waiting.extend(node.args[::-1])
                continue
            node = None if node.is_variable_type() else value(node, exception=False)
        if node.__class__ in NUMBERS and isfinite(node):
            found.append(node)
    return found


def _body(stated):
    """One expression whose value depends on all numbers in some expressions and relations."""
    parts = (part for expr in stated for part in (read_side(expr) if isinstance(expr, RelationalExpression) else (expr,)))
    return sum(k * part for k, part in enumerate((part for part in parts if part is not None), start=1))


def _at_trial(bodies, trial):
    return [_at_fixed_values(body, *trial) for body in bodies]


def _at_fixed_values(body, first, step):
    """Value where the k-th variable of the expression is first + step k; None where it is undefined."""
    variables = list(identify_variables(body, include_fixed=True)) if hasattr(body, 'is_expression_type') else []
    with kept_values(variables):
        for k, v in enumerate(variables):
            v.set_value(first + step * k, skip_validation=True)
        try:
            number = value(body, exception=False)
        except (ArithmeticError, ValueError):
            return None
        return number if isinstance(number, (int, float)) and isfinite(number) else None
