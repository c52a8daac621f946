"""The reduced LPEC: the MPCC linearised at a point, binaries only for bi-active pairs (theory, eq. 17).

    min  grad f' d
    s.t. linearised rows and bounds,   |d_j| <= Delta max(1, |w_j|)
         G_i + grad G_i' d  = 0  (alpha),   H_i + grad H_i' d  = 0  (beta),   the other side >= 0
         0 <= G_i + grad G_i' d <= M_i^G y_i,   0 <= H_i + grad H_i' d <= M_i^H (1 - y_i),   y_i in {0, 1}  (gamma)

with M_i from the row's 1-norm over the trust region, never a global big-M.  d = 0 is feasible by construction: what the point
already violates is not asked of d.

Where multipliers are at hand, weak duality is asked first: if it shows that even without the binaries nothing descends, no
branch does, and HiGHS is not called.
"""

from dataclasses import dataclass

import highspy
import numpy as np
from scipy import sparse

from pyomo_fesd.mpcc.active_set import G_ZERO, H_ZERO
from pyomo_fesd.mpcc.deadline import Deadline
from pyomo_fesd.mpcc.duality import lower_bound

#: HiGHS' own 1e-7 is too coarse: a step's value is compared with 1e-6.  With such tolerances its presolve calls some LPECs
#: infeasible although d = 0 is feasible, and d = 0 optimal in others that have descent, so it stays off.
ATTEMPTS = (
    {'presolve': 'off', 'tolerance': 1e-9},
    {'presolve': 'off', 'tolerance': 1e-8, 'solver': 'ipm'},
    {'presolve': 'off', 'tolerance': 1e-7},
)
TOLERANCES = ('primal_feasibility_tolerance', 'dual_feasibility_tolerance', 'mip_feasibility_tolerance')
ENDED_WELL = (highspy.HighsModelStatus.kOptimal, highspy.HighsModelStatus.kObjectiveTarget)
LIMITED = (highspy.HighsModelStatus.kSolutionLimit, highspy.HighsModelStatus.kIterationLimit, highspy.HighsModelStatus.kTimeLimit)
#: Branch and bound ends at a direction whose value is below this many times what counts as descent.
CLEAR_DESCENT = 1e3


@dataclass(frozen=True)
class LpecResult:
    """Outcome of one LPEC.

    Attributes
    ----------
    solved : bool
    value : float
        grad f' d (from weak duality: a lower bound of it), never positive
    d : array (n)
    zero : int array (q)
        the assignment that d follows
    binaries : int
    """

    solved: bool
    value: float
    d: np.ndarray
    zero: np.ndarray
    binaries: int


@dataclass(frozen=True)
class _Program:
    """min cost' d, low <= A d <= high, lower <= d <= upper; the rows of bi-active pairs stand last but one group each."""

    cost: np.ndarray
    A: object
    low: np.ndarray
    high: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    sides: tuple


