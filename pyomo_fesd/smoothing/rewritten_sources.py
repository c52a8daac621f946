"""Rewrite sources with their absolute values replaced; those that are built alike are stamped from the first of them.

A constraint over time is built alike at every time: only its first time is walked, sorted into linear terms and asked for units.

Takes: a source, and for each of its absolute values whether it is replaced.
Leaves: the rewritten source, with its positive parts in the generated block beside it.
"""

from collections.abc import Callable
from typing import NamedTuple

from pyomo_fesd.core import Stamp, divided_by, expression_key, known_sign, unit_of
from pyomo_fesd.smoothing.generated_blocks import add_to_source, last_number
from pyomo_fesd.smoothing.linear_terms import LinearCombination
from pyomo_fesd.smoothing.rewriting import PatternReplacer
from pyomo_fesd.smoothing.sources import expressions, set_expressions


class _Part(NamedTuple):
    """One positive part s [z] = max(0, z): its number in the source, z, its unit, and the variable s."""

    number: int
    z: object
    unit: object
    s: object


class _Pattern(NamedTuple):
    """The first one of the sources that are built alike: its parts, its new expressions, and the stamp of its components."""

    parts: list
    rewritten: list
    stamp: Stamp


class SourceRewriter:
    """Rewrites one source after the other."""

    def __init__(self):
        self._replacer, self._patterns, self._units = PatternReplacer(), {}, {}

    def rewrite(self, source, reasons: list, replaced: Callable) -> int:
        """Rewrite one source and return the number of its new pairs.

        Parameters
        ----------
        reasons : list of str or None
            for each absolute value why it is left alone, or None
        replaced : function (Match, guarded) -> bool
            the same for a match
        """
        before, after = expressions(source), last_number(source)
        structure, components = expression_key(before, _properties)
        key = structure, tuple(map(self._unit, components)), tuple(reasons), after
        pattern = self._patterns.get(key)
        if pattern is not None and structure is not None:
            _copy(pattern, source, components)
            return len(pattern.parts)
        parts = _PositiveParts(source, after)
        rewritten = [self._replacer.replace(e, replaced, parts.absolute) for e in before]
        set_expressions(source, rewritten)
        self._patterns[key] = _Pattern(parts.found, rewritten, Stamp([*components, *(part.s for part in parts.found)]))
        return len(parts.found)

    def _unit(self, component):
        """The text of the unit of a component, or of a unit itself; a named Expression has that of its contents."""
        if component.is_named_expression_type():
            return None
        has_unit = component.is_variable_type() or component.is_parameter_type()
        unit = component.get_units() if has_unit else component
        if id(unit) not in self._units:
            # Pyomo writes a unit slowly, and each state block of a flowsheet has units of its own; kept for their ids
            self._units[id(unit)] = unit, str(unit)
        return self._units[id(unit)][1]


def _properties(v):
    """What the rewriting asks of a variable: its bounds, and its value if it is fixed."""
    return v.lb, v.ub, v.fixed and v.value


def _copy(pattern, source, components):
    others = [*components, *(part.s for part in pattern.parts)]
    for k, part in enumerate(pattern.parts, start=len(components)):
        z = pattern.stamp.expression(part.z, others)
        others[k] = add_to_source(source, part.number, divided_by(z, part.unit))
    set_expressions(source, [pattern.stamp.expression(e, others) for e in pattern.rewritten])


class _PositiveParts:
    """The positive parts of one source: equal z, or z and -z, share one s = max(0, z).

    Attributes
    ----------
    found : list of _Part
    """

    def __init__(self, source, number):
        self._source, self._number = source, number
        self._known, self.found = {}, []

    def absolute(self, z):
        """|z| = 2 s - z; z and the result are LinearCombinations."""
        for sign in (1, -1):
            if z.key(sign) in self._known:
                return LinearCombination(self._known[z.key(sign)], 2).add(z, -sign)
        self._number += 1  # counted also where bounds decide, so that each has the same number at all times
        expr = z.expression()
        sign = known_sign(expr)
        if sign:
            return LinearCombination(z, sign)
        s = self._known[z.key()] = self._add(expr)
        return LinearCombination(s, 2).add(z, -1)

    def _add(self, z):
        """The positive part of z, in its unit."""
        unit = unit_of(z)
        s = add_to_source(self._source, self._number, divided_by(z, unit))
        self.found.append(_Part(self._number, z, unit, s))
        return s if unit is None else s * unit
