"""Set the Boolean indicators of disjuncts from their multipliers."""

from math import isnan

from pyomo.core import Block

from pyomo_fesd.core import all_switched_systems, value_or_nan


def set_indicators(model: Block) -> None:
    """Set the indicators of the disjuncts that ``fesd.dcs`` transformed: True or False where the mode is clear, else unset."""
    for disjunct, weight in all_switched_systems(model).multipliers.items():
        # Pyomo's own link: near 0 or 1 it sets the Boolean, between it leaves it unset
        number = value_or_nan(weight)
        disjunct.binary_indicator_var.set_value(None if isnan(number) else number, skip_validation=True)
