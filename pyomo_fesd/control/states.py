"""The states at the first time: what a measurement gives."""

from pyomo.core import Block
from pyomo.core.base.var import VarData
from pyomo.dae import ContinuousSet

from pyomo_fesd.core import TimeIndex, derivatives


def first_states(model: Block, wrt: ContinuousSet) -> list[VarData]:
    """Return the states that are fixed at the first time."""
    times = TimeIndex(wrt)
    states = (v for d in derivatives(model, wrt) for v in d.get_state_var().values())
    return [v for v in states if v.fixed and times.time(v) == wrt.first()]
