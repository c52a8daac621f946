"""Right limits: values right of a boundary where states jump, or controls and data of control stages differ (events page, eq. E4).

A side that is continuous but for the jumps of states enters an element with its value *after* the boundary on the left:

    lam_{n,0} = lam(after_{n-1})        in place of        lam_{n,0} = lam_{n-1,end}                       (in eq. 11)

States are replaced by their values after the jump.  Algebraic variables that equations tie to them (the parts p and n of a
switching function, a level that follows from a volume) get a copy at the boundary, with copies of these equations; so does the
positive part s of a nonsmooth term, whose pair defines it.  Where no jump happens the copies repeat the values on the left.

Takes: the state jumps; time complementarities and conditions of modes with hysteresis.
Leaves: the time complementarities with ``starts``; ``copy`` (Vars) and ``copied`` (Constraints) on the block of the jumps.
Does not apply: to variables that are continuous only by the user's word.
"""

from collections.abc import Iterable
from dataclasses import replace
from functools import cached_property, partial

from pyomo.common.collections import ComponentMap, ComponentSet

from pyomo_fesd.core import (
    Dependents,
    Element,
    MovingGrid,
    Pair,
    TimeIndex,
    all_switched_systems,
    derivatives,
    exchanged,
    switched_systems,
)
from pyomo_fesd.finite_elements.continuity import Continuity
from pyomo_fesd.finite_elements.explicit_time import differ
from pyomo_fesd.finite_elements.relations import Relations, variables_in, variables_in_sides
from pyomo_fesd.finite_elements.time_complementarities import TimeComplementarity


