"""What can be known of an instance of ``random_mpcc`` without ``pyomo_fesd``: all its branches, in HiGHS.

``truth`` solves every branch of a convex instance; ``faults`` judges a point, by an LP for every branch that is active there.
"""

import itertools
from collections import Counter

import highspy
import numpy as np

INF = np.inf
#: Violation and complementarity of a certified point, rows divided by max(1, largest entry of their gradient).
FEASIBLE = 1e-6
#: Sides below this are zero: ``biactive_tol`` of the solver.
ACTIVE = 1e-6
#: A linearised branch descends if its LP falls below this times max(1, |f|); the solver itself asks for 1e-6.
DESCENT = 1e-5


def solve_branch(a, P, lb, ub, rows):
    """min w'Pw/2 + a'w over bounds and linear rows (coefficients, low, high) in HiGHS: (status, value, w)."""
    lp = highspy.HighsLp()
    A = np.array([r[0] for r in rows]).reshape(len(rows), len(a))
    lp.num_col_, lp.num_row_ = len(a), len(rows)
    lp.col_cost_, lp.col_lower_, lp.col_upper_ = a, lb, ub
    lp.row_lower_, lp.row_upper_ = np.array([r[1] for r in rows], float), np.array([r[2] for r in rows], float)
    lp.a_matrix_.format_ = highspy.MatrixFormat.kRowwise
    row, column = np.nonzero(A)
    lp.a_matrix_.start_ = np.concatenate([[0], np.cumsum(np.bincount(row, minlength=len(rows)))]).astype(np.int32)
    lp.a_matrix_.index_, lp.a_matrix_.value_ = column.astype(np.int32), A[row, column]
    highs = highspy.Highs()
    highs.setOptionValue('output_flag', False)
    highs.setOptionValue('presolve', 'off')
    highs.setOptionValue('primal_feasibility_tolerance', 1e-9)
    highs.passModel(lp)
    if P is not None:
        low = [(i, j) for j in range(len(a)) for i in range(j, len(a)) if P[i, j]]
        hessian = highspy.HighsHessian()
        hessian.dim_, hessian.format_ = len(a), highspy.HessianFormat.kTriangular
        hessian.start_ = np.searchsorted([j for _, j in low], np.arange(len(a) + 1)).astype(np.int32)
        hessian.index_, hessian.value_ = np.array([i for i, _ in low], np.int32), np.array([P[k] for k in low])
        highs.passHessian(hessian)
    highs.run()
    status = highs.modelStatusToString(highs.getModelStatus())
    w = np.array(highs.getSolution().col_value)
    return status, float(a @ w + (0 if P is None else w @ P @ w / 2)) if status == 'Optimal' else None, w


def truth(p):
    """What is known of a convex instance: a Counter of its branches' status, and the best objective or None.

    The best is -inf where a branch is unbounded; a status that HiGHS did not settle leaves the instance out ('unknown').
    """
    n = len(p.lb)
    a, P = (np.zeros(n), None) if p.f is None else (p.f.a, p.f.P)
    statuses, best = Counter(), None
    for choice in itertools.product(*(p.alternatives(c) for c in p.conditions)):
        rows = [(r.a, low - r.b, high - r.b) for r, low, high in [*p.rows, *itertools.chain(*choice)]]
        status, value, _ = solve_branch(a, P, p.lb, p.ub, rows)
        if status != 'Optimal':
            # unbounded means feasible and unbounded; without the objective the two are told apart
            feasible = solve_branch(np.zeros(n), None, p.lb, p.ub, rows)[0]
            status = {'Optimal': status, 'Infeasible': 'Infeasible'}.get(feasible, 'unknown')
        if status == 'Unbounded':
            value = -INF
        elif status not in ('Optimal', 'Infeasible'):
            status = 'unknown'
        statuses[status] += 1
        if value is not None:
            best = value if best is None else min(best, value)
    return statuses, best


def faults(p, w):
    """What a certificate at ``w`` would get wrong: sentences, none if ``w`` is feasible and B-stationary."""
    found = []
    wrong = max(np.max(p.lb - w), np.max(w - p.ub))
    for row, low, high in p.rows:
        wrong = max(wrong, miss(row, low, high, w))
    if wrong > FEASIBLE:
        found.append(f'infeasible by {wrong:.1e}')
    active = []
    for k, condition in enumerate(p.conditions):
        wrong = [max(miss(*part, w) for part in alternative) for alternative in p.alternatives(condition)]
        if min(wrong) > FEASIBLE:
            found.append(f'condition {k} violated by {min(wrong):.1e}')
        active.append(
            [
                alternative
                for alternative in p.alternatives(condition)
                if max(max(low - r(w), r(w) - high) for r, low, high in alternative) <= ACTIVE
            ]
        )
    if found or p.f is None:
        return found
    reach = np.maximum(1.0, np.abs(w))
    d_low, d_high = np.minimum(np.maximum(-reach, p.lb - w), 0), np.maximum(np.minimum(reach, p.ub - w), 0)
    for choice in itertools.product(*active):
        rows = [*p.rows, *itertools.chain(*choice)]
        linear = [(r.gradient(w), min(low - r(w), 0.0), max(high - r(w), 0.0)) for r, low, high in rows]
        status, value, d = solve_branch(p.f.gradient(w), None, d_low, d_high, linear)
        if status != 'Optimal':
            found.append(f'an LP of the check ends as {status}')
        elif value < -DESCENT * max(1.0, abs(p.f(w))):
            found.append(f'descent {value:.1e} along {np.round(d, 4).tolist()}')
    return found


def miss(row, low, high, w):
    """By how much a row is violated, divided by max(1, largest entry of its gradient)."""
    return max(low - row(w), row(w) - high, 0.0) / max(1.0, np.abs(row.gradient(w)).max())
