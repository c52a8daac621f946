"""States that are fixed at every time are inputs, as a flow at the end of a pipe that is a state inside it.

Takes: a model and its ContinuousSet of time.
Leaves: nothing.
Does not apply: to states that are fixed at the first and the last time only, which a simulation leaves alone.
"""

from pyomo_fesd.timeindex import TimeIndex, derivatives


def prescribed_states(model, wrt):
    """The variables of all states that are fixed throughout."""
    times = TimeIndex(wrt)
    for derivative in derivatives(model, wrt):
        for family in times.families(derivative.get_state_var().values()).values():
            if len(family) > 2 and all(v.fixed for v in family.values()):
                yield from family.values()
