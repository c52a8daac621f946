"""A system without freedom has an equation or a condition for every unknown; here one that has none is found and named."""

import numpy as np
from pyomo.core.expr import EqualityExpression
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import maximum_bipartite_matching, structural_rank

from pyomo_fesd.complementarity import read
from pyomo_fesd.errors import FesdError
from pyomo_fesd.march.equations import variables_of

#: Names that an error lists.
SHOWN = 3


def refuse_freedom(equations):
    """Refuse unknowns of one element that nothing determines.

    Raises
    ------
    FesdError
        naming variables that no equation or condition is left for (a largest matching); the choice among those that stand in
        the same equations is arbitrary
    """
    unknown = equations.timed
    matched = maximum_bipartite_matching(_incidence(equations, unknown), perm_type='row') if unknown else ()
    loose = [unknown[j] for j, i in enumerate(matched) if i < 0]
    if loose:
        names = ', '.join(v.name for v in loose[:SHOWN]) + (', ...' if len(loose) > SHOWN else '')
        raise FesdError(
            loose[0],
            f"simulate: nothing determines {names}, or another variable in the same equations",
            "fix it, or name its Var in inputs if it is a control whose present values are meant",
        )


def refuse_free_start(equations, states):
    """Refuse states that are not fixed at the first time and that the equations there do not determine.

    Parameters
    ----------
    equations : Equations
        of the first time
    states : list of VarData
        that are not fixed there
    """
    others = [v for v in equations.unknown if not any(v is x for x in states)]
    for k, state in enumerate(states, start=1):
        ranks = [structural_rank(_incidence(equations, known)) for known in (others, [*others, *states[:k]])]
        if ranks[1] - ranks[0] < k:
            raise FesdError(
                state,
                "simulate: this state is neither fixed at the first time nor determined by equations there",
                "fix its initial value",
            )


def _incidence(equations, unknown):
    """Which unknowns stand in which equation or condition."""
    columns = {id(v): j for j, v in enumerate(unknown)}
    determining = [(row,) for row in equations.all_rows if isinstance(row, EqualityExpression)]
    determining += map(read, equations.conditions)
    places = [(i, columns[id(v)]) for i, row in enumerate(determining) for v in variables_of(row) if id(v) in columns]
    rows, ends = zip(*places) if places else ((), ())
    return csr_matrix((np.ones(len(places)), (rows, ends)), shape=(len(determining), len(columns)))
