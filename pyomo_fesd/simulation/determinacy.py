"""A simulation needs zero degrees of freedom: find and name unknowns that no equation or condition determines."""

from bisect import bisect_left
from collections.abc import Sequence
from itertools import chain

import numpy as np
from pyomo.common.collections import ComponentSet
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
    if not states:
        return
    chosen = ComponentSet(states)
    others = [v for v in equations.unknown if v not in chosen]
    incidence, known = _incidence(equations, [*others, *states]), len(others)
    alone = structural_rank(incidence[:, :known])

    def undetermined(count):
        return alone + count - structural_rank(incidence[:, : known + count])

    if undetermined(len(states)):
        first = bisect_left(range(len(states) + 1), 1, key=undetermined) - 1
        free = _free_beside(incidence, known + first, others)
        raise FesdError(
            states[first],
            "simulate: this state is neither fixed at the first time nor determined by equations there" + _named(free),
            "fix its initial value" + (f", or '{free.name}'" if free is not None else ''),
        )


def _free_beside(incidence, state, others):
    """An unknown that only the equation of a state contains, so that this determines neither; None where there is none.

    ``state`` is the column of a state; those of ``others`` come first.
    """
    for row in incidence[:, [state]].nonzero()[0]:
        rest = incidence[np.delete(np.arange(incidence.shape[0]), row), : len(others)]
        counted = structural_rank(rest)
        for column in incidence[row, : len(others)].nonzero()[1]:
            if structural_rank(rest[:, np.delete(np.arange(len(others)), column)]) == counted:
                return others[column]
    return None


def _named(free):
    return "" if free is None else f", whose equation there also contains '{free.name}', which nothing else determines"


def _incidence(equations, unknown):
    """Incidence matrix of equations and conditions (rows) and unknowns (columns)."""
    columns = {id(v): j for j, v in enumerate(unknown)}
    determining = [(row,) for row in equations.all_rows if isinstance(row, EqualityExpression)]
    determining += map(read_complementarity, equations.conditions)
    rows = [sorted({columns[id(v)] for part in row for v in variables_that_count(part) if id(v) in columns}) for row in determining]
    ends = np.cumsum([0, *map(len, rows)])
    return csr_matrix((np.ones(ends[-1]), np.fromiter(chain(*rows), int, ends[-1]), ends), shape=(len(rows), len(columns)))
