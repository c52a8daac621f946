"""Flatten nested Disjunctions: every path from the outermost Disjunction down to an innermost disjunct is one mode.

    region of a mode    = the regions of all disjuncts on its path            (theory, section 1)
    equations of a mode = the equations of all disjuncts on its path
    nu of a disjunct    = sum of nu over the modes that it is part of

A disjunct that contains several Disjunctions has a mode for each combination of theirs.  A Disjunction belongs to an outer
disjunct if it is declared there, as in pyomo.gdp, or if its own disjuncts are.

Takes: the active Disjunctions over time, with deactivated disjuncts and fixed indicators.
Leaves: a ``DisjunctionTree`` for each outermost Disjunction; nothing on the model.
Does not apply: to Disjunctions of different times inside one another.
"""

from dataclasses import dataclass, replace
from itertools import chain, product
from typing import Any

from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.core import Block, Constraint
from pyomo.gdp import Disjunct, Disjunction

from pyomo_fesd.core import FesdError, data_of, declared, own_data

CONSTRAINTS = {Constraint}


@dataclass(frozen=True, eq=False)
class Mode:
    """One mode of a system.

    Attributes
    ----------
    disjuncts : tuple of DisjunctData
        those on the path to it, outermost first
    innermost : tuple of DisjunctData
        at the end of the path; several where a disjunct contains several Disjunctions
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
        """Return the active constraints: the region and the equations of the mode."""
        return chain(*map(active_constraints, self.disjuncts))


@dataclass(frozen=True, eq=False)
class DisjunctionTree:
    """An outermost Disjunction at one time with everything inside.

    Attributes
    ----------
    disjunction : DisjunctionData
    nested : list of DisjunctionData
        the Disjunctions below it
    modes : list of Mode
        those that can be active
    """

    disjunction: Any
    nested: list
    modes: list

    def disjuncts(self):
        """Return all disjuncts, also deactivated ones."""
        return chain(*(d.disjuncts for d in (self.disjunction, *self.nested)))


def active_constraints(disjunct) -> list:
    """Return the active constraints of a disjunct and of the Blocks in it."""
    if Block in disjunct._ctypes:
        return list(disjunct.component_data_objects(Constraint, active=True, descend_into=Block))
    # most disjuncts hold a few Constraints, and there is one at every time: Pyomo's walk takes longer than all the rest
    found = []
    for component in declared(disjunct, CONSTRAINTS):
        if component.is_indexed():
            found += [data for data in data_of(component) if data.active] if component.active else ()
        elif component.active and len(component):
            found.append(component)
    return found


def enclosing_disjunct(component):
    """Return the innermost disjunct around a component, or None."""
    block = component.parent_block()
    while block is not None and block.ctype is not Disjunct:
        block = block.parent_block()
    return block


class Nesting:
    """The Disjunctions of a model by the disjunct that they lie in.

    Parameters
    ----------
    model : BlockData
    times : TimeIndex
    with_hysteresis : ComponentSet of DisjunctionData
        there a fixed indicator is the mode at the first time, and the others stay possible
    """

    def __init__(self, model, times, with_hysteresis=()):
        self._times, self._with_hysteresis = times, with_hysteresis
        self._inside, self._hosts, self._around = ComponentMap(), ComponentMap(), {}
        found = own_data(model, Disjunction, (Block, Disjunct), active=True)
        for disjunction in (d for d in found if d.active):
            host = self._hosts[disjunction] = self._host(disjunction)
            if host is not None:
                self._inside.setdefault(host, []).append(disjunction)

    def _host(self, disjunction):
        """The disjunct over time in which a Disjunction over time or its disjuncts are declared, or None."""
        if self._times.time(disjunction) is None:
            return None
        host = self._enclosing(disjunction)
        if host is not None:
            return host
        hosts = {id(host): host for host in map(self._enclosing, disjunction.disjuncts)}
        if len(hosts) > 1:
            raise FesdError(
                disjunction,
                "its disjuncts lie in different disjuncts, or only some of them in one",
                "declare all disjuncts of a nested Disjunction in the disjunct that it belongs to",
            )
        return next(iter(hosts.values()), None)

    def _enclosing(self, component):
        """The innermost disjunct over time around a component, or None."""
        # the data of one component lie in the same block
        owner = component.parent_component()
        if id(owner) not in self._around:
            self._around[id(owner)] = enclosing_disjunct(owner)
        disjunct = self._around[id(owner)]
        return disjunct if disjunct is not None and self._times.time(disjunct) is not None else None

    def outermost(self, disjunctions, targets):
        """Return the ``disjunctions`` over time that are not nested; a Disjunction among the targets must not be nested."""
        named = [t for t in targets if t.ctype is Disjunction]
        named = ComponentSet(chain(*(t.values() if hasattr(t, 'values') else [t] for t in named)))
        found = []
        for disjunction in disjunctions:
            host = self._hosts[disjunction] if disjunction in self._hosts else self._host(disjunction)
            if host is None and self._times.time(disjunction) is not None:
                found.append(disjunction)
            elif host is not None and disjunction in named:
                raise FesdError(
                    disjunction,
                    f"fesd.dcs: this Disjunction is nested in '{host.name}'",
                    "give the outermost Disjunction as target; it includes the nested ones",
                )
        return found

    def tree(self, disjunction) -> DisjunctionTree:
        """Return the tree of an outermost Disjunction."""
        nested = list(self._below(disjunction))
        _refuse_inclusive_or(disjunction)
        for d in nested:
            _refuse_inclusive_or(d)
            if self._times.time(d) != self._times.time(disjunction):
                raise FesdError(d, f"it is nested in '{disjunction.name}', which is of another time", "nest modes of one time")
        with_hysteresis = disjunction in self._with_hysteresis
        tree = DisjunctionTree(disjunction, nested, list(self._modes(disjunction, with_hysteresis)))
        chosen = [] if with_hysteresis else [d for d in tree.disjuncts() if d.indicator_var.fixed and d.indicator_var.value]
        return replace(tree, modes=_modes_fixed_to_true(tree, chosen)) if chosen else tree

    def _below(self, disjunction):
        for disjunct in disjunction.disjuncts:
            for inner in self._inside.get(disjunct, ()):
                yield inner
                yield from self._below(inner)

    def _modes(self, disjunction, with_hysteresis):
        possible = [d for d in disjunction.disjuncts if _is_possible(disjunction, d, with_hysteresis)]
        if not possible:
            raise FesdError(disjunction, "all its disjuncts are switched off", "activate one, or deactivate the Disjunction")
        for disjunct in possible:
            if disjunct not in self._inside:
                # most have none; there is one at every time, and the product takes longer than all the rest
                yield Mode((disjunct,), (disjunct,))
                continue
            for paths in product(*(self._modes(inner, with_hysteresis) for inner in self._inside[disjunct])):
                below = chain(*(path.disjuncts for path in paths))
                yield Mode((disjunct, *below), tuple(chain(*(path.innermost for path in paths))))


def _is_possible(disjunction, disjunct, with_hysteresis):
    if disjunct.active:
        return with_hysteresis or not (disjunct.indicator_var.fixed and disjunct.indicator_var.value is False)
    if disjunct.transformation_block is not None:
        raise FesdError(
            disjunct,
            f"another transformation has already treated this disjunct of '{disjunction.name}'",
            "apply fesd.dcs instead of, not after, gdp.bigm or gdp.hull",
        )
    return False


def _modes_fixed_to_true(tree, chosen):
    """The modes that contain every ``chosen`` disjunct, whose indicator is fixed to True."""
    modes = [mode for mode in tree.modes if all(d in mode for d in chosen)]
    if not modes:
        raise FesdError(
            tree.disjunction,
            "the disjuncts fixed to True belong to no common mode: " + ', '.join(f"'{d.name}'" for d in chosen),
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
