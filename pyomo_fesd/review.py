"""A look at a solution on moving elements: what a user should know that no certificate says.

* Not unique: on a boundary from which both modes lead away, a Filippov system can stay or leave at any time.  With the rate
  cdot of the switching function, and nu the weight of the mode where c > 0, that is the case where

      cdot(nu = 1) > 0 > cdot(nu = 0)

  at the first time with c = 0, or in a sliding mode (which then repels).
* Overlooked: between its stage points, an element's polynomials go where its mode, condition or guard does not allow it, as at
  an even root of the switching function.

Takes: a solved model with a moving grid.
Leaves: warnings of the logger ``pyomo_fesd``, one for each component.
Does not apply: to switching functions of algebraic variables (the first), or with more than one point where both signs meet.
"""

import logging
from collections import defaultdict
from dataclasses import dataclass

import numpy as np
from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.core import Block, Constraint, value
from pyomo.core.expr.calculus.derivatives import Modes, differentiate
from pyomo.core.expr.visitor import identify_variables
from pyomo.mpec import Complementarity
from scipy.interpolate import BarycentricInterpolator

from pyomo_fesd import marks
from pyomo_fesd.complementarity import read
from pyomo_fesd.elements.cross import grid_of
from pyomo_fesd.elements.jumps import read_jumps
from pyomo_fesd.elements.memory import read_modes
from pyomo_fesd.records import records
from pyomo_fesd.timeindex import DISCRETISATION, TimeIndex, derivatives, strip_time
from pyomo_fesd.trajectory import jumps_that_happen, physical_time

logger = logging.getLogger('pyomo_fesd')

#: A switching function below this is zero; a multiplier farther than this from 0 and 1 slides.
ZERO, SLIDING = 1e-7, 1e-6
#: An excursion counts if it is larger than this part of the function's largest value in the element.
EXCURSION = 1e-4


def review(model):
    """Warn of what the solution in ``model`` overlooks or leaves open; returns the messages.

    Called by ``mpec_hybrid`` and ``simulate`` for the moving grids on the Block that they solve.
    """
    messages = []
    grids = [(wrt, block) for wrt, block in records(model).grids.items() if _is_below(block, model)]
    for wrt, block in grids:
        look = _Look(model, wrt, block)
        messages += [*look.not_unique(), *look.overlooked()]
    for message in messages:
        logger.warning(message)
    return messages


@dataclass(frozen=True)
class _Switching:
    """One switching function over time: labels to the multiplier nu of its positive side and to c itself (c = p - n)."""

    name: str
    nu: dict
    c: dict


