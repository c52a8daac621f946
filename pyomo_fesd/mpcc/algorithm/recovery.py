"""Recoveries after a relaxation that failed, in this order; each one is noted in the log."""

from dataclasses import dataclass
from typing import Callable

import numpy as np

#: Size of a perturbation, relative to max(1, |w|), and its seed: a run can be repeated.
SIZE, SEED = 1e-2, 1


@dataclass(frozen=True)
class Recovery:
    """One recovery.

    Attributes
    ----------
    note : str
        for the log
    start : callable (start of the run, last point, homotopy) -> array
    eps : callable (first eps, last eps, factor) -> float
    other_form : bool
        whether to continue with the next form of Reg(eps)
    """

    note: str
    start: Callable
    eps: Callable
    other_form: bool = False


def _perturbed(w0, w, homotopy):
    return w0 + SIZE * np.maximum(1.0, np.abs(w0)) * np.random.default_rng(SEED).standard_normal(len(w0))


def _before(w0, w, homotopy):
    return w0 if homotopy.end is None else homotopy.end.w


RECOVERIES = (
    Recovery("back to the last relaxation, half a step", _before, lambda first, last, factor: last * factor**-0.5),
    Recovery("go on with a smaller eps", lambda w0, w, homotopy: w, lambda first, last, factor: last * factor),
    Recovery("start again, other form", lambda w0, w, homotopy: w0, lambda first, last, factor: first, other_form=True),
    Recovery(
        "restore feasibility, raise eps", lambda w0, w, homotopy: homotopy.restored(w), lambda first, last, factor: first * 10
    ),
    Recovery("perturb the start", _perturbed, lambda first, last, factor: first * 1e-2),
    Recovery("raise eps, other form", lambda w0, w, homotopy: w0, lambda first, last, factor: first * 100, other_form=True),
)
