"""Linear equations of one variable that put it at a bound: beside the bound they leave the variable no interior.

Such is the distance of bodies whose positions are given, gap = d with d >= 0, where they touch at the first time.

Takes: a compiled MPCC, and bounds of variables and rows.
Leaves: bounds in which the variable is fixed and the row is free.
"""

import numpy as np

#: A value this near to a bound is at it.
AT_BOUND = 1e-12


def fix_single(c, w, lbx, ubx, lbg, ubg, least_only=False):
    """Fix the variables that such rows put at a bound, or only those at their lower bound, in place."""
    rows, columns = c.single_rows
    if not len(rows):
        return
    slopes = np.asarray(c.gradients(w)[1][rows, columns]).ravel()
    with np.errstate(divide='ignore', invalid='ignore'):
        # a parameter may have made a slope zero
        value = w[columns] + (c.lbg[rows] - c.evaluate(w).g[rows]) / slopes
    for bound in (lbx.copy(),) if least_only else (lbx.copy(), ubx.copy()):
        at = (np.abs(value - bound[columns]) <= AT_BOUND) & (lbx[columns] < ubx[columns])
        lbx[columns[at]] = ubx[columns[at]] = bound[columns[at]]
        lbg[rows[at]], ubg[rows[at]] = -np.inf, np.inf
