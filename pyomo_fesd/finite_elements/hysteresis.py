"""Hysteresis between elements: a mode stays active over element boundaries until a condition of its region ends (eq. E1).

With the weight nu_{n,i} of mode i in element n, constant in the element, and its conditions c_ik at the boundaries b = 0..N:

    binary:     0 <= nu_{n,i}  perp  1 - nu_{n,i} >= 0
    parts:      0 <= n_{b,ik}  perp  n_{b,ik} + c_ik(x_b) >= 0         (n is the negative part)
    region:     0 <= n_{b,ik}  perp  nu_{b,i} + nu_{b+1,i} >= 0       (the elements on either side)
    least:      0 <= m_{k-1} - m_k  perp  p_k - m_k >= 0,  m_1 = p_1   (the least of the positive parts p_k = n_{b,ik} + c_ik(x_b))
    leaving:    0 <= nu_{b,i} (1 - nu_{b+1,i})  perp  m_{b,i} >= 0

so a mode ends only where one of its c_ik is 0, and it cannot stay active beyond.  The weights are 0 or 1: modes with hysteresis
do not slide.  All other variables are functions of the states: none is free to take a value, where no mode ends, that would tie a
boundary to c_ik = 0.  Where a condition jumps at the boundary, with a state or with a set-point that differs from one control
stage to the next, it is imposed there twice: the left value for the element before, the right value for the element after and for
leaving.

Takes: the hysteresis modes of ``SwitchedSystems``.
Leaves: ``hysteresis`` (a block): ``n``, ``positive`` (p), ``m``, ``one``, ``stays``, ``beyond`` (conditions right of a boundary),
and the pairs ``binary``, ``parts``, ``region``, ``least`` and ``leaving``; the weights of an element have one variable.
Does not apply: to a condition that ends and begins again inside one element; more elements find it.
"""

from dataclasses import dataclass

from pyomo.core import Block, Constraint, Expression, Set, Var, quicksum
from pyomo.core.expr.visitor import identify_variables
from pyomo.dae import ContinuousSet
from pyomo.mpec import Complementarity, complements

from pyomo_fesd.core import Element, Hysteresis, MovingGrid, TimeIndex, all_switched_systems, strip_time, value_or_zero
from pyomo_fesd.finite_elements.right_limits import RightLimits

#: Sides of a boundary: a condition that jumps there is imposed on both, any other on the left only.
LEFT, RIGHT = 0, 1


@dataclass(frozen=True)
class HysteresisLaw:
    """One mode with hysteresis over time.

    Attributes
    ----------
    name : str
        the Disjunction and the number of the mode
    system, title : str
        the Disjunction, and with it the disjunct, by the user's names
    weights : dict label -> ExpressionData
    conditions : dict label -> tuple of expressions c >= 0
    """

    name: str
    system: str
    title: str
    weights: dict
    conditions: dict

    @property
    def independent(self) -> bool:
        """Whether its weight is a variable of its own; the last one follows from the others."""
        return next(iter(self.weights.values())).expr.is_variable_type()

    def condition(self, number: int) -> dict:
        """Return condition 1, 2, ... of the mode by label."""
        return {t: conditions[number - 1] for t, conditions in self.conditions.items()}

    def weight(self, element: Element):
        """Return nu_{n,i}, the weight at the last collocation point of the element, which all its points share."""
        return self.weights[element.points[-1]]


def read_hysteresis(model: Block, wrt: ContinuousSet) -> list[HysteresisLaw]:
    """Return the modes with hysteresis over ``wrt``."""
    times, found = TimeIndex(wrt), {}
    for entry in all_switched_systems(model).hysteresis:
        label, system = times.split(entry.disjunction)
        if label is not None:
            found.setdefault((strip_time(system), entry.number), {})[label] = entry
    return [
        HysteresisLaw(
            f'{system} {number}',
            system,
            f'{system}: {_mode_name(next(iter(entries.values())), times)}',
            {t: entry.weight for t, entry in entries.items()},
            {t: tuple(c.expr for c in entry.conditions) for t, entry in entries.items()},
        )
        for (system, number), entries in found.items()
    ]


def _mode_name(entry, times):
    """The disjunct's own name; ``mode 1`` where it has none."""
    name = '_disjuncts' if entry.disjunct is None else strip_time(times.split(entry.disjunct)[1]).split('.')[-1]
    return f'mode {entry.number}' if '_disjuncts' in name else name


