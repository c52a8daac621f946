"""Rows that the NL file needs besides the model's own: sides of pairs, decisions, penalty terms.

Takes: an ``Mpcc`` and the symbols of its parameters.
Leaves: ``Entries`` on a temporary block while the context is open; afterwards the model is as it was.
"""

from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice

from pyomo.common.collections import ComponentMap
from pyomo.common.modeling import unique_component_name
from pyomo.common.numeric_types import native_numeric_types
from pyomo.core import Block, ConstraintList, Objective, VarList, quicksum, value
from pyomo.core.expr import Expr_ifExpression, PowExpression, ProductExpression
from pyomo.core.expr.numvalue import is_potentially_variable
from pyomo.repn import generate_standard_repn

from pyomo_fesd.mpcc.compile.model_values import set_parts
from pyomo_fesd.mpcc.compile.read_mpcc import Condition

#: A bound that no sum reaches.
ALWAYS = 1e300
#: Nodes that may be fixed although one of their arguments is not.
MAY_BE_FIXED = (PowExpression, Expr_ifExpression)


@dataclass(frozen=True)
class Entries:
    """The entry of the NL file for each expression of the MPCC: a row ``expr >= 0``, a plain variable, or a number.

    Attributes
    ----------
    conditions : list of Condition, with those that mixed conditions were split into
    G, H : lists, one entry each condition
    eta, equal : lists, one entry each decision
    penalty : list, one entry each term
    gauges : list, one entry each value that tells whether a change is at an end of a row
    present : list, rows that only keep variables in the file
    splits : list of (VarData, VarData, expression), auxiliary variables as in ``ModelValues``
    """

    conditions: list
    G: list
    H: list
    eta: list
    equal: list
    penalty: list
    gauges: list
    present: list
    splits: list


@contextmanager
def auxiliary_rows(problem, symbols):
    """The ``Entries`` of ``problem`` on a temporary block; its complementarities are inactive while it exists."""
    model, block = problem.model, Block()
    model.add_component(unique_component_name(model, '_pyomo_fesd_auxiliary'), block)
    deactivated = _deactivate(problem.sources)
    try:
        yield _Rows(block, symbols).entries(problem)
    finally:
        model.del_component(block)
        _activate(deactivated)


class _Rows:
    """Writes the rows on ``block`` with ``symbols`` in place of the parameters."""

    def __init__(self, block, symbols):
        block.row, block.part = ConstraintList(), VarList()
        self._block, self._symbols, self._shared, self._splits = block, symbols, {}, []

    def entries(self, problem):
        if problem.objective is None:
            self._block.objective = Objective(expr=0)
        conditions = problem.conditions + [part for source, mixed in problem.mixed for part in self._split(source, mixed)]
        G = [self._shared_entry(c.G) for c in conditions]
        H = [self._shared_entry(c.H) for c in conditions]
        return Entries(
            conditions,
            G,
            H,
            eta=[self._entry(d.eta) for d in problem.decisions],
            equal=[self._entry(d.constraint.body - d.constraint.upper) for d in problem.decisions],
            penalty=[self._entry(term.weight * term.expression.expr) for term in problem.hints.penalties],
            gauges=[self._shared_entry(gauge) for arrival in problem.hints.arrivals for gauge in arrival.gauges()],
            # the NL writer drops variables that no row contains
            present=[self._keep(self._symbols.variables), self._keep(G + H)],
            splits=self._splits,
        )

    def _split(self, source, mixed):
        """l <= B <= u perp F as B - l perp F+ and u - B perp F- with F = F+ - F-."""
        plus, minus = self._block.part.add(), self._block.part.add()
        plus.setlb(0)
        minus.setlb(0)
        set_parts(plus, minus, mixed.F)
        self._splits.append((plus, minus, mixed.F))
        self._block.row.add(self._symbols.substitute(mixed.F) == plus - minus)
        return [Condition(source, mixed.body - mixed.lower, plus), Condition(source, mixed.upper - mixed.body, minus)]

    def _shared_entry(self, expr):
        """One entry for a side of several pairs: its branch equation must not appear twice."""
        if id(expr) not in self._shared:
            self._shared[id(expr)] = self._entry(expr)
        return self._shared[id(expr)]

    def _entry(self, expr):
        expr = self._symbols.substitute(expr)
        if not hasattr(expr, 'is_fixed'):
            return value(expr)
        if not _surely_varies(expr) and expr.is_fixed():
            # 0 * x is fixed although x may have no value
            return generate_standard_repn(expr, compute_values=True).constant
        return expr if expr.is_variable_type() else self._block.row.add(expr >= 0)

    def _keep(self, entries):
        """A row that contains the variables among ``entries`` and always holds."""
        variables = [e for e in entries if hasattr(e, 'is_variable_type') and e.is_variable_type()]
        return self._block.row.add(quicksum(variables) <= ALWAYS) if variables else 0.0


def _surely_varies(expr):
    """Whether the first variables of ``expr`` show that it is not fixed; Pyomo's ``is_fixed`` always visits all of them."""
    waiting = [expr]
    while waiting:
        node = waiting.pop()
        if node.is_expression_type():
            deciding = _deciding_arguments(node)
            if not deciding:
                return False
            waiting += deciding
        elif node.is_fixed():
            return False
    return True


def _deciding_arguments(node):
    """Arguments of ``node`` that, if they all vary, show that it varies; none if no argument can show it."""
    if isinstance(node, ProductExpression):
        # each factor has to vary: one may be 0
        factors = [a for a in node.args if a.__class__ not in native_numeric_types or a == 0]
        return factors if all(map(is_potentially_variable, factors)) else []
    if isinstance(node, MAY_BE_FIXED):
        return []
    return list(islice(filter(is_potentially_variable, node.args), 1))


def _deactivate(datas):
    """Deactivate the components of all ``datas``, which the NL writer refuses; returns the datas by component."""
    components = ComponentMap()
    for data in datas:
        components.setdefault(data.parent_component(), []).append(data)
    for component in components:
        component.deactivate()
    return components


def _activate(components):
    for component, datas in components.items():
        component._active = True
        for data in datas:
            data.activate()
