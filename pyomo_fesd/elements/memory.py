"""Hysteresis between elements: a mode goes on over element boundaries until a condition of its region ends (eq. E1).

With the weight nu_{n,i} of mode i in element n, constant in the element, and its conditions c_ik at the boundaries b = 0..N:

    binary:     0 <= nu_{n,i}  perp  1 - nu_{n,i} >= 0
    parts:      0 <= n_{b,ik}  perp  n_{b,ik} + c_ik(x_b) >= 0         (n is the negative part)
    region:     0 <= n_{b,ik}  perp  nu_{b,i} + nu_{b+1,i} >= 0       (the elements on either side)
    leaving:    0 <= d_{b,ik}  perp  n_{b,ik} + c_ik(x_b) >= 0,       nu_{b,i} - nu_{b+1,i} <= sum_k d_{b,ik}

so a mode is left (d > 0) only where one of its c_ik is 0, and it cannot go on beyond.  There is no multiplier between 0 and 1:
modes with memory do not slide.  Where a condition jumps at the boundary, with a state or with a set-point that differs from stage
to stage, it stands there twice: the left one for the element before, the right one for the element after and for leaving.

Takes: the marks MEMORY.
Leaves: ``memory`` (a block): ``n``, ``d``, ``leave``, ``one``, ``beyond`` (conditions right of a boundary), and the pairs
``binary``, ``parts``, ``region`` and ``leaving``; the weights of an element have one variable.
Does not apply: to a condition that ends and begins again inside one element; more elements find it.
"""

import re
from dataclasses import dataclass

from pyomo.core import Block, Constraint, Expression, Set, Var, quicksum, value
from pyomo.core.expr.visitor import identify_variables
from pyomo.mpec import Complementarity, complements

from pyomo_fesd import marks
from pyomo_fesd.switching import public_name
from pyomo_fesd.timeindex import TimeIndex, strip_time

#: Sides of a boundary: a condition that jumps there stands on both, any other on the left only.
LEFT, RIGHT = 0, 1


@dataclass(frozen=True)
class Mode:
    """One mode with memory over time.

    Attributes
    ----------
    name : str
        the family name of its weights
    system, title : str
        the Disjunction that it belongs to, and with it the disjunct, as people know them
    weights : dict label -> ExpressionData
    conditions : dict label -> tuple of expressions c >= 0
    """

    name: str
    system: str
    title: str
    weights: dict
    conditions: dict

    @property
    def independent(self):
        """Whether its weight is a variable of its own; the last one follows from the others."""
        return next(iter(self.weights.values())).expr.is_variable_type()

    def weight(self, element):
        """nu_{n,i}: the value at the last stage of the element stands for all of it."""
        return self.weights[element.points[-1]]

    def unchanged(self, before, after):
        """Factor of eta (eq. 12) between two elements: 1 where the mode goes on or stays off."""
        a, b = self.weight(before), self.weight(after)
        return a * b + (1 - a) * (1 - b)


def read_modes(model, wrt):
    """The modes with memory over ``wrt``, from the marks, also after they are used up."""
    times, marked = TimeIndex(wrt), {}
    disjuncts = {id(weight): disjunct for disjunct, weight in marks.marked(model, marks.INDICATOR)}
    for weight, conditions in marks.marked(model, marks.MEMORY, used=True):
        label, name = times.split(weight)
        if label is not None:
            marked.setdefault(name, {})[label] = (weight, conditions)
    return [
        Mode(
            name,
            *_titles(name, family, disjuncts, times),
            {t: weight for t, (weight, _) in family.items()},
            {t: tuple(c.expr for c in conditions) for t, (_, conditions) in family.items()},
        )
        for name, family in marked.items()
    ]


def _titles(name, family, disjuncts, times):
    """Names for people: ``relay`` and ``relay: heating``; ``relay: mode 1`` where the disjunct has no name of its own."""
    *units, number = (i for i in re.search(r'\[([^[]*)\]$', name)[1].split(',') if i != '*')
    system = re.sub(r'_memory_\d+$', '', public_name(name)) + (f"[{','.join(units)}]" if units else '')
    disjunct = disjuncts.get(id(next(weight for weight, _ in family.values())))
    own = None if disjunct is None else strip_time(times.split(disjunct)[1]).split('.')[-1]
    return system, f'{system}: {own}' if own and '_disjuncts' not in own else f'{system}: mode {number}'