class RightLimits:
    """The expressions that replace variables right of the inner boundaries, made on the first request.

    Parameters
    ----------
    moving : MovingGrid
        with its ``state_jumps`` if there are any
    continuity : Continuity
    given : iterable of Var
        held on each control stage, or continuous by the user's word
    """

    def __init__(self, moving: MovingGrid, continuity: Continuity, given: Iterable):
        self._moving, self._times, self._jumps = moving, TimeIndex(moving.wrt), moving.state_jumps
        self._continuous = _Continuous(moving.block.model(), self._times, continuity, given)
        inner = moving.grid.elements[:-1] if self._jumps is not None else ()
        self._states = {e.n: self._jumps.values_after(e) for e in inner}
        self._copies, self._done = {n: ComponentMap() for n in self._states}, ComponentSet()
        self._copied_dependents = set()

    @cached_property
    def _relations(self):
        labels = {e.right for e in self._moving.grid.elements[:-1]}
        known, rules = self._continuous, self._continuous.continuity.rules
        return Relations(self._moving.block.model(), self._times, labels, rules, known.is_algebraic, known.inside)

    def with_starts(self, condition: TimeComplementarity) -> TimeComplementarity:
        """Return a time complementarity with the pairs that elements start from where the sides on their left may differ."""
        if not self._states or not any(condition.continuous):
            return condition
        found = {}
        for before, element in zip(self._moving.grid.elements, self._moving.grid.elements[1:]):
            pair = condition.sides.get(before.right)
            if pair is not None and not (element.inputs_change and any(condition.jumps_with_controls)):
                swap = self._swap(before, variables_in_sides(pair))
                found |= {element.n: Pair(*(exchanged(side, swap) for side in pair))} if swap else {}
        return replace(condition, starts=found)

    def condition(self, before: Element, element: Element, functions: dict):
        """Return a function of time right of the boundary between two elements; None where it equals the one on the left.

        Parameters
        ----------
        functions : dict label -> expression
        """
        left = functions[before.right]
        right = self._of_next_stage(before, functions[element.points[0]]) if element.inputs_change else left
        same = not element.inputs_change or self._same(left, right)
        right = left if same else right
        swap = self._swap(before, variables_in(right)) if self._states else {}
        return None if same and not swap else exchanged(right, swap)

    def _same(self, left, right):
        """Whether two expressions contain no controls of a control stage, and have the same numbers."""
        return all(self._continuous.across(v) for v in variables_in(left)) and not differ([(left,), (right,)])

    def _of_next_stage(self, before, expr):
        """An expression of the next element at its left boundary: controls keep their new values."""
        continuous = [v for v in variables_in(expr) if self._times.time(v) is not None and self._continuous.across(v)]
        return exchanged(expr, {id(v): self._times.at(v, before.right) for v in continuous})

    def _swap(self, before, variables):
        """id of those variables that differ after a jump -> the expression after the jump."""
        states, copies = self._states[before.n], self._copies[before.n]
        tied, relations = self._relations.closure(before.right, variables)
        if any(v in states for relation in relations for v in relation.variables):
            for v in (v for v in tied if v not in copies):
                copies[v] = self._copy(before.n, v)
            self._copy_equations(before.n, [r.equation for r in relations if r.equation is not None])
            self._copy_dependents(before.n)
        return {id(v): known[v] for v in variables for known in (states, copies) if v in known}

    def _copy(self, boundary, v):
        copy = self._jumps.copy[boundary, self._place(len(self._copies[boundary]) + 1)]
        copy.bounds, copy.value = (v.lower, v.upper), v.value
        return copy

    def _copy_equations(self, boundary, equations):
        """Impose ``equations`` on the states after the boundary and the copies."""
        swap = self._swaps(boundary)
        for equation in equations:
            if equation not in self._done:
                self._done.add(equation)
                place = self._place(sum(1 for b, _ in self._jumps.copied if b == boundary) + 1)
                self._jumps.copied.add((boundary, place), exchanged(equation.expr, swap))

    def _copy_dependents(self, boundary):
        """Record how the copies follow from the states after the boundary."""
        copies, swap = self._copies[boundary], self._swaps(boundary)
        found = {id(one): one for v in copies for one in self._dependents.get(v, ())}
        for key, one in found.items():
            if (boundary, key) not in self._copied_dependents:
                self._copied_dependents.add((boundary, key))
                among = [k for k, v in enumerate(one.variables) if v in copies]
                arguments = tuple(exchanged(a, swap) if hasattr(a, 'is_expression_type') else a for a in one.arguments)
                variables = tuple(copies[one.variables[k]] for k in among)
                record = Dependents(variables, arguments, partial(_some, one.values, among))
                switched_systems(self._jumps.block).dependents.append(record)

    @cached_property
    def _dependents(self):
        """The records by the variables that they determine."""
        found = ComponentMap()
        for one in all_switched_systems(self._moving.block.model()).dependents:
            for v in one.variables:
                found.setdefault(v, []).append(one)
        return found

    def _swaps(self, boundary):
        return {id(v): after for known in (self._states, self._copies) for v, after in known[boundary].items()}

    def _place(self, number):
        self._jumps.block.place.add(number)
        return number


def _some(values, among, arguments):
    """Some of the values of a ``Dependents``."""
    found = values(arguments)
    return [found[k] for k in among]


class _Continuous:
    """The variables that are continuous in time but for the jumps of states, at any label."""

    def __init__(self, model, times, continuity, given):
        self._times, self.continuity = times, continuity
        self.given = ComponentSet([*(d.get_state_var() for d in derivatives(model, times.wrt)), *given])
        self._names = {id(known): self._names_of(known) for known in (continuity.inside, continuity.across)}

    def _names_of(self, known):
        return {self._times.split(v)[1] for some in (known.given, known.tied) for v in some if not v.is_indexed()}

    def inside(self, v):
        """Inside every control stage."""
        return self._in(v, self.continuity.inside)

    def across(self, v):
        """At the boundaries of control stages too."""
        return self._in(v, self.continuity.across)

    def is_algebraic(self, v, label):
        """Whether it varies with time and is no state."""
        return self._times.time(v) is not None and v.parent_component() not in self.given

    def _in(self, v, known):
        return self._times.time(v) is None or v in known or self._times.split(v)[1] in self._names[id(known)]
