"""The quantities whose derivatives are asked for: expressions with a name."""

from collections.abc import Mapping

import numpy as np
from pyomo.core import Objective
from pyomo.core.expr.calculus.diff_with_pyomo import reverse_ad
from pyomo.core.expr.visitor import identify_variables

from pyomo_fesd.core import FesdError, moving_grids
from pyomo_fesd.results import Switch, labelled_switches


def read_outputs(model, outputs) -> dict:
    """Return ``{name: expression}`` of outputs: components (indexed or not), expressions, ``Switch``es, or a dictionary of these.

    Raises
    ------
    FesdError
        for an entry that is none of these, and for a Switch that is not one of the model's present switches
    """
    if isinstance(outputs, Mapping):
        return {str(name): _expression(model, output) for name, output in outputs.items()}
    entries = outputs if isinstance(outputs, (list, tuple)) and not isinstance(outputs, Switch) else [outputs]
    found = {}
    for entry in entries:
        datas = entry.values() if getattr(entry, 'is_indexed', bool)() else (entry,)
        found.update((_name(data), _expression(model, data)) for data in datas)
    return found


def _name(data):
    return str(data) if isinstance(data, Switch) else getattr(data, 'name', None) or str(data)


def _expression(model, output):
    """The expression of one output."""
    if isinstance(output, Switch):
        return _time_of(model, output)
    if getattr(output, 'ctype', None) is Objective:
        return output.expr
    if not hasattr(output, 'is_expression_type'):
        raise FesdError(str(output), "not an output: neither a Var, an expression, an objective nor a Switch", "give one of these")
    return output


def _time_of(model, switch):
    """The time of a switch as an expression of element lengths."""
    for wrt, moving in moving_grids(model).items():
        label = next((label for label, other in labelled_switches(model, wrt) if other == switch), None)
        if label is not None:
            return moving.time_expression(label)
    raise FesdError(str(switch), "not one of the model's present switches", "call switches(model) again after each solve")


def gradients(outputs, c, parameters):
    """Gradients of outputs by the scaled variables (k, n) and by parameters (k, l).

    Raises
    ------
    FesdError
        for a variable that no active constraint contains
    """
    column = {id(v): j for j, v in enumerate(c.variables)}
    given = {id(p) for p in parameters}
    by_w, by_p = np.zeros((len(outputs), len(column))), np.zeros((len(outputs), len(parameters)))
    for i, expr in enumerate(outputs.values()):
        if not hasattr(expr, 'is_expression_type'):
            continue
        slopes = reverse_ad(expr)
        for v in identify_variables(expr, include_fixed=False):
            if id(v) in column:
                by_w[i, column[id(v)]] = slopes[v] / c.scale.x[column[id(v)]]
            elif id(v) not in given:
                raise FesdError(v, "no active constraint contains this variable, so nothing determines it", "leave it out")
        by_p[i] = [slopes.get(p, 0.0) for p in parameters]
    return by_w, by_p
