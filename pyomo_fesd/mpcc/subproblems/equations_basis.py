"""A basis in which as many equations of a linear program as possible determine a column each.

Without a basis the dual simplex method makes a pivot for each equation first: of a collocated model that is nearly one for each
column, and most of the time of a program whose optimum is d = 0.  A matching of equations and columns names these pivots at once.
HiGHS repairs a basis that is singular, and began without one in some programs.

Takes: an equilibrated program.
Leaves: a basis, feasible or not: all columns have bounds, so that each basis is dual feasible with some of them.
"""

import highspy
import numpy as np
from scipy.sparse.csgraph import maximum_bipartite_matching

#: An equation may leave its sides so far apart: residuals of round-off make it an interval.
EQUATION = 1e-9
#: Smaller entries of a row, which reaches 1, are no pivots.  (109 programs of discs, carts, a ball and hoppers took 33,000 pivots
#: with this, 49,000 with 0.01, 42,000 with 0.3; without a basis, and with HiGHS' scaling, 350,000.)
PIVOT = 0.1


def equations_basis(program, high) -> highspy.HighsBasis:
    """Return a basis of the equilibrated ``program`` with the upper bounds ``high`` of its rows."""
    rows, columns = _matched(program, np.flatnonzero(high - program.low <= EQUATION))
    status, basis = highspy.HighsBasisStatus, highspy.HighsBasis()
    of_rows, of_columns = np.full(len(high), status.kBasic), np.full(len(program.cost), status.kNonbasic)
    of_rows[rows], of_columns[columns] = status.kNonbasic, status.kBasic
    basis.row_status, basis.col_status, basis.valid = of_rows.tolist(), of_columns.tolist(), True
    return basis


def _matched(program, equations):
    """Equations and the columns, that may move, with which they are matched."""
    free = np.flatnonzero(program.lower < program.upper)
    A = program.A.tocsc()[:, free].tocsr()[equations]
    A.data = np.where(np.abs(A.data) >= PIVOT, 1.0, 0.0)
    A.eliminate_zeros()
    columns = maximum_bipartite_matching(A, perm_type='column')
    matched = columns >= 0
    return equations[matched], free[columns[matched]]
