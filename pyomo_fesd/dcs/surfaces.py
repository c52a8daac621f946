"""The surfaces q(x) = b at which functions in pieces change, each written once however many functions share it.

    max(0, q - b) = s               a kink (kink.py; theory, eq. 8)
    1 where q > b, 0 where q < b    alpha, a step (step.py; theory, eq. 5), whose p is max(0, q - b)

A quantity q that is an affine function of one met before at the same time is the same quantity: ``x``, ``1 - x`` and
``2*x + y - y`` have their surfaces in common.  That is decided by values at a few random points.

Takes: quantities over time as expressions, and levels b as numbers.
Leaves: a block for each quantity, in it ``kink`` and ``step`` over time and level, and ``inside``, the range that q must not leave.
Does not apply: without time.
"""

import logging
from bisect import bisect_left

import numpy as np
from pyomo.common.collections import ComponentMap
from pyomo.core import Block, Constraint, Set
from pyomo.core.expr.visitor import identify_mutable_parameters, identify_variables

from pyomo_fesd import kink, marks
from pyomo_fesd.dcs import step
from pyomo_fesd.dcs.home import forget
from pyomo_fesd.dcs.regions import value_now
from pyomo_fesd.timeindex import discretised

logger = logging.getLogger('pyomo_fesd')

#: Random points at which two quantities are compared.
POINTS = 5
#: Relative agreement at which two quantities, or two levels, are the same.
SAME = 1e-9
#: Rounding error of a value, relative to the terms that it is made of.
ROUNDING = 1e-13
#: What a level may be.
KINDS = ('kink', 'step')


class Surfaces:
    """All surfaces of one ``home``."""

    def __init__(self, home):
        self._home = home
        self._samples = Samples()

    def positive_part(self, time, q, level):
        """max(0, q - level), as an expression."""
        block, known, factor, b = self._locate(time, q, level)
        steps = block.component('step')
        if steps is not None and (time, b) in steps.switching:
            part = steps.p[time, b] if factor > 0 else steps.n[time, b]
        else:
            s = self._kink(block, time, known, b)
            part = s if factor > 0 else s - _difference(known, b)
        return part if abs(factor) == 1 else abs(factor) * part

    def indicator(self, time, q, level, sign=1):
        """1 where sign (q - level) > 0, 0 where it is < 0, between where q stays at the level; an expression."""
        block, known, factor, b = self._locate(time, q, level)
        steps = self._levels(block, 'step', step, b)
        if (time, b) not in steps.switching:
            self._home.undo.callback(forget, steps, (time, b))
            step.add(steps, (time, b), _difference(known, b))
            alpha = steps.alpha[time, b]
            marks.mark(steps, marks.SIDES, alpha, (f'{block.doc} = {b:g}', {'below': 1 - alpha, 'above': alpha}))
        alpha = steps.alpha[time, b]
        return alpha if factor * sign > 0 else 1 - alpha

    def keep_inside(self, time, q, lower, upper):
        """Impose lower <= q <= upper."""
        block, known, _, _ = self._locate(time, q, lower)
        ends = tuple(sorted(self._locate(time, q, b)[3] for b in (lower, upper)))
        ranges = self._home.part(block, 'ranges', lambda: Set(dimen=2))
        inside = self._home.part(block, 'inside', lambda: Constraint(self._home.wrt, ranges))
        self._member(ranges, ends)
        if (time, *ends) not in inside:
            self._home.undo.callback(inside._data.pop, (time, *ends))
            inside.add((time, *ends), (ends[0], known, ends[1]))

    def bends_by(self, then, otherwise, q, level):
        """The number f for which ``then - otherwise`` is f (q - level) everywhere; None if there is none, so that it jumps."""
        values = [self._samples.of(e) for e in (then, otherwise, q)]
        if any(v is None for v in values) or any(map(_parameters, (then, otherwise, q))):
            return None
        difference, c = values[0] - values[1], values[2] - level
        f = float(difference @ c / (c @ c)) if c.any() else 0.0
        rounding = ROUNDING * np.abs(values[:2]).max()
        return _short(f) if np.abs(difference - f * c).max() <= SAME * np.abs(difference).max() + rounding else None

    def warn_explicit_time(self):
        """Levels that differ from point to point of an element depend on the time label, which is not physical time."""
        for block in self._home.blocks() if discretised(self._home.wrt) else ():
            for name in KINDS:
                part = block.component(name)
                if part is not None and _differs_inside_elements(part.complementarity, self._home.wrt):
                    logger.warning(
                        "%s: its breakpoints or conditions depend on the time label (a Param over time, or t itself in a rule). "
                        "Labels are not physical time once elements move. Use a clock state: a Var with derivative 1 that "
                        "starts at the first time.",
                        block.doc,
                    )

    def _kink(self, block, time, q, level):
        kinks = self._levels(block, 'kink', kink, level)
        if (time, level) in kinks.complementarity:
            return kinks.s[time, level]
        self._home.undo.callback(forget, kinks, (time, level))
        s = kink.add(kinks, (time, level), _difference(q, level))
        size = max(1.0, abs(level))
        sides = {'below': (s - _difference(q, level)) / size, 'above': s / size}
        marks.mark(kinks, marks.SIDES, s, (f'{block.doc} = {level:g}', sides))
        return s

    def _levels(self, block, name, primitive, level):
        """The sub-block of all kinks, or all steps, of a quantity, with ``level`` among its levels."""
        new = block.component(name) is None
        part = self._home.part(block, name, Block)
        if new:
            part.levels = Set(dimen=1)
            primitive.declare(part, self._home.wrt, part.levels)
        self._member(part.levels, level)
        return part

    def _member(self, members, element):
        if element not in members:
            self._home.undo.callback(members.discard, element)
            members.add(element)

    def _locate(self, time, q, level):
        """The block of q, q as it was first met at this time, and the factor and the level that q has in terms of it."""
        here = self._home.entries(time)
        found = [(known, block, 1.0, 0.0) for (known,), block in here if known is q]
        if not found:
            related = ((known, block, self._relation(q, known)) for (known,), block in here)
            found = [(known, block, *relation) for known, block, relation in related if relation is not None]
        known, block, factor, shift = found[0] if found else (q, self._home.new(time, [q], self._home.text(q)), 1.0, 0.0)
        return block, known, factor, _as_known(block, (level - shift) / factor, max(abs(level), abs(shift)) / abs(factor))

    def _relation(self, q, known):
        """(f, d) with q = f known + d; None if there is none."""
        values, others = self._samples.of(q), self._samples.of(known)
        # with different mutable Params they are the same today and may not be so tomorrow
        if values is None or others is None or _parameters(q) != _parameters(known):
            return None
        return _affine(values, others)