def add_hysteresis(moving: MovingGrid, modes: list[HysteresisLaw], limits: RightLimits) -> None:
    """Add the law of switching between elements."""
    if not modes:
        return
    moving.block.hysteresis = block = Block()
    _declare_boundary_pairs(block, modes, len(moving.grid.elements))
    moving.hysteresis = rows = Hysteresis(
        modes, block, block.n, block.m, block.beyond, block.binary, block.parts, block.region, block.least, block.leaving
    )
    for mode in modes:
        _share_weights(moving, mode)
    for mode in modes:
        _add_elements(rows, mode, moving.grid)
        _add_boundaries(moving, mode, limits)


def _declare_boundary_pairs(block, modes, elements):
    most = max((len(cs) for mode in modes for cs in mode.conditions.values()), default=0)
    block.mode = Set(initialize=[m.name for m in modes], ordered=True)
    block.boundary = Set(initialize=range(elements + 1), ordered=True)
    block.number = Set(initialize=range(1, most + 1), ordered=True)
    block.side = Set(initialize=[LEFT, RIGHT], ordered=True)
    block.beyond = Expression(block.mode, block.boundary, block.number, rule=lambda *_: Expression.Skip)
    index = (block.mode, block.boundary, block.number, block.side)
    block.n = Var(*index, dense=False, bounds=(0, None))
    block.positive = Expression(*index, rule=lambda *_: Expression.Skip)
    block.m = Var(block.mode, block.boundary, block.number, dense=False, bounds=(0, None))
    block.one, block.stays = Constraint(block.mode, block.boundary), Constraint(block.mode, block.boundary)
    for name in ('binary', 'leaving'):
        block.add_component(name, Complementarity(block.mode, block.boundary))
    block.least = Complementarity(block.mode, block.boundary, block.number)
    for name in ('parts', 'region'):
        block.add_component(name, Complementarity(*index))


def _share_weights(moving, mode):
    """One weight for all points of an element; the first time belongs to the first element."""
    for element in moving.grid.elements:
        first = [moving.wrt.first()] if element.n == 1 else []
        weights = [mode.weights[t] for t in (*first, *element.own_labels) if t in mode.weights]
        nu = mode.weight(element).expr
        if nu.is_variable_type():
            given = next((w.expr for w in weights if w.expr.fixed), nu)
            if given.fixed:
                nu.fix(given.value)
        for weight in weights:
            weight.set_value(nu)


def _add_elements(rows, mode, grid):
    """nu is 0 or 1; the last mode's weight follows from the others and only has to be no less than 0."""
    for element in grid.elements:
        nu = mode.weight(element)
        if mode.independent:
            rows.binary.add((mode.name, element.n), complements(nu.expr >= 0, 1 - nu.expr >= 0))
        elif len(list(identify_variables(nu))) > 1:
            rows.block.one.add((mode.name, element.n), nu >= 0)


def _add_boundaries(moving, mode, limits):
    """The conditions of one mode at all boundaries, and where it may end."""
    rows, elements = moving.hysteresis, moving.grid.elements
    labels = [moving.wrt.first(), *(e.right for e in elements)]
    for b, (label, before, after) in enumerate(zip(labels, [None, *elements], [*elements, None])):
        inner, ends = before is not None and after is not None, []
        for k, c in enumerate(mode.conditions[label], start=1):
            beyond = limits.condition(before, after, mode.condition(k)) if inner else None
            if beyond is None:
                sides = [(LEFT, c, (before, after))]
            else:
                rows.beyond[mode.name, b, k] = beyond
                sides = [(LEFT, c, (before,)), (RIGHT, beyond, (after,))]
            for side, at_side, neighbours in sides:
                positive = _add_condition(rows, (mode.name, b, k, side), at_side, mode, neighbours)
            ends.append(positive)
        if inner:
            _add_end(rows, (mode.name, b), ends, mode.weight(before), mode.weight(after))


def _add_condition(rows, index, c, mode, elements):
    """Add one condition at one boundary, for the elements beside it; returns its positive part."""
    n = rows.n[index]
    n.value = max(-value_or_zero(c), 0.0)
    rows.block.positive[index] = n + c
    positive = rows.block.positive[index]
    rows.parts.add(index, complements(n >= 0, positive >= 0))
    rows.region.add(index, complements(n >= 0, quicksum(mode.weight(e).expr for e in elements if e is not None) >= 0))
    return positive


def _add_end(rows, index, ends, before, after):
    """The mode may end where the least of the positive parts ``ends`` is 0; without conditions nowhere."""
    if not ends:
        rows.block.stays.add(index, before.expr <= after.expr)
        return
    least = ends[0]
    for k, positive in enumerate(ends[1:], start=2):
        m = rows.m[(*index, k)]
        m.value = min(max(value_or_zero(least), 0.0), max(value_or_zero(positive), 0.0))
        rows.least.add((*index, k), complements(least - m >= 0, positive - m >= 0))
        least = m
    rows.leaving.add(index, complements(before.expr * (1 - after.expr) >= 0, least >= 0))
