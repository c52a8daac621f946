"""Write the boundaries q(x) = b at which piecewise functions change, each once however many functions share it.

    max(0, q - b) = s               a positive part (core/positive_part.py; theory, eq. 8)
    1 where q > b, 0 where q < b    alpha, a step (core/step.py; theory, eq. 5), whose p is max(0, q - b)

A quantity q that is an affine function of another one at the same time is the same quantity: ``x``, ``1 - x`` and
``2*x + y - y`` share their boundaries (``quantities.py``).

Takes: quantities over time as expressions, and levels b as numbers.
Leaves: a block for each quantity, in it ``positive_part`` and ``step`` over time and level, and ``inside``, the range of q.
Does not apply: without time.
"""

import logging
from bisect import bisect_left

from pyomo.core import Block, Constraint, Set

from pyomo_fesd.core import (
    Surface,
    add_positive_part,
    add_step,
    declare_positive_part,
    declare_step,
    discretised,
    switched_systems,
)
from pyomo_fesd.dcs.piecewise.generated_blocks import delete_data
from pyomo_fesd.dcs.piecewise.quantities import SAME, Quantities, shortened

logger = logging.getLogger('pyomo_fesd')

#: Components of a quantity that hold levels.
LEVELLED = ('positive_part', 'step')


class Breakpoints:
    """All boundaries among the quantities of some ``GeneratedBlocks``."""

    def __init__(self, blocks):
        self._blocks = blocks
        self.quantities = Quantities()

    def positive_part(self, time, q, level):
        """Return max(0, q - level) as an expression."""
        block, known, factor, b = self._locate(time, q, level)
        steps = block.component('step')
        if steps is not None and (time, b) in steps.switching:
            part = steps.p[time, b] if factor > 0 else steps.n[time, b]
        else:
            s = self._positive_part(block, time, known, b)
            part = s if factor > 0 else s - _difference(known, b)
        return part if abs(factor) == 1 else abs(factor) * part

    def indicator(self, time, q, level, sign=1):
        """Return 1 where sign (q - level) > 0, 0 where it is < 0, between where q stays at the level; an expression."""
        block, known, factor, b = self._locate(time, q, level)
        steps = self._levelled(block, 'step', declare_step, b)
        if (time, b) not in steps.switching:
            self._blocks.undo.callback(delete_data, steps, (time, b))
            alpha = add_step(steps, (time, b), _difference(known, b))
            _record(steps, alpha, f'{block.doc} = {b:g}', {'below': 1 - alpha, 'above': alpha})
        alpha = steps.alpha[time, b]
        return alpha if factor * sign > 0 else 1 - alpha

    def keep_inside(self, time, q, lower, upper):
        """Impose lower <= q <= upper."""
        block, known, _, _ = self._locate(time, q, lower)
        ends = tuple(sorted(self._locate(time, q, b)[3] for b in (lower, upper)))
        ranges = self._blocks.component_of(block, 'ranges', lambda: Set(dimen=2))
        inside = self._blocks.component_of(block, 'inside', lambda: Constraint(self._blocks.wrt, ranges))
        self._add_member(ranges, ends)
        if (time, *ends) not in inside:
            self._blocks.undo.callback(inside._data.pop, (time, *ends))
            inside.add((time, *ends), (ends[0], known, ends[1]))

    def warn_explicit_time(self):
        """Warn of levels that differ inside an element: they depend on the time label, which is not physical time."""
        for block in self._blocks.blocks() if discretised(self._blocks.wrt) else ():
            for part in _levelled_parts(block):
                if _differs_inside_elements(part.complementarity, self._blocks.wrt):
                    logger.warning(
                        "%s: its breakpoints or conditions depend on the time label (a Param over time, or t itself in a rule). "
                        "Labels are not physical time once elements move. Use a clock state: a Var with derivative 1 that "
                        "starts at the first time.",
                        block.doc,
                    )

    def _positive_part(self, block, time, q, level):
        parts = self._levelled(block, 'positive_part', declare_positive_part, level)
        if (time, level) in parts.complementarity:
            return parts.s[time, level]
        self._blocks.undo.callback(delete_data, parts, (time, level))
        s = add_positive_part(parts, (time, level), _difference(q, level))
        size = max(1.0, abs(level))
        sides = {'below': (s - _difference(q, level)) / size, 'above': s / size}
        _record(parts, s, f'{block.doc} = {level:g}', sides)
        return s

    def _levelled(self, block, name, declare, level):
        """The sub-block of all positive parts, or all steps, of a quantity, with ``level`` among its levels."""
        new = block.component(name) is None
        part = self._blocks.component_of(block, name, Block)
        if new:
            part.levels = Set(dimen=1)
            declare(part, self._blocks.wrt, part.levels)
        self._add_member(part.levels, level)
        return part

    def _add_member(self, members, element):
        if element not in members:
            self._blocks.undo.callback(members.discard, element)
            members.add(element)

    def _locate(self, time, q, level):
        """The block of q, the same quantity as first written at this time, and the factor and the level of q in terms of it."""
        block, known, factor, shift = self._known(time, q) or (self._blocks.new(time, [q], self._blocks.text(q)), q, 1.0, 0.0)
        return block, known, factor, _known_level(block, (level - shift) / factor, max(abs(level), abs(shift)) / abs(factor))

    def _known(self, time, q):
        """(block, known, f, d) of the first quantity with q = f known + d at this time; None for a new quantity."""
        here = self._blocks.entries(time)
        for (known,), block in here:
            if known is q:
                return block, known, 1.0, 0.0
        for (known,), block in here:
            relation = self.quantities.affine(q, known)
            if relation is not None:
                return block, known, *relation
        return None


def _levelled_parts(block):
    return [part for part in map(block.component, LEVELLED) if part is not None]


def _differs_inside_elements(conditions, wrt):
    """Whether two points of one finite element, its left boundary apart, have conditions at different levels."""
    levels = {}
    for time, level, *_ in conditions:
        levels.setdefault(time, set()).add(level)
    boundaries, elements = wrt.get_finite_elements(), {}
    for time, here in levels.items():
        elements.setdefault(bisect_left(boundaries, time), []).append(here)
    return any(here != element[0] for element in elements.values() for here in element)


def _known_level(block, level, scale):
    """A level of the quantity that differs from ``level`` by rounding only, or else ``level``."""
    known = (b for part in _levelled_parts(block) for b in part.levels)
    return next((b for b in known if abs(b - level) <= SAME * scale), float(shortened(level)))


def _difference(q, level):
    return q - level if level else q


def _record(block, variable, name, sides):
    switched_systems(block).surfaces.append(Surface(variable, name, sides))
