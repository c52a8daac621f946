"""Which variables are continuous in time, found from the equations.

Cross complementarity lets a side that is continuous enter with its value at the left boundary of an element (theory, eq. 11),
so a switch cannot hide between two elements.  Continuous are differential states; what ``fesd.dcs`` and the kinks have marked,
where the quantity that switches is continuous itself; algebraic variables that equations tie to continuous ones; and what the
user names with the keyword ``continuous``.  Held controls are continuous inside a control stage and jump at its boundaries.
"""

from dataclasses import dataclass

import numpy as np
from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.core import Block, Constraint
from pyomo.core.expr.visitor import identify_variables
from pyomo.mpec import Complementarity
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import maximum_bipartite_matching

from pyomo_fesd import marks
from pyomo_fesd.timeindex import DISCRETISATION, derivatives


@dataclass(frozen=True)
class Continuity:
    """What is continuous, for components over time or their data at the first inner time.

    Attributes
    ----------
    rules : ComponentMap Var -> Constraint or Complementarity
        what ties each marked variable to the states
    inside : ComponentSet
        continuous inside every control stage
    across : ComponentSet
        continuous at the boundaries of control stages too
    """

    rules: ComponentMap
    inside: ComponentSet
    across: ComponentSet

    def holds(self, expr):
        """Whether ``expr`` is a function of variables that are continuous inside every stage."""
        return _all_in(expr, self.inside)

    def jumps_at_stages(self, expr):
        """Whether ``expr`` contains a held control, or something that follows from one."""
        return not _all_in(expr, self.across)

    def rule(self, expr):
        """The Constraint that ties a marked variable to the states; None for any other side."""
        rule = self.rules.get(expr.parent_component()) if expr.is_variable_type() else None
        return rule if rule is not None and rule.ctype is Constraint else None


def _all_in(expr, known):
    variables = list(identify_variables(expr, include_fixed=True)) if hasattr(expr, 'is_expression_type') else []
    return bool(variables) and all(_in(v, known) for v in variables)


def _in(v, known):
    return v in known or v.parent_component() in known


def read_continuity(model, times, held, told, trace):
    """Find the continuous variables of a discretised model.

    Parameters
    ----------
    times : TimeIndex
    held : ComponentSet of Var
        controls that are constant on each stage
    told : list of Var
        variables of which the user says that they are continuous
    trace : bool
        whether algebraic variables matter: they do not where ``fesd.dcs`` wrote every condition
    """
    rules = ComponentMap(marks.marked(model, marks.CONTINUOUS))
    equations = _Equations(model, times) if trace or any(r.ctype is Complementarity for r in rules.values()) else None
    start = ComponentSet(d.get_state_var() for d in derivatives(model, times.wrt))
    start.update(told)
    across = _closure(start, rules, held, equations)
    start.update(held)
    return Continuity(rules, _closure(start, rules, (), equations) if held else across, across)


def _closure(start, rules, held, equations):
    """``start`` and all that follows from it; nothing that contains a held control does."""
    known = ComponentSet(start)
    for v, rule in rules.items():
        if rule.ctype is Constraint:
            known.update(_without(v, rule, held))
    if equations is None:
        return known
    kinks = [(v, rule) for v, rule in rules.items() if rule.ctype is Complementarity and equations.here(v)]
    while True:
        known.update(equations.tied(known))
        ready = [v for v, rule in kinks if v not in known and all(u is s or _in(u, known) for s, u in equations.kink(v, rule))]
        if not ready:
            return known
        known.update(ready)


def _without(v, rule, components):
    """A marked Var, or those data of it whose own equations contain none of ``components``."""
    if not components:
        return [v]
    jumping = {
        index for index, data in rule.items() if any(u.parent_component() in components for u in identify_variables(data.body))
    }
    return [v[index] for index in v if index in rule and index not in jumping] if jumping else [v]


class _Equations:
    """The algebraic equations of one inner time, as lists of the variables that they contain."""

    def __init__(self, model, times):
        self._times = times
        self._label = list(times.wrt)[1]
        constraints = model.component_data_objects(Constraint, active=True, descend_into=Block)
        self._rows = [
            [v for v in identify_variables(c.body) if times.time(v) is not None]
            for c in constraints
            if c.equality and times.time(c) == self._label and not c.parent_component().local_name.endswith(DISCRETISATION)
        ]

    def here(self, component):
        """Whether a marked component has data at this time."""
        return any(True for _ in self._data(component))

    def _data(self, component):
        return (v for v in component.values() if self._times.time(v) == self._label)

    def kink(self, component, condition):
        """``(s, variable)`` for every variable of the conditions that define s = max(0, z) at this time."""
        for s in self._data(component):
            for side in condition[s.index()]._args:
                yield from ((s, v) for v in identify_variables(side, include_fixed=True))

    def tied(self, known):
        """Variables that equations tie to known ones.

        They are the unknowns of the equations that are not under-determined (Dulmage and Mendelsohn): those that no alternating
        path connects with an unmatched unknown.
        """
        rows = [[v for v in row if not _in(v, known)] for row in self._rows]
        columns = ComponentMap()
        for row in rows:
            for v in row:
                columns.setdefault(v, len(columns))
        places = [(i, columns[v]) for i, row in enumerate(rows) for v in row]
        if not places:
            return ComponentSet()
        incidence = csr_matrix((np.ones(len(places)), tuple(zip(*places))), shape=(len(rows), len(columns)))
        loose = _under_determined(incidence)
        return ComponentSet(v for v, j in columns.items() if j not in loose)


def _under_determined(incidence):
    """Columns that an alternating path connects with an unmatched column."""
    row_of = maximum_bipartite_matching(incidence, perm_type='row')  # of each column, -1 if unmatched
    column_of = {i: j for j, i in enumerate(row_of) if i >= 0}
    by_column, loose = incidence.tocsc(), {j for j, i in enumerate(row_of) if i < 0}
    waiting = list(loose)
    while waiting:
        j = waiting.pop()
        for i in by_column.indices[by_column.indptr[j] : by_column.indptr[j + 1]]:
            if column_of[i] not in loose:
                loose.add(column_of[i])
                waiting.append(column_of[i])
    return loose
