"""Pyomo's expressions as rows: a constant, linear terms, a nonlinear part.

Pyomo's NL writer splits expressions in this way before it writes them, and here its visitor does so without a file.

Takes: expressions of a model.
Leaves: rows, and which variables they contain.
"""

from contextlib import contextmanager
from dataclasses import dataclass, field

from pyomo.common.errors import InfeasibleConstraintException, InvalidValueError
from pyomo.common.numeric_types import native_numeric_types
from pyomo.core import Block, Constraint, SortComponents
from pyomo.core.expr import LinearExpression, NegationExpression, ProductExpression, SumExpression
from pyomo.repn.ampl import AMPLRepnVisitor, evaluate_ampl_nl_expression

from pyomo_fesd.core import withheld_messages
from pyomo_fesd.mpcc.compile.model_values import Contradiction
from pyomo_fesd.mpcc.compile.nonlinear_parts import NonlinearParts
from pyomo_fesd.mpcc.compile.unreadable import refuse_dropped_terms, without_value

#: A constraint without variables may miss its bounds by this much, as in Pyomo's NL writer.
TOLERANCE = 1e-8
#: Terms of a sum that its factor multiplies one by one: for each variable, casadi needs a pass over all of them otherwise.
MANY = 8


@dataclass(eq=False)
class Row:
    """``constant + linear terms + nonlinear part``.

    Attributes
    ----------
    constant : float
    linear : dict, coefficient by the id of its variable
    nonlinear : (template, ids) or None
    source : ConstraintData, or expression
    lower, upper : float or None
    """

    constant: float = 0.0
    linear: dict = field(default_factory=dict)
    nonlinear: tuple | None = None
    source: object = None
    lower: float | None = None
    upper: float | None = None

    @property
    def expr(self):
        """The expression of a row that is not a constraint."""
        return self.source

    def to_bounded_expression(self):
        """As of a constraint ``expr >= 0``."""
        return 0.0, self.source, None


class RowReader:
    """Reads expressions and keeps their variables.

    Attributes
    ----------
    parts : NonlinearParts
    """

    def __init__(self, conditions: bool = False):
        named, self._known, self._external = {}, {}, {}
        self._visitor = AMPLRepnVisitor(named, self._external, self._known, set(), False, True, SortComponents.unsorted)
        self.parts = NonlinearParts(named, conditions)

    def row(self, expr, factor=1) -> Row:
        """Return ``factor * expr`` as a row."""
        repn = self._visitor.walk_expression((expr, None, 0, factor))
        constant, nonlinear = repn.const, repn.nonlinear
        if nonlinear and not nonlinear[1]:
            constant, nonlinear = constant + evaluate_ampl_nl_expression(nonlinear[0], list(self._external.values())), None
        return Row(constant, repn.linear, nonlinear, expr)

    def terms(self, expr) -> list[Row]:
        """Return the terms of a sum as rows, so that those of equal form share their derivatives."""
        return [self.row(term, factor) for term, factor in _terms(expr)]

    def constraints(self, model) -> list[Row]:
        """Return the active constraints that have bounds and variables.

        Raises
        ------
        Contradiction
            for one without variables that is violated
        """
        found = []
        for con in model.component_data_objects(Constraint, active=True, descend_into=Block, sort=SortComponents.unsorted):
            lower, body, upper = con.to_bounded_expression(True)
            if lower is None and upper is None:
                continue
            row = self.row(body)
            row.source, row.lower, row.upper = con, lower, upper
            if row.nonlinear or row.linear:
                found.append(row)
            else:
                _check(row)
        return found

    def variables(self, rows, objective, others) -> list:
        """Return the variables of the rows, of the objective's terms and ``others``, nonlinear ones first, in the model's order."""
        by_rows, by_objective = (self.parts.variables(row.nonlinear for row in some if row.nonlinear) for some in (rows, objective))
        used = {k for row in (*rows, *objective) for k in row.linear} | by_rows | by_objective
        self._known.update({id(v): v for v in others})
        used.update(map(id, others))
        rank = {k: 0 for k in used} | dict.fromkeys(by_objective, -1) | dict.fromkeys(by_rows, -2)
        rank |= dict.fromkeys(by_rows & by_objective, -3)
        return sorted((v for k, v in self._known.items() if k in used), key=lambda v: rank[id(v)])


@contextmanager
def readable(model):
    """Within the body, expressions without a value and contradicting fixed values are errors that name a component.

    Raises
    ------
    FesdError
        for expressions of fixed values that have none, such as a division by zero, and for fixed values that are no number
    Contradiction
        where fixed values alone violate a constraint or a bound
    """
    with withheld_messages('pyomo') as messages:
        try:
            yield
        except InvalidValueError as error:
            raise without_value(model, str(error).split('generated by:')[-1]) from None
        except InfeasibleConstraintException as error:
            raise Contradiction(str(error)) from None
    refuse_dropped_terms(model, messages)


def _check(row):
    low, high, now = row.lower, row.upper, row.constant
    if (low is not None and low - now > TOLERANCE) or (high is not None and high - now < -TOLERANCE):
        raise Contradiction(
            f"model contains a trivially infeasible constraint '{row.source.name}' (fixed body value {now} outside bounds "
            f"[{low}, {high}])."
        )


def _terms(expr):
    """Terms of a sum, also of sums in it, and their factors."""
    waiting = [(expr, 1)]
    while waiting:
        term, factor = waiting.pop()
        kind = term.__class__
        if kind is SumExpression:
            waiting += [(a, factor) for a in reversed(term.args)]
        elif kind is NegationExpression:
            waiting.append((term.arg(0), -factor))
        elif kind is ProductExpression and term.arg(0).__class__ in native_numeric_types:
            waiting.append((term.arg(1), factor * term.arg(0)))
        elif kind is ProductExpression and (products := _products(*term.args)):
            waiting += [(product, factor) for product in reversed(products)]
        elif hasattr(term, 'is_named_expression_type') and term.is_named_expression_type():
            waiting.append((term.expr, factor))
        else:
            yield term, factor


def _products(one, other):
    """Terms of ``x[i] * sum(Q[i, j] * x[j] for j)``, a row of a quadratic form; none of other products."""
    if one.__class__ is LinearExpression:
        one, other = other, one
    if other.__class__ is not LinearExpression or other.nargs() < MANY or not _is_variable(one):
        return []
    return [one * term for term in other.args]


def _is_variable(expr):
    return expr.__class__ not in native_numeric_types and expr.is_variable_type()
