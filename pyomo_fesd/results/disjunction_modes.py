"""The multipliers of transformed Disjunctions over time, and the sides of piecewise functions, by mode."""

from pyomo.core import Block
from pyomo.gdp import Disjunct, Disjunction

from pyomo_fesd.core import TimeIndex, all_switched_systems, strip_time


def disjunction_modes(model: Block, times: TimeIndex) -> dict:
    """Return ``{disjunction: {mode: {label: multiplier}}}`` of every Disjunction over time that ``fesd.dcs`` transformed."""
    multipliers, found = all_switched_systems(model).multipliers, {}
    disjunctions = model.component_data_objects(Disjunction, descend_into=(Block, Disjunct))
    for name, by_time in times.families(disjunctions).items():
        for t, disjunction in by_time.items():
            for number, disjunct in enumerate(disjunction.disjuncts, start=1):
                if disjunct in multipliers:
                    modes = found.setdefault(strip_time(name), {})
                    modes.setdefault(_mode_name(disjunction, disjunct, number, times), {})[t] = multipliers[disjunct]
    return found


def _mode_name(disjunction, disjunct, number, times):
    """The Disjunct's own name without time; a mode written as a list of expressions is called by its number."""
    if disjunct.parent_component() is disjunction.parent_component()._autodisjuncts:
        return f'mode {number}'
    # an index may contain dots
    above = times.split(disjunct.parent_block())[1]
    return strip_time(times.split(disjunct)[1].removeprefix(f'{above}.' if above else ''))


def surface_sides(model: Block, times: TimeIndex) -> dict:
    """Return ``{surface: {side: {label: expression that is positive there}}}`` of piecewise functions."""
    found = {}
    for surface in all_switched_systems(model).surfaces:
        for side, weight in surface.sides.items():
            found.setdefault(surface.name, {}).setdefault(side, {})[times.time(surface.variable)] = weight
    return found
