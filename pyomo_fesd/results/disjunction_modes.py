"""The multipliers of transformed Disjunctions over time, and the sides of piecewise functions, by mode."""

from pyomo.core import Block
from pyomo.gdp import Disjunct, Disjunction

from pyomo_fesd.core import TimeIndex, all_switched_systems, own_components, strip_time


def disjunction_modes(model: Block, times: TimeIndex) -> dict:
    """Return ``{disjunction: {mode: {label: multiplier}}}`` of every Disjunction over time that ``fesd.dcs`` transformed."""
    multipliers, found, names = all_switched_systems(model).multipliers, {}, {}
    for name, by_time in times.families_in(own_components(model, Disjunction, (Block, Disjunct))).items():
        modes = {}
        for t, disjunction in by_time.items():
            nameless = disjunction.parent_component()._autodisjuncts
            for number, disjunct in enumerate(disjunction.disjuncts, start=1):
                weight = multipliers.get(disjunct)
                if weight is not None:
                    # a mode written as a list of expressions is called by its number
                    is_named = disjunct.parent_component() is not nameless
                    mode = _mode_name(disjunct, times, names) if is_named else f'mode {number}'
                    modes.setdefault(mode, {})[t] = weight
        if modes:
            found.setdefault(strip_time(name), {}).update(modes)
    return found


def _mode_name(disjunct, times, known):
    """The Disjunct's own name without time, from those ``known``: it is the same at all times."""
    full = times.split(disjunct)[1]
    if full not in known:
        # an index may contain dots
        above = times.split(disjunct.parent_block())[1]
        known[full] = strip_time(full.removeprefix(f'{above}.' if above else ''))
    return known[full]


def surface_sides(model: Block, times: TimeIndex) -> dict:
    """Return ``{surface: {side: {label: expression that is positive there}}}`` of piecewise functions."""
    found = {}
    for surface in all_switched_systems(model).surfaces:
        for side, weight in surface.sides.items():
            found.setdefault(surface.name, {}).setdefault(side, {})[times.time(surface.variable)] = weight
    return found
