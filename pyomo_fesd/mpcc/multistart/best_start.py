"""Combine several starts: the best of them, and the work of all.

Takes: the ``Start`` and the ``Run`` of each.
Leaves: one ``Run``.
"""

import numpy as np

from pyomo_fesd.core import FesdError
from pyomo_fesd.mpcc.algorithm import Counts, Outcome

#: Objectives within this of the best one, relative, are as good: then the first start counts.
TIE = 1e-8
#: Outcome of a start without an answer in time.
NO_ANSWER = 'failed: no answer in time'


def combine(total, c, ended, requested, interrupted):
    """Fill ``total`` from the starts that have ended.

    Parameters
    ----------
    total : Run
    c : MpccFunctions
    ended : list of (Start, Run or None)
    requested : int
        number of starts in all
    interrupted : bool

    Raises
    ------
    FesdError
        if every start failed
    """
    ended = sorted(ended, key=lambda one: one[0].start)
    runs = [one for one in ended if one[1] is not None]
    total.starts = [start for start, _ in ended]
    if ended and not runs and not interrupted:
        raise FesdError('starts', f"every start failed, the first with: {ended[0][0].outcome}", "see whether executor=None works")
    total.counts = _summed([run.counts for _, run in runs])
    if runs:
        best = _best(c, runs)
        for name in ('outcome', 'w', 'point', 'lowest', 'eps', 'steps'):
            setattr(total, name, getattr(best, name))
    total.outcome = _outcome(total.outcome, {run.outcome for _, run in runs}, ended, requested, interrupted)


def _outcome(best, outcomes, ended, requested, interrupted):
    """The outcome of the best start, unless others did not end."""
    if interrupted or Outcome.INTERRUPTED in outcomes:
        return Outcome.INTERRUPTED
    if Outcome.STOPPED in outcomes:
        return Outcome.STOPPED
    answers = sum(start.outcome != NO_ANSWER for start, _ in ended)
    cut_off = Outcome.TIME_LIMIT in outcomes or answers < requested
    return Outcome.TIME_LIMIT if cut_off and best is not Outcome.SOLVED else best


def _best(c, runs):
    """Certified before uncertified, then the lower objective, then the lower number."""
    ranks = [_rank(c, start, run) for start, run in runs]
    first, least = min(ranks)
    enough = least + TIE * max(1.0, abs(least)) if np.isfinite(least) else least
    return next(run for (_, run), (kind, amount) in zip(runs, ranks) if kind == first and amount <= enough)


def _rank(c, start, run):
    """(kind, amount), the less the better: certified or unbounded by objective, feasible by objective, others by violation."""
    if start.objective is not None:
        kind = 0 if start.certified or run.outcome is Outcome.UNBOUNDED else 1
        return kind, c.minimised(start.objective)
    if run.w is None:
        return 2, np.inf
    at = c.evaluate(run.w)
    parts = (*c.violations(run.w, at), np.abs(np.minimum(at.G, at.H)))
    return 2, max(part.max(initial=0.0) for part in parts)


def _summed(counts):
    """``Counts`` of all runs."""
    total = {name: sum(getattr(count, name) for count in counts) for name in ('nlps', 'iterations', 'lpecs')}
    return Counts(**total, binaries=max((count.binaries for count in counts), default=0))