def _differs_inside_elements(conditions, wrt):
    """Whether two points of one finite element, its left boundary apart, have conditions at different levels."""
    levels = {}
    for time, level, *_ in conditions:
        levels.setdefault(time, set()).add(level)
    boundaries, elements = wrt.get_finite_elements(), {}
    for time, here in levels.items():
        elements.setdefault(bisect_left(boundaries, time), []).append(here)
    return any(here != element[0] for element in elements.values() for here in element)


class Samples:
    """Values of expressions at the same few random points around the present values of their variables."""

    def __init__(self):
        self._random = np.random.default_rng(1)
        self._points = ComponentMap()
        self._values = {}

    def of(self, expression):
        """The values; None if the expression has none at some point.  The variables keep their values."""
        if id(expression) not in self._values:
            # with the expression itself, so that its id is not given to another one
            self._values[id(expression)] = expression, self._evaluate(expression)
        return self._values[id(expression)][1]

    def _evaluate(self, expression):
        kept = [(v, v.value, v.stale) for v in identify_variables(expression, include_fixed=True)]
        for v, now, _ in kept:
            if v not in self._points:
                self._points[v] = (now or 1.0) * self._random.uniform(0.5, 1.5, POINTS)
        values = []
        try:
            for k in range(POINTS):
                for v, _, _ in kept:
                    v.set_value(self._points[v][k], skip_validation=True)
                values.append(value_now(expression))
        finally:
            for v, now, stale in kept:
                v.set_value(now, skip_validation=True)
                v.stale = stale
        return None if None in values else np.array(values, dtype=float)


def _affine(values, others):
    """(f, d) with values = f others + d, f not 0; None if there is none."""
    variation, other = values - values.mean(), others - others.mean()
    size = np.abs(other).max()
    f = float(variation @ (other / size) / (other / size @ other)) if size > 1e-100 else 0.0
    rounding = ROUNDING * max(np.abs(values).max(), np.abs(f * others).max())
    if not f or np.abs(variation - f * other).max() > SAME * np.abs(variation).max() + rounding:
        return None
    f = _short(f)
    d = float((values - f * others).mean())
    return f, 0.0 if abs(d) <= 10 * rounding else _short(d)


def _short(number):
    """A number without the rounding errors in its last digits."""
    short = float(f'{number:.12g}')
    return short if abs(short - number) <= ROUNDING * abs(number) else number


def _as_known(block, level, scale):
    """A level as its quantity has it already, if it differs by rounding only."""
    known = (b for name in KINDS if block.component(name) is not None for b in block.component(name).levels)
    return next((b for b in known if abs(b - level) <= SAME * scale), float(_short(level)))


def _parameters(expression):
    """What may change although no variable does: two quantities with different mutable Params are never the same."""
    return {id(p) for p in identify_mutable_parameters(expression)}


def _difference(q, level):
    return q - level if level else q
