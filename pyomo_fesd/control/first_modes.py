"""Modes with hysteresis at the first time: part of the state, so they are measured and loaded like a state.

Takes: a moving grid; modes that are active at its first time, as disjuncts or by their names without time.
Leaves: values of the fixed multipliers of the first element, 1 for these modes and 0 for the others of their systems.
Does not apply: to modes without hysteresis, which follow from the states.
"""

from collections.abc import Iterable

from pyomo.common.collections import ComponentSet
from pyomo.core import value
from pyomo.core.base.var import VarData
from pyomo.core.expr.visitor import identify_variables

from pyomo_fesd.core import FesdError, MovingGrid, TimeIndex, all_switched_systems, strip_time


class FirstModes:
    """The modes with hysteresis at the first time of a moving grid.

    Attributes
    ----------
    multipliers : list of VarData
        fixed multipliers of the first element, parameters of a control problem
    """

    def __init__(self, moving: MovingGrid):
        self._wrt, self._times = moving.wrt, TimeIndex(moving.wrt)
        first, last = {moving.wrt.first(), *moving.grid.elements[0].own_labels}, moving.wrt.last()
        self._systems, self._weights, self._ends = {}, {}, {}
        for entry in all_switched_systems(moving.block.model()).hysteresis:
            label, system = self._times.split(entry.disjunction)
            if label is None or entry.disjunct is None:
                continue
            mode = self._name(entry.disjunct)
            self._systems[mode] = system
            if label in first:
                self._weights.setdefault(mode, []).append(entry.weight)
            if label == last:
                self._ends[mode] = entry.weight
        weights = [w for some in self._weights.values() for w in some]
        self.multipliers = list(ComponentSet(v for w in weights for v in identify_variables(w.expr) if v.fixed))

    def load(self, modes: Iterable) -> None:
        """Let some modes be the active ones of their systems at the first time.

        Raises
        ------
        FesdError
            for what is no mode with hysteresis, two modes of one system, and a mode that is not fixed in the model
        """
        active = {}
        for mode in modes:
            name = mode if isinstance(mode, str) else self._name(mode)
            if name not in self._systems:
                known = ', '.join(f"'{known}'" for known in self._systems) or "none"
                raise FesdError(name, "load_modes: not a mode with hysteresis", f"modes with hysteresis of this model: {known}")
            if active.setdefault(self._systems[name], name) != name:
                raise FesdError(
                    name, f"load_modes: '{active[self._systems[name]]}', of the same Disjunction, is given too", "give one"
                )
        chosen = [
            (weight.expr, float(mode in active.values()))
            for mode, weights in self._weights.items()
            for weight in weights
            if self._systems[mode] in active and weight.expr.is_variable_type()
        ]
        for v, _ in chosen:
            _refuse_free(v)
        for v, number in chosen:
            v.set_value(number)

    def at_end(self) -> list[str]:
        """Return the names of the modes that are active at the last time."""
        return [mode for mode, weight in self._ends.items() if value(weight) > 0.5]

    def present(self) -> list[str]:
        """Return the names of the modes that are active at the first time."""
        return [mode for mode, weights in self._weights.items() if value(weights[0]) > 0.5]

    def _name(self, disjunct):
        """A disjunct, or one over all times, by its name without time."""
        data = next(iter(disjunct.values())) if getattr(disjunct, 'is_indexed', bool)() else disjunct
        return strip_time(self._times.split(data)[1])


def _refuse_free(v: VarData):
    if not v.fixed:
        raise FesdError(
            v,
            "load_modes: the mode at the first time is free in this model",
            "fix an indicator at the first time before fesd.dcs, e.g. m.heating[0].indicator_var.fix(True)",
        )
