"""Read the equations of one element of a moving grid from the model: equations, signs, pairs, unknowns.

Does not apply: to inequalities of the user and conditions like them (``requirements``), which do not determine a simulation.
"""

from collections import defaultdict
from collections.abc import Container
from dataclasses import replace
from itertools import chain, groupby

from pyomo.common.collections import ComponentSet
from pyomo.core import Block, Constraint, value
from pyomo.core.base.suffix import Suffix, SuffixFinder
from pyomo.core.base.var import VarData
from pyomo.core.expr import RangedExpression
from pyomo.mpec import Complementarity

from pyomo_fesd.core import (
    MovingGrid,
    StructuralKey,
    TimeIndex,
    any_number,
    data_of,
    derivatives,
    is_discretisation_equation,
    is_generated,
    nine_digits,
    own_components,
    read_complementarity,
    variables_of,
)
from pyomo_fesd.simulation.element_equations import ElementEquations, PointPairs
from pyomo_fesd.simulation.requirements import Requirements

#: A side below this part of the other is zero.
STRICT = 1e-5


class EquationReader:
    """Reads the equations of a moving grid; variables over time in ``given`` are known.

    Attributes
    ----------
    requirements : Requirements
        conditions that are left out, with variables that are known
    """

    def __init__(self, model: Block, moving: MovingGrid, times: TimeIndex, given: Container[VarData]):
        self._model, self._moving, self._times, self._given = model, moving, times, given
        self._states = ComponentSet(d.get_state_var() for d in derivatives(model, times.wrt))
        self._first, self._classes, self._factor = times.wrt.first(), {}, _scaling_factors(model.model())
        self._rows_at, self._rows_of, self._copies_of = defaultdict(list), defaultdict(list), defaultdict(list)
        self._read_rows()
        self._read_copies()
        self._read_grid_rows()
        self.requirements = self._read_requirements()
        self._conditions, self._pairs = defaultdict(list), defaultdict(list)
        self._read_conditions()

    def _read_rows(self):
        """Equations of the user and generated rows, by label."""
        between = None if self._moving.hysteresis is None else self._moving.hysteresis.block
        for component in own_components(self._model, Constraint, Block, active=True):
            generated = is_generated(component)
            for c in data_of(component) if component.parent_block() is not between else ():
                label = self._label(c, generated) if c.active and (generated or c.equality) else None
                if label is not None:
                    self._rows_at[label].append(c)

    def _label(self, c, generated):
        """The time of a row; an equation of the user without one, scalar or in a ConstraintList, may be one of the first time."""
        label = self._times.time(c)
        return self._first if label is None and not generated and self._is_initial(c) else label

    def _is_initial(self, equation):
        """Whether an equation contains variables of the first time, and of no other."""
        labels = {self._times.time(v) for v in variables_of([equation.body])} - {None}
        return labels == {self._first}

    def _read_copies(self):
        """Copies of variables right of a boundary, and their equations, by element."""
        jumps = None if self._moving.state_jumps is None else self._moving.state_jumps.block
        for block, later in ((jumps, 1), (self._moving.limits, 0)):
            for (n, _), c in block.copied.items() if block is not None else ():
                self._rows_of[n + later].append(c)
            for (n, _), v in block.copy.items() if block is not None else ():
                self._copies_of[n + later].append(v)
        impacts = None if self._moving.state_jumps is None else self._moving.state_jumps.impacts
        if impacts is not None and impacts.drift is not None:
            for (_, n, _), v in chain(impacts.drift.items(), impacts.rate.items()):
                self._copies_of[n].append(v)
            for (_, n, _), c in chain(impacts.rates.items(), impacts.closed.items()):
                self._rows_of[n].append(c)

    def _read_grid_rows(self):
        """Signs and left limits by label, signs after jumps by element."""
        for c in chain(_data(self._moving.nonnegative), _data(self._moving.left_limit)):
            label = max(t for t in map(self._times.time, variables_of([c.body])) if t is not None)
            self._rows_at[label].append(c)
        for c in _data(self._moving.sign_after):
            self._rows_of[c.index()[1]].append(c)

    def _read_requirements(self):
        found = Requirements(self._moving.complementarities, self._rows_at.__getitem__, self._times, self._given)
        self._given = ComponentSet(chain(self._given, found.variables))
        for t, rows in self._rows_at.items() if found.equations else ():
            self._rows_at[t] = [c for c in rows if id(c) not in found.equations]
        found.prepare()
        return found

    def _read_conditions(self):
        """Conditions by label, aggregated pairs by element, and the conditions over time, without requirements."""
        names = self.requirements.names
        self._over_time = [c for c in self._moving.complementarities if c.name not in names]
        for index, c in self._moving.pairs.items():
            if index[0] not in names:
                self._pairs[index[1]].append(c)
        left_out = {id(c) for f in self._moving.complementarities if f.name in names for c in f.conditions.values()}
        for c in self._model.component_data_objects(Complementarity, descend_into=Block):
            label = self._times.time(c)
            if label is not None and getattr(c, '_args', None) is not None and id(c) not in left_out:
                self._conditions[label].append(c)

    def first(self, label: float) -> ElementEquations:
        """Return the algebraic equations of the first time; conditions hold there as they are."""
        conditions = [c for c in self._conditions[label] if c.active]
        pairs = [read_complementarity(c) for c in conditions]
        over_time = [f for f in self._over_time if label in f.sides]
        points = {f.name: PointPairs([f.sides[label]], 1, f.continuous) for f in over_time}
        return self._equations(self._rows_at[label], {}, pairs, points, conditions, (label,))

    def element(self, element, event_functions: dict) -> ElementEquations:
        """Return the equations of an element that also ends where one of the ``event_functions`` falls to zero."""
        labels, n = element.own_labels, element.n
        rows = [*(c for t in labels for c in self._rows_at[t]), *self._rows_of[n]]
        pairs = [read_complementarity(c) for c in self._pairs[n]]
        conditions = [c for t in labels for c in self._conditions[t]]
        points = {f.name: PointPairs.read(f, element) for f in self._over_time}
        chosen = [self._moving.r[n], *self._copies_of[n]]
        return self._equations(rows, event_functions, pairs, points, conditions, labels, chosen)

    def boundary(self, b: int, closed: Container[str]) -> ElementEquations:
        """Return the laws of impact at boundary ``b`` for the ``closed`` contacts, whose gaps are taken for zero."""
        jumps = self._moving.state_jumps
        copies, copied = ([found[i] for i in found if i[0] == b] for found in (jumps.copy, jumps.copied))
        pairs = [*jumps.impacts.closed_pairs(b, closed), *map(read_complementarity, jumps.impacts.slip_pairs(b))]
        rows = [*jumps.impacts.rows(b, closed), *copied]
        return replace(self._equations(rows, {}, pairs, {}, [], (), [*jumps.impacts.unknown(b, closed), *copies]), length=None)

    def _equations(self, constraints, event_functions, pairs, points, conditions, labels, chosen=()):
        """Assemble the record; ``chosen`` are unknowns whatever the equations contain, the length multiplier first."""
        key = StructuralKey()
        for is_collocation, some in groupby(constraints, is_discretisation_equation):
            # labels are rounded, and so are the coefficients of collocation
            key.extend([c.expr for c in some], any_number if is_collocation else nine_digits)
        key.extend(chain(*event_functions.values(), *pairs, *(pair for p in points.values() for pair in p.pairs)))
        unknown = self._unknown(key.variables, chosen, labels)
        positions = set(map(id, unknown))
        bounds = tuple(map(self._bounds, unknown))
        structure = (
            tuple(key.tokens),
            tuple(id(v) in positions for v in key.variables),
            bounds,
            tuple(p.structure for p in points.values()),
            tuple(event_functions),
        )
        return ElementEquations(
            rows=list(map(_relation, constraints)),
            event_functions=event_functions,
            cross_pairs=pairs,
            point_pairs=points,
            conditions=conditions,
            labels=labels,
            points=labels[: len(self._moving.grid.tau)],
            length=next(iter(chosen), None),
            unknown=unknown,
            known=[v for v in key.variables if id(v) not in positions],
            bounds=bounds,
            element_class=self._classes.setdefault(structure, len(self._classes)),
            times=self._times,
            factor=self._factor,
        )

    def _unknown(self, variables, chosen, labels):
        taken = set(map(id, chosen))
        return [*chosen, *(v for v in variables if id(v) not in taken and self._is_determined(v, labels))]

    def _is_determined(self, v, labels):
        if self._times.time(v) not in labels or v in self._given:
            return False
        # a state that is fixed later than at the first time, as at the end of a control problem, is simulated all the same
        return not v.fixed or (self._is_state(v) and self._times.time(v) != self._first)

    def _is_state(self, v):
        return v.parent_component() in self._states

    def _bounds(self, v):
        return (None, None) if self._is_state(v) else (v.lb, v.ub)

    def active_set(self, label: float) -> dict[str, bool] | None:
        """Return for each condition at one label whether its H (else its G) is zero; None if both sides of one are zero."""
        found = {}
        for condition in self._over_time:
            if label in condition.sides:
                G, H = map(abs, map(value, condition.sides[label]))
                if min(G, H) > STRICT * max(G, H) or max(G, H) < STRICT:
                    return None
                found[condition.name] = G > H
        return found


def _scaling_factors(model):
    """The function that returns the user's scaling factor of a variable, or None."""
    present = any(s.local_name == 'scaling_factor' for s in model.component_objects(Suffix, active=True))
    return SuffixFinder('scaling_factor', None, model).find if present else lambda v: None


def _relation(constraint):
    """The relation that a constraint states; an equation also where two equal bounds state it."""
    expr = constraint.expr
    return constraint.body == constraint.upper if isinstance(expr, RangedExpression) and constraint.equality else expr


def _data(component):
    return () if component is None else component.values()