def add_memory(block, modes, limits, grid, wrt):
    """Put the law of switching between the elements of ``grid`` on ``block``; the marks are used up."""
    if not modes:
        return
    marks.use_up(block.model(), marks.MEMORY, wrt)
    most = max((len(cs) for mode in modes for cs in mode.conditions.values()), default=0)
    block.memory = memory = Block()
    memory.mode = Set(initialize=[m.name for m in modes], ordered=True)
    memory.boundary = Set(initialize=range(len(grid.elements) + 1), ordered=True)
    memory.number = Set(initialize=range(1, most + 1), ordered=True)
    memory.side = Set(initialize=[LEFT, RIGHT], ordered=True)
    memory.beyond = Expression(memory.mode, memory.boundary, memory.number, rule=lambda *_: Expression.Skip)
    index = (memory.mode, memory.boundary, memory.number, memory.side)
    memory.n = Var(*index, dense=False, bounds=(0, None))
    memory.d = Var(*index, dense=False, bounds=(0, 1))
    memory.leave = Constraint(memory.mode, memory.boundary)
    memory.one = Constraint(memory.mode, memory.boundary)
    memory.binary = Complementarity(memory.mode, memory.boundary)
    for name in ('parts', 'region', 'leaving'):
        memory.add_component(name, Complementarity(*index))
    for mode in modes:
        _hold(mode, grid, wrt)
    for mode in modes:
        _add_elements(memory, mode, grid)
        _add_boundaries(memory, mode, limits, grid, wrt)


def _hold(mode, grid, wrt):
    """One weight for all points of an element; the first time belongs to the first element."""
    for element in grid.elements:
        labels = dict.fromkeys((*((wrt.first(),) if element.n == 1 else ()), *element.points, element.right))
        weights = [mode.weights[t] for t in labels if t in mode.weights]
        nu = mode.weight(element).expr
        if nu.is_variable_type():
            given = next((w.expr for w in weights if w.expr.fixed), nu)
            if given.fixed:
                nu.fix(given.value)
        for weight in weights:
            weight.set_value(nu)


def _add_elements(memory, mode, grid):
    """nu is 0 or 1; the last mode's weight follows from the others and only has to be no less than 0."""
    for element in grid.elements:
        nu = mode.weight(element)
        if mode.independent:
            memory.binary.add((mode.name, element.n), complements(nu.expr >= 0, 1 - nu.expr >= 0))
        elif len(list(identify_variables(nu))) > 1:
            memory.one.add((mode.name, element.n), nu >= 0)


def _add_boundaries(memory, mode, limits, grid, wrt):
    labels = [wrt.first(), *(e.right for e in grid.elements)]
    elements = [None, *grid.elements, None]
    for b, (label, before, after) in enumerate(zip(labels, elements, elements[1:])):
        inner, ends = before is not None and after is not None, []
        for k, c in enumerate(mode.conditions[label], start=1):
            functions = {t: conditions[k - 1] for t, conditions in mode.conditions.items()}
            beyond = limits.condition(before, after, functions) if inner else None
            if beyond is None:
                ends += _add_condition(memory, (mode.name, b, k, LEFT), c, mode, (before, after), inner)
            else:
                memory.beyond[mode.name, b, k] = beyond
                _add_condition(memory, (mode.name, b, k, LEFT), c, mode, (before,), False)
                ends += _add_condition(memory, (mode.name, b, k, RIGHT), beyond, mode, (after,), True)
        if inner:
            memory.leave.add((mode.name, b), mode.weight(before).expr - mode.weight(after).expr <= quicksum(ends))


def _add_condition(memory, index, c, mode, elements, may_end):
    """One condition at one boundary, for the elements beside it; returns d as a list if the mode may end there."""
    n = memory.n[index]
    n.value = max(-(value(c, exception=False) or 0.0), 0.0)
    weights = [mode.weight(e).expr for e in elements if e is not None]
    memory.parts.add(index, complements(n >= 0, n + c >= 0))
    memory.region.add(index, complements(n >= 0, quicksum(weights) >= 0))
    if not may_end:
        return []
    d = memory.d[index]
    d.value = 0.0
    memory.leaving.add(index, complements(d >= 0, n + c >= 0))
    return [d]
