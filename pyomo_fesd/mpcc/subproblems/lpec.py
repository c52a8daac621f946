"""The reduced LPEC: the MPCC linearised at a point, binaries only for bi-active pairs (theory, eq. 17).

    min  grad f' d
    s.t. linearised rows and bounds,   |d_j| <= Delta max(1, |w_j|)
         G_i + grad G_i' d  = 0  (alpha),   H_i + grad H_i' d  = 0  (beta),   the other side >= 0
         0 <= G_i + grad G_i' d <= M_i^G y_i,   0 <= H_i + grad H_i' d <= M_i^H (1 - y_i),   y_i in {0, 1}  (gamma)

with M_i from the row's 1-norm over the trust region, never a global big-M.  d = 0 is feasible by construction: a violation of the
point is not to be corrected by d.

Where nothing descends, the LPEC is solved once more without the sides of fillings that are positive: their places may lie densely,
and a pair of the next one would stop a descent that goes on beyond it before it counts.

With multipliers, weak duality comes first: if it shows that even without the binaries no direction descends, no branch has one, and
HiGHS is not called.

A descent that is small beside the terms of the objective's gradient may still matter where the objective is a small sum of large
terms.  It is no proof against the point, but worth a look (``LpecResult.matters``).
"""

from copy import copy
from dataclasses import dataclass, field, replace
from functools import partial
from operator import attrgetter

import numpy as np

from pyomo_fesd.mpcc.compile import LastPoints, major_index, with_entries
from pyomo_fesd.mpcc.nlp import Deadline, check_options
from pyomo_fesd.mpcc.subproblems.active_set import G_ZERO, H_ZERO
from pyomo_fesd.mpcc.subproblems.binaries import with_binaries
from pyomo_fesd.mpcc.subproblems.descent import Descent
from pyomo_fesd.mpcc.subproblems.impact_sides import settle_drifts
from pyomo_fesd.mpcc.subproblems.linear_program import Program, refusal, solve
from pyomo_fesd.mpcc.subproblems.pair_program import PairProgram, undecided
from pyomo_fesd.mpcc.subproblems.pair_search import PairSearch
from pyomo_fesd.mpcc.subproblems.side_constraints import release_followers, without_constant

#: A relative descent beyond positive sides of fillings counts from here: those of two places differ by the error of a method.
BEYOND_FILLINGS = 1e-4
#: A value above this, relative to the objective, matters although the descent relative to the objective's terms does not count.
#: It is also above this part of the objective's largest term: what a solution with all digits would not leave.
MATTERS, LEFT = 1e-3, 1e-10
#: Variables that do not move are 0 below this.
AT_ZERO = 1e-9
#: Displacements, relative to the variables' sizes, along which gradients are compared; so many, in random directions.
DISPLACEMENT, DISPLACEMENTS, SEED = 1e-4, 2, 0


@dataclass(frozen=True)
class LpecResult:
    """Outcome of one LPEC.

    Attributes
    ----------
    solved : bool
    value : float
        grad f' d, never positive
    d : array (n)
    zero : int array (q)
        the assignment that d follows
    binaries : int
    descent : float
        the value relative to the terms of the gradient (see ``descent``): free of units and of the objective's offset
    matters : bool
        whether the descent does not count, but the value is above round-off, and not small beside the objective
    """

    solved: bool
    value: float
    d: np.ndarray
    zero: np.ndarray
    binaries: int
    descent: float = 0.0
    matters: bool = False


@dataclass(frozen=True)
class Linearised:
    """The LPEC at one point, without its binaries: the Program, decisions in force, and values of bi-active sides.

    The Program's last rows are those of G and H of the bi-active pairs.  ``drifts`` are those of contacts that these pairs decide.
    """

    program: Program
    equal: np.ndarray
    G: np.ndarray
    H: np.ndarray
    drifts: list = field(default_factory=list)


