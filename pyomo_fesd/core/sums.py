"""Sums and products of expressions, equal to those of Pyomo's operators, in less time.

Pyomo takes long to leave out the 0 and the 1 that ``sum`` and ``prod`` begin with, and to choose the class of each term.
"""

from collections.abc import Sequence
from math import prod

from pyomo.core.base.var import VarData
from pyomo.core.expr import LinearExpression, MonomialTermExpression


def sum_of(terms: Sequence):
    """Return the sum of ``terms``, 0 without any."""
    if len(terms) > 1 and all(x.__class__ is VarData for x in terms):
        return LinearExpression(list(terms))
    return sum(terms[1:], terms[0]) if terms else 0


def product_of(factors: Sequence):
    """Return the product of ``factors``, 1 without any."""
    return prod(factors[1:], start=factors[0]) if factors else 1


def weighted_sum(terms: Sequence):
    """Return the sum of pairs of a number and a variable or expression, 0 without any."""
    if len(terms) > 1 and all(x.__class__ is VarData and weight not in (0, 1) for weight, x in terms):
        return LinearExpression(list(map(MonomialTermExpression, terms)))
    return sum_of([weight * x for weight, x in terms])
