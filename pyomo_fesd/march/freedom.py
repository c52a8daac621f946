"""A system without freedom has an equation or a condition for every unknown; here one that has none is found and named."""

import numpy as np
from pyomo.core.expr import EqualityExpression
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import maximum_bipartite_matching

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
    columns = {id(v): j for j, v in enumerate(equations.timed)}
    determined = [(row,) for row in equations.rows if isinstance(row, EqualityExpression)] + equations.conditions
    places = [(i, columns[id(v)]) for i, row in enumerate(determined) for v in variables_of(row) if id(v) in columns]
    if not columns:
        return
    rows, ends = zip(*places) if places else ((), ())
    incidence = csr_matrix((np.ones(len(places)), (rows, ends)), shape=(len(determined), len(columns)))
    loose = [equations.timed[j] for j, i in enumerate(maximum_bipartite_matching(incidence, perm_type='row')) if i < 0]
    if loose:
        names = ', '.join(v.name for v in loose[:SHOWN]) + (', ...' if len(loose) > SHOWN else '')
        raise FesdError(
            loose[0],
            f"simulate: nothing determines {names}, or another variable in the same equations",
            "fix it, or name its Var in inputs if it is a control whose present values are meant",
        )
