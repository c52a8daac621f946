"""What is read as an absolute value, and where smoothing protects rather than approximates.

    |z|,   sqrt(z**2 + c),   (z**2 + c)**0.5,   z*z for z**2      with a constant c = eps**2 >= 0

IDAES' smooth_abs, and with it smooth_max, smooth_min and smooth_bound, are the third form.

Takes: one node of an expression.
Leaves: ``Match(z, eps)``, or None.
Does not apply: to a square with a factor, to several squares (a norm), or where c depends on a variable that is not fixed.
"""

from math import sqrt
from typing import NamedTuple

from pyomo.common.numeric_types import native_numeric_types
from pyomo.core import value
from pyomo.core.expr import numeric_expr as ne

from pyomo_fesd.kinks.terms import structure


class Match(NamedTuple):
    """|z|, smoothed with ``eps`` (0: not smoothed)."""

    z: object
    eps: float


def match(node):
    """What ``node`` is the absolute value of; None if it is something else."""
    rule = RULES.get(node.__class__)
    return None if rule is None else rule(node)


def _absolute(node):
    return Match(node.arg(0), 0.0)


def _square_root(node):
    return _root(node.arg(0)) if node.getname() == 'sqrt' else None


def _power(node):
    base, exponent = node.args
    return _root(base) if _is_number(exponent) and exponent == 0.5 else None


#: Expression type -> how to read it.
RULES = {ne.AbsExpression: _absolute, ne.UnaryFunctionExpression: _square_root, ne.PowExpression: _power}


def _root(base):
    """``sqrt(base)`` with base = z**2 + constants."""
    terms = base.args if isinstance(base, ne.SumExpression) else [base]
    moving = [t for t in terms if not _is_number(t) and t.is_potentially_variable()]
    if len(moving) > 1:  # eps may be a fixed variable; z may be one too, at the first time
        moving = [t for t in moving if not t.is_fixed()]
    z = _squared(moving[0]) if len(moving) == 1 else None
    if z is None:
        return None
    c = value(sum(t for t in terms if t is not moving[0]), exception=False)
    return Match(z, sqrt(c)) if c is not None and c >= 0 else None


def _squared(term):
    """z where ``term`` is z**2 or z*z; None otherwise."""
    if isinstance(term, ne.PowExpression) and _is_number(term.arg(1)) and term.arg(1) == 2:
        return term.arg(0)
    if isinstance(term, ne.ProductExpression) and structure(term.arg(0)) == structure(term.arg(1)):
        return term.arg(0)
    return None


def _is_number(e):
    return e.__class__ in native_numeric_types


#: Functions that need a positive argument, or have an infinite slope at 0.
GUARDED_FUNCTIONS = ('sqrt', 'log', 'log10')


def guards(node, position):
    """Whether ``node`` needs its argument at ``position`` away from 0: roots, logarithms, denominators, powers but 1, 2, 3, ..."""
    if isinstance(node, ne.UnaryFunctionExpression):
        return node.getname() in GUARDED_FUNCTIONS
    if isinstance(node, ne.DivisionExpression):
        return position == 1
    if isinstance(node, ne.PowExpression) and position == 0:
        exponent = node.arg(1)
        return not (_is_number(exponent) and exponent >= 0 and exponent == int(exponent))
    return False
