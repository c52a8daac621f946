"""The algebraic equations at a few times as a graph: the variables that they tie to known ones, and through which equations.

Takes: a discretised model, the times, and the rules of ``SwitchedSystems.continuous``.
Leaves: nothing on the model.
Does not apply: to inequalities, and to the equations of pyomo.dae's discretisation.
"""

from collections.abc import Callable, Iterator

import numpy as np
from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.core import Block, Constraint, Expression
from pyomo.core.expr.visitor import identify_variables
from pyomo.mpec import Complementarity
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import maximum_bipartite_matching

from pyomo_fesd.core import TimeIndex, is_discretisation_equation, mutable_parameters, read_side


def variables_of(expr) -> Iterator:
    """Yield the variables of ``expr``, and the mutable Params, which may change from one control stage to the next."""
    yield from identify_variables(expr)
    yield from mutable_parameters(expr)


def rule_of(v, rules: ComponentMap):
    """Return the rule of a variable or of its component; None without one."""
    return rules.get(v, rules.get(v.parent_component()))


class AlgebraicGraph:
    """The algebraic equations at a few times, with their variables; without the rules of p, n, lam and mu.

    These rules make p and n as continuous as the quantity that switches, not the reverse.  A continuous function is an equation:
    the condition of a nonsmooth term means s = max(0, z), and interpolation weights follow from their arguments.  So it may be part
    of an implicit one.

    Parameters
    ----------
    model : Block
    times : TimeIndex
    labels : set of float
    rules : ComponentMap Var -> Constraint, Complementarity or Expression
    """

    def __init__(self, model: Block, times: TimeIndex, labels: set[float], rules: ComponentMap):
        self._times, self._labels, self._rules = times, labels, rules
        functions = [(v, rule) for v, rule in rules.items() if rule.ctype is not Constraint]
        excluded = ComponentSet(rule for rule in rules.values() if rule.ctype is Constraint)
        # equations inside a function of its arguments do not determine the arguments
        inside = ComponentSet(rule.parent_block() for _, rule in functions if rule.ctype is Expression)
        equations = (c for c in self._equations(model) if _is_algebraic(c, excluded) and c.parent_block() not in inside)
        self._rows = [(c.body, self._over_time(variables_of(c.expr))) for c in equations]
        for component, rule in functions:
            self._rows += self._function(component, rule)

    def _equations(self, model):
        constraints = model.component_data_objects(Constraint, active=True, descend_into=Block)
        return (c for c in constraints if c.equality and self._times.time(c) in self._labels)

    def _over_time(self, variables):
        return [v for v in variables if self._times.time(v) is not None]

    def _data(self, component):
        among = component.values() if hasattr(component, 'values') else [component]
        return (d for d in among if self._times.time(d) in self._labels)

    def mentioning(self, rule: Constraint, test: Callable) -> set:
        """Return the indices at which a Constraint contains a variable for which ``test`` is true."""
        return {c.index() for c in self._data(rule) if any(test(v) for v in variables_of(c.expr))}

    def tied_by(self, component, rule: Constraint, apart: set) -> list:
        """Return the data of a variable that have an equation of their own, not one of those with an index in ``apart``."""
        return [v for v in self._data(component) if v.index() in rule and v.index() not in apart]

    def _function(self, component, rule):
        """A row for every value of a function at these times: its variable and those of the arguments."""
        for v in self._data(component):
            arguments = self._definition(v, rule)
            if arguments:
                found = ComponentSet([v, *(u for e in arguments for u in variables_of(e))])
                yield arguments[-1], self._over_time(found)

    def _definition(self, v, rule):
        """The expressions to which a rule ties ``v``: the sides of a condition, arguments at the same time, or equations."""
        if rule.ctype is Complementarity:
            return [read_side(a).body for a in _relation_sides(rule, v)]
        if rule.ctype is Expression:
            label = self._times.time(v)
            return [e.expr for e in rule.values() if e.expr is not None and self._times.time(e) == label]
        return [c.body for c in self._data(rule) if any(u is v for u in identify_variables(c.body))]

    def tied(self, known) -> list:
        """Return the variables that equations tie to known ones.

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
        columns, entries = ComponentMap(), []
        for i, (_, variables) in enumerate(self._rows):
            entries += [(i, columns.setdefault(v, len(columns))) for v in variables if v not in known]
        if not entries:
            return columns, None
        return columns, csr_matrix((np.ones(len(entries)), tuple(zip(*entries))), shape=(len(self._rows), len(columns)))

    def definitions(self, expr, known) -> list:
        """Return ``expr`` and the expressions that its variables follow from, down to known ones."""
        columns, incidence = self._incidence(known)
        row_of = maximum_bipartite_matching(incidence, perm_type='row') if columns else []
        found, seen, waiting = [expr], ComponentSet(), list(identify_variables(expr))
        while waiting:
            v = waiting.pop()
            if v in seen:
                continue
            seen.add(v)
            rule = rule_of(v, self._rules)
            if rule is not None:
                sources = self._definition(v, rule)
            else:
                row = row_of[columns[v]] if v in columns else -1
                sources = [] if row < 0 else [self._rows[row][0]]
            for source in sources:
                found.append(source)
                waiting += identify_variables(source)
        return found


def _relation_sides(rule, v):
    """The two sides of the condition that a Complementarity states for a variable.

    One condition may belong to a variable of the user's that has other indices; pyomo.dae gives a Var all its indices, also those
    without a condition.
    """
    data = rule if not rule.is_indexed() else rule[v.index()] if v.index() in rule else None
    return [] if data is None else data._args


def _is_algebraic(equation, excluded):
    return equation.parent_component() not in excluded and not is_discretisation_equation(equation)


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
