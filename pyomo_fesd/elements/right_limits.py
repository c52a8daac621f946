"""Right limits: what depends on states that jump, or on controls and data that differ from stage to stage (events page, eq. E4).

A side that is continuous but for the jumps of states enters an element with its value *after* the boundary on the left:

    lam_{n,0} = lam(after_{n-1})        in place of        lam_{n,0} = lam_{n-1,end}                       (in eq. 11)

States are replaced by their values after the jump.  Algebraic variables that equations tie to them (the parts p and n of a
switching function, a level that follows from a volume) get a copy at the boundary, with copies of these equations; so does the
part s of a kink, whose pair defines it.  Where no jump happens the copies repeat the values on the left.

Takes: the jumps; families of ``cross`` and conditions of modes with memory.
Leaves: the families with ``starts``; ``copy`` (Vars) and ``copied`` (Constraints) on the block of the jumps.
Does not apply: to variables of which the user only says that they are continuous.
"""

from collections import Counter, defaultdict
from dataclasses import replace
from functools import cached_property

from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.core import Block, Constraint, Set, Var
from pyomo.core.expr.visitor import identify_variables, replace_expressions
from pyomo.mpec import Complementarity

from pyomo_fesd.elements.explicit_time import differ
from pyomo_fesd.elements.jumps import values_after
from pyomo_fesd.timeindex import DISCRETISATION, derivatives


class RightLimits:
    """What stands for variables right of the inner boundaries, made when it is asked for.

    Parameters
    ----------
    block : Block
        of the moving grid, with its ``jumps`` if there are any
    jumps : list of Jump
    continuity : Continuity
    given : list of Var
        held on each stage, or said by the user to be continuous
    """

    def __init__(self, block, jumps, grid, times, continuity, given):
        self._model, self._grid, self._times = block.model(), grid, times
        self._home, self._continuous = block.component('jumps'), _Continuous(block.model(), times, continuity, given)
        self._states = {e.n: values_after(self._home, jumps, e) for e in grid.elements[:-1]} if jumps else {}
        self._copies, self._done = {n: ComponentMap() for n in self._states}, ComponentSet()
        if jumps:
            self._home.place = Set(dimen=1)
            self._home.copy = Var(self._home.boundary, self._home.place, dense=False)
            self._home.copied = Constraint(self._home.boundary, self._home.place)

    @cached_property
    def _ties(self):
        return _Ties(self._model, self._times, self._grid, self._continuous)

    def family(self, family):
        """A family with the pairs that elements start from where the sides on their left may differ."""
        if not self._states or not any(family.continuous):
            return family
        found = {}
        for before, element in zip(self._grid.elements, self._grid.elements[1:]):
            pair = family.sides.get(before.right)
            if pair is not None and not (element.opens_stage and any(family.jumps_with_controls)):
                swap = self._swap(before, [v for side in pair for v in _variables(side)])
                if swap:
                    found[element.n] = type(pair)(*(replace_expressions(side, swap) for side in pair))
        return replace(family, starts=found)

    def condition(self, before, element, functions):
        """A function of time right of the boundary between two elements; None where it does not differ from that on the left.

        Parameters
        ----------
        functions : dict label -> expression
        """
        there = functions[before.right]
        after = self._of_next_stage(before, functions[element.points[0]]) if element.opens_stage else there
        # the same but for controls of the next stage, and for numbers that differ from stage to stage
        same = not element.opens_stage or (
            all(self._continuous.across(v) for v in _variables(there)) and not differ([lambda: there, lambda: after])
        )
        after = there if same else after
        swap = self._swap(before, _variables(after)) if self._states else {}
        return None if same and not swap else replace_expressions(after, swap)

    def _of_next_stage(self, before, expr):
        """An expression of the next element at its left boundary: controls keep their new values."""
        moved = [v for v in _variables(expr) if self._times.time(v) is not None and self._continuous.across(v)]
        return replace_expressions(expr, {id(v): self._times.at(v, before.right) for v in moved})

    def _swap(self, before, variables):
        """id of those variables that differ after a jump -> what stands for them."""
        states, copies = self._states[before.n], self._copies[before.n]
        tied, relations = self._ties.closure(before.right, variables)
        if any(v in states for _, mentioned in relations for v in mentioned):
            for v in tied:
                if v not in copies:
                    copies[v] = self._copy(before.n, v)
            self._repeat(before.n, [row for row, _ in relations if row is not None], states, copies)
        return {id(v): known[v] for v in variables for known in (states, copies) if v in known}

    def _copy(self, boundary, v):
        place = len(self._copies[boundary]) + 1
        self._home.place.add(place)
        copy = self._home.copy[boundary, place]
        copy.bounds, copy.value = (v.lower, v.upper), v.value
        return copy

    def _repeat(self, boundary, rows, states, copies):
        """Impose ``rows`` on what stands for their variables after the boundary."""
        swap = {id(v): after for known in (states, copies) for v, after in known.items()}
        for row in rows:
            if row not in self._done:
                self._done.add(row)
                place = sum(1 for b, _ in self._home.copied if b == boundary) + 1
                self._home.place.add(place)
                self._home.copied.add((boundary, place), replace_expressions(row.expr, swap))


