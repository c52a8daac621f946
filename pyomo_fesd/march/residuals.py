"""What does not hold where a march cannot go on: the equations of the element that are missed most, by name.

A residual counts relative to the largest term of its equation, so that an energy balance in J/s and a flow in m3/s compare.

Takes: the element's ``Equations`` and the values that the last attempt had for the unknowns.
Leaves: nothing; the model's own values are put back.
Does not apply: to what the package generated, which says nothing of the plant.
"""

from contextlib import contextmanager

from pyomo.core import Block, Constraint, value
from pyomo.core.expr.numeric_expr import SumExpression

from pyomo_fesd import marks
from pyomo_fesd.complementarity import read

#: How many a message names.
SHOWN = 3
#: A residual relative to its terms, and one by itself, that is none.
NONE, NOTHING = 1e-6, 1e-8


def largest_residuals(model, times, equations, values):
    """A sentence that names the block and the equations that are missed most; empty if all of them hold.

    Parameters
    ----------
    times : TimeIndex
    equations : Equations
    values : array
        of their unknowns
    """
    labels = set(equations.labels)
    rows = model.component_data_objects(Constraint, active=True, descend_into=Block)
    rows = [c for c in rows if c.equality and times.time(c) in labels and not marks.is_generated(c)]
    with _with_values(equations.unknown, values):
        missed = [(*_residual(c), c) for c in rows] + [(*_distance(c), c) for c in equations.conditions]
    missed = sorted((m for m in missed if not (m[0] <= NONE or m[1] <= NOTHING)), key=lambda m: -m[0])[:SHOWN]
    if not missed:
        return ''
    home = missed[0][-1].parent_block()
    place = '' if home.parent_block() is None else f" in {home.name}"
    return f"largest residuals{place}: " + ', '.join(f"{c.name} ({residual:.2g})" for _, residual, c in missed)


@contextmanager
def _with_values(variables, values):
    kept = [(v, v.value, v.stale) for v in variables]
    try:
        for v, number in zip(variables, values):
            v.set_value(float(number), skip_validation=True)
        yield
    finally:
        for v, number, stale in kept:
            v.set_value(number, skip_validation=True)
            v.stale = stale


def _residual(equation):
    """Relative and absolute residual of an equation; infinite where it has no value."""
    terms = equation.body.args if isinstance(equation.body, SumExpression) else [equation.body]
    numbers = [_number(term) for term in (*terms, equation.upper)]
    residual = abs(sum(numbers[:-1]) - numbers[-1])
    return residual / max(map(abs, numbers)) if residual else 0.0, residual


def _distance(condition):
    """The same of a condition 0 <= G perp H >= 0, or one between two bounds."""
    sides = [_number(side) for side in read(condition) if side is not None]
    if len(sides) == 2:
        distance = abs(min(sides))
    else:
        low, body, high, F = sides
        distance = abs(body - min(max(low, body - F), high))
    return distance / max(1.0, *map(abs, sides)), distance


def _number(expr):
    number = value(expr, exception=False)
    return float('inf') if number is None or isinstance(number, complex) else number
