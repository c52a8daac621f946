"""Which variables are continuous in time, found from the equations.

Cross complementarity lets a side that is continuous enter with its value at the left boundary of an element (theory, eq. 11),
so a switch cannot hide between two elements.  Continuous are differential states; what ``fesd.dcs`` and the kinks have marked,
where the quantity that switches is continuous itself; algebraic variables that equations tie to continuous ones; and what the
user names with the keyword ``continuous``.  Held controls are continuous inside a control stage and jump at its boundaries.
"""

from dataclasses import dataclass

import numpy as np
from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.core import Block, Constraint, Expression
from pyomo.core.expr.visitor import identify_variables
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import maximum_bipartite_matching

from pyomo_fesd import marks
from pyomo_fesd.timeindex import DISCRETISATION, derivatives


@dataclass(frozen=True)
class Continuity:
    """What is continuous, for components over time or their data at the first inner time.

    Attributes
    ----------
    rules : ComponentMap Var -> Constraint, Complementarity or Expression
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
    functions = [(v, rule) for v, rule in rules.items() if rule.ctype is not Constraint]
    equations = _Equations(model, times, functions) if trace or functions else None
    start = ComponentSet(d.get_state_var() for d in derivatives(model, times.wrt))
    start.update(told)
    across = _closure(start, rules, held, equations)
    start.update(held)
    return Continuity(rules, _closure(start, rules, (), equations) if held else across, across)


def _closure(start, rules, held, equations):
    """``start`` and all that follows from it; nothing that contains a held control does."""
    known = ComponentSet(start)
    known.update(v for v, rule in rules.items() if rule.ctype is Constraint and not _mentions(rule, held))
    if equations is not None:
        known.update(equations.tied(known))
    return known


def _mentions(rule, components):
    """Whether a Constraint over time contains variables of ``components``."""
    data = next(iter(rule.values()), None) if components else None
    return data is not None and any(v.parent_component() in components for v in identify_variables(data.body))


class _Equations:
    """The algebraic equations of one inner time, as lists of the variables that they contain.

    A continuous function is one of them: the condition of a kink says s = max(0, z), the weights of a mesh follow from its
    arguments.  So they may be part of an implicit equation.
    """

    def __init__(self, model, times, functions):
        label = list(times.wrt)[1]
        # what a function of its arguments is made of says nothing of the arguments
        inside = ComponentSet(rule.parent_block() for _, rule in functions if rule.ctype is Expression)
        constraints = model.component_data_objects(Constraint, active=True, descend_into=Block)
        equations = [
            [c.body]
            for c in constraints
            if c.equality
            and times.time(c) == label
            and not c.parent_component().local_name.endswith(DISCRETISATION)
            and c.parent_block() not in inside
        ]
        for component, rule in functions:
            here = {index: v for index, v in component.items() if times.time(v) == label}
            if rule.ctype is Expression:
                arguments = [e for e in rule.values() if e.expr is not None and times.time(e) == label]
                equations += [[v, *arguments] for v in here.values() if arguments]
            else:
                # pyomo.dae gives a Var all its indices, also those without a condition
                equations += [rule[index]._args for index in here if index in rule]
        self._rows = [
            [v for v in ComponentSet(v for e in row for v in identify_variables(e)) if times.time(v) is not None]
            for row in equations
        ]

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
