"""Continue the laws of a mode outside of its region, where the blended equation evaluates them too (``reading/mode_domains.py``).

    E = e + 2 sum_k a_k m_k        m_k = 0 in the mode, m_k >= max(0, -c_k) outside:  n_k or p_k of eq. (5), lam_i / 2 of eq. (3)
    E = nu e + 1 - nu              with hysteresis, where nu is 1 or 0

So E = e inside, and E >= 0 outside.  A law of e becomes a variable y with an equation that has no domain and no infinite slope:

    y = sqrt(e):  y**2 = E, y >= 0      y = e**(a/b):  z**b = E, z >= 0, y = z**a      y = log(e):  exp(y) = E      ...

It is exact: nothing is smoothed.  A domain with two ends, as of asin, takes e / (1 + 2 sum_k a_k m_k), which stays between them.

Takes: right-hand sides, and what ``DomainReader`` read in them.
Leaves: ``law`` and ``law_equation`` on the block of the form, by index and number; ``shortfall`` where the form has no m_k.
Does not apply: where the region does not imply that a law is defined; it stays as it is.
"""

from fractions import Fraction
from math import pi, prod

from pyomo.core import Block, Constraint, Set, Var
from pyomo.core.expr import cos, cosh, exp, sin, tanh
from pyomo.core.expr.numeric_expr import DivisionExpression

from pyomo_fesd.core import add_positive_part, declare_positive_part, exchanged, value_or_nan, without_unit
from pyomo_fesd.dcs.forms import hysteresis
from pyomo_fesd.dcs.reading import arguments_of, factors_of

#: y of a function: the inverse function, and the bounds of y.
INVERSES = {
    'sqrt': (lambda y: y**2, (0, None)),
    'log': (exp, (None, None)),
    'log10': (lambda y: 10**y, (None, None)),
    'acosh': (cosh, (0, None)),
    'asin': (sin, (-pi / 2, pi / 2)),
    'acos': (cos, (0, pi)),
    'atanh': (tanh, (None, None)),
}
#: Exponents are fractions if their denominators are at most the first number, to within the second.
LARGEST_DENOMINATOR, EXACT = 4, 1e-12


class Continuation:
    """Writes the laws of one Disjunction at one time.

    Parameters
    ----------
    block : BlockData
        of the form
    sets : tuple
        index sets of its components
    index : tuple
    system : ModeSystem or HysteresisSystem
    form : module of ``forms``
    """

    def __init__(self, block, sets, index, system, form):
        self._block, self._sets, self._index, self._system, self._form = block, sets, index, system, form
        self._written = 0

    def law(self, mode: int, expression, domains: tuple):
        """Return an ``expression`` of a ``mode``, by number, with restricted functions continued as ``domains`` say."""
        if not any(domains):
            return expression
        laws = {}
        for (node, kind, argument), sides in zip(arguments_of(expression), domains):
            if sides:
                inside = self._inside(mode, argument, sides, laws)
                laws[id(node)] = self._write(kind, node, [_replaced(e, laws) for e in node.args], *inside)
        return _replaced(expression, laws)

    def side(self, mode: int, expression, side):
        """Return an ``expression`` of a ``mode`` that the region keeps at one sign, kept at it outside too."""
        return self._inside(mode, expression, (side,), {})[0]

    def _inside(self, mode, argument, sides, laws):
        """(E, f) such that E / f is the argument inside the region, and in the domain outside."""
        e, only = _replaced(argument, laws), sides[0]
        if len(sides) > 1:
            if self._form is hysteresis:
                return self._weight(mode) * e, 1.0
            return e, 1.0 + 2 * sum(self._shortfall(mode, side.factors) for side in sides)
        if only.position is None:
            return only.sign * (self._continued(mode, only.sign * e + only.offset, only.factors) - only.offset), 1.0
        parts = [_replaced(part, laws) for part in factors_of(argument)]
        parts[only.position] = only.sign * self._continued(mode, only.sign * parts[only.position], only.factors)
        return prod(parts), 1.0

    def _continued(self, mode, e, factors):
        if self._form is hysteresis:
            weight = self._weight(mode)
            return weight * e + (1 - weight)
        return e + 2 * self._shortfall(mode, factors)

    def _weight(self, mode):
        return self._form.weight(self._block, self._index, self._system, [mode])

    def _shortfall(self, mode, factors):
        return sum(a * self._missing(mode, k) for k, a in factors)

    def _missing(self, mode, k):
        """m_k: of the form if it has one, or else max(0, -c_k) of its own."""
        known = self._form.shortfall(self._block, self._index, self._system, mode, k)
        if known is not None:
            return known
        c, sign = without_unit(self._system.regions.functions[k]), self._system.regions.geometry.signs[mode][k]
        if self._block.component('shortfall') is None:
            self._block.shortfall = Block()
            self._block.shortfall.functions = Set(dimen=1)
            declare_positive_part(self._block.shortfall, *self._sets, self._block.shortfall.functions)
        part, key = self._block.shortfall, (*self._index, k + 1)
        part.functions.add(k + 1)
        s = part.s[key] if key in part.complementarity else add_positive_part(part, key, -c)
        return s if sign > 0 else s + c

    def _write(self, kind, node, args, E, factor):
        """The value of a restricted function of E / factor."""
        if kind == 'reciprocal':
            y = self._new((None, None), 1 / E, lambda y: y * E == factor)
            return args[0] * y if isinstance(node, DivisionExpression) else y ** -args[1]
        if kind == 'power':
            return self._power(E, args[1])
        inverse, bounds = INVERSES[kind]
        return self._new(bounds, node.create_node_with_local_data((E / factor,)), lambda y: inverse(y) * factor == E)

    def _power(self, E, exponent):
        """E**exponent, by an equation with exponents that are whole or larger than 1."""
        fixed = exponent.__class__ in (int, float)
        whole = Fraction(exponent).limit_denominator(LARGEST_DENOMINATOR) if fixed else Fraction(1, 2)
        if fixed and abs(whole - exponent) <= EXACT and whole.denominator > 1:
            numerator, root = whole.numerator, whole.denominator
        elif fixed and abs(exponent) < 1:
            numerator, root = (1 if exponent > 0 else -1), 1 / abs(exponent)
        else:
            numerator, root = 2 * exponent, 2
        z = self._new((0, None), E ** (1 / root), lambda z: z**root == E)
        return z if numerator.__class__ is int and numerator == 1 else z**numerator

    def _new(self, bounds, start, equation):
        """A variable with an equation, from which it is determined; it starts at the value of ``start``."""
        block = self._block
        if block.component('law') is None:
            block.laws = Set(dimen=1)
            block.law = Var(*self._sets, block.laws, dense=False)
            block.law_equation = Constraint(*self._sets, block.laws)
        self._written += 1
        block.laws.add(self._written)
        y = block.law[(*self._index, self._written)]
        y.setlb(bounds[0])
        y.setub(bounds[1])
        now = value_or_nan(start)
        y.value = now if abs(now) < 1e10 else 1.0
        block.law_equation.add((*self._index, self._written), equation(y))
        return y


def _replaced(expression, laws):
    return exchanged(expression, laws) if laws and hasattr(expression, 'is_expression_type') else expression
