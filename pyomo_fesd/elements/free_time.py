"""Time that is itself a variable: a free final time, or free lengths of the control stages.

    dt = sigma_k ds in stage k,     sigma_k = T/(S_N - S_0)   or   sigma_k = L_k/(S_k - S_{k-1})

s is the label of the ContinuousSet, t the time of the plant, S_k the labels of the stage boundaries.  The plant is written in its
own time, xdot = f; the elements (eq. 9 and 10) and everything that is measured in time get the factor.

Takes: ``final_time``, a Var, or ``stage_lengths``, one Var for each stage.
Leaves: a start value where there was none; ``lengths`` puts the factors in.
Does not apply: to models that are scaled by hand, dx == T f; their labels stay what they are.
"""

from pyomo.core import Var

from pyomo_fesd.errors import FesdError
from pyomo_fesd.timeindex import TimeIndex


def check_free_time(final_time, stage_lengths, wrt):
    """Refuse what is no length of time.

    Raises
    ------
    FesdError
        for both keywords at once, for what is no Var, depends on time, or may be zero
    """
    if final_time is not None and stage_lengths is not None:
        raise FesdError(wrt, "both final_time and stage_lengths are given", "constrain the sum of the stage lengths instead")
    if final_time is not None:
        _check(final_time, 'final_time', wrt)
    for length in stage_lengths or ():
        _check(length, 'stage_lengths', wrt)


def _check(length, keyword, wrt):
    if getattr(length, 'ctype', None) is not Var or length.is_indexed():
        raise FesdError(length, f"{keyword}: not a single variable", "give a Var, e.g. Var(bounds=(0.1, None), initialize=1)")
    if length.model() is not wrt.model():
        raise FesdError(length, f"{keyword}: it belongs to another model than '{wrt.name}'", "give a Var of the model itself")
    if TimeIndex(wrt).time(length) is not None:
        raise FesdError(length, f"{keyword}: it is a variable at one time", "give a Var that is not indexed by time")
    if length.fixed and not (length.value is not None and length.value > 0):
        raise FesdError(length, f"{keyword}: it is fixed to {length.value}", "fix it to a positive length of time")
    if not length.fixed and not (length.lb is not None and length.lb > 0):
        raise FesdError(
            length,
            f"{keyword}: its lower bound is {length.lb}, and no time at all satisfies every equation of motion",
            "give it a positive lower bound: the shortest time that can be meant",
        )


def factors(final_time, stage_lengths, stages):
    """sigma of each control stage as a list; None where labels are the time of the plant.

    Parameters
    ----------
    stages : list of float
        labels of the stage boundaries, the ends included

    Raises
    ------
    FesdError
        if there are not as many lengths as stages
    """
    nominal = [b - a for a, b in zip(stages, stages[1:])]
    if final_time is not None:
        return [_factor(final_time, sum(nominal))] * len(nominal)
    if stage_lengths is None:
        return None
    if len(stage_lengths) != len(nominal):
        raise FesdError(
            stage_lengths[0], f"stage_lengths: {len(stage_lengths)} for {len(nominal)} control stages", "give one for each stage"
        )
    return [_factor(length, usual) for length, usual in zip(stage_lengths, nominal)]


def _factor(length, nominal):
    """length/nominal; a variable without a value starts at the nominal length, as far as its bounds allow."""
    if length.value is None:
        low, high = length.bounds
        length.set_value(min(max(nominal, low), nominal if high is None else high), skip_validation=True)
    return length / nominal