class Lpec:
    """Solves LPECs of one compiled MPCC.

    Parameters
    ----------
    sides : Sides
    options : dict
        HiGHS options, passed through
    deadline : Deadline, optional
        at which HiGHS stops

    Raises
    ------
    FesdError
        naming an option that HiGHS refuses
    """

    def __init__(self, compiled, sides, options, deadline=None):
        check_options('HiGHS', options, refusal, 'lpec_options')
        self._c, self._sides, self._options, self._deadline = compiled, sides, options, deadline or Deadline()
        self._known_changes = LastPoints(self._changes)

    def at_most(self, seconds):
        """The same LPECs, with so many seconds from now on; None: as they are."""
        other = copy(self)
        other._deadline = self._deadline if seconds is None else self._deadline.at_most(seconds)
        return other

    def solve(self, w, sets, Delta, equal=None, beyond=False, multipliers=None, enough=None, limits=None) -> LpecResult:
        """Solve the LPEC at ``w`` with active sets ``sets``, trust region ``Delta`` and the decisions ``equal`` imposed.

        Parameters
        ----------
        beyond : bool
            whether to ignore the bounds of variables with guide bounds, which belong to the method
        multipliers : array, optional
            of the branch's rows, positive at lower bounds, to try weak duality with
        enough : float, optional
            a relative descent of at most this does not count, and any other one ends the search
        limits : dict, optional
            HiGHS options of a call that proves nothing; when one of them ends the search, the best direction so far is taken
        """
        found = self._solve(w, sets, Delta, equal, beyond, multipliers, enough, limits, released=False)
        proves = enough is not None and limits is None
        if not (proves and self._c.fillings and found.solved) or found.descent > enough:
            return found
        further = self._solve(w, sets, Delta, equal, beyond, multipliers, enough, limits, released=True)
        return further if further.descent > max(enough, BEYOND_FILLINGS) else found

    def _solve(self, w, sets, Delta, equal, beyond, multipliers, enough, limits, released):
        """``solve``, with the positive sides of fillings, or where they are ``released`` without."""
        sets, equal, at = self.linearised(w, sets, Delta, equal, beyond, released)
        rows = np.concatenate(row_places(sets, equal, len(self._c.lbg)))
        descent = Descent(at.program, lambda: [(cost, partial(_product, A, rows)) for cost, A in self.changes(w)])
        if enough is None:
            return self.best(sets, at, descent, limits)
        if multipliers is not None:
            y = self._row_multipliers(multipliers, sets, equal)
            if descent.proved(y) <= enough and not self._matters(w, descent, descent.least(y)):
                return LpecResult(True, 0.0, np.zeros(len(w)), sets.zero, 0)
        matters = partial(self._matters, w, descent)
        found = self.best(sets, at, descent, limits) if limits else self.searched(sets, at, descent, enough, matters)
        return replace(found, matters=found.descent <= enough and matters(found.value))

    def _matters(self, w, descent, value):
        return -value > MATTERS * abs(self._c.evaluate(w).f) and not descent.negligible(value, LEFT)

    def linearised(self, w, sets, Delta, equal=None, beyond=False, released=False):
        """The LPEC without its binaries; also the active sets and the decisions with which it was written."""
        equal = np.zeros(self._c.equal.numel(), dtype=bool) if equal is None else equal
        reach = Delta * sizes_of(w)
        sets = release_followers(sets, self._c.followers, self._c.evaluate(w))
        lower, upper = self.box(w, sets, reach, beyond, released)
        sets = without_constant(sets, self._sides, (lower == 0.0) & (upper == 0.0))
        return sets, equal, self._linearised(w, sets, equal, reach, lower, upper, released)

    def searched(self, sets, at, descent, enough, matters=lambda value: False) -> LpecResult:
        """A direction of a linearised LPEC that descends by more than ``enough``, or the proof that there is none.

        Without one the result is that of the branch whose value ``matters`` most, if there is one.
        """
        pairs = int(sets.gamma.sum())
        p = PairProgram(at.program, pairs, at.drifts, partial(self._zeros, sets))
        measure = descent.with_rows(p.program, p.own)
        none = LpecResult(True, 0.0, np.zeros(len(at.program.cost)), sets.zero, pairs)

        def branch(sides, answer):
            found = _within_branch(measure.of(p.with_sides(sides)), answer, _with(sets, sides), pairs)
            return replace(found, descent=0.0) if descent.negligible(found.value) else found

        search = PairSearch(p, measure, enough, matters, branch, self._options, self._deadline)
        found = search.run()
        if found is None and search.is_open:
            return replace(none, solved=False)
        return found or min((other for other in search.others if matters(other.value)), key=attrgetter('value'), default=none)

    def _zeros(self, sets, sides):
        """The variables that zero sides make zero, with these ``sides`` of the bi-active pairs."""
        lower, upper = self._sides.bounds(_with(sets, sides), self._c.lbx, self._c.ubx)
        return (lower == 0.0) & (upper == 0.0)

    def best(self, sets, at, descent, limits=None) -> LpecResult:
        """The best direction of a linearised LPEC and its relative descent, as HiGHS finds it with a binary for each pair."""
        found = self._with_binaries(sets, at, limits)
        if not found.solved or descent.negligible(found.value):
            return found
        branch = PairProgram(at.program, found.binaries).with_sides(found.zero[sets.gamma])
        answer = solve(branch, self._options, self._deadline, limits=limits)
        if answer is None or answer.y is None:
            return replace(found, descent=-found.value / float(np.abs(at.program.cost) @ at.program.reach))
        return _within_branch(descent.of(branch), answer, found.zero, found.binaries)

    def _with_binaries(self, sets, at, limits):
        """HiGHS' answer with a binary for each bi-active pair."""
        n, y = len(at.program.cost), int(sets.gamma.sum())
        start = np.concatenate([np.zeros(n), (sets.zero[sets.gamma] == H_ZERO).astype(float)])
        answer = solve(with_binaries(at.program, at.G, at.H), self._options, self._deadline, start, limits)
        if answer is None:
            return LpecResult(False, 0.0, np.zeros(n), sets.zero, y)
        zero, d = _with(sets, np.where(answer.d[n:] > 0.5, H_ZERO, G_ZERO)), answer.d[:n]
        return LpecResult(True, min(float(at.program.cost @ d), 0.0), d, zero, y)

    def _linearised(self, w, sets, equal, reach, lower, upper, released):
        c = self._c
        at = c.evaluate(w)
        G, H = np.maximum(at.G, 0.0), np.maximum(at.H, 0.0)
        alpha, beta, gamma, free = sets.alpha, sets.beta, sets.gamma, sets.open
        filled = _pairs_of(c.fillings if released else (), c.pairs)
        other_H, other_G = (np.where(filled[kind], -np.inf, -side[kind]) for kind, side in ((alpha, H), (beta, G)))
        low = [np.minimum(c.lbg - at.g, 0.0), 0.0, other_H, 0.0, other_G, 0.0, -G[free], -H[free], -G[gamma], -H[gamma]]
        high = [np.maximum(c.ubg - at.g, 0.0), 0.0, np.inf, 0.0, np.inf, 0.0, np.inf, np.inf, np.inf, np.inf]
        places = row_places(sets, equal, len(c.lbg))
        low, high = (np.concatenate([np.broadcast_to(v, len(rows)) for v, rows in zip(by, places)]) for by in (low, high))
        settle_drifts(c, (lower == 0.0) & (upper == 0.0) & (np.abs(w) <= AT_ZERO), lower, upper, low, high)
        drifts = undecided(c.drifts, partial(self._zeros, sets), np.count_nonzero(gamma))
        weighted = [drift.row for drift in drifts]
        low[weighted], high[weighted] = -np.inf, np.inf
        program = Program(c.gradients(w)[0], c.stacked_jacobian(w)[np.concatenate(places)], low, high, lower, upper, reach)
        return Linearised(program, equal, G[gamma], H[gamma], drifts)

    def changes(self, w):
        """Changes of the gradient and of all rows along displacements of all variables by their sizes, within their bounds."""
        # several LPECs are solved at one point
        return self._known_changes(w, np.concatenate([self._c.parameters, self._c.lbx, self._c.ubx]))

    def _changes(self, w, _):
        random, sizes = np.random.default_rng(SEED), sizes_of(w)
        gradient, A, changes = self._c.gradients(w)[0], self._c.stacked_jacobian(w), []
        for _ in range(DISPLACEMENTS):
            step = DISPLACEMENT * sizes * random.choice((-1.0, 1.0), size=len(w))
            within = [(w + s >= self._c.lbx) & (w + s <= self._c.ubx) for s in (step, -step)]
            step = np.where(within[0], step, np.where(within[1], -step, 0.0))
            cost = np.nan_to_num((self._c.gradients(w + step)[0] - gradient) / DISPLACEMENT, posinf=0.0, neginf=0.0)
            there = self._c.stacked_jacobian(w + step).data
            changes.append((cost, with_entries(A, np.nan_to_num((there - A.data) / DISPLACEMENT, posinf=0.0, neginf=0.0))))
        return changes

    def box(self, w, sets, reach, beyond, released=False):
        """Bounds of d: the trust region; 0 for the variables of a side that is zero because they are at their bounds."""
        c = self._c
        free = c.guided & beyond
        lbx, ubx = np.where(free, -np.inf, c.lbx), np.where(free, np.inf, c.ubx)
        inside = _inner_shares(c.fillings if released else (), sets.gamma)
        lbx[inside], ubx[inside] = -np.inf, np.inf
        lower, upper = np.minimum(np.maximum(-reach, lbx - w), 0.0), np.maximum(np.minimum(reach, ubx - w), 0.0)
        settled = np.concatenate([sets.alpha, sets.beta]) & (self._sides.row_of < 0)
        still, _ = self._sides.variables(settled)
        lower[still] = upper[still] = 0.0
        return lower, upper

    def _row_multipliers(self, lam, sets, equal):
        """Multipliers of a branch's rows (own, sides, decisions) in the order of the program's rows."""
        m, q, row_of = len(self._c.lbg), len(sets.zero), self._sides.row_of
        of_side = np.zeros(2 * q)
        of_side[row_of >= 0] = lam[m + row_of[row_of >= 0]]
        G, H = of_side[:q], of_side[q:]
        decided = lam[len(lam) - len(equal) :]
        sides = [G[sets.alpha], H[sets.alpha], H[sets.beta], G[sets.beta]]
        undecided = [G[sets.open], H[sets.open], G[sets.gamma], H[sets.gamma]]
        return np.concatenate([lam[:m], *sides, decided[equal], *undecided])


