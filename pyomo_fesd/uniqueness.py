"""Solutions that are not unique: on a boundary from which both modes lead away, a Filippov system can stay or leave at any time.

With the rate cdot of the switching function, and nu the weight of the mode where c > 0, that is the case where

    cdot(nu = 1) > 0 > cdot(nu = 0)

at the first time with c = 0, or in a sliding mode (which then repels).

Takes: a solved model with a moving grid.
Leaves: messages.
Does not apply: to switching functions that contain algebraic variables, or where several surfaces meet.
"""

from collections import defaultdict

import numpy as np
from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.core import Block, Constraint, value
from pyomo.core.expr.calculus.derivatives import Modes, differentiate
from pyomo.core.expr.visitor import identify_variables
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import lsqr

from pyomo_fesd import marks
from pyomo_fesd.elements.cross import grid_of
from pyomo_fesd.records import records
from pyomo_fesd.switching import size
from pyomo_fesd.timeindex import DISCRETISATION, TimeIndex, derivatives
from pyomo_fesd.trajectory import physical_time

#: A switching function below this part of its largest value is zero; a multiplier farther than this from 0 and 1 slides.
ZERO, SLIDING = 1e-7, 1e-6
#: Accuracy of the linear equations.
EXACT = 1e-10


def not_unique(model, wrt, functions):
    """Messages for boundaries from which both modes lead away."""
    grid, time, rates = grid_of(records(model).grids[wrt]), None, None
    for s in functions:
        for label, slides in _meetings(s, grid, wrt):
            rates = rates or _Rates(model, wrt)
            rate, slope, nu = *rates.of(s, label), s.nu[label].value
            if slope > 0 and (slides or rate + (1 - nu) * slope > 0 > rate - nu * slope):
                time = time or physical_time(model, wrt)
                yield (
                    f"{s.name}: at time {time[label]:.6g} both modes lead away from their boundary: the solution is "
                    "not unique, it may stay there or leave at any time. One of them is shown. Start off the boundary."
                )
                break


def _meetings(s, grid, wrt):
    """``(label, whether it slides)`` where c = 0 and either mode is possible: the first time, and where a slide begins."""
    first, before, zero = wrt.first(), False, ZERO * size(s.c)
    if first in s.c and abs(value(s.c[first])) <= zero:
        yield first, False
    for element in grid.elements:
        label = element.points[0]
        slides = label in s.c and SLIDING < s.nu[label].value < 1 - SLIDING and abs(value(s.c[label])) <= zero
        if slides and not before:
            yield label, True
        before = slides


class _Rates:
    """How fast switching functions change, by the equations at a label."""

    def __init__(self, model, wrt):
        self._rates = ComponentMap((d.get_state_var(), d) for d in derivatives(model, wrt))
        self._given = ComponentSet(v for name in (marks.SELECTOR, marks.CONTINUOUS) for v, _ in marks.marked(model, name))
        self._rows, self._linear, times = defaultdict(list), {}, TimeIndex(wrt)
        for c in model.component_data_objects(Constraint, active=True, descend_into=Block):
            if c.equality and not c.parent_component().local_name.endswith(DISCRETISATION):
                self._rows[times.time(c)].append(c)

    def of(self, s, label):
        """cdot and d cdot/d nu at ``label``; (0, 0) if c is no function of states alone."""
        # the parts p and n cancel out of c
        variables = [v for v in identify_variables(s.c[label], include_fixed=True) if not marks.is_generated(v)]
        if not variables or any(v.parent_component() not in self._rates for v in variables):
            return 0.0, 0.0
        gradient = differentiate(s.c[label], wrt_list=variables, mode=Modes.reverse_numeric)
        rates = [self._rates[v.parent_component()][v.index()] for v in variables]
        change = self._change(label, s.nu[label])
        return sum(g * r.value for g, r in zip(gradient, rates)), sum(g * change.get(r, 0.0) for g, r in zip(gradient, rates))

    def _change(self, label, nu):
        """How derivatives and algebraic variables at ``label`` change with nu, by the implicit function theorem."""
        if label not in self._linear:
            self._linear[label] = self._linearised(label)
        columns, J, others = self._linear[label]
        if not columns:
            return ComponentMap()
        right = np.zeros(J.shape[0])
        for row, gradient in others.get(id(nu), ()):
            right[row] -= gradient
        return ComponentMap(zip(columns, lsqr(J, right, atol=EXACT, btol=EXACT)[0]))

    def _linearised(self, label):
        """Columns and Jacobian of the unknowns in the equations at ``label``; by id, where the other variables stand in them."""
        columns, entries, others, number = ComponentMap(), [], defaultdict(list), 0
        for c in self._rows[label]:
            variables = list(identify_variables(c.body))
            unknown = [self._unknown(v) for v in variables]
            if not any(unknown):
                continue
            gradient = differentiate(c.body, wrt_list=variables, mode=Modes.reverse_numeric)
            for v, g, sought in zip(variables, gradient, unknown):
                if sought:
                    entries.append((g, number, columns.setdefault(v, len(columns))))
                else:
                    others[id(v)].append((number, g))
            number += 1
        if not entries:
            return columns, None, others
        numbers, rows, places = zip(*entries)
        return columns, csr_matrix((numbers, (rows, places)), shape=(number, len(columns))), others

    def _unknown(self, v):
        home = v.parent_component()
        return home not in self._rates and v not in self._given and home not in self._given
