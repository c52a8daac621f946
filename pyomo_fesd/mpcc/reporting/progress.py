"""The progress of a run after every outer iteration, for a callback."""

import time
from dataclasses import dataclass, field

import numpy as np
from pyomo.common.collections import ComponentMap

from pyomo_fesd.mpcc.algorithm import Outcome, Stop


@dataclass(frozen=True)
class Progress:
    """A run after one of its outer iterations.

    Attributes
    ----------
    start : int
        the number of the start; 0 is the model's own values
    iteration : int
        of this start's homotopy, from 1
    eps : float
        the relaxation parameter
    relaxed_objective : float
        the model's objective at the relaxation's end, which complementarity may still violate
    incumbent : float or None
        the objective of the best exactly complementary point of this start; None before there is one
    certified : bool
        whether that point is certified
    nlp_iterations : int
        so far, in all NLPs of this start
    seconds : float
        since ``solve`` was called
    """

    start: int
    iteration: int
    eps: float
    relaxed_objective: float
    incumbent: float
    certified: bool
    nlp_iterations: int
    seconds: float
    _compiled: object = field(repr=False)
    _w: np.ndarray = field(repr=False)

    def values(self):
        """ComponentMap from variables to their values at the best point, or before there is one, at the relaxation's end."""
        c = self._compiled
        return ComponentMap(zip(c.variables, map(float, c.values(self._w))))


def reporter(callback, compiled, started):
    """The function that a run calls after every outer iteration; a true answer of ``callback`` stops the run.

    Parameters
    ----------
    callback : callable Progress -> object, or None
    started : float
        value of ``time.perf_counter()`` at the start
    """

    def report(run, start=0):
        if callback is not None and callback(_progress(run, start, compiled, started)):
            raise Stop(Outcome.STOPPED)

    return report


def _progress(run, start, compiled, started):
    relaxations, point = [step for step in run.steps if step.kind == 'relaxation'], run.point
    relaxed = relaxations[-1]
    return Progress(
        start=start,
        iteration=len(relaxations),
        eps=run.eps,
        relaxed_objective=relaxed.f,
        incumbent=None if point is None else compiled.objective(point.f),
        certified=point is not None and point.certificate.certified,
        nlp_iterations=run.counts.iterations,
        seconds=time.perf_counter() - started,
        _compiled=compiled,
        _w=relaxed.w if point is None else point.w,
    )
