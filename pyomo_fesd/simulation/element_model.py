"""Copy the equations of one element into a model of their own, in which the known values are parameters."""

from collections.abc import Sequence

import pyomo.environ as pyo
from pyomo.mpec import Complementarity, complements

from pyomo_fesd.core import FesdError, Pair, exchanged, variables_of
from pyomo_fesd.simulation.element_equations import ElementEquations


class ElementModel:
    """Unknowns, known values and rows of the element class of ``pattern``.

    Attributes
    ----------
    model : ConcreteModel
        with ``unknown``, ``known`` (fixed, at first with the ``typical`` values of ``pattern``) and ``row``
    length : VarData or None
        the length multiplier
    """

    def __init__(self, pattern: ElementEquations):
        self.model = m = pyo.ConcreteModel()
        m.unknown, m.known = pyo.Var(range(len(pattern.unknown))), pyo.Var(range(len(pattern.known)))
        self._copies = {id(v): m.unknown[k] for k, v in enumerate(pattern.unknown)}
        self._copies.update((id(v), m.known[k]) for k, v in enumerate(pattern.known))
        m.scaling_factor = pyo.Suffix(direction=pyo.Suffix.EXPORT)
        for v, bounds in zip(pattern.unknown, pattern.bounds):
            self._copies[id(v)].bounds = bounds
            self._copies[id(v)].set_value(v.value, skip_validation=True)
        factors = pattern.factors
        self.length = None if pattern.length is None else self._copies[id(pattern.length)]
        for v in pattern.unknown:
            factor = factors.get(v, None if v is pattern.length else pattern.size_factor(v))
            if factor is not None:
                m.scaling_factor[self._copies[id(v)]] = factor
        m.row = pyo.ConstraintList()
        for row in pattern.all_rows:
            self._add(row, pattern, factors)
        self.set_known(pattern)
        for v, number in pattern.typical.items():
            if id(v) in self._copies:
                self._copies[id(v)].set_value(number)
        m.known.fix()

    def _add(self, row, pattern, factors):
        """Add a row, unless it contains known values only."""
        unknown = [v for v in variables_of([row]) if self._copies[id(v)].parent_component() is self.model.unknown]
        if not unknown:
            return
        added = self.model.row.add(exchanged(row, self._copies))
        # the scale of a row is that of its variables, if the user has given all of them a factor
        given = [factors.get(v) for v in unknown if v is not pattern.length]
        if given and None not in given:
            self.model.scaling_factor[added] = min(given)

    def add_pairs(self, name: str, pairs: Sequence[Pair]) -> None:
        """Add ``pairs`` to the model, as Complementarities ``name`` in their order."""
        self.model.add_component(name, Complementarity(range(len(pairs))))
        for i, pair in enumerate(pairs):
            G, H = (exchanged(side, self._copies) for side in pair)
            self.model.component(name).add(i, complements(G >= 0, H >= 0))

    def set_known(self, equations: ElementEquations) -> None:
        """Take the known values from other ``equations`` of the class."""
        for k, number in enumerate(known_values(equations)):
            self.model.known[k].set_value(number)


def known_values(equations: ElementEquations) -> list[float]:
    """Return the present values of the known variables.

    Raises
    ------
    FesdError
        naming a variable without a value
    """
    found = [v.value for v in equations.known]
    if None in found:
        raise FesdError(equations.known[found.index(None)], "simulate: it has no value", "give it one")
    return found


def write_values(equations: ElementEquations, values: Sequence[float]) -> None:
    """Write ``values`` of the unknowns into the user's model; the caller sets the length multiplier."""
    length = equations.length
    for v, number in zip(equations.unknown, values):
        if v is not length:
            v.set_value(number, skip_validation=True)
