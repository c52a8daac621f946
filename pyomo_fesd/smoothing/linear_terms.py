"""Linear combinations with like terms collected: (a + b + |a - b|)/2 becomes b + s, with each of a, b and s once.

Exact but for rounding: only numbers are multiplied and added; a nonlinear part is one term, compared by its ``component_key``.
"""

from pyomo.common.numeric_types import native_types
from pyomo.core.expr import numeric_expr as ne

from pyomo_fesd.core import component_key


def _sum(args):
    return [(1, a) for a in args]


def _negation(args):
    return [(-1, args[0])]


def _product(args):
    a, b = args
    if b.__class__ in native_types:
        a, b = b, a
    if a.__class__ in native_types:
        return [(a, b)]
    for multiple, other in ((a, b), (b, a)):
        factor, rest = _factor(multiple)
        if factor != 1:
            return [(factor, rest * other)]
    return None


def _quotient(args):
    a, b = args
    if b.__class__ in native_types:
        return [(1 / b, a)]
    factor, rest = (a, 1) if a.__class__ in native_types else _factor(a)
    return [(factor, rest / b)] if factor != 1 else None


def _factor(e):
    """Number and rest of a multiple, 1 and ``e`` of other expressions: Pyomo writes x - p*y as x + (-p)*y."""
    parts = linear_parts(e)
    return parts[0] if parts and len(parts) == 1 else (1, e)


#: Expression type -> function from its arguments to ``[(number, argument)]``, None if the expression is not linear in them.
LINEAR = {
    ne.SumExpression: _sum,
    ne.LinearExpression: _sum,
    ne.NPV_SumExpression: _sum,
    ne.NegationExpression: _negation,
    ne.NPV_NegationExpression: _negation,
    ne.ProductExpression: _product,
    ne.MonomialTermExpression: _product,
    ne.NPV_ProductExpression: _product,
    ne.DivisionExpression: _quotient,
    ne.NPV_DivisionExpression: _quotient,
}


def linear_parts(e) -> list | None:
    """``[(number, expression)]`` of which ``e`` is the sum; None if it is neither sum nor multiple."""
    rule = LINEAR.get(e.__class__)
    return None if rule is None else rule(e.args)


class LinearCombination:
    """``sum_i c_i e_i + constant`` with numbers c_i."""

    def __init__(self, expr=0, factor=1):
        self.constant = 0
        self._terms = {}  # key of e_i -> (c_i, e_i)
        self.add(expr, factor)

    def add(self, expr, factor=1):
        """Add ``factor * expr`` (an expression, a number or a LinearCombination) and return self."""
        waiting = [(factor, expr)]
        while waiting:
            c, e = waiting.pop()
            parts = e.parts() if e.__class__ is LinearCombination else linear_parts(e)
            if parts is not None:
                waiting.extend((c * f, a) for f, a in reversed(parts))
            elif e.__class__ in native_types:
                self.constant += c * e
            else:
                self._add_term(c, e)
        return self

    def _add_term(self, c, e):
        key = component_key(e)
        before, _ = self._terms.get(key, (0, e))
        self._terms[key] = (before + c, e)
        if not before + c:
            del self._terms[key]

    def parts(self) -> list:
        """``[(c_i, e_i)]``, the constant last."""
        return [*self._terms.values(), *([(self.constant, 1)] if self.constant else [])]

    def key(self, sign=1) -> tuple:
        """A key that is equal for equal combinations; with ``sign`` -1 the key of the negative one."""
        return frozenset((k, sign * c) for k, (c, _) in self._terms.items()), sign * self.constant

    def expression(self):
        """The combination as a Pyomo expression, or a number."""
        return sum(c * e for c, e in self.parts())
