"""Modes that are stated after the first time only: nothing says in which region the first element begins.

A Disjunction that leaves out the first time t_0 (``Disjunction.Skip``) has no condition there.  If the state leaves the region of
its first mode between t_0 and the first collocation point, all points of the first element agree, and the switch is missed.

Takes: a solved model with a moving grid.
Leaves: messages.
Does not apply: to continuous piecewise functions (a kink that is missed costs accuracy, not the mode), and to conditions with
variables that no equation determines at t_0.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import isnan
from typing import Any

from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.core import Block, Constraint, value
from pyomo.core.expr.visitor import identify_variables
from pyomo.dae import ContinuousSet
from pyomo.gdp import Disjunct, Disjunction

from pyomo_fesd.core import (
    TimeIndex,
    all_switched_systems,
    derivatives,
    exchanged,
    moving_grids,
    own_components,
    strip_time,
    value_or_nan,
)
from pyomo_fesd.results import SwitchingFunction

#: A mode is active where its multiplier is larger.
ACTIVE = 1e-6
#: A condition holds down to these parts of its body in the first element, and of its largest variable.
HOLDS, ROUND_OFF = 1e-6, 1e-9
#: What to do about a Disjunction, and about a function.
REGIONS = "State its regions at the first time too, where they need no equations: [[m.x[t] <= 1], [m.x[t] >= 1]]"
FUNCTION = "State the equation with this function at the first time too"


@dataclass(frozen=True)
class _Condition:
    """``lower <= body <= upper``; None where there is no bound."""

    body: Any
    lower: Any
    upper: Any


def unknown_first_modes(model: Block, wrt: ContinuousSet, functions: list[SwitchingFunction]) -> Iterator[str]:
    """Yield a message for each Disjunction whose conditions in the first element do not hold at the first time."""
    times, point = TimeIndex(wrt), moving_grids(model)[wrt].grid.elements[0].points[0]
    for name, conditions, remedy in (*_of_disjunctions(model, times, point), *_of_jumping_functions(model, times, point)):
        for condition in conditions:
            begin = _at_first_time(condition.body, times)
            if begin is not None and _violated(condition, begin) and _determined(begin, model, times):
                yield (
                    f"{name}: a switch before the first collocation point (label {point:g}) may be missed: at the first time, "
                    f"where it is not stated, {begin} = {value(begin):.6g} is outside of the mode of the first element. {remedy}."
                )
                break


def _of_disjunctions(model, times, point) -> Iterator[tuple]:
    """``(name, conditions of the active modes at a point, remedy)`` of every Disjunction that is not stated at the first time."""
    multipliers = all_switched_systems(model).multipliers
    for name, by_time in times.families_in(own_components(model, Disjunction, (Block, Disjunct))).items():
        if times.wrt.first() not in by_time and point in by_time:
            yield strip_time(name), _regions(by_time[point], multipliers), REGIONS


def _regions(disjunction, multipliers):
    for disjunct in disjunction.disjuncts:
        if disjunct in multipliers and value(multipliers[disjunct]) > ACTIVE:
            # the disjunct itself is off once it is transformed
            for con in disjunct.component_data_objects(Constraint, descend_into=Block):
                if con.active and not con.equality:
                    yield _Condition(con.body, con.lower, con.upper)


def _of_jumping_functions(model, times, point) -> Iterator[tuple]:
    """The same for the surfaces of functions that jump."""
    systems, steps = all_switched_systems(model), {}
    names = ComponentMap((surface.variable, surface.name) for surface in systems.surfaces)
    for step in systems.steps:
        if step.nu in names:
            steps.setdefault(names[step.nu], {})[times.time(step.nu)] = step
    for name, by_time in steps.items():
        if times.wrt.first() not in by_time and point in by_time:
            yield name, _sides(by_time[point].c, by_time[point].nu.value), FUNCTION


def _sides(c, nu):
    if nu > ACTIVE:
        yield _Condition(c, 0.0, None)
    if nu < 1 - ACTIVE:
        yield _Condition(c, None, 0.0)


def _at_first_time(body, times):
    """The body for the variables at the first time; None where one of them has no data there."""
    others = {}
    for v in identify_variables(body, include_fixed=True):
        try:
            others[id(v)] = v if times.time(v) is None else times.at(v, times.wrt.first())
        except KeyError:
            return None
    return exchanged(body, others)


def _violated(condition, begin):
    """Whether the condition does not hold for the body at the first time, by more than round-off."""
    now, later = value_or_nan(begin), value(condition.body)
    sizes = [abs(v.value) for v in identify_variables(begin, include_fixed=True) if v.value is not None]
    for bound, sign in ((condition.lower, 1), (condition.upper, -1)):
        if bound is not None and not isnan(now):
            margin = max(HOLDS * abs(later - value(bound)), ROUND_OFF * max(sizes, default=0.0))
            if sign * (now - value(bound)) < -margin:
                return True
    return False


def _determined(begin, model, times):
    """Whether each variable is fixed, a state, or in an equation at the first time."""
    states = ComponentSet(d.get_state_var() for d in derivatives(model, times.wrt))
    undetermined = ComponentSet(v for v in identify_variables(begin, include_fixed=False) if v.parent_component() not in states)
    for con in model.component_data_objects(Constraint, active=True, descend_into=Block) if undetermined else ():
        if times.time(con) == times.wrt.first():
            undetermined -= ComponentSet(identify_variables(con.body))
    return not undetermined
