"""Name the equations with the largest residuals in an element that cannot be solved.

Residuals are relative to the largest term of their equation, so that an energy balance in J/s and a flow in m3/s compare.

Leaves: the model's own values, put back.
Does not apply: to generated rows, which say nothing about the plant.
"""

from collections.abc import Sequence
from math import inf

from pyomo.core import Block, Constraint, value
from pyomo.core.expr.numeric_expr import SumExpression

from pyomo_fesd.core import Pair, TimeIndex, is_generated, kept_values, read_complementarity
from pyomo_fesd.simulation.element_equations import ElementEquations
from pyomo_fesd.solvers import user_names

#: Equations that a message names.
SHOWN = 3
#: An equation holds if its residual is below one of these: relative to its terms, and by itself.
RELATIVE, ABSOLUTE = 1e-6, 1e-8


def largest_residuals(model: Block, times: TimeIndex, equations: ElementEquations, values: Sequence[float]) -> str:
    """Return text that names the equations with the largest residuals at ``values`` of the unknowns; empty if all hold."""
    rows = _equations_of_user(model, times, set(equations.labels))
    with kept_values(equations.unknown):
        for v, number in zip(equations.unknown, values):
            v.set_value(float(number), skip_validation=True)
        found = [(*_residual(c), c) for c in rows] + [(*_distance(c), c) for c in equations.conditions]
    violated = [f for f in found if not (f[0] <= RELATIVE or f[1] <= ABSOLUTE)]
    if not violated:
        return ''
    shown = sorted(violated, key=lambda f: -f[0])[:SHOWN]
    block, names = shown[0][-1].parent_block(), user_names(model)
    where = '' if block.parent_block() is None or is_generated(block) else f" in {block.name}"
    named = ((names(c) if is_generated(c) else c.name, residual) for _, residual, c in shown)
    return f"largest residuals{where}: " + ', '.join(f"{name} ({residual:.2g})" for name, residual in named)


def _equations_of_user(model, times, labels):
    rows = model.component_data_objects(Constraint, active=True, descend_into=Block)
    return [c for c in rows if c.equality and times.time(c) in labels and not is_generated(c)]


def _residual(equation):
    """Relative and absolute residual of an equation; infinite where it has no value."""
    terms = equation.body.args if isinstance(equation.body, SumExpression) else [equation.body]
    numbers = [_number(term) for term in (*terms, equation.upper)]
    residual = abs(sum(numbers[:-1]) - numbers[-1])
    return residual / max(map(abs, numbers)) if residual else 0.0, residual


def _distance(condition):
    """Relative and absolute residual of a complementarity condition."""
    read = read_complementarity(condition)
    sides = [_number(side) for side in read if side is not None]
    if isinstance(read, Pair):
        distance = abs(min(sides))
    else:
        low, body, high, F = sides
        distance = abs(body - min(max(low, body - F), high))
    return distance / max(1.0, *map(abs, sides)), distance


def _number(expr):
    number = value(expr, exception=False)
    return inf if number is None or isinstance(number, complex) else number
