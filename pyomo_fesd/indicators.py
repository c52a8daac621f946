"""The Boolean indicators of disjuncts, set from their multipliers."""

from pyomo.core import value

from pyomo_fesd import marks


def set_indicators(model):
    """Set the indicators of the disjuncts that ``fesd.dcs`` transformed: True or False where the mode is clear, else unset."""
    for disjunct, weight in marks.marked(model, marks.INDICATOR):
        # Pyomo's own link: near 0 or 1 it sets the Boolean, between it leaves it unset
        disjunct.binary_indicator_var.set_value(value(weight, exception=False), skip_validation=True)
