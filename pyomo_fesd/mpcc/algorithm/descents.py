"""Descents: from a point to a better one in the branch that the LPEC of its certificate names, or another LPEC beside it.

Takes: a certified or descending ``Point``.
Leaves: a better one; None if no branch leads down.
"""

from dataclasses import replace

import numpy as np

from pyomo_fesd.mpcc.algorithm.branch_solutions import SECOND, UNEVEN
from pyomo_fesd.mpcc.subproblems import MATTERS, Stationarity

#: A branch NLP's objective must fall by this, relative, to count as descent.
PROGRESS = 1e-8
#: So much from a point whose branch NLP did not end: smaller steps only go on in a branch that Ipopt cannot finish.
UNFINISHED = 1e-3
#: The trust region of a descent step shrinks by this factor, so many times; once where a branch was followed onward from the point
#: before (of ten such searches of discs, 3 to 5 s each, none has led down).
SHRINK, SHRINKS = 0.1, {False: 3, True: 1}
#: It grows by the first number from one within which the objective has fallen by the second, relative.
GROWTH, FALL = 3.0, 1e-3
#: Ipopt leaves sides without a multiplier at the root of its tolerance.  Those below this count as zero as well, if this descends
#: clearly: gradients are inexact too.
NEARLY, CLEAR = 1e-4, 1e-4
#: HiGHS for an LPEC with a binary for every pair, which proves nothing: small descents and a long search are not worth it.
WIDE = {'mip_abs_gap': 1e-6, 'mip_max_nodes': 100}


class Descents:
    """The descents of one run.

    Parameters
    ----------
    subsolves : Subsolves
    attempts : Attempts
    solutions : BranchSolutions
    global_lpec : bool
        whether a full LPEC searches beyond the bi-active pairs for a better branch
    """

    def __init__(self, subsolves, attempts, solutions, global_lpec):
        self._subsolves, self._tolerances, self._run = subsolves, subsolves.tolerances, subsolves.run
        self._attempts, self._solutions, self._global_lpec = attempts, solutions, global_lpec

    def better(self, point, worth):
        """A better point, or None; a point that is not ``worth`` a descent only gets the check of its certificate."""
        enough = point.less(PROGRESS if point.nlp.solved else UNFINISHED)
        if point.certificate.grade is Stationarity.DESCENT:
            return self._step_down(point, enough) if worth else None
        if point.certificate.grade is not Stationarity.B:
            return None
        better = self._beyond(point, enough, NEARLY, CLEAR) or self._within_round_off(point)
        return self._beyond(point, enough, np.inf, 0.0, WIDE) if better is None and worth and self._global_lpec else better

    def _within_round_off(self, point):
        """A clearly better point in the branch of a direction whose descent matters, though it proves nothing."""
        step = point.certificate.lpec
        if step is None or not step.matters:
            return None
        # with an objective of 0 any other point would be as good
        enough = point.f - MATTERS * max(abs(point.f), -step.value)
        found = (self._solutions.certified(w, step.zero, max_iter=SECOND, below=point.f) for w in (point.w + step.d, point.w))
        return next((better for better in found if is_below(better, enough)), None)

    def _step_down(self, point, enough):
        """In the branch of the direction: from its end, or onward from the point, or within ever smaller trust regions.

        With decisions of sides a trust region that has led to the point comes first, and a larger one before.
        """
        step = point.certificate.lpec
        if point.reach is not None and self._solutions.at_once:
            better = self._within_reach(point, enough, (GROWTH * point.reach, point.reach))
            if better is not None:
                return better
        better = self._attempts.point(point.w + step.d, step.zero, None, False)
        if is_below(better, enough) or _settles(better, point):
            return better
        # from the end of a direction Ipopt may go back; from the point itself it follows it, if slowly
        follows = self._attempts.patient and point.equal is not None
        onward = self._solutions.onward(point, step.zero, enough) if follows else None
        radii = (self._tolerances.radius * SHRINK**k for k in range(1, 1 + SHRINKS[follows]))
        return self._within_reach(point, enough, radii) if onward is None else onward

    def _within_reach(self, point, enough, radii):
        """In the branch of the best direction within a trust region, of which the ``radii`` are tried until one leads down.

        With decisions of sides small steps are not worth it where the incumbent is certified.
        """
        w, incumbent = point.w, self._run.point
        if self._solutions.at_once and incumbent is not None and incumbent.certificate.certified:
            enough = min(enough, point.less(UNEVEN))
        sets = self._subsolves.sets(w, self._tolerances.biactive)
        for radius in radii:
            step = self._subsolves.lpec(w, sets, radius, point.equal, limits=self._subsolves.patience())
            if not step.solved or step.descent == 0.0:
                return None
            reach = radius * np.maximum(1.0, np.abs(w))
            within = {'box': (w - reach, w + reach), 'max_iter': self._attempts.first}
            better = self._solutions.certified(w + step.d, step.zero, below=point.f, **within)
            if is_below(better, enough) or _settles(better, point):
                return replace(better, reach=radius if is_below(better, point.less(FALL)) else None)
        return None

    def _beyond(self, point, enough, tolerance, clear, limits=None):
        """A better point in the branch that the LPEC names if all sides below ``tolerance`` count as zero."""
        sets = self._subsolves.sets(point.w, tolerance)
        if np.count_nonzero(sets.gamma) <= point.certificate.biactive:
            return None
        limits = self._subsolves.patience() | (limits or {})
        # where the multipliers of the point show that no side descends, there is nothing to search for
        shown = {'multipliers': -point.nlp.lam_g, 'enough': clear}
        step = self._subsolves.lpec(point.w, sets, self._tolerances.radius, point.equal, limits=limits, **shown)
        if not step.solved or step.descent <= clear:
            return None
        return self._attempts.point(point.w + step.d, step.zero, None, False, enough=enough)


def _settles(better, point):
    """Whether another point is certified and as good, where the descent of this one is too small to count as progress."""
    return better is not None and better.certificate.certified and better.f <= point.f


def is_below(point, enough) -> bool:
    """Return whether there is a point and its objective is at most ``enough``."""
    return point is not None and point.f <= enough
