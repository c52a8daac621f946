"""The problem of one element as a model of its own, with the values of what is known as parameters.

Takes: ``Equations``.
Leaves: nothing in the user's model.
"""

import pyomo.environ as pyo
from pyomo.core.expr.visitor import replace_expressions
from pyomo.mpec import Complementarity, complements

from pyomo_fesd.errors import FesdError
from pyomo_fesd.march.equations import variables_of


class Scene:
    """Unknowns, known values and rows of one kind of problem.

    Parameters
    ----------
    pattern : Equations
        any problem of the kind

    Attributes
    ----------
    model : ConcreteModel
        with ``unknown``, ``known`` (fixed) and ``row``
    length : VarData or None
        the length multiplier
    rows : dict name -> list of ConstraintData
        the limits
    """

    def __init__(self, pattern):
        self.model = m = pyo.ConcreteModel()
        m.unknown, m.known = pyo.Var(range(len(pattern.unknown))), pyo.Var(range(len(pattern.known)))
        self._own = {id(v): m.unknown[k] for k, v in enumerate(pattern.unknown)}
        self._own.update((id(v), m.known[k]) for k, v in enumerate(pattern.known))
        m.scaling_factor = pyo.Suffix(direction=pyo.Suffix.EXPORT)
        for v, bounds in zip(pattern.unknown, pattern.bounds):
            self._own[id(v)].bounds = bounds
            self._own[id(v)].set_value(v.value, skip_validation=True)
        factors = pattern.factors
        for v, factor in factors.items():
            m.scaling_factor[self._own[id(v)]] = factor
        self.length = None if pattern.length is None else self._own[id(pattern.length)]
        m.row = pyo.ConstraintList()
        for row in pattern.rows:
            self._add(row, pattern, factors)
        self.rows = {name: [self._add(row, pattern, factors) for row in rows] for name, rows in pattern.limits.items()}
        self.know(pattern)
        m.known.fix()

    def _add(self, row, pattern, factors):
        """Add a row; None if it holds between known values only, and so is no condition on the others."""
        unknown = [v for v in variables_of([row]) if self._own[id(v)].parent_component() is self.model.unknown]
        if not unknown:
            return None
        added = self.model.row.add(replace_expressions(row, self._own))
        # the scale of a row is that of its variables, if the user has given all of them a factor
        given = [factors.get(v) for v in unknown if v is not pattern.length]
        if given and None not in given:
            self.model.scaling_factor[added] = min(given)
        return added

    def add_pairs(self, name, pairs):
        """Add ``pairs`` to the model, as Complementarities ``name`` in their order."""
        self.model.add_component(name, Complementarity(range(len(pairs))))
        for i, pair in enumerate(pairs):
            G, H = (replace_expressions(side, self._own) for side in pair)
            self.model.component(name).add(i, complements(G >= 0, H >= 0))

    def know(self, equations):
        """Take the present values of what is known from other ``equations`` of the kind."""
        for k, number in enumerate(known_values(equations)):
            self.model.known[k].set_value(number)


def known_values(equations):
    """Present values of what is known.

    Raises
    ------
    FesdError
        naming a variable without a value
    """
    found = [v.value for v in equations.known]
    if None in found:
        raise FesdError(equations.known[found.index(None)], "simulate: it has no value", "give it one")
    return found


def put_out(equations, values):
    """Write ``values`` of the unknowns of ``equations`` into the user's model; a length is the caller's business."""
    for v, number in zip(equations.unknown, values):
        if v is not equations.length:
            v.set_value(number, skip_validation=True)
