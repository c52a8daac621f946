"""The rows of one element class, and both sides of its conditions, as casadi expressions with their derivatives and factors.

    V(x, p) = distances of rows from their bounds, then sides;    w = s_x x unknowns,   p known values

Factors follow the rules of ``mpcc.compile``: those of the user, else by sizes at the start.

Takes: ``ElementEquations``.
Leaves: ``ElementFunctions``.
Does not apply: to functions that casadi does not have (``Unsupported``).
"""

import casadi as ca
import numpy as np
from pyomo.core.expr import EqualityExpression

from pyomo_fesd.simulation.casadi_expressions import CasadiExpressions, difference
from pyomo_fesd.simulation.element_equations import ElementEquations
from pyomo_fesd.simulation.element_scale import element_scale


class ElementFunctions:
    """Expressions of the element class of ``pattern``, in the units of the model.

    Attributes
    ----------
    x, p : SX
        symbols of the unknowns that the equations contain, and of all known values
    order : int array
        positions of x among the unknowns of the equations
    V, slopes : SX
        distances and sides, and their derivatives by x
    factors : array
        of the entries of V in the solver's scale
    depends : bool array
        whether an entry of V depends on x
    equations, others : list of int
        entries that are residuals of equations; distances of other rows from their bounds, which are not negative at a solution
    events : list of int
        the event functions that have unknowns at all labels, one after the other
    points : dict name -> (list of int, list of int)
        sides G and sides H of each condition over time that has labels
    cross : list of (int, int)
        both sides of the aggregated pairs
    s_x, lower, upper : arrays
        factors and scaled bounds of x
    """

    def __init__(self, pattern: ElementEquations, user_scaling: bool = True):
        every, self.p = ca.SX.sym('x', len(pattern.unknown)), ca.SX.sym('p', len(pattern.known))
        symbols = zip([*pattern.unknown, *pattern.known], [*ca.vertsplit(every), *ca.vertsplit(self.p)])
        rows = ElementRows(pattern, {id(v): symbol for v, symbol in symbols})
        self.order = np.array([k for k, v in enumerate(pattern.unknown) if id(v) in rows.met], dtype=int)
        self.x = every[self.order.tolist()]
        bounds = [pattern.bounds[k] for k in self.order.tolist()]
        lower, upper = (np.array([end if b[i] is None else b[i] for b in bounds]) for i, end in enumerate((-np.inf, np.inf)))
        self.V = ca.vertcat(ca.SX(0, 1), *rows.distances, *rows.sides)
        slopes = ca.jacobian(self.V, ca.vertcat(self.x, self.p))
        scale = element_scale(pattern, rows, self, slopes, (lower, upper), user_scaling)
        self.s_x, self.lower, self.upper = scale.x, lower * scale.x, upper * scale.x
        self.slopes, self.factors = slopes[:, : self.x.numel()], np.concatenate([scale.rows, scale.sides])
        self.depends = np.zeros(self.V.numel(), dtype=bool)
        self.depends[self.slopes.sparsity().row()] = True
        self.equations, self.others, self.events = rows.equations, rows.others, rows.events
        # sides come after the distances
        begin = len(rows.distances)
        self.points = {name: tuple([begin + k for k in some] for some in both) for name, both in rows.points.items()}
        self.cross = [tuple(begin + k for k in both) for both in rows.cross]


class ElementRows:
    """Distances of rows from their bounds and sides of conditions, in the units of the model, and what they belong to.

    Attributes
    ----------
    distances, sides : list of SX
    unknown : list of list of VarData
        the unknowns of each distance
    written : list of expressions
        each side as the model writes it
    met : dict id -> VarData
        all variables in them
    equations, others, events : list of int, numbers of distances
    points, cross : numbers of sides, as the attributes of ``ElementFunctions``
    """

    def __init__(self, pattern: ElementEquations, symbols: dict):
        self._writer, self._unknown = CasadiExpressions(symbols), set(map(id, pattern.unknown))
        self.distances, self.unknown, self.sides, self.written, self.met = [], [], [], [], {}
        rows = [(row, self._row(row)) for row in pattern.rows]
        events = [[self._row(row) for row in some] for some in pattern.event_functions.values()]
        self.equations = [k for row, numbers in rows for k in numbers if isinstance(row, EqualityExpression)]
        self.events = [k for some in events if all(some) for numbers in some for k in numbers]
        self.others = sorted({*range(len(self.distances))}.difference(self.equations, self.events))
        found = {name: some.pairs for name, some in pattern.point_pairs.items() if some.number}
        self.points = {name: tuple(list(map(self._side, some)) for some in zip(*pairs)) for name, pairs in found.items()}
        self.cross = [tuple(map(self._side, pair)) for pair in pattern.cross_pairs]

    def _row(self, row):
        """Numbers of the distances of one row; none if it has known values only."""
        met = {}
        parts = [self._writer.of(part, met) for part in row.args]
        self.met.update(met)
        unknown = [v for k, v in met.items() if k in self._unknown]
        begin = len(self.distances)
        for low, high in zip(parts, parts[1:]) if unknown else ():
            self.distances.append(difference(high, low))
            self.unknown.append(unknown)
        return range(begin, len(self.distances))

    def _side(self, side):
        self.sides.append(self._writer.of(side, self.met))
        self.written.append(side)
        return len(self.sides) - 1
