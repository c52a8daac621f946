"""Static if-then-else in rows of an NL file, which casadi does not read: placeholders, and casadi's own afterwards.

    row(x, Expr_if(c, a, b))     becomes     row(x, z),  c >= 0,  a >= 0,  b >= 0       in the file, and
    z := if_else(c >= 0, a, b)                                                          in the function that casadi reads

Takes: a model whose rows are to be written.
Leaves: while the context is open, rows on a temporary block in place of those with ``Expr_if``; afterwards the model is as it was.
Does not apply: to conditions other than inequalities; to modes over time, whose switches ``fesd.dcs`` finds.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import casadi as ca
import numpy as np
from pyomo.common.collections import ComponentMap
from pyomo.common.modeling import unique_component_name
from pyomo.core import Block, Constraint, ConstraintList, Objective, VarList, value
from pyomo.core.expr import Expr_ifExpression, InequalityExpression, RangedExpression
from pyomo.core.expr.visitor import replace_expressions

from pyomo_fesd.core import FesdError


@dataclass
class Conditionals:
    """The placeholders, inner before outer.

    Attributes
    ----------
    entries : list of (VarData, margins, then, otherwise)
        z, and rows or numbers for the margins of its condition (true where all are >= 0) and for both values
    originals : ComponentMap
        row of the temporary block -> row of the model
    """

    entries: list = field(default_factory=list)
    originals: ComponentMap = field(default_factory=ComponentMap)


@contextmanager
def conditionals(model) -> Iterator[Conditionals]:
    """Replace the rows with ``Expr_if`` while the context is open."""
    block, writer = Block(), None
    replaced = []
    model.add_component(unique_component_name(model, '_pyomo_fesd_conditionals'), block)
    try:
        writer = _Writer(block)
        for data in list(model.component_data_objects((Constraint, Objective), active=True, descend_into=Block)):
            if data.parent_block() is not block and writer.read(data.expr):
                writer.replace(data)
                data.deactivate()
                replaced.append(data)
        yield writer.found
    finally:
        for data in replaced:
            data.activate()
        model.del_component(block)


class _Writer:
    def __init__(self, block):
        block.placeholder, block.row = VarList(), ConstraintList()
        self._block, self._symbol, self.found = block, {}, Conditionals()

    def read(self, expr) -> bool:
        """Give every ``Expr_if`` in an expression a placeholder; returns whether there is one."""
        nodes = list(_inner_first(expr))
        for node in nodes:
            if id(node) not in self._symbol:
                condition, then, otherwise = node.args
                z = self._block.placeholder.add()
                z.set_value(value(node, exception=False))
                margins = [self._entry(margin) for margin in _margins(condition, node)]
                self.found.entries.append((z, margins, self._entry(then), self._entry(otherwise)))
                self._symbol[id(node)] = z
        return bool(nodes)

    def replace(self, data):
        """State a row or an objective with the placeholders."""
        if data.ctype is Objective:
            self._block.objective = Objective(expr=self._substituted(data.expr), sense=data.sense)
        else:
            self.found.originals[self._block.row.add(self._substituted(data.expr))] = data

    def _entry(self, expr):
        """A row ``expr >= 0``, or a number."""
        expr = self._substituted(expr)
        return value(expr) if not hasattr(expr, 'is_fixed') or expr.is_fixed() else self._block.row.add(expr >= 0)

    def _substituted(self, expr):
        return replace_expressions(expr, self._symbol) if hasattr(expr, 'is_expression_type') else expr


def _inner_first(expr):
    """Every ``Expr_if`` node of an expression, those inside of others before them."""
    if hasattr(expr, 'is_expression_type') and expr.is_expression_type():
        for arg in expr.args:
            yield from _inner_first(arg)
        if isinstance(expr, Expr_ifExpression):
            yield expr


def _margins(condition, node):
    if isinstance(condition, InequalityExpression):
        low, high = condition.args
        return [high - low]
    if isinstance(condition, RangedExpression):
        low, body, high = condition.args
        return [body - low, high - body]
    raise FesdError(str(node), "an if-then-else whose condition is no inequality", "write the condition as an inequality")


def resolved(found: Conditionals, nl):
    """Return the ``NlModel`` without the placeholders and their rows."""
    rows = {id(c): i for i, c in enumerate(nl.constraints)}
    columns = {id(v): j for j, v in enumerate(nl.variables)}
    x = ca.SX.sym('x', len(nl.variables))
    f, g = nl.function(x)

    def entry(given):
        if not hasattr(given, 'ctype'):
            return given
        i = rows[id(given)]
        return g[i] - nl.lbg[i]  # the file keeps constants of linear rows in their bounds

    present = [one for one in found.entries if id(one[0]) in columns]
    symbols, values = [], []
    for z, margins, then, otherwise in present:
        holds = ca.logic_and(*[entry(m) >= 0 for m in margins]) if len(margins) == 2 else entry(margins[0]) >= 0
        chosen = ca.if_else(holds, entry(then), entry(otherwise))
        values.append(ca.substitute([chosen], symbols, values)[0] if symbols else chosen)
        symbols.append(x[columns[id(z)]])
    own = {id(z) for z, *_ in found.entries}
    helpers = {id(row) for _, margins, *parts in found.entries for row in (*margins, *parts) if hasattr(row, 'ctype')}
    kept_x = [j for j, v in enumerate(nl.variables) if id(v) not in own]
    kept_g = [i for i, c in enumerate(nl.constraints) if id(c) not in helpers]
    f, g = ca.substitute([f, g[kept_g]], symbols, values)
    constraints = [found.originals.get(nl.constraints[i], nl.constraints[i]) for i in kept_g]
    take = np.array(kept_g, dtype=int)
    return type(nl)(
        [nl.variables[j] for j in kept_x],
        constraints,
        ca.Function('nl', [x[kept_x]], [f, g]),
        nl.lbg[take],
        nl.ubg[take],
        nl.cancelling[take],
    )