class _Continuous:
    """Which variables are continuous in time but for the jumps of states, at any label."""

    def __init__(self, model, times, continuity, given):
        self._times, self.continuity = times, continuity
        self.given = ComponentSet([*(d.get_state_var() for d in derivatives(model, times.wrt)), *given])
        self._names = {
            id(found): {times.split(v)[1] for some in (found.given, found.tied) for v in some if not v.is_indexed()}
            for found in (continuity.inside, continuity.across)
        }

    def inside(self, v):
        """Inside every control stage."""
        return self._in(v, self.continuity.inside)

    def across(self, v):
        """At the boundaries of control stages too."""
        return self._in(v, self.continuity.across)

    def _in(self, v, found):
        return self._times.time(v) is None or v in found or self._times.split(v)[1] in self._names[id(found)]


class _Ties:
    """Which continuous algebraic variables hang together at the labels of inner boundaries."""

    def __init__(self, model, times, grid, continuous):
        self._times, self._continuous = times, continuous
        rules = continuous.continuity.rules
        self._parts = ComponentSet(v for v, rule in rules.items() if rule.ctype is Constraint)
        self._relations = defaultdict(ComponentMap)
        labels = {e.right for e in grid.elements[:-1]}
        for row in model.component_data_objects(Constraint, active=True, descend_into=Block):
            label = times.time(row)
            if label in labels and row.equality and not row.parent_component().local_name.endswith(DISCRETISATION):
                self._add(label, row, _variables(row.body))
        for s, rule in rules.items():
            if rule.ctype is Complementarity:
                for v in (v for v in s.values() if times.time(v) in labels):
                    self._add(times.time(v), None, [u for side in rule[v.index()]._args for u in _variables(side)])

    def _add(self, label, row, mentioned):
        """A relation between continuous variables; rows with others (nu, rates) tell nothing about these."""
        if all(map(self._continuous.inside, mentioned)):
            relation = (row, mentioned)
            for v in mentioned:
                if self._algebraic(v):
                    self._relations[label].setdefault(v, []).append(relation)

    def _algebraic(self, v):
        return self._times.time(v) is not None and v.parent_component() not in self._continuous.given

    def closure(self, label, wanted):
        """The algebraic variables at ``label`` that ``wanted`` depend on, and the relations ``(row, variables)`` between them."""
        found, relations, waiting = ComponentSet(), {}, [v for v in wanted if self._algebraic(v)]
        while waiting:
            v = waiting.pop()
            if v not in found and v in self._relations[label]:
                found.add(v)
                for relation in self._relations[label][v]:
                    relations[id(relation)] = relation
                    waiting += [u for u in relation[1] if self._algebraic(u)]
        relations = self._without_results(list(relations.values()), ComponentSet(wanted))
        left = ComponentSet(v for _, mentioned in relations for v in mentioned)
        return [v for v in found if v in left], relations

    def _without_results(self, relations, wanted):
        """A variable in one relation only is its result: both go, unless it is wanted, or a part that pairs determine too."""
        while True:
            number = Counter(id(v) for _, mentioned in relations for v in ComponentSet(mentioned))
            kept = [
                (row, mentioned)
                for row, mentioned in relations
                if not any(number[id(v)] == 1 and self._is_result(v) and v not in wanted for v in mentioned)
            ]
            if len(kept) == len(relations):
                return kept
            relations = kept

    def _is_result(self, v):
        return self._algebraic(v) and v.parent_component() not in self._parts


def _variables(expr):
    return list(identify_variables(expr, include_fixed=True)) if hasattr(expr, 'is_expression_type') else []
