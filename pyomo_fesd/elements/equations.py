"""The algebraic equations of a few times, as a graph: which variables they tie to known ones, and through which equations.

Takes: a discretised model, the times, and the rules of marked variables.
Leaves: nothing on the model.
Does not apply: to inequalities, and to the equations of pyomo.dae's discretisation.
"""

import numpy as np
from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.core import Block, Constraint, Expression
from pyomo.core.expr.visitor import identify_variables
from pyomo.mpec import Complementarity
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import maximum_bipartite_matching

from pyomo_fesd.complementarity import side
from pyomo_fesd.timeindex import DISCRETISATION
from pyomo_fesd.values import mutable_parameters


def variables_of(expr):
    """The variables of ``expr``, and the mutable Params, which may change from stage to stage."""
    yield from identify_variables(expr)
    yield from mutable_parameters(expr)


def rule_of(v, rules):
    """What a mark on a variable, or on its component, says; None without one."""
    return rules.get(v, rules.get(v.parent_component()))


class Equations:
    """The algebraic equations of a few times, with the variables that they contain; without the rules of p, n, lam and mu.

    These say that p and n are as continuous as the quantity that switches, and not the other way round.  A continuous function is
    an equation: the condition of a kink says s = max(0, z), the weights of a mesh follow from its arguments.  So it may be part
    of an implicit one.
    """

    def __init__(self, model, times, labels, rules):
        self._times, self._labels = times, labels
        functions = [(v, rule) for v, rule in rules.items() if rule.ctype is not Constraint]
        apart = ComponentSet(rule for rule in rules.values() if rule.ctype is Constraint)
        # what a function of its arguments is made of says nothing of the arguments
        inside = ComponentSet(rule.parent_block() for _, rule in functions if rule.ctype is Expression)
        constraints = model.component_data_objects(Constraint, active=True, descend_into=Block)
        self._rows = [
            (c.body, [v for v in variables_of(c.expr) if times.time(v) is not None])
            for c in constraints
            if c.equality and times.time(c) in labels and _is_model(c.parent_component(), apart) and c.parent_block() not in inside
        ]
        for component, rule in functions:
            self._rows += list(self._function(component, rule))

    def _data(self, component):
        among = component.values() if hasattr(component, 'values') else [component]
        return (d for d in among if self._times.time(d) in self._labels)

    def mentioning(self, rule, test):
        """The indices at which a Constraint contains a variable for which ``test`` is true."""
        return {c.index() for c in self._data(rule) if any(test(v) for v in variables_of(c.expr))}

    def tied_by(self, component, rule, apart):
        """Data of a marked variable that have an equation of their own, not one of those with an index in ``apart``."""
        return [v for v in self._data(component) if v.index() in rule and v.index() not in apart]

    def _function(self, component, rule):
        """A row for every value of a function at these times: its variable and those of the arguments."""
        for v in self._data(component):
            if rule.ctype is Expression:
                same = self._times.time(v)
                arguments = [e.expr for e in rule.values() if e.expr is not None and self._times.time(e) == same]
            else:
                arguments = [side(a).body for a in _sides(rule, v)]
            if arguments:
                found = ComponentSet([v, *(u for e in arguments for u in variables_of(e))])
                yield arguments[-1], [u for u in found if self._times.time(u) is not None]

    def tied(self, known):
        """Variables that equations tie to known ones.

        They are the unknowns of the equations that are not under-determined (Dulmage and Mendelsohn): those that no alternating
        path connects with an unmatched unknown.
        """
        columns, incidence = self._incidence(known)
        if incidence is None:
            return []
        loose = _under_determined(incidence, maximum_bipartite_matching(incidence, perm_type='row'))
        return [v for v, j in columns.items() if j not in loose]

    def _incidence(self, known):
        """Unknowns with their numbers, and which equation contains which."""
        columns, places = ComponentMap(), []
        for i, (_, variables) in enumerate(self._rows):
            places += [(i, columns.setdefault(v, len(columns))) for v in variables if v not in known]
        if not places:
            return columns, None
        return columns, csr_matrix((np.ones(len(places)), tuple(zip(*places))), shape=(len(self._rows), len(columns)))

    def behind(self, expr, rules, known):
        """``expr`` and the expressions that its variables follow from, down to known ones."""
        columns, incidence = self._incidence(known)
        row_of = maximum_bipartite_matching(incidence, perm_type='row') if columns else []
        found, seen, waiting = [expr], ComponentSet(), list(identify_variables(expr))
        while waiting:
            v = waiting.pop()
            if v in seen:
                continue
            seen.add(v)
            for source in self._sources(v, rules, columns, row_of):
                found.append(source)
                waiting += identify_variables(source)
        return found

    def _sources(self, v, rules, columns, row_of):
        """What defines one variable: a mark's rule, or the equation that is matched with it."""
        rule = rule_of(v, rules)
        if rule is not None and rule.ctype is Complementarity:
            return [side(a).body for a in _sides(rule, v)]
        if rule is not None and rule.ctype is Expression:
            same = self._times.time(v)
            return [e.expr for e in rule.values() if e.expr is not None and self._times.time(e) == same]
        if rule is not None:
            return [c.body for c in self._data(rule) if any(u is v for u in identify_variables(c.body))]
        return [self._rows[row_of[columns[v]]][0]] if v in columns and row_of[columns[v]] >= 0 else []


def _sides(rule, v):
    """The two sides of the condition that a Complementarity states for a variable.

    One condition may be marked for a variable of the user's that has other indices; pyomo.dae gives a Var all its indices, also
    those without a condition.
    """
    data = rule if not rule.is_indexed() else rule[v.index()] if v.index() in rule else None
    return [] if data is None else data._args


def _is_model(constraint, apart):
    return constraint not in apart and not constraint.local_name.endswith(DISCRETISATION)


def _under_determined(incidence, row_of):
    """Columns that an alternating path connects with an unmatched column (``row_of`` is -1 there)."""
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
