"""Sum-up rounding: fractions of modes over control stages become one mode a stage, with almost the same integrals.

    a_{k,i} >= 0, sum_i a_{k,i} = 1      fractions of the relaxed solution in stage k, of length d_k
    s_{k,i} = sum_{l<=k} a_{l,i} d_l - sum_{l<k} w_{l,i} d_l
    w_{k,i} = 1  for the i with the largest s_{k,i}, 0 for the others

    max_{k,i} | sum_{l<=k} (a_{l,i} - w_{l,i}) d_l |  <=  (n - 1) max d          n modes

Source: Sager, Bock, Diehl (2012), The integer approximation error in mixed-integer optimal control, Math. Program. 133.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pyomo_fesd.core import FesdError

#: Largest difference of a sum of fractions from 1, and of a fraction from [0, 1].
INEXACT = 1e-6


@dataclass(frozen=True)
class RoundedModes:
    """Result of ``sum_up_rounding``.

    Attributes
    ----------
    weights : int array (stages, modes)
        one 1 in each row
    modes : int array (stages)
        its column
    deviation : float
        largest difference of the integrals of fractions and weights, in the unit of ``lengths``
    bound : float
        (modes - 1) times the longest stage: no deviation is larger
    """

    weights: np.ndarray
    modes: np.ndarray
    deviation: float
    bound: float


def sum_up_rounding(fractions, lengths: Sequence[float] | None = None) -> RoundedModes:
    """Round relaxed fractions of modes to one mode in each control stage.

    Parameters
    ----------
    fractions : array (stages, modes)
        rows sum to 1; a single on/off control a has the columns 1 - a and a
    lengths : array (stages), optional
        lengths of the stages; default 1

    Raises
    ------
    FesdError
        for fractions that are negative or do not sum to 1, and lengths that do not fit or are not positive
    """
    a = np.asarray(fractions, dtype=float)
    if a.ndim != 2 or not a.size:
        raise FesdError(
            'sum_up_rounding', f"fractions has the shape {a.shape}", "give a row for each stage, a column for each mode"
        )
    d = np.ones(len(a)) if lengths is None else np.asarray(lengths, dtype=float)
    if d.shape != a.shape[:1] or not (np.isfinite(d) & (d > 0)).all():
        raise FesdError('sum_up_rounding', "lengths are not one positive number for each stage", f"give {len(a)} of them")
    wrong = ~((np.abs(a.sum(axis=1) - 1) <= INEXACT) & (a >= -INEXACT).all(axis=1))
    if wrong.any():
        stage = int(np.argmax(wrong))
        cause = f"the fractions {a[stage].tolist()} of stage {stage} are negative or do not sum to 1"
        raise FesdError('sum_up_rounding', cause, "for an on/off control a give the columns 1 - a and a")
    modes, ahead, deviation = np.zeros(len(a), dtype=int), np.zeros(a.shape[1]), 0.0
    for k, row in enumerate(a * d[:, None]):
        ahead += row
        # equal ones: the first
        modes[k] = int(np.argmax(ahead))
        ahead[modes[k]] -= d[k]
        deviation = max(deviation, float(np.abs(ahead).max()))
    return RoundedModes(np.eye(a.shape[1], dtype=int)[modes], modes, deviation, (a.shape[1] - 1) * float(d.max()))
