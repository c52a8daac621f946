"""Nested Disjunctions, flattened: every way from the outermost Disjunction down to an innermost disjunct is one mode.

    region of a mode    = the regions of all disjuncts on its way            (theory, section 1)
    equations of a mode = the equations of all disjuncts on its way
    nu of a disjunct    = sum of nu over the modes that it is part of

A disjunct that contains several Disjunctions has a mode for each combination of theirs.  A Disjunction belongs to an outer
disjunct if it is declared there, as in pyomo.gdp, or if its own disjuncts are.

Takes: the active Disjunctions over time, and which disjuncts are switched off or fixed.
Leaves: a ``Tree`` for each outermost Disjunction; nothing on the model.
Does not apply: to Disjunctions of different times inside one another.
"""

from dataclasses import dataclass, replace
from itertools import chain, product

from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.core import Block, Constraint
from pyomo.gdp import Disjunct, Disjunction

from pyomo_fesd.errors import FesdError


@dataclass(frozen=True, eq=False)
class Mode:
    """One mode of a system.

    Attributes
    ----------
    disjuncts : tuple of DisjunctData
        those on the way to it, outermost first
    innermost : tuple of DisjunctData
        where the way ends; several where a disjunct contains several Disjunctions
    """

    disjuncts: tuple
    innermost: tuple

    @property
    def name(self):
        """The names of the innermost disjuncts."""
        return ' and '.join(d.name for d in self.innermost)

    def __contains__(self, disjunct):
        return any(d is disjunct for d in self.disjuncts)

    def constraints(self):
        """The active constraints that say where the mode holds and what it does."""
        return chain(*(d.component_data_objects(Constraint, active=True, descend_into=Block) for d in self.disjuncts))


@dataclass(frozen=True, eq=False)
class Tree:
    """An outermost Disjunction at one time with everything inside.

    Attributes
    ----------
    disjunction : DisjunctionData
    nested : list of DisjunctionData
        the Disjunctions below it
    modes : list of Mode
        those that can be active
    """

    disjunction: object
    nested: list
    modes: list

    def disjuncts(self):
        """All disjuncts, also those that are switched off."""
        return chain(*(d.disjuncts for d in (self.disjunction, *self.nested)))


class Nesting:
    """Which Disjunction of a model lies inside which disjunct.

    Parameters
    ----------
    remembered : ComponentSet of DisjunctionData
        with memory: there a fixed indicator tells which mode comes first, and leaves the others possible
    """

    def __init__(self, model, times, remembered=()):
        self._times, self._remembered = times, remembered
        self._inside = ComponentMap()
        for disjunction in model.component_data_objects(Disjunction, active=True, descend_into=(Block, Disjunct)):
            host = self._host(disjunction)
            if host is not None:
                self._inside.setdefault(host, []).append(disjunction)

    def _host(self, disjunction):
        """The disjunct over time that a Disjunction over time lies in, by its own place or by that of its disjuncts, or None."""
        if self._times.time(disjunction) is None:
            return None
        host = self._enclosing(disjunction)
        if host is not None:
            return host
        hosts = ComponentSet(self._enclosing(d) for d in disjunction.disjuncts)
        if len(hosts) > 1:
            raise FesdError(
                disjunction,
                "its disjuncts lie in different disjuncts, or only some of them in one",
                "declare all disjuncts of a nested Disjunction in the disjunct that it belongs to",
            )
        return next(iter(hosts), None)

    def _enclosing(self, component):
        """The innermost disjunct over time around a component, or None."""
        block = component.parent_block()
        while block is not None and block.ctype is not Disjunct:
            block = block.parent_block()
        return block if block is not None and self._times.time(block) is not None else None

    def outermost(self, disjunctions, targets):
        """Those of ``disjunctions`` that are over time and not nested; one that is named as a target must not be nested."""
        named = [t for t in targets if t.ctype is Disjunction]
        named = ComponentSet(chain(*(t.values() if hasattr(t, 'values') else [t] for t in named)))
        found = []
        for disjunction in disjunctions:
            host = self._host(disjunction)
            if host is None and self._times.time(disjunction) is not None:
                found.append(disjunction)
            elif host is not None and disjunction in named:
                raise FesdError(
                    disjunction,
                    f"fesd.dcs: this Disjunction is nested in '{host.name}'",
                    "give the outermost Disjunction as target; what is inside goes with it",
                )
        return found

    def tree(self, disjunction):
        """The tree of an outermost Disjunction."""
        nested = list(self._below(disjunction))
        for d in (disjunction, *nested):
            _refuse_inclusive_or(d)
            if self._times.time(d) != self._times.time(disjunction):
                raise FesdError(d, f"it is nested in '{disjunction.name}', which is of another time", "nest modes of one time")
        remembered = disjunction in self._remembered
        tree = Tree(disjunction, nested, list(self._modes(disjunction, remembered)))
        return tree if remembered else replace(tree, modes=_agreeing(tree))

    def _below(self, disjunction):
        for disjunct in disjunction.disjuncts:
            for inner in self._inside.get(disjunct, ()):
                yield inner
                yield from self._below(inner)

    def _modes(self, disjunction, remembered):
        possible = [d for d in disjunction.disjuncts if _possible(disjunction, d, remembered)]
        if not possible:
            raise FesdError(disjunction, "all its disjuncts are switched off", "activate one, or deactivate the Disjunction")
        for disjunct in possible:
            for ways in product(*(self._modes(inner, remembered) for inner in self._inside.get(disjunct, ()))):
                below, ends = (tuple(chain(*(getattr(way, part) for way in ways))) for part in ('disjuncts', 'innermost'))
                yield Mode((disjunct, *below), ends or (disjunct,))


def _possible(disjunction, disjunct, remembered):
    if disjunct.active:
        return remembered or not (disjunct.indicator_var.fixed and disjunct.indicator_var.value is False)
    if disjunct.transformation_block is not None:
        raise FesdError(
            disjunct,
            f"another transformation has already treated this disjunct of '{disjunction.name}'",
            "apply fesd.dcs instead of, not after, gdp.bigm or gdp.hull",
        )
    return False


def _agreeing(tree):
    """The modes that have every disjunct on whose indicator is fixed to True."""
    chosen = [d for d in tree.disjuncts() if d.indicator_var.fixed and d.indicator_var.value]
    modes = [mode for mode in tree.modes if all(d in mode for d in chosen)]
    if not modes:
        raise FesdError(
            tree.disjunction,
            "no mode has all those on that are fixed to True: " + ', '.join(f"'{d.name}'" for d in chosen),
            "a switching system is in one mode at a time: fix the indicators of one mode only",
        )
    return modes


def _refuse_inclusive_or(disjunction):
    if not disjunction.xor:
        raise FesdError(
            disjunction,
            "it is declared with xor=False: several modes may be active at once",
            "a switching system is in one mode at a time: leave xor at True",
        )