class Lpec:
    """Solves LPECs of one compiled MPCC.

    Parameters
    ----------
    sides : Sides
    options : dict
        HiGHS options, passed through
    deadline : Deadline, optional
        at which HiGHS is to stop
    """

    def __init__(self, compiled, sides, options, deadline=None):
        self._c, self._sides, self._options, self._deadline = compiled, sides, options, deadline or Deadline()

    def solve(self, w, sets, Delta, equal=None, beyond=False, multipliers=None, small=None, limits=None):
        """Solve the LPEC at ``w`` with active sets ``sets``, trust region ``Delta`` and the decisions ``equal`` imposed.

        Parameters
        ----------
        beyond : bool
            the artificial bounds do not count: is there descent that only they forbid?
        multipliers : array, optional
            of the branch's rows, positive at lower bounds, to try weak duality with
        small : float, optional
            descent below this is none: weak duality may end the search, and a clear descent may end branch and bound
        limits : dict, optional
            HiGHS options of this call; when one of them ends the search, the best direction so far is taken
        """
        equal = np.zeros(self._c.equal.numel(), dtype=bool) if equal is None else equal
        program = self._program(w, sets, Delta, equal, beyond)
        if multipliers is not None and small is not None:
            y = self._row_multipliers(multipliers, sets, equal)
            bound = lower_bound(program.cost, program.A, program.low, program.high, program.lower, program.upper, y)
            if bound >= -small:
                return LpecResult(True, min(bound, 0.0), np.zeros(len(w)), sets.zero, 0)
        return self._mixed_integer(w, sets, program, small, limits or {})

    def _program(self, w, sets, Delta, equal, beyond):
        """The linear program without the binaries."""
        c = self._c
        free = c.artificial & beyond
        lbx, ubx = np.where(free, -np.inf, c.lbx), np.where(free, np.inf, c.ubx)
        at = c.evaluate(w)
        grad, J_g, J_G, J_H, J_equal = c.gradients(w)
        lower, upper = _box(w, lbx, ubx, Delta)
        self._fix(lower, upper, sets)
        G, H = np.maximum(at.G, 0.0), np.maximum(at.H, 0.0)
        rows = [
            (J_g, np.minimum(c.lbg - at.g, 0.0), np.maximum(c.ubg - at.g, 0.0)),
            (J_G[sets.alpha], 0.0, 0.0),
            (J_H[sets.alpha], -H[sets.alpha], np.inf),
            (J_H[sets.beta], 0.0, 0.0),
            (J_G[sets.beta], -G[sets.beta], np.inf),
            (J_equal[equal], 0.0, 0.0),
            (J_G[sets.gamma], -G[sets.gamma], np.inf),
            (J_H[sets.gamma], -H[sets.gamma], np.inf),
        ]
        A = sparse.vstack([r[0] for r in rows]).tocsr()
        low = np.concatenate([np.broadcast_to(r[1], r[0].shape[0]) for r in rows])
        high = np.concatenate([np.broadcast_to(r[2], r[0].shape[0]) for r in rows])
        gamma = sets.gamma
        return _Program(grad, A, low, high, lower, upper, ((J_G[gamma], G[gamma]), (J_H[gamma], H[gamma])))

    def _fix(self, lower, upper, sets):
        """A side that is zero where its variables stand at their bounds stays zero only if none of them moves."""
        settled = np.concatenate([sets.alpha, sets.beta]) & (self._sides.row_of < 0)
        still = self._sides.fixings[np.flatnonzero(settled)].indices
        lower[still] = upper[still] = 0.0

    def _row_multipliers(self, lam, sets, equal):
        """Multipliers of a branch's rows (own, sides, decisions) in the order of the program's rows."""
        m, q, row_of = len(self._c.lbg), len(sets.zero), self._sides.row_of
        of_side = np.zeros(2 * q)
        of_side[row_of >= 0] = lam[m + row_of[row_of >= 0]]
        G, H = of_side[:q], of_side[q:]
        decided = lam[len(lam) - len(equal) :]
        alpha, beta, gamma = sets.alpha, sets.beta, sets.gamma
        return np.concatenate([lam[:m], G[alpha], H[alpha], H[beta], G[beta], decided[equal], G[gamma], H[gamma]])

    def _mixed_integer(self, w, sets, p, small, limits):
        """With a binary for each bi-active pair: G + grad G d - M y <= 0  and  H + grad H d + M y <= M."""
        n, y = len(w), int(sets.gamma.sum())
        A, high = p.A, p.high
        if y:
            (J_G, G), (J_H, H) = p.sides
            M_G, M_H = _big_m(J_G, G, p.lower, p.upper), _big_m(J_H, H, p.lower, p.upper)
            switch = sparse.bmat([[J_G, -sparse.diags(M_G)], [J_H, sparse.diags(M_H)]])
            A = sparse.vstack([sparse.hstack([A, sparse.csr_matrix((A.shape[0], y))]), switch])
            high = np.concatenate([high, -G, M_H - H])
        program = _Program(
            np.concatenate([p.cost, np.zeros(y)]),
            A.tocsc(),
            np.concatenate([p.low, np.full(2 * y, -np.inf)]),
            high,
            np.concatenate([p.lower, np.zeros(y)]),
            np.concatenate([p.upper, np.ones(y)]),
            (),
        )
        start = np.concatenate([np.zeros(n), (sets.zero[sets.gamma] == H_ZERO).astype(float)])
        solution = self._highs(program, y, start, None if small is None else -CLEAR_DESCENT * small, limits)
        zero = sets.zero.copy()
        if solution is None:
            return LpecResult(False, 0.0, np.zeros(n), zero, y)
        zero[sets.gamma] = np.where(solution[n:] > 0.5, H_ZERO, G_ZERO)
        return LpecResult(True, min(float(p.cost @ solution[:n]), 0.0), solution[:n], zero, y)

    def _highs(self, p, binaries, start, target, limits):
        """Solve with HiGHS, from a start that is feasible; None if it does not end well."""
        lp = highspy.HighsLp()
        lp.num_col_, lp.num_row_ = p.A.shape[1], p.A.shape[0]
        lp.col_cost_, lp.col_lower_, lp.col_upper_ = p.cost, p.lower, p.upper
        lp.row_lower_, lp.row_upper_ = p.low, p.high
        lp.a_matrix_.format_ = highspy.MatrixFormat.kColwise
        lp.a_matrix_.start_, lp.a_matrix_.index_, lp.a_matrix_.value_ = p.A.indptr, p.A.indices, p.A.data
        if binaries:
            kinds = [highspy.HighsVarType.kContinuous] * (p.A.shape[1] - binaries)
            lp.integrality_ = kinds + [highspy.HighsVarType.kInteger] * binaries
        for attempt in ATTEMPTS:
            highs = highspy.Highs()
            highs.setOptionValue('output_flag', False)
            settings = {name: value for name, value in attempt.items() if name != 'tolerance'}
            if binaries:
                settings.pop('solver', None)
                if target is not None:
                    settings['objective_target'] = target
            settings |= dict.fromkeys(TOLERANCES, attempt['tolerance']) | limits | self._options
            if self._deadline.at is not None:
                settings['time_limit'] = min(settings.get('time_limit', np.inf), self._deadline.left())
            for name, option in settings.items():
                highs.setOptionValue(name, option)
            highs.passModel(lp)
            guess = highspy.HighsSolution()
            guess.col_value = list(start)
            highs.setSolution(guess)
            highs.run()
            status = highs.getModelStatus()
            stopped = bool(limits) and status in LIMITED
            if status in ENDED_WELL or (stopped and highs.getSolution().value_valid):
                return np.array(highs.getSolution().col_value)
            if stopped:
                return None
        return None


def _box(w, lbx, ubx, Delta):
    """Bounds of d: the trust region, relative for large variables, within the variables' own bounds."""
    reach = Delta * np.maximum(1.0, np.abs(w))
    return np.minimum(np.maximum(-reach, lbx - w), 0.0), np.maximum(np.minimum(reach, ubx - w), 0.0)


def _big_m(J, side, d_low, d_high):
    """The largest value that each side can take in the box."""
    positive, negative = J.maximum(0), J.minimum(0)
    return side + positive @ d_high + negative @ d_low
