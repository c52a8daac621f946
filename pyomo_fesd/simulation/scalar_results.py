"""Values of variables without time that follow from the solution, as an Integral or a final value does.

    J == integral of x**2,    worst == J + x[T]

Takes: a simulated model.
Leaves: values of the variables without time that one equation after the other determines; shares of elements before the times
    of ``at``.
Does not apply: to variables that equations over time contain, which are given; to variables that only several equations together
    determine.
"""

import logging

from pyomo.common.collections import ComponentSet
from pyomo.core import Block, Constraint
from pyomo.core.base.constraint import ConstraintData
from pyomo.core.expr.visitor import identify_variables
from pyomo.mpec import Complementarity
from pyomo.util.calc_var_value import calculate_variable_from_constraint

from pyomo_fesd.core import TimeIndex, is_generated, moving_grids, read_complementarity, variables_of

logger = logging.getLogger('pyomo_fesd')


def evaluate_scalars(model: Block, times: TimeIndex, equations: list[ConstraintData]) -> None:
    """Set the variables without time that the solution defines by timeless ``equations``."""
    for instant in moving_grids(model)[times.wrt].instants.values():
        instant.place()
    waiting = _without(ComponentSet(), {c: _open(c, times) for c in equations})
    if waiting:
        waiting = _without(_variables_over_time(model, times), waiting)
    while ready := next((c for c, free in waiting.items() if len(free) == 1), None):
        (v,) = waiting.pop(ready)
        _evaluate(v, ready)
        waiting = _without(ComponentSet([v]), waiting)


def _without(known, waiting):
    """The equations with the variables that are still open."""
    return {c: free - known for c, free in waiting.items() if free - known}


def _open(equation, times):
    free = identify_variables(equation.body, include_fixed=False)
    return ComponentSet(v for v in free if times.time(v) is None and not is_generated(v))


def _variables_over_time(model, times):
    """The variables of all equations and conditions over time."""
    over_time = (c for c in model.component_data_objects(Constraint, active=True, descend_into=Block) if times.time(c) is not None)
    conditions = model.component_data_objects(Complementarity, active=True, descend_into=Block)
    rows = [*(c.body for c in over_time), *(side for c in conditions for side in read_complementarity(c))]
    return ComponentSet(variables_of(rows))


def _evaluate(v, equation):
    try:
        calculate_variable_from_constraint(v, equation)
    except (ArithmeticError, ValueError, RuntimeError) as error:
        logger.warning("%s: its value was not found from '%s': %s", v.name, equation.name, ' '.join(str(error).split()))
