"""Right limits: where states jump, what depends on them jumps with them (events page, eq. E4).

A side that is continuous but for the jumps of states enters an element with its value *after* the boundary on the left:

    lam_{n,0} = lam(after_{n-1})        in place of        lam_{n,0} = lam_{n-1,end}                       (in eq. 11)

States are replaced by their values after the jump.  Algebraic variables that equations tie to them (the parts p and n of a
switching function, a level that follows from a volume) get a copy at the boundary, with copies of these equations; so does the
part s of a kink, whose pair defines it.  Where no jump happens the copies repeat the values on the left.

Takes: families of ``cross`` and the jumps.
Leaves: the families with ``starts``; ``copy`` (Vars) and ``copied`` (Constraints) on the block of the jumps.
Does not apply: to variables of which the user only says that they are continuous.
"""

from collections import Counter, defaultdict
from dataclasses import replace

from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.core import Block, Constraint, Set, Var
from pyomo.core.expr.visitor import identify_variables, replace_expressions
from pyomo.mpec import Complementarity

from pyomo_fesd.elements.jumps import values_after
from pyomo_fesd.timeindex import DISCRETISATION, derivatives


def start_after_jumps(block, families, jumps, grid, times, continuity, config):
    """The families, with the sides that their elements start from where a state jumps.

    Parameters
    ----------
    continuity : Continuity
    config : ConfigDict
        with ``piecewise_constant`` and ``continuous``: held on each stage, and said by the user to be continuous
    """
    if not jumps:
        return families
    given = [*config.piecewise_constant, *config.continuous]
    limits = _RightLimits(block, jumps, grid, _Ties(block.model(), times, grid, continuity, given))
    return [replace(f, starts=limits.starts(f)) if any(f.continuous) else f for f in families]


class _RightLimits:
    """What stands for variables right of each inner boundary, made when it is asked for."""

    def __init__(self, block, jumps, grid, ties):
        self._home, self._grid = block.jumps, grid
        self._states = {e.n: values_after(block.jumps, jumps, e) for e in grid.elements[:-1]}
        self._copies = {e.n: ComponentMap() for e in grid.elements[:-1]}
        self._done = ComponentSet()
        self._ties = ties
        self._home.place = Set(dimen=1)
        self._home.copy = Var(self._home.boundary, self._home.place, dense=False)
        self._home.copied = Constraint(self._home.boundary, self._home.place)

    def starts(self, family):
        """Element number -> the pair of sides after the boundary on its left; elements where nothing differs are left out."""
        found = {}
        for before, element in zip(self._grid.elements, self._grid.elements[1:]):
            pair = family.sides.get(before.right)
            if pair is not None and not (element.opens_stage and any(family.jumps_with_controls)):
                swap = self._swap(before, [v for side in pair for v in _variables(side)])
                if swap:
                    found[element.n] = type(pair)(*(replace_expressions(side, swap) for side in pair))
        return found

    def _swap(self, before, variables):
        """id of those variables that differ after the boundary -> what stands for them."""
        states, copies = self._states[before.n], self._copies[before.n]
        tied, relations = self._ties.closure(before.right, variables)
        if any(v in states for _, mentioned in relations for v in mentioned):
            for v in tied:
                if v not in copies:
                    copies[v] = self._copy(before.n, v)
            self._repeat(before.n, [row for row, _ in relations if row is not None], states, copies)
        return {id(v): known[v] for v in variables for known in (states, copies) if v in known}

    def _copy(self, boundary, v):
        self._home.place.add(len(self._copies[boundary]) + 1)
        copy = self._home.copy[boundary, len(self._copies[boundary]) + 1]
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


class _Ties:
    """Which continuous algebraic variables hang together at the labels of inner boundaries."""

    def __init__(self, model, times, grid, continuity, given):
        self._times, self._inside = times, continuity.inside
        known = (v for some in (continuity.inside.given, continuity.inside.tied) for v in some)
        self._names = {times.split(v)[1] for v in known if not v.is_indexed()}
        self._given = ComponentSet([*(d.get_state_var() for d in derivatives(model, times.wrt)), *given])
        self._parts = ComponentSet(v for v, rule in continuity.rules.items() if rule.ctype is Constraint)
        self._relations = defaultdict(ComponentMap)
        labels = {e.right for e in grid.elements[:-1]}
        for row in model.component_data_objects(Constraint, active=True, descend_into=Block):
            label = times.time(row)
            if label in labels and row.equality and not row.parent_component().local_name.endswith(DISCRETISATION):
                self._add(label, row, _variables(row.body))
        for s, rule in continuity.rules.items():
            if rule.ctype is Complementarity:
                for v in (v for v in s.values() if times.time(v) in labels):
                    self._add(times.time(v), None, [u for side in rule[v.index()]._args for u in _variables(side)])

    def _add(self, label, row, mentioned):
        """A relation between continuous variables; rows with others (nu, rates) tell nothing about these."""
        if all(map(self._continuous, mentioned)):
            relation = (row, mentioned)
            for v in mentioned:
                if self._algebraic(v):
                    self._relations[label].setdefault(v, []).append(relation)

    def _continuous(self, v):
        if self._times.time(v) is None or v in self._inside:
            return True
        return self._times.split(v)[1] in self._names

    def _algebraic(self, v):
        return self._times.time(v) is not None and v.parent_component() not in self._given

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
