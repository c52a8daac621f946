"""Controls that are constant on each control stage."""

from pyomo.core import ConstraintList

from pyomo_fesd.errors import FesdError
from pyomo_fesd.timeindex import TimeIndex, is_indexed_by


def check_controls(controls, wrt):
    """Every control must be indexed by time."""
    for u in controls:
        if not is_indexed_by(u, wrt):
            raise FesdError(u, f"piecewise_constant: this is not indexed by '{wrt.name}'", "give Vars over the ContinuousSet")


def hold_controls(block, controls, grid, wrt):
    """u(t) = u(end of its stage) for every time of a control stage; the first time belongs to the first stage."""
    block.held = ConstraintList()
    owner, times = grid.element_of(), TimeIndex(wrt)
    last = {stage: elements[-1].right for stage, elements in grid.stages.items()}
    for u in controls:
        for values in times.families(u.values()).values():
            for t, value in values.items():
                stage = owner[t].stage if t in owner else 1
                if t != last[stage] and not (value.fixed and values[last[stage]].fixed):
                    block.held.add(value == values[last[stage]])