def _with(sets, sides):
    """The zero sides of all pairs with those of the bi-active ones."""
    zero = sets.zero.copy()
    zero[sets.gamma] = sides
    return zero


def _within_branch(descent, answer, zero, pairs):
    """The result of the best direction of branch ``zero``, whose multipliers show the relative descent."""
    return LpecResult(True, min(descent.value(answer.d), 0.0), answer.d, zero, pairs, descent.proved(answer.y))


def _product(A, rows, y):
    """B' y with the ``rows`` B of A (csr)."""
    factors = np.bincount(rows, y, A.shape[0])
    return np.bincount(A.indices, A.data * factors[major_index(A)], A.shape[1])


def sizes_of(w):
    """The size of each variable at ``w``."""
    return np.maximum(1.0, np.abs(w))


def row_places(sets, equal, m):
    """The program's rows among all: own (m), pairs with G = 0, with H = 0, decisions, open pairs, bi-active pairs."""
    G = m + np.arange(len(sets.zero))
    H, decisions = G + len(G), m + 2 * len(G) + np.flatnonzero(equal)
    sides = [G[sets.alpha], H[sets.alpha], H[sets.beta], G[sets.beta]]
    return [np.arange(m), *sides, decisions, G[sets.open], H[sets.open], G[sets.gamma], H[sets.gamma]]


def _pairs_of(fillings, number):
    """Which of the pairs belong to fillings."""
    found = np.zeros(number, dtype=bool)
    for filling in fillings:
        found[filling.pairs] = True
    return found


def _inner_shares(fillings, gamma):
    """The shares beside which no pair is bi-active."""
    found = [np.zeros(0, dtype=int)]
    for filling in fillings:
        near = gamma[filling.pairs]
        found.append(filling.shares[~(np.append(near, False) | np.append(False, near))])
    return np.concatenate(found)
