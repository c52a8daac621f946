"""The initial conditions of a model: what a measurement gives."""

from pyomo.common.collections import ComponentSet
from pyomo.core import Block, Var
from pyomo.core.base.var import VarData
from pyomo.dae import ContinuousSet

from pyomo_fesd.core import TimeIndex, all_switched_systems


def first_states(model: Block, wrt: ContinuousSet) -> list[VarData]:
    """Return the variables that are fixed at the first time and free at the last: states, or what determines them (volume, level).

    Multipliers of modes are not among them (``FirstModes``).
    """
    selectors = ComponentSet(v for s in all_switched_systems(model).selectors for v in (s.values() if s.is_indexed() else [s]))
    variables = model.component_data_objects(Var, descend_into=Block)
    found = []
    for by_label in TimeIndex(wrt).families(variables).values():
        first, last = by_label.get(wrt.first()), by_label.get(wrt.last())
        if None not in (first, last) and first.fixed and not last.fixed and first not in selectors:
            found.append(first)
    return found
