"""Time that is itself a variable: a free final time, or free lengths of the control stages.

    dt = sigma_k ds in control stage k,     sigma_k = T/(S_N - S_0)   or   sigma_k = L_k/(S_k - S_{k-1})

s is the label of the ContinuousSet, t the time of the plant, S_k the labels of the control-stage boundaries.  The plant is written
in its own time, xdot = f; the elements (eq. 9 and 10) and all quantities in units of time get the factor.

Takes: ``final_time``, a Var, or ``stage_lengths``, one Var for each control stage.
Leaves: a start value where there was none; ``lengths`` applies the factors.
Does not apply: to models that are scaled by hand, dx == T f; their labels do not change.
"""

from math import inf

from pyomo.core import Var
from pyomo.dae import ContinuousSet

from pyomo_fesd.core import FesdError, TimeIndex


def check_free_time(final_time: Var | None, stage_lengths: list[Var] | None, wrt: ContinuousSet, signals: list[Var]) -> None:
    """Refuse lengths of time that cannot be one.

    Raises
    ------
    FesdError
        for both keywords at once, for a length that is not a Var, depends on time, or may be zero, and beside ``signals``
    """
    if signals and not (final_time is None and stage_lengths is None):
        raise FesdError(
            signals[0],
            "a signal has given times, but labels have none with final_time or stage_lengths",
            "write it as a piecewise function of pyomo_fesd.clock",
        )
    if final_time is not None and stage_lengths is not None:
        raise FesdError(wrt, "both final_time and stage_lengths are given", "constrain the sum of stage_lengths instead")
    if final_time is not None:
        _check_length_variable(final_time, 'final_time', wrt)
    for length in stage_lengths or ():
        _check_length_variable(length, 'stage_lengths', wrt)


def _check_length_variable(length, keyword, wrt):
    if getattr(length, 'ctype', None) is not Var or length.is_indexed():
        raise FesdError(length, f"{keyword}: not a single variable", "give a Var, e.g. Var(bounds=(0.1, None), initialize=1)")
    if length.model() is not wrt.model():
        raise FesdError(length, f"{keyword}: it belongs to another model than '{wrt.name}'", "give a Var of the model itself")
    if TimeIndex(wrt).time(length) is not None:
        raise FesdError(length, f"{keyword}: it is a variable at one time", "give a Var that is not indexed by time")
    if length.fixed and not (length.value is not None and 0 < length.value < inf):
        raise FesdError(length, f"{keyword}: it is fixed to {length.value}", "fix it to a positive length of time")
    if not length.fixed and not (length.lb is not None and length.lb > 0):
        raise FesdError(
            length,
            f"{keyword}: its lower bound is {length.lb}, and a length of zero satisfies every differential equation",
            "give it a positive lower bound: the shortest possible time",
        )


def factors(final_time: Var | None, stage_lengths: list[Var] | None, stages: list[float]) -> list | None:
    """Return sigma of each control stage; None where labels are the time of the plant.

    Parameters
    ----------
    stages : list of float
        labels of the control-stage boundaries, first and last time included

    Raises
    ------
    FesdError
        if there are not as many lengths as control stages
    """
    nominal = [b - a for a, b in zip(stages, stages[1:])]
    if final_time is not None:
        return [_time_factor(final_time, sum(nominal))] * len(nominal)
    if stage_lengths is None:
        return None
    if len(stage_lengths) != len(nominal):
        raise FesdError(
            stage_lengths[0],
            f"stage_lengths: {len(stage_lengths)} for {len(nominal)} control stages",
            "give one for each",
        )
    return [_time_factor(length, usual) for length, usual in zip(stage_lengths, nominal)]


def _time_factor(length, nominal):
    """length/nominal; a variable without a value starts at the nominal length, as far as its bounds allow."""
    if length.value is None:
        low, high = length.bounds
        length.set_value(min(max(nominal, low), nominal if high is None else high), skip_validation=True)
    return length / nominal
