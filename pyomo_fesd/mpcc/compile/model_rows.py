"""All rows of an MPCC: the model's own, sides of pairs, decisions, penalty, gauges, as functions of its variables.

Takes: an ``Mpcc`` and the symbols of its parameters.
Leaves: ``ModelRows``, in the units of the model.
"""

from dataclasses import dataclass

import numpy as np

from pyomo_fesd.core import refuse_foreign
from pyomo_fesd.mpcc.compile.entries import auxiliary_block, read_entries
from pyomo_fesd.mpcc.compile.grouped_rows import grouped_rows
from pyomo_fesd.mpcc.compile.nonlinear_parts import Unsupported
from pyomo_fesd.mpcc.compile.round_off import without_round_off
from pyomo_fesd.mpcc.compile.row_functions import RowFunctions
from pyomo_fesd.mpcc.compile.row_reader import RowReader, readable
from pyomo_fesd.mpcc.compile.unreadable import unsupported


@dataclass(frozen=True)
class ModelRows:
    """The rows of an MPCC with n variables, m rows, q pairs.

    Attributes
    ----------
    variables : list of VarData (n)
    constraints : list of ConstraintData (m)
    lbg, ubg : arrays (m)
        constants of linear rows are part of their bounds, without round-off
    cancelling : array (m + 2q)
        sizes of the terms of fixed values that cancel in small constants of rows and sides, else 0
    conditions : list of Condition (q)
    side_of : int array (2q), equal numbers for equal sides
    plain : int array (2q)
        the variable that a side is, n + k for the parameter k, -1 for others
    splits : list, as in ``ModelValues``
    cost, rows, sides, others : RowFunctions of the variables and the parameters
        f and penalty; g; G, H and the decisions' equations; eta and gauges
    """

    variables: list
    constraints: list
    lbg: np.ndarray
    ubg: np.ndarray
    cancelling: np.ndarray
    conditions: list
    side_of: np.ndarray
    plain: np.ndarray
    splits: list
    cost: RowFunctions
    rows: RowFunctions
    sides: RowFunctions
    others: RowFunctions


def model_rows(problem, symbols, conditions: bool = False) -> ModelRows:
    """Read the rows of ``problem``; ``symbols`` stand for the parameters, ``conditions`` is whether ``Expr_if`` is accepted.

    Raises
    ------
    FesdError
        for expressions that cannot be evaluated, and for variables of another model
    Contradiction
        where fixed values alone violate a constraint
    """
    model, reader = problem.model, RowReader(conditions)
    try:
        with auxiliary_block(problem) as block, readable(model):
            objective = [] if problem.objective is None else reader.terms(_expression_of(problem, symbols))
            rows = reader.constraints(model)
            entries = read_entries(problem, symbols, reader, block)
            rows = sorted([*rows, *(reader.constraints(block) if block else ())], key=lambda row: not row.nonlinear)
            found = _functions(reader, objective, rows, entries, symbols.variables)
            refuse_foreign(found.variables, model.model(), model)
            return found
    except Unsupported:
        raise unsupported(model, symbols) from None


def _expression_of(problem, symbols):
    return symbols.substitute(problem.objective.expr)


def _functions(reader, objective, rows, entries, parameters):
    pairs = entries.distinct()
    G, H = ([side[k] for k in pairs] for side in (entries.G, entries.H))
    sides, others = [*G, *H], [*entries.eta, *entries.gauges]
    every = [*rows, *sides, *others, *entries.equal, *entries.penalty]
    variables = reader.variables(every, objective, [*parameters, *entries.plain.values()])
    fixed = {id(p) for p in parameters}
    free = [v for v in variables if id(v) not in fixed]
    column = {id(v): j for j, v in enumerate([*free, *parameters])}
    number = {row: k for k, row in enumerate(dict.fromkeys(sides))}
    lbg, ubg, of_rows = _bounds(rows)
    of_sides = _clean(sides)
    functions = [objective, entries.penalty], *([[row] for row in some] for some in (rows, [*sides, *entries.equal], others))
    return ModelRows(
        free,
        [row.source for row in rows],
        lbg,
        ubg,
        np.concatenate([of_rows, of_sides]),
        [entries.conditions[k] for k in pairs],
        np.array([number[row] for row in sides], dtype=int),
        np.array([column[id(entries.plain[row])] if row in entries.plain else -1 for row in sides], dtype=int),
        entries.splits,
        *(grouped_rows(some, column, len(free), reader.parts) for some in functions),
    )


def _bounds(rows):
    """Bounds of rows, to which the constants of linear ones move, and the sizes of terms that cancel in small constants."""
    moved = np.array([0.0 if row.nonlinear else row.constant for row in rows], dtype=float)
    for row in rows:
        row.constant = row.constant if row.nonlinear else 0.0
    low = np.array([-np.inf if row.lower is None else row.lower for row in rows], dtype=float) - moved
    high = np.array([np.inf if row.upper is None else row.upper for row in rows], dtype=float) - moved
    return without_round_off([row.source for row in rows], low, high)


def _clean(sides):
    """Remove round-off from the constants of linear sides; returns the sizes of terms that cancel in small ones."""
    found = [row for row in dict.fromkeys(sides) if row.linear and not row.nonlinear]
    low = np.array([-row.constant for row in found], dtype=float)
    constants, _, sizes = without_round_off(found, low, np.full(len(found), np.inf))
    for row, constant in zip(found, constants.tolist()):
        row.constant = -constant
    size = dict(zip(found, sizes.tolist()))
    return np.array([size.get(row, 0.0) for row in sides])
