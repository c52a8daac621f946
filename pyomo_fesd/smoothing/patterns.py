"""Recognise absolute values, exact or smoothed, and places where smoothing protects rather than approximates.

    |z|,   sqrt(z**2 + c),   (z**2 + c)**0.5,   z*z for z**2      with a constant c = eps**2 >= 0

IDAES' smooth_abs has the third form, and with it smooth_max, smooth_min and smooth_bound.

Takes: one node of an expression.
Leaves: ``Match(z, eps)``, or None.
Does not apply: to a square with a factor, to several squares (a norm), or where c depends on a variable that is not fixed.
"""

from math import sqrt
from typing import NamedTuple

from pyomo.common.numeric_types import native_numeric_types
from pyomo.core.expr import numeric_expr as ne

from pyomo_fesd.core import component_key, value_or_nan


class Match(NamedTuple):
    """|z|, smoothed with ``eps`` (0: not smoothed)."""

    z: object
    eps: float


def match(node) -> Match | None:
    """Return the argument of the absolute value ``node`` with its smoothing; None for other nodes."""
    rule = RULES.get(node.__class__)
    return None if rule is None else rule(node)


def _absolute(node):
    return Match(node.arg(0), 0.0)


def _square_root(node):
    return _root(node.arg(0)) if node.getname() == 'sqrt' else None


def _power(node):
    base, exponent = node.args
    return _root(base) if _is_number(exponent) and exponent == 0.5 else None


#: Expression type -> function from a node to its Match or None.
RULES = {ne.AbsExpression: _absolute, ne.UnaryFunctionExpression: _square_root, ne.PowExpression: _power}


def _root(base):
    """``sqrt(base)`` with base = z**2 + constants."""
    terms = base.args if isinstance(base, ne.SumExpression) else [base]
    varying = _varying(terms)
    z = _squared(varying[0]) if len(varying) == 1 else None
    if z is None:
        return None
    c = value_or_nan(sum(t for t in terms if t is not varying[0]))
    return Match(z, sqrt(c)) if c >= 0 else None


def _varying(terms):
    """The terms that contain variables; of several only those that are not fixed, since eps may be a fixed variable."""
    varying = [t for t in terms if not _is_number(t) and t.is_potentially_variable()]
    return varying if len(varying) < 2 else [t for t in varying if not t.is_fixed()]


def _squared(term):
    """z where ``term`` is z**2 or z*z; None otherwise."""
    if isinstance(term, ne.PowExpression) and _is_number(term.arg(1)) and term.arg(1) == 2:
        return term.arg(0)
    if isinstance(term, ne.ProductExpression) and component_key(term.arg(0)) == component_key(term.arg(1)):
        return term.arg(0)
    return None


def _is_number(e):
    return e.__class__ in native_numeric_types


#: Functions that need a positive argument, or have an infinite slope at 0.
GUARDED_FUNCTIONS = ('sqrt', 'log', 'log10')


def guards(node, position: int) -> bool:
    """Whether ``node`` needs its argument at ``position`` away from 0.

    So do roots, logarithms, denominators and powers other than 1, 2, 3, ...
    """
    if isinstance(node, ne.UnaryFunctionExpression):
        return node.getname() in GUARDED_FUNCTIONS
    if isinstance(node, ne.DivisionExpression):
        return position == 1
    if isinstance(node, ne.PowExpression) and position == 0:
        exponent = node.arg(1)
        return not (_is_number(exponent) and exponent >= 0 and exponent == int(exponent))
    return False
