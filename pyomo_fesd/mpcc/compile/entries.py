"""The expressions of an MPCC besides the model's own rows: sides of pairs, decisions, penalty terms, gauges.

Takes: an ``Mpcc``, the symbols of its parameters, a ``RowReader``.
Leaves: ``Entries``; while the context is open, auxiliary variables and their equations on a temporary block.  Afterwards the model
is as it was.
"""

from contextlib import contextmanager
from dataclasses import dataclass

from pyomo.common.modeling import unique_component_name
from pyomo.core import Block, ConstraintList, VarList

from pyomo_fesd.mpcc.compile.model_values import set_parts
from pyomo_fesd.mpcc.compile.read_mpcc import Condition
from pyomo_fesd.mpcc.compile.row_reader import Row


@dataclass(frozen=True)
class Entries:
    """Rows of the expressions of an MPCC; sides of several pairs are one row.

    Attributes
    ----------
    conditions : list of Condition, with those that mixed conditions were split into
    G, H : lists of Row, one each condition
    eta, equal : lists of Row, one each decision
    penalty : list of Row, terms of the sum of all penalties
    gauges : list of Row, one each value that tells whether a change is at an end of a row
    plain : dict of Row -> VarData, sides that are a variable
    splits : list of (VarData, VarData, expression), auxiliary variables as in ``ModelValues``
    """

    conditions: list
    G: list
    H: list
    eta: list
    equal: list
    penalty: list
    gauges: list
    plain: dict
    splits: list

    def distinct(self) -> list[int]:
        """Return positions of the pairs without repetitions, in whichever order of their sides."""
        first = {frozenset(pair): k for k, pair in reversed(list(enumerate(zip(self.G, self.H))))}
        return sorted(first.values())


@contextmanager
def auxiliary_block(problem):
    """A temporary block on the model, for the auxiliary variables of mixed conditions; None where there is none."""
    if not problem.mixed:
        yield None
        return
    model, block = problem.model, Block()
    model.add_component(unique_component_name(model, '_pyomo_fesd_auxiliary'), block)
    block.part, block.row = VarList(), ConstraintList()
    try:
        yield block
    finally:
        model.del_component(block)


def read_entries(problem, symbols, reader, block) -> Entries:
    """Read the expressions of ``problem``; ``symbols`` stand for the parameters."""
    return _Reading(symbols, reader, block).entries(problem)


class _Reading:
    """Reads expressions, each side once."""

    def __init__(self, symbols, reader, block):
        self._symbols, self._reader, self._block = symbols, reader, block
        self._shared, self._variables, self._plain = {}, {}, {}
        self._splits = []

    def entries(self, problem):
        conditions = problem.conditions + [part for source, mixed in problem.mixed for part in self._split(source, mixed)]
        penalties = [term.weight * term.expression.expr for term in problem.hints.penalties]
        return Entries(
            conditions,
            G=[self._shared_entry(c.G) for c in conditions],
            H=[self._shared_entry(c.H) for c in conditions],
            eta=[self._entry(d.eta) for d in problem.decisions],
            equal=[self._entry(d.constraint.body - d.constraint.upper) for d in problem.decisions],
            penalty=[row for term in penalties for row in self._reader.terms(self._symbols.substitute(term))],
            gauges=[self._shared_entry(gauge) for arrival in problem.hints.arrivals for gauge in arrival.gauges()],
            plain=self._plain,
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
        """One row for a side of several pairs: its branch equation must not appear twice."""
        if id(expr) not in self._shared:
            self._shared[id(expr)] = self._entry(expr)
        return self._shared[id(expr)]

    def _entry(self, expr):
        expr = self._symbols.substitute(expr)
        if hasattr(expr, 'is_variable_type') and expr.is_variable_type() and not expr.fixed:
            if id(expr) not in self._variables:
                self._variables[id(expr)] = row = Row(linear={id(expr): 1.0}, source=expr)
                self._plain[row] = expr
            return self._variables[id(expr)]
        return self._reader.row(expr)
