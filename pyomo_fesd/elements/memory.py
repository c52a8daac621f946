"""Hysteresis between elements: a mode goes on over element boundaries until a condition of its region ends.

With the weight nu_{n,i} of mode i in element n, constant in the element, and c_ik = p - n at the boundaries b = 0..N:

    binary:     0 <= nu_{n,i}  perp  1 - nu_{n,i} >= 0
    parts:      0 <= n_{b,ik}  perp  p_{b,ik} >= 0
    region:     0 <= n_{b,ik}  perp  nu_{b,i} + nu_{b+1,i} >= 0       (the elements on either side)
    leaving:    0 <= d_{b,ik}  perp  p_{b,ik} >= 0,                   nu_{b,i} - nu_{b+1,i} <= sum_k d_{b,ik}

so a mode is left (d > 0) only where one of its c_ik is 0, and it cannot go on beyond.  There is no multiplier between 0 and 1:
modes with memory do not slide.

Takes: the marks MEMORY.
Leaves: ``memory`` (a block): ``p``, ``n``, ``d``, ``switching``, ``leave``, ``hold``, and the pairs ``binary``, ``parts``,
``region`` and ``leaving``.
Does not apply: to a condition that ends and begins again inside one element; more elements find it.
"""

import re
from dataclasses import dataclass

from pyomo.core import Block, Constraint, Set, Var, quicksum, value
from pyomo.mpec import Complementarity, complements

from pyomo_fesd import marks
from pyomo_fesd.timeindex import TimeIndex


@dataclass(frozen=True)
class Mode:
    """One mode with memory over time.

    Attributes
    ----------
    name : str
    system : str
        the Disjunction that it belongs to, by the family name of its weights
    weights : dict label -> expression
    conditions : dict label -> tuple of expressions c >= 0
    independent : bool
        whether its weight is a variable of its own; the last one follows from the others
    """

    name: str
    system: str
    weights: dict
    conditions: dict
    independent: bool

    def weight(self, element):
        """nu_{n,i}: the value at the last stage of the element stands for all of it."""
        return self.weights[element.points[-1]]

    def unchanged(self, before, after):
        """Factor of eta (eq. 12) between two elements: 1 where the mode goes on or stays off."""
        a, b = self.weight(before), self.weight(after)
        return a * b + (1 - a) * (1 - b)


def read_modes(model, wrt):
    """The modes with memory of a model, from the marks, also after they are used up."""
    times, marked = TimeIndex(wrt), {}
    selectors = {id(v) for v, _ in marks.marked(model, marks.SELECTOR)}
    for weight, conditions in marks.marked(model, marks.MEMORY, used=True):
        label, name = times.split(weight)
        marked.setdefault(name, {})[label] = (weight.expr, conditions)
    return [
        Mode(
            name,
            re.sub(r',?\d+\]$', ']', name),
            {t: weight for t, (weight, _) in family.items()},
            {t: tuple(c.expr for c in conditions) for t, (_, conditions) in family.items()},
            all(id(weight) in selectors for weight, _ in family.values()),
        )
        for name, family in marked.items()
    ]


def add_memory(block, modes, grid, wrt):
    """Put the law of switching between the elements of ``grid`` on ``block``; the marks are used up."""
    if not modes:
        return
    marks.use_up(block.model(), marks.MEMORY)
    most = max((len(cs) for mode in modes for cs in mode.conditions.values()), default=0)
    block.memory = memory = Block()
    memory.mode = Set(initialize=[m.name for m in modes], ordered=True)
    memory.boundary = Set(initialize=range(len(grid.elements) + 1), ordered=True)
    memory.number = Set(initialize=range(1, most + 1), ordered=True)
    index = (memory.mode, memory.boundary, memory.number)
    for name in 'pn':
        memory.add_component(name, Var(*index, dense=False, bounds=(0, None)))
    memory.d = Var(*index, dense=False, bounds=(0, 1))
    memory.switching = Constraint(*index)
    memory.leave = Constraint(memory.mode, memory.boundary)
    memory.binary = Complementarity(memory.mode, memory.boundary)
    for name in ('parts', 'region', 'leaving'):
        memory.add_component(name, Complementarity(*index))
    memory.hold = Constraint(memory.mode, wrt)
    for mode in modes:
        _add_boundaries(memory, mode, grid, wrt)
        if mode.independent:
            _add_elements(memory, mode, grid, wrt)


def _add_boundaries(memory, mode, grid, wrt):
    labels = [wrt.first(), *(e.right for e in grid.elements)]
    weights = [None, *map(mode.weight, grid.elements), None]
    for b, label in enumerate(labels):
        before, after = weights[b], weights[b + 1]
        sides = [w for w in (before, after) if w is not None]
        inner, left = len(sides) == 2, []
        for k, c in enumerate(mode.conditions[label], start=1):
            p, n = memory.p[mode.name, b, k], memory.n[mode.name, b, k]
            now = value(c, exception=False) or 0.0
            p.value, n.value = max(now, 0.0), max(-now, 0.0)
            memory.switching.add((mode.name, b, k), c == p - n)
            memory.parts.add((mode.name, b, k), complements(n >= 0, p >= 0))
            memory.region.add((mode.name, b, k), complements(n >= 0, quicksum(sides) >= 0))
            if inner:
                d = memory.d[mode.name, b, k]
                d.value = 0.0
                left.append(d)
                memory.leaving.add((mode.name, b, k), complements(d >= 0, p >= 0))
        if inner:
            memory.leave.add((mode.name, b), before - after <= quicksum(left))


def _add_elements(memory, mode, grid, wrt):
    """nu is 0 or 1, and the same at all points of an element; the first time belongs to the first element."""
    for element in grid.elements:
        nu = mode.weight(element)
        memory.binary.add((mode.name, element.n), complements(nu >= 0, 1 - nu >= 0))
        labels = dict.fromkeys((*element.points[:-1], element.right, *((wrt.first(),) if element.n == 1 else ())))
        for label in labels:
            other = mode.weights.get(label)
            if other is not None and other is not nu:
                memory.hold.add((mode.name, label), other == nu)
