"""Relations between algebraic variables at one label: which variables an expression depends on, and by which equations.

Copies of variables at the right of a boundary need copies of the equations that determine them, and only of these.

Takes: active equations, and the pairs that define the positive parts s of nonsmooth terms, label by label.
Leaves: answers; the model is not touched.
"""

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.core import Block, Constraint
from pyomo.core.base.constraint import ConstraintData
from pyomo.core.base.var import VarData
from pyomo.core.expr.visitor import identify_variables
from pyomo.mpec import Complementarity

from pyomo_fesd.core import TimeIndex, is_discretisation_equation
from pyomo_fesd.finite_elements.algebraic_graph import rule_of


class Relation(NamedTuple):
    """An equation, or the pair of a positive part (``equation`` is None), which determines that part only; with its variables."""

    equation: ConstraintData | None
    variables: list
    part: VarData | None = None


class Relations:
    """The relations at some labels, by the algebraic variables in them.

    Parameters
    ----------
    model : Block
    times : TimeIndex
    labels : set of float
    rules : ComponentMap
        the rule of each part of a switching function or nonsmooth term
    is_algebraic : function (variable, label) -> bool
        whether relations determine it
    is_known : function (variable) -> bool
        whether a relation with it determines the others; default: any
    """

    def __init__(
        self, model: Block, times: TimeIndex, labels: set, rules, is_algebraic: Callable, is_known: Callable | None = None
    ):
        self._is_algebraic = is_algebraic
        self._rules = rules
        self._by_label = defaultdict(ComponentMap)
        for label, relation in _all_relations(model, times, rules):
            if label in labels:
                relation = relation()
                if is_known is None or all(map(is_known, relation.variables)):
                    self._add(label, relation)

    def _add(self, label, relation):
        for v in ComponentSet(relation.variables):
            if self._is_algebraic(v, label):
                self._by_label[label].setdefault(v, []).append(relation)

    def closure(self, label: float, wanted: Iterable) -> tuple[list, list[Relation]]:
        """Return the algebraic variables at ``label`` that ``wanted`` depend on, and the relations between them."""
        at_label, wanted = self._by_label[label], ComponentSet(v for v in wanted if self._is_algebraic(v, label))
        found, relations, waiting = ComponentSet(), {}, list(wanted)
        while waiting:
            v = waiting.pop()
            if v not in found and v in at_label:
                found.add(v)
                relations.update((id(relation), relation) for relation in at_label[v])
                waiting += (u for relation in at_label[v] for u in relation.variables if self._is_algebraic(u, label))
        kept = self._without_results(label, list(relations.values()), wanted)
        left = ComponentSet(v for relation in kept for v in relation.variables)
        return [v for v in found if v in left], kept

    def _without_results(self, label, relations, wanted):
        """Remove each variable that occurs in one relation only, with this relation, unless it is wanted or a part of a pair.

        A pair is not solved for its argument: that stays, and is undetermined if it occurs nowhere else.
        """
        while True:
            number = Counter(id(v) for relation in relations for v in ComponentSet(relation.variables))
            results = ComponentSet(
                v
                for relation in relations
                for v in relation.variables
                if number[id(v)] == 1 and (relation.part is None or relation.part is v) and self._is_result(v, label)
            )
            kept = [relation for relation in relations if not any(v in results and v not in wanted for v in relation.variables)]
            if len(kept) == len(relations):
                return kept
            relations = kept

    def _is_result(self, v, label):
        """Whether an equation may be all that determines it: p and n, lam and mu have a pair besides."""
        rule = rule_of(v, self._rules)
        return self._is_algebraic(v, label) and (rule is None or rule.ctype is not Constraint)


def _all_relations(model, times, rules) -> Iterator[tuple]:
    """``(label, function that returns the Relation)``."""
    for equation in model.component_data_objects(Constraint, active=True, descend_into=Block):
        if equation.equality and not is_discretisation_equation(equation):
            yield times.time(equation), lambda c=equation: Relation(c, variables_in(c.body))
    for s, rule in rules.items():
        if rule.ctype is Complementarity:
            for v in s.values():
                yield times.time(v), lambda v=v, rule=rule: Relation(None, variables_in_sides(rule[v.index()]._args), v)


def variables_in(expr) -> list:
    """Return the variables of an expression or a number, fixed ones included."""
    return list(identify_variables(expr, include_fixed=True)) if hasattr(expr, 'is_expression_type') else []


def variables_in_sides(sides: Iterable) -> list:
    """Return the variables of several expressions, one after the other."""
    return [v for side in sides for v in variables_in(side)]
