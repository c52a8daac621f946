"""A simulation needs zero degrees of freedom: find and name unknowns that no equation or condition determines."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from pyomo.core.base.var import VarData
from pyomo.core.expr import EqualityExpression
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import maximum_bipartite_matching, structural_rank

from pyomo_fesd.core import FesdError, read_complementarity, variables_that_count
from pyomo_fesd.simulation.element_equations import ElementEquations

#: Names that an error lists.
SHOWN = 3


def refuse_undetermined(equations: ElementEquations) -> None:
    """Refuse unknowns of one element that nothing determines.

    Raises
    ------
    FesdError
        naming variables that a maximum matching leaves without an equation or condition; the choice among variables of the
        same equations is arbitrary
    """
    unknown = equations.collocated
    matched = maximum_bipartite_matching(_incidence(equations, unknown), perm_type='row') if unknown else ()
    free = [unknown[j] for j, i in enumerate(matched) if i < 0]
    if free:
        names = ', '.join(v.name for v in free[:SHOWN]) + (', ...' if len(free) > SHOWN else '')
        raise FesdError(
            free[0],
            f"simulate: nothing determines {names}, or another variable in the same equations",
            "fix it, or name its Var in inputs if it is a control whose present values are meant",
        )


def refuse_undetermined_start(equations: ElementEquations, states: Sequence[VarData]) -> None:
    """Refuse ``states`` that are neither fixed at the first time nor determined by the ``equations`` there."""
    others = [v for v in equations.unknown if not any(v is x for x in states)]
    for k, state in enumerate(states, start=1):
        ranks = [structural_rank(_incidence(equations, unknown)) for unknown in (others, [*others, *states[:k]])]
        if ranks[1] - ranks[0] < k:
            free = _free_beside(equations, state, others)
            raise FesdError(
                state,
                "simulate: this state is neither fixed at the first time nor determined by equations there" + _named(free),
                "fix its initial value" + (f", or '{free.name}'" if free is not None else ''),
            )


def _free_beside(equations, state, others):
    """An unknown that only the equation of a state contains, so that this determines neither; None where there is none."""
    for row in equations.all_rows:
        inside = list(variables_that_count(row))
        if any(v is state for v in inside):
            rest = replace(equations, rows=[other for other in equations.rows if other is not row])
            counted = structural_rank(_incidence(rest, others))
            for v in inside:
                without = [u for u in others if u is not v]
                if len(without) < len(others) and structural_rank(_incidence(rest, without)) == counted:
                    return v
    return None


def _named(free):
    return "" if free is None else f", whose equation there also contains '{free.name}', which nothing else determines"


def _incidence(equations, unknown):
    """Incidence matrix of equations and conditions (rows) and unknowns (columns)."""
    columns = {id(v): j for j, v in enumerate(unknown)}
    determining = [(row,) for row in equations.all_rows if isinstance(row, EqualityExpression)]
    determining += map(read_complementarity, equations.conditions)
    entries = [
        (i, columns[id(v)])
        for i, row in enumerate(determining)
        for part in row
        for v in variables_that_count(part)
        if id(v) in columns
    ]
    rows, where = zip(*entries) if entries else ((), ())
    return csr_matrix((np.ones(len(entries)), (rows, where)), shape=(len(determining), len(columns)))
