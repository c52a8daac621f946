"""Numeric gradients of many expressions: those that are built alike are derived once and evaluated together.

Takes: expressions.
Leaves: nothing.
"""

from collections import defaultdict
from collections.abc import Iterable

import numpy as np

from pyomo_fesd.core.gradient import gradient, slopes_by_casadi
from pyomo_fesd.core.structural_key import StructuralKey, exactly

#: Expressions of equal form from which a function of their own pays.
ALIKE = 8


def gradients(expressions: Iterable) -> list[tuple[list, list[float]]]:
    """Return for each expression its variables, fixed ones too, and its derivatives by them as ``gradient`` gives them."""
    expressions = list(expressions)
    alike, found = defaultdict(list), [([], [])] * len(expressions)
    for i, expression in enumerate(expressions):
        form, variables = _form(expression)
        if variables:
            alike[form].append((i, variables))
    for instances in alike.values():
        numbers, variables = zip(*instances)
        some = [expressions[i] for i in numbers]
        slopes = _together(some, variables) if len(some) >= ALIKE else map(gradient, some, variables)
        for i, own, of_own in zip(numbers, variables, slopes):
            found[i] = own, of_own
    return found


def _together(expressions, variables):
    """The gradients of expressions of equal form."""
    try:
        function = slopes_by_casadi(expressions[0], variables[0])
    except NotImplementedError:
        return map(gradient, expressions, variables)
    values = np.array([[np.nan if v.value is None else v.value for v in own] for own in variables], dtype=float)
    return function(values.T).full().T.tolist()


def _form(expression):
    """A key that is equal for expressions that differ in their variables only, and the variables."""
    key = StructuralKey()
    key.append(expression, exactly)
    return tuple(key.tokens), key.variables
