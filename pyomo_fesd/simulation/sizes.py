"""Sizes of the quantities in a simulation, from the equations of a whole element.

Bodies at rest have values that are 0 to round-off, from which no size can be read; what their positions, velocities and forces
would be without contact forces is in the equations.  With the terms J_ik x_k and the constants b_i of the rows at the start, all
values of one quantity over time together,

* a quantity has its largest known value, or the larger of finite bounds;
* any other one has s_j = max_i max(b_i, max_k |J_ik| s_k)/|J_ij|, first by rows in which no other one is without a size;
* a known value far below the size that the others give to its quantity is no size.

Takes: the equations of an element, and values of its unknowns at the left boundary.
Leaves: factors, powers of 2; quantities keep the size that they have got first.
Does not apply: to the length of an element, and to what is between two finite bounds.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import isfinite, log2

from pyomo.core.base.var import VarData
from pyomo.core.expr.calculus.derivatives import Modes, differentiate
from pyomo.core.expr.visitor import identify_variables

from pyomo_fesd.core import TimeIndex, value_or_nan
from pyomo_fesd.simulation.element_equations import ElementEquations

#: Constants below this part of the terms of their row are round-off.
ROUND_OFF = 1e-12
#: A known value below this part of what the other sizes give is no size.
NEGLIGIBLE = 1e-9
#: How far the second point is away, relative; its parts of that are multiples of the golden ratio.
BESIDE, GOLDEN = 0.3, 0.6180339887498949
#: Sizes beyond these are none.
LEAST, MOST = 1e-30, 1e30


@dataclass(frozen=True)
class Row:
    """A linearised equation.

    Attributes
    ----------
    constant : float
        its size; 0 if it is round-off
    coefficients : dict quantity -> float
        the largest of each quantity, absolute
    """

    constant: float = 0.0
    coefficients: dict = field(default_factory=dict)

    def largest(self, sizes: dict) -> float:
        """Return the size of the largest term of those with a size."""
        known = (a * sizes[name] for name, a in self.coefficients.items() if name in sizes)
        return max([self.constant, *known])


class Sizes:
    """Sizes of quantities over time, by their names without the time."""

    def __init__(self, times: TimeIndex):
        self._times, self._sizes = times, {}

    def learn(self, equations: ElementEquations, values: Sequence[float]) -> None:
        """Find the sizes of the quantities in ``equations`` that have none yet; ``values`` are those of the unknowns."""
        given, known = dict(self._sizes), {}
        given |= {self._name(v): max(abs(v.lb), abs(v.ub)) for v in equations.unknown if _is_bounded(v)}
        for v in equations.known:
            sizes = given if self._times.time(v) is None else known
            name = self._name(v)
            sizes[name] = max(sizes.get(name, 0.0), abs(v.value or 0.0))
        rows = self._terms(equations, values)
        dynamic = _spread(rows, given)
        # beside what the equations say without it, a value that is round-off is no size
        known = {name: size for name, size in known.items() if size > NEGLIGIBLE * dynamic.get(name, 0.0)}
        found = _spread(rows, known | given)
        self._sizes = {name: size for name, size in found.items() if LEAST < size < MOST} | self._sizes

    def factor(self, v: VarData) -> float | None:
        """Return the factor by which a variable is of order one; None without a size."""
        size = None if _is_bounded(v) else self.size(v)
        if size is None:
            return None
        factor = 2.0 ** -round(log2(size))
        # a factor of 1 counts as none
        return 2.0 if factor == 1.0 else factor

    def size(self, v: VarData) -> float | None:
        """Return the size of a variable; None if it has none."""
        return self._sizes.get(self._name(v))

    def _name(self, v):
        label, name = self._times.split(v)
        return v.name if label is None else name

    def _terms(self, equations, values):
        """The ``Row`` of each equation, the larger of two points: the left boundary, and one beside it.

        At a single point terms may cancel, such as the directions of friction at equal weights.
        """
        variables = [*equations.unknown, *equations.known]
        before = [v.value for v in variables]
        try:
            for v, number in zip(equations.unknown, values):
                v.set_value(0.0 if number is None else number, skip_validation=True)
            here = [self._linearised(row) for row in equations.rows]
            for k, v in enumerate(variables, start=1):
                v.set_value(_beside(v, k * GOLDEN % 1), skip_validation=True)
            beside = [self._linearised(row) for row in equations.rows]
        finally:
            for v, number in zip(variables, before):
                v.set_value(number, skip_validation=True)
        return [_larger(one, other) for one, other in zip(here, beside)]

    def _linearised(self, row):
        """Without terms where the row has no value."""
        body = row.args[0] - sum(row.args[1:])
        variables = list(identify_variables(body, include_fixed=True))
        try:
            slopes = differentiate(body, wrt_list=variables, mode=Modes.reverse_numeric)
        except (ArithmeticError, ValueError, TypeError):
            return Row()
        here, terms, row = value_or_nan(body), [a * (v.value or 0.0) for a, v in zip(slopes, variables)], Row()
        if not all(map(isfinite, (here, *slopes))):
            return row
        for a, v in zip(slopes, variables):
            name = self._name(v)
            row.coefficients[name] = max(row.coefficients.get(name, 0.0), abs(a))
        constant = abs(here - sum(terms))
        return replace(row, constant=constant) if constant > ROUND_OFF * sum(map(abs, (here, *terms))) else row


def _beside(v, part):
    """A value beside that of a variable, within finite bounds."""
    return v.lb + part * (v.ub - v.lb) if _is_bounded(v) else (1 + BESIDE * part) * (v.value or 0.0)


def _larger(one, other):
    names = {**one.coefficients, **other.coefficients}
    larger = {name: max(some.coefficients.get(name, 0.0) for some in (one, other)) for name in names}
    return Row(max(one.constant, other.constant), larger)


def _is_bounded(v):
    return v.has_lb() and v.has_ub()


def _spread(rows, known):
    """Give a size to all quantities that rows relate to those with one."""
    sizes = {name: size for name, size in known.items() if size > 0}
    while True:
        new = _by_rows(rows, sizes, 1) or _by_rows(rows, sizes, None)
        if not new:
            return sizes
        sizes |= new


def _by_rows(rows, sizes, number):
    """Sizes of those without one, by the rows with this ``number`` of such, or by all."""
    found = {}
    for row in rows:
        open_ = [name for name, a in row.coefficients.items() if a > 0 and name not in sizes]
        largest = row.largest(sizes)
        for name in open_ if largest > 0 and number in (None, len(open_)) else ():
            found[name] = max(found.get(name, 0.0), largest / row.coefficients[name])
    return found