class _Look:
    """A look at the solution on one moving grid."""

    def __init__(self, model, wrt, block):
        self._model, self._wrt, self._block = model, wrt, block
        self._grid, self._index, self._time = grid_of(block), TimeIndex(wrt), physical_time(model, wrt)
        self._rates = ComponentMap((d.get_state_var(), d) for d in derivatives(model, wrt))
        self._switching = list(self._read())
        self._starts = defaultdict(ComponentMap)
        for before, _, _, values in jumps_that_happen(model, wrt):
            self._starts[before.n + 1] = ComponentMap(values)

    def _read(self):
        """The switching functions with one multiplier: those of eq. (5), also in the Heaviside form."""
        rules = ComponentMap(marks.marked(self._model, marks.CONTINUOUS))
        selectors = ComponentSet(v for v, _ in marks.marked(self._model, marks.SELECTOR))
        conditions = self._model.component_data_objects(Complementarity, descend_into=Block)
        found = {}
        for condition in filter(marks.is_generated, conditions):
            nu, n = read(condition) if getattr(condition, '_args', None) is not None else (None, None)
            rule = rules.get(n.parent_component()) if _is_variable(n) else None
            if rule is None or rule.ctype is not Constraint or not _is_variable(nu):
                continue
            if nu in selectors or nu.parent_component() in selectors:
                label, name = self._index.split(condition)
                equation = rule[n.index()]
                parts = equation.parent_block().component('p')
                if parts is None:
                    continue  # Stewart's lam belongs to a mode, not to a switching function
                p = parts[n.index()]
                family = found.setdefault(name, _Switching(_name(name), {}, {}))
                # c == p - n
                family.nu[label], family.c[label] = nu, equation.body - equation.upper + p - n
        return found.values()

    # not unique

    def not_unique(self):
        """Messages for boundaries from which both modes lead away."""
        for s in self._switching:
            for label, slides in self._meetings(s):
                rate, slope, nu = *self._rate(s, label), s.nu[label].value
                if slope is not None and slope > 0 and (slides or rate + (1 - nu) * slope > 0 > rate - nu * slope):
                    yield (
                        f"{s.name}: at time {self._time[label]:.6g} both modes lead away from their boundary: the solution is "
                        "not unique, it may stay there or leave at any time. One of them is shown. Start off the boundary."
                    )
                    break

    def _meetings(self, s):
        """Labels at which c = 0 and either mode is possible: the first time, and one of each element that slides."""
        first = self._wrt.first()
        if first in s.c and abs(value(s.c[first])) <= ZERO:
            yield first, False
        for element in self._grid.elements:
            label = element.points[0]
            if label in s.c and SLIDING < s.nu[label].value < 1 - SLIDING and abs(value(s.c[label])) <= ZERO:
                yield label, True

    def _rate(self, s, label):
        """cdot and d cdot/d nu at ``label``, by the equations there; (0, None) if c is no function of states alone."""
        variables = list(identify_variables(s.c[label], include_fixed=True))
        if any(v.parent_component() not in self._rates for v in variables):
            variables = [v for v in variables if not marks.is_generated(v)]
        if not variables or any(v.parent_component() not in self._rates for v in variables):
            return 0.0, None
        gradient = differentiate(s.c[label], wrt_list=variables, mode=Modes.reverse_numeric)
        rates = [self._rates[v.parent_component()][v.index()] for v in variables]
        change = self._change(label, s.nu[label])
        rate = sum(g * r.value for g, r in zip(gradient, rates))
        return rate, sum(g * change.get(r, 0.0) for g, r in zip(gradient, rates))

    def _change(self, label, nu):
        """How derivatives and algebraic variables at ``label`` change with nu, by the implicit function theorem."""
        given = ComponentSet(v for v, _ in marks.marked(self._model, marks.SELECTOR))
        given.update(v for v, _ in marks.marked(self._model, marks.CONTINUOUS))
        rows, columns = [], ComponentMap()
        for c in self._model.component_data_objects(Constraint, active=True, descend_into=Block):
            if c.equality and self._index.time(c) == label and not c.parent_component().local_name.endswith(DISCRETISATION):
                variables = list(identify_variables(c.body))
                row = ComponentMap(zip(variables, differentiate(c.body, wrt_list=variables, mode=Modes.reverse_numeric)))
                unknown = [v for v in variables if self._unknown(v, given)]
                if unknown:
                    rows.append(row)
                    for v in unknown:
                        columns.setdefault(v, len(columns))
        J = np.zeros((len(rows), len(columns)))
        for i, row in enumerate(rows):
            for v, entry in row.items():
                if v in columns:
                    J[i, columns[v]] = entry
        right = -np.array([row.get(nu, 0.0) for row in rows])
        return ComponentMap(zip(columns, np.linalg.lstsq(J, right, rcond=None)[0])) if columns else ComponentMap()

    def _unknown(self, v, given):
        home = v.parent_component()
        return home not in self._rates and v not in given and home not in given

    # overlooked

    def overlooked(self):
        """Messages for elements between whose stage points a function goes where it must not."""
        for name, signs, functions in self._kept():
            for element, sign in zip(self._grid.elements, signs):
                when = self._excursion(functions, element, sign) if sign else None
                if when is not None:
                    yield (
                        f"{name}: near time {when:.6g} the solution leaves its region between two stage points and comes back, "
                        "which the elements do not see. Take more elements (nfe)."
                    )
                    break

    def _kept(self):
        """``(name, sign for each element, {label: expression})`` of everything that keeps its sign inside an element."""
        elements = self._grid.elements
        for s in self._switching:
            yield s.name, [self._sign(s.c, e) for e in elements], s.c
        for mode in read_modes(self._model, self._wrt):
            active = [int((value(mode.weight(e), exception=False) or 0) > 0.5) for e in elements]
            for k in range(min(map(len, mode.conditions.values()))):
                yield _name(mode.name), active, {t: cs[k] for t, cs in mode.conditions.items()}
        for jump in read_jumps(self._model, self._wrt):
            yield jump.name, [1] * len(elements), jump.guards

    @staticmethod
    def _sign(c, element):
        """The sign that c has at the stage points of an element; 0 if it slides."""
        values = [value(c[t]) for t in element.points if t in c]
        largest = max(values, key=abs, default=0.0)
        return 0 if abs(largest) <= ZERO else int(np.sign(largest))

    def _excursion(self, functions, element, sign):
        """The time at which sign c is clearly negative inside an element; None if it is not."""
        labels = (element.left, *element.points)
        if any(t not in functions for t in labels):
            return None
        at_stages = np.array([sign * value(functions[t]) for t in element.points])
        largest = np.abs(at_stages).max()
        if largest <= ZERO or at_stages.min() > 2 * np.ptp(at_stages):
            return None  # it slides, or stays far from zero
        tau, inside = np.array([0.0, *self._grid.tau]), np.linspace(0.0, 1.0, 14)[1:-1]
        values = sign * self._between(functions, element, tau, inside)
        worst = int(np.argmin(values))
        if values[worst] >= -EXCURSION * max(largest, np.abs(values).max()):
            return None
        start, end = self._time[element.left], self._time[element.right]
        return start + inside[worst] * (end - start)

    def _between(self, functions, element, tau, inside):
        """The function at relative times ``inside``, of variables interpolated between the points of an element."""
        rows = [list(identify_variables(functions[t], include_fixed=True)) for t in (element.left, *element.points)]
        numbers = [[v.value for v in row] for row in rows]
        numbers[0] = [self._starts[element.n].get(v, v.value) for v in rows[0]]
        polynomials = [BarycentricInterpolator(tau, column)(inside) for column in zip(*numbers)]
        kept = [(v, v.value, v.stale) for v in rows[-1]]
        try:
            values = []
            for k in range(len(inside)):
                for v, polynomial in zip(rows[-1], polynomials):
                    v.set_value(polynomial[k], skip_validation=True)
                values.append(value(functions[element.points[-1]]))
        finally:
            for v, old, stale in kept:
                v.set_value(old, skip_validation=True)
                v.stale = stale
        return np.array(values)


def _is_below(block, model):
    while block is not None and block is not model:
        block = block.parent_block()
    return block is model


def _is_variable(expr):
    return getattr(expr, 'is_variable_type', bool)()


def _name(name):
    """A family's name for people: the Disjunction or mode without time and without the package's own blocks."""
    parts = [p for p in strip_time(name).split('.') if not p.startswith(marks.GENERATED)]
    return '.'.join(parts[:-1]) or parts[-1]
