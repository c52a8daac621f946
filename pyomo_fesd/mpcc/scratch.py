"""What the NL writer has to write besides the model's own rows, on a block that is gone afterwards.

Takes: the ``Mpcc`` and the ``Handles`` of its parameters.
Leaves: ``Entries``, as long as the context is open; then the model as it was.
"""

from contextlib import contextmanager
from dataclasses import dataclass

from pyomo.common.collections import ComponentMap
from pyomo.common.modeling import unique_component_name
from pyomo.common.numeric_types import native_numeric_types
from pyomo.core import Block, ConstraintList, Objective, VarList, quicksum, value
from pyomo.core.expr import Expr_ifExpression, PowExpression, ProductExpression
from pyomo.core.expr.numvalue import is_potentially_variable
from pyomo.repn import generate_standard_repn

from pyomo_fesd.mpcc.problem import Condition
from pyomo_fesd.mpcc.source import set_parts

#: A bound that no sum reaches.
ALWAYS = 1e300
#: Nodes that may be fixed although one of their arguments is not.
WHOLE = (PowExpression, Expr_ifExpression)


@dataclass(frozen=True)
class Entries:
    """What stands in the NL file for each expression of the MPCC: a row ``expr >= 0``, a plain variable, or a number.

    Attributes
    ----------
    conditions : list of Condition, with those that mixed conditions were split into
    G, H : lists, one entry each condition
    eta, equal : lists, one entry each decision
    penalty : list, one entry each term
    present : list, rows that say nothing
    splits : list of (VarData, VarData, expression), auxiliary variables as in ``Source``
    """

    conditions: list
    G: list
    H: list
    eta: list
    equal: list
    penalty: list
    present: list
    splits: list


@contextmanager
def entries_of(problem, handles):
    """The ``Entries`` of ``problem`` on a scratch block; its pairs sleep while it exists."""
    model, scratch = problem.model, Block()
    model.add_component(unique_component_name(model, '_pyomo_fesd_scratch'), scratch)
    pairs = _sleep(problem.sources)
    try:
        yield _entries(scratch, problem, handles)
    finally:
        model.del_component(scratch)
        _wake(pairs)


def _entries(scratch, problem, handles):
    scratch.row = ConstraintList()
    scratch.part = VarList()
    if problem.objective is None:
        scratch.objective = Objective(expr=0)
    splits, known = [], {}
    conditions = problem.conditions + [c for source, m in problem.mixed for c in _split(scratch, source, m, handles, splits)]
    G = [_shared_entry(scratch, c.G, handles, known) for c in conditions]
    H = [_shared_entry(scratch, c.H, handles, known) for c in conditions]
    return Entries(
        conditions,
        G,
        H,
        eta=[_entry(scratch, handles.in_terms(d.eta)) for d in problem.decisions],
        equal=[_entry(scratch, handles.in_terms(d.constraint.body - d.constraint.upper)) for d in problem.decisions],
        penalty=[_entry(scratch, handles.in_terms(weight * term.expr)) for term, weight in problem.penalties],
        # parameters and plain sides must be in the NL file even if they stand nowhere else
        present=[_keep(scratch, handles.variables), _keep(scratch, G + H)],
        splits=splits,
    )


def _split(scratch, source, m, handles, splits):
    """l <= B <= u perp F as B - l perp F+ and u - B perp F- with F = F+ - F-."""
    plus, minus = scratch.part.add(), scratch.part.add()
    plus.setlb(0)
    minus.setlb(0)
    set_parts(plus, minus, m.F)
    splits.append((plus, minus, m.F))
    scratch.row.add(handles.in_terms(m.F) == plus - minus)
    return [Condition(source, m.body - m.lower, plus), Condition(source, m.upper - m.body, minus)]


def _shared_entry(scratch, expr, handles, known):
    """As ``_entry``, one for a side that stands in several pairs: its branch equation must not appear twice."""
    if id(expr) not in known:
        known[id(expr)] = _entry(scratch, handles.in_terms(expr))
    return known[id(expr)]


def _entry(scratch, expr):
    """What stands for ``expr`` in the NL file."""
    if not hasattr(expr, 'is_fixed'):
        return value(expr)
    if not _varies(expr) and expr.is_fixed():
        # 0 * x is fixed although x may have no value
        return generate_standard_repn(expr, compute_values=True).constant
    if expr.is_variable_type():
        return expr
    return scratch.row.add(expr >= 0)


def _varies(expr):
    """Whether the first variables of ``expr`` show that it is not fixed; Pyomo's ``is_fixed`` always looks at all."""
    waiting = [expr]
    while waiting:
        node = waiting.pop()
        if not node.is_expression_type():
            if node.is_fixed():
                return False
        elif isinstance(node, ProductExpression):
            # each factor has to vary: one may be 0
            factors = [a for a in node.args if a.__class__ not in native_numeric_types or a == 0]
            if not all(map(is_potentially_variable, factors)):
                return False
            waiting += factors
        else:
            first = None if isinstance(node, WHOLE) else next(filter(is_potentially_variable, node.args), None)
            if first is None:
                return False
            waiting.append(first)
    return True


def _keep(scratch, entries):
    """A row that keeps variables in the NL file which stand in no other: the writer drops those."""
    variables = [e for e in entries if hasattr(e, 'is_variable_type') and e.is_variable_type()]
    return scratch.row.add(quicksum(variables) <= ALWAYS) if variables else 0.0


def _sleep(sources):
    """Deactivate the components of all ``sources``, which the NL writer refuses; returns what ``_wake`` needs."""
    components = ComponentMap()
    for source in sources:
        components.setdefault(source.parent_component(), []).append(source)
    for component in components:
        component.deactivate()
    return components


def _wake(components):
    for component, datas in components.items():
        component._active = True
        for data in datas:
            data.activate()
