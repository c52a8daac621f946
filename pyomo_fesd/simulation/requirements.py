"""Complementarity conditions that restrict a path and determine nothing: requirements of a control problem, as inequalities are.

Takes: conditions one side of which is a variable that is free where the other side is zero: nothing else contains it but
inequalities, as in 0 <= force perp w >= |slip|, or one equation that contains another such variable, as in slip = p - n with
0 <= force perp p >= 0 and 0 <= force perp n >= 0.
Leaves: these conditions and equations out of a simulation; their variables are zero where the other side is positive, else they
fulfil their equation.
Does not apply: to conditions without which the rest is not determined, and to variables that are not all free at once, as those of
a law of friction.
"""

from collections import Counter
from collections.abc import Callable, Container, Iterable
from itertools import chain

import numpy as np
from pyomo.core import Constraint, value
from pyomo.core.base.var import VarData
from pyomo.core.expr.compare import compare_expressions
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import structural_rank

from pyomo_fesd.core import TimeIndex, variables_of


class Requirements:
    """The conditions of this kind among ``conditions`` (TimeComplementarity).

    Parameters
    ----------
    rows_at : callable label -> iterable of ConstraintData
        all rows at a time
    given : container of VarData
        known variables

    Attributes
    ----------
    names : set of str
        of the conditions
    variables : list of VarData
        those that are free
    equations : set of int
        id of the equations that only they fulfil
    """

    def __init__(
        self,
        conditions: Iterable,
        rows_at: Callable[[float], Iterable[Constraint]],
        times: TimeIndex,
        given: Container[VarData],
    ):
        conditions = [c for c in conditions if c.sides]
        candidates = [(c, k) for c in conditions for k in range(2) if _may_be_free(_last(c), k, times, given)]
        free = _AtLastTime(candidates, conditions, rows_at, times, given).free() if candidates else []
        self.names = {c.name for c, _ in free}
        self._sides = [(sides[k], sides[1 - k]) for c, k in free for sides in c.sides.values()]
        self.variables = [v for v, _ in self._sides]
        self._rows = list(self._read_rows({t for c, _ in free for t in c.sides}, rows_at))
        self.equations = {id(row) for row, _ in self._rows}

    def _read_rows(self, labels, rows_at):
        """Equations at ``labels`` that contain free variables, with these."""
        ids = set(map(id, self.variables))
        for row in chain.from_iterable(map(rows_at, labels)):
            inside = [v for v in variables_of([row.body]) if id(v) in ids] if row.equality else ()
            if inside:
                yield row, inside

    def prepare(self) -> None:
        """Give the variables that have no value the value 0."""
        for v in self.variables:
            if v.value is None:
                v.set_value(0.0, skip_validation=True)

    def fulfil(self) -> None:
        """Set a variable to 0 where the other side is positive; others such that their equation holds, if one of them can."""
        for row, inside in self._rows:
            _fulfil(row, inside)
        for v, other in self._sides:
            if value(other) > 0:
                v.set_value(0.0, skip_validation=True)


class _AtLastTime:
    """The equations and conditions of the last time, as sets of unknowns."""

    def __init__(self, candidates, conditions, rows_at, times, given):
        self._candidates = candidates
        last = max(t for c, _ in candidates for t in c.sides)

        def unknown(parts):
            return {id(v) for v in variables_of(parts) if times.time(v) == last and not v.fixed and v not in given}

        self._equations = {id(row): unknown([row.body]) for row in rows_at(last) if row.equality}
        self._conditions = {c.name: unknown(c.sides[last]) for c in conditions if last in c.sides}

    def free(self):
        """Those of the candidates whose variables are free where the other side is zero."""
        count = Counter(chain.from_iterable(self._conditions.values()))
        alone = {id(_last(c)[k]): (c, k) for c, k in self._candidates if count[id(_last(c)[k])] == 1}
        shared = {row: inside & alone.keys() for row, inside in self._equations.items() if inside & alone.keys()}
        without_equation = alone.keys() - set().union(*shared.values())
        groups = [({v}, set()) for v in without_equation]
        groups += [(inside, {row}) for row, inside in shared.items() if _are_free_at_once([alone[v] for v in inside])]
        return [alone[v] for inside, rows in groups if self._rest_is_determined(inside, rows, alone) for v in inside]

    def _rest_is_determined(self, inside, rows, alone):
        """Whether each other unknown has an equation or condition without those that contain the variables ``inside``."""
        names = {alone[v][0].name for v in inside}
        left = [v for row, v in self._equations.items() if row not in rows]
        left += [v for name, v in self._conditions.items() if name not in names]
        columns = {v: j for j, v in enumerate(set().union(*self._equations.values(), *self._conditions.values()) - inside)}
        entries = [(i, columns[v]) for i, found in enumerate(left) for v in found if v in columns]
        if not entries or any(v in inside for found in left for v in found):
            return False
        at = tuple(zip(*entries))
        return structural_rank(csr_matrix((np.ones(len(entries)), at), shape=(len(left), len(columns)))) == len(columns)


def _may_be_free(sides, k, times, given):
    side, other = sides[k], sides[1 - k]
    if not isinstance(side, VarData) or side.fixed or times.time(side) is None or side in given:
        return False
    return other is not side and side not in variables_of([other])


def _last(condition):
    """Both sides at the last time."""
    return condition.sides[max(condition.sides)]


def _are_free_at_once(candidates):
    """Whether there are several, all with the same other side; a law of friction has not."""
    first, *others = (_last(c)[1 - k] for c, k in candidates)
    return bool(others) and all(compare_expressions(first, other) for other in others)


def _fulfil(row, inside):
    """Let one of the variables ``inside`` fulfil an equation that is linear in them, with a value that is not negative."""
    for v in inside:
        v.set_value(0.0, skip_validation=True)
    rest = value(row.upper) - value(row.body)
    for v in inside:
        v.set_value(1.0, skip_validation=True)
        slope = value(row.upper) - value(row.body) - rest
        v.set_value(max(0.0, -rest / slope) if slope else 0.0, skip_validation=True)
        if v.value:
            return
