"""What holds in one element of a moving grid, read from the model: equations, signs, pairs, unknowns.

Elements whose equations are the same, down to their numbers, are of the same ``kind``: one compiled problem serves them all.  So
plants whose data or controls differ from stage to stage need no special treatment.

Takes: a model after ``fesd.finite_elements``.
Leaves: nothing; the model is only read.
Does not apply: to inequalities of the user, which do not determine a simulation.
"""

from collections import defaultdict
from dataclasses import dataclass

from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.core import Block, Constraint, value
from pyomo.core.base.suffix import SuffixFinder
from pyomo.core.expr.relational_expr import RelationalExpression
from pyomo.core.expr.visitor import identify_variables
from pyomo.mpec import Complementarity

from pyomo_fesd import marks
from pyomo_fesd.complementarity import read
from pyomo_fesd.timeindex import DISCRETISATION, derivatives

#: What stands in lists on the block of the grid, but belongs to one point in time.
LISTS = ('nonnegative', 'left_limit')


@dataclass(frozen=True)
class Equations:
    """The problem of one element, or of the first time.

    Attributes
    ----------
    rows : list of relational expressions
    pairs : list of Pair
    conditions : list of Pair
        what the pairs stand for, one for each point
    length : VarData or None
        the length multiplier of an element
    unknown : list of VarData
        what the problem determines
    timed : list of VarData
        the unknowns at stage points
    known : list of VarData
    bounds : list of (lower, upper)
        of the unknowns; states have none, as a simulation goes where the equations lead
    factors : ComponentMap
        the user's ``scaling_factor`` of variables
    kind : tuple
        equal for problems that differ only in the values of what is known
    """

    rows: list
    pairs: list
    conditions: list
    length: object
    unknown: list
    timed: list
    known: list
    bounds: list
    factors: ComponentMap
    kind: tuple


def own_labels(element):
    """The labels of an element without its left boundary."""
    return tuple(dict.fromkeys((*element.points, element.right)))


def variables_of(expressions):
    """All variables of ``expressions``, fixed ones too, each once."""
    found = ComponentSet()
    for e in expressions:
        if hasattr(e, 'is_expression_type'):
            found.update(identify_variables(e, include_fixed=True))
    return found


class Reader:
    """Reads the problems of one moving grid.

    Parameters
    ----------
    model : Block
    block : Block
        of the grid
    times : TimeIndex
    given : ComponentSet of VarData
        variables over time that a march knows: inputs, weights of modes with memory
    """

    def __init__(self, model, block, times, given):
        self._block, self._times, self._given = block, times, given
        self._states = ComponentSet(d.get_state_var() for d in derivatives(model, times.wrt))
        self._equations, self._conditions = defaultdict(list), defaultdict(list)
        self._factor = SuffixFinder('scaling_factor', None, model.model()).find
        memory = block.component('memory')
        for c in model.component_data_objects(Constraint, active=True, descend_into=Block):
            label = times.time(c)
            if label is not None and (c.equality or marks.is_generated(c)) and c.parent_block() is not memory:
                self._equations[label].append(c)
        for name in LISTS:
            for c in block.component(name).values() if block.component(name) is not None else ():
                self._equations[max(t for t in map(times.time, variables_of([c.body])) if t is not None)].append(c)
        for c in model.component_data_objects(Complementarity, descend_into=Block):
            label = times.time(c)
            if label is not None and getattr(c, '_args', None) is not None:
                self._conditions[label].append(c)

    def first(self, label):
        """The algebraic equations of the first time; conditions hold there as they are."""
        conditions = [read(c) for c in self._conditions[label] if c.active]
        return self._problem(self._equations[label], [], conditions, conditions, (label,))

    def element(self, element, limits):
        """What holds in an element.

        Parameters
        ----------
        limits : list of relational expressions
            that end it, such as guards
        """
        labels, n, jumps = own_labels(element), element.n, self._block.component('jumps')
        equations, copies = [c for t in labels for c in self._equations[t]], []
        if jumps is not None:
            equations += [c for (b, _), c in jumps.copied.items() if b == n - 1]
            copies = [v for (b, _), v in jumps.copy.items() if b == n - 1]
        equations += [c for (_, m, _), c in self._block.sign_after.items() if m == n]
        pairs = [read(c) for index, c in self._block.cross.items() if index[1] == n]
        conditions = [read(c) for t in labels for c in self._conditions[t]]
        return self._problem(equations, limits, pairs, conditions, labels, element.points, self._block.r[n], copies)

    def _problem(self, equations, limits, pairs, conditions, labels, points=(), length=None, copies=()):
        rows = [*(c.expr for c in equations), *limits]
        sides = [side for pair in pairs for side in pair]
        everything = variables_of([*rows, *sides])
        unknown = ComponentSet([*([] if length is None else [length]), *copies])
        unknown.update(v for v in everything if self._determined(v, labels))
        bounds = [(None, None) if self._is_state(v) else (v.lb, v.ub) for v in unknown]
        laid = [c.parent_component().local_name.endswith(DISCRETISATION) for c in equations]
        numbers = _numbers([*(row for row, is_laid in zip(rows, laid) if not is_laid), *limits, *sides], everything)
        kind = (len(rows), tuple(numbers), tuple(v in unknown for v in everything), tuple(bounds))
        known = [v for v in everything if v not in unknown]
        timed = [v for v in unknown if self._times.time(v) in points]
        factors = ComponentMap((v, self._factor(v)) for v in unknown if self._factor(v) is not None)
        return Equations(rows, pairs, conditions, length, list(unknown), timed, known, bounds, factors, kind)

    def _determined(self, v, labels):
        if self._times.time(v) not in labels or v in self._given:
            return False
        # a state that is fixed later than at the first time, as at the end of a control problem, is simulated all the same
        return not v.fixed or (self._is_state(v) and self._times.time(v) != self._times.wrt.first())

    def _is_state(self, v):
        return v.parent_component() in self._states


def _numbers(expressions, variables):
    """Values of ``expressions`` where the variables have values that depend on their order only."""
    kept = [(v, v.value, v.stale) for v in variables]
    try:
        for k, (v, _, _) in enumerate(kept):
            v.set_value(0.5 + 0.618034 * k % 1, skip_validation=True)
        return [_number(e) for e in expressions]
    finally:
        for v, old, stale in kept:
            v.set_value(old, skip_validation=True)
            v.stale = stale


def _number(expr):
    """A relational expression tells its body and its bounds; '-' where there is no value."""
    args = expr.args if isinstance(expr, RelationalExpression) else (expr,)
    try:
        return tuple(f'{value(a):.9g}' for a in args)
    except (ArithmeticError, ValueError, TypeError):
        return '-'
