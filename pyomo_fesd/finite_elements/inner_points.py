"""What components have at new points inside elements: from the ends of the element.

    value       linear between the ends for what is free or a state, that of the right end for what is fixed and for derivatives
    fixed, active, bounds, scaling factors, left out by the user, multiplied by IDAES        as at the right end

Takes: a model before it gets the points, and then with them.
Leaves: values, flags, bounds and Suffix entries at the new points.
Does not apply: to mutable Params, whose new values their own defaults give.
"""

import logging
from bisect import bisect_right
from collections.abc import Iterator

from pyomo.common.collections import ComponentSet
from pyomo.core import Block, Constraint, Suffix, Var
from pyomo.core.base.var import VarData
from pyomo.dae import ContinuousSet, DerivativeVar
from pyomo.gdp import Disjunct

from pyomo_fesd.core import TimeIndex, derivatives, is_discretisation_equation, signals

logger = logging.getLogger('pyomo_fesd')

PLACES = (Block, Disjunct)
#: The Suffix in which IDAES keeps the factors that it has multiplied equations with.
SCALED_IN_PLACE = 'constraint_transformed_scaling_factor'
#: Names that one message lists.
SHOWN = 3


class InnerPoints:
    """The components over time of ``model`` at the present points, which become those of all points."""

    def __init__(self, model: Block, wrt: ContinuousSet):
        self._model, self._wrt, self._times, self._old = model, wrt, TimeIndex(wrt), list(wrt)
        rates = list(derivatives(model, wrt))
        self._states, self._rates = ComponentSet(d.get_state_var() for d in rates), ComponentSet(rates)
        self._own = ComponentSet(signals(wrt))
        self._families = self._times.families(model.component_data_objects(Var, descend_into=PLACES))
        self._constraints = self._equations()

    def complete(self) -> None:
        """Give all that has a new time what it has at the ends of its element."""
        self._remove_left_out()
        self._copy_activity()
        self._give_values()
        self._copy_suffixes()
        self._scale_equations()

    def _ends(self, label):
        """The boundaries left and right of a new label."""
        k = bisect_right(self._old, label)
        return self._old[k - 1], self._old[k]

    def _new(self, ctype) -> Iterator[tuple]:
        """``(name, label, data)`` of components at new labels."""
        old = set(self._old)
        for name, by_time in self._times.families(self._model.component_data_objects(ctype, descend_into=PLACES)).items():
            for label, data in by_time.items():
                if label not in old:
                    yield name, label, data

    def _equations(self):
        """``{name: {label: data}}`` of the equations that are not pyomo.dae's own."""
        found = self._model.component_data_objects(Constraint, descend_into=PLACES)
        return self._times.families(c for c in found if not is_discretisation_equation(c))

    def _remove_left_out(self):
        """Delete equations that the user has deleted: where the model did not have them, or had them at no time."""
        old = set(self._old)
        for name, by_time in self._equations().items():
            before = self._constraints.get(name, {})
            for label, data in by_time.items():
                if label not in before and (label in old or not before):
                    del data.parent_component()[data.index()]

    def _copy_activity(self):
        """Deactivate what is inactive at the right end of the element."""
        old = set(self._old)
        for data in list(self._model.component_data_objects(descend_into=PLACES)):
            if not hasattr(data, 'deactivate') or not data.active:
                continue
            label = self._times.time(data)
            if label is not None and label not in old:
                source = self._source(data, label)
                if source is not None and not source.active:
                    data.deactivate()

    def _source(self, data, label):
        """The data at the right end of the element; None where it does not exist."""
        try:
            return self._times.at(data, self._ends(label)[1])
        except KeyError:
            return None

    def _give_values(self):
        varied = {}
        for name, label, v in self._new(Var):
            known = self._families.get(name, {})
            left, right = self._ends(label)
            if right not in known or v.parent_component() in self._own:
                continue
            self._give(v, known.get(left), known[right], (label - left) / (right - left))
            if v.fixed and v.parent_component() not in self._states and _differ(known.get(left), known[right]):
                varied.setdefault(name, left)
        varied = {name: left for name, left in varied.items() if left > self._old[0]}
        if varied:
            shown = ', '.join(list(varied)[:SHOWN]) + (f' and {len(varied) - SHOWN} more' if len(varied) > SHOWN else '')
            logger.warning(
                "recollocate: fixed to different values at the times that the model had, and held in each element at the value of "
                "its end, as BACKWARD differences do: %s",
                shown,
            )

    def _give(self, v: VarData, left, right, part):
        v.setlb(right.lower)
        v.setub(right.upper)
        is_state = v.parent_component() in self._states
        v.fixed = right.fixed
        number = right.value
        held = (right.fixed and not is_state) or isinstance(v.parent_component(), DerivativeVar)
        if not held and left is not None and None not in (left.value, number):
            number = (1 - part) * left.value + part * number
        if number is not None:
            v.set_value(number, skip_validation=True)

    def _copy_suffixes(self):
        for suffix in self._model.component_data_objects(Suffix, descend_into=PLACES):
            for data, entry in list(self._entries(suffix)):
                suffix[data] = entry

    def _scale_equations(self):
        """Multiply equations by the factor that IDAES has put into those at the right ends; all of pyomo.dae's own are new."""
        old = set(self._old)
        for suffix in self._model.component_data_objects(Suffix, descend_into=PLACES):
            if suffix.local_name == SCALED_IN_PLACE:
                for c, factor in suffix.items():
                    label = self._times.time(c)
                    if label is not None and (label not in old or self._is_rewritten(c)):
                        _multiply(c, factor)

    def _is_rewritten(self, c):
        name = c.parent_component().local_name
        rate = c.parent_block().component(name.removesuffix('_disc_eq')) if is_discretisation_equation(c) else None
        return rate is not None and rate in self._rates

    def _entries(self, suffix):
        """New data with the entries of the right ends of their elements."""
        inside = {}
        old = set(self._old)
        for label in self._wrt:
            if label not in old:
                inside.setdefault(self._ends(label)[1], []).append(label)
        for data, entry in list(suffix.items()):
            for label in inside.get(self._times.time(data), ()):
                try:
                    new = self._times.at(data, label)
                except KeyError:
                    continue
                if new is not None and new not in suffix:
                    yield new, entry


def _multiply(c, factor):
    """Scale a constraint in place."""
    if c.equality:
        c.set_value(c.body * factor == c.upper * factor)
    else:
        c.set_value(tuple(None if part is None else part * factor for part in (c.lower, c.body, c.upper)))


def _differ(a, b):
    return a is not None and None not in (a.value, b.value) and a.value != b.value
