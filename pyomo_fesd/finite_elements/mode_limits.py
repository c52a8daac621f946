"""Right limits of arguments that jump with the modes or with a held control.

In a nonsmooth term of r v a Disjunction sets the ratio r; a threshold x - u has a set-point u that differs from one control stage
to the next.  The value just right of a boundary has no label then: that of the boundary belongs to the modes and controls before.
Without it a switch between the boundary and the first collocation point stays unseen.  An element gets it as copies of the
algebraic variables,

    w_{n,0} = w(states at the left boundary, multipliers and held controls of the element's first collocation point)

by copies of the equations that determine them; parts s = max(0, w - b), p, n, and lam enter eq. (11) with their copies.

Takes: the time complementarities of positive parts neither side of which is continuous, and those that jump at boundaries of
control stages; the grid with state jumps and hysteresis.
Leaves: these with ``starts``, at every element or at those that open a control stage; ``limits`` (a block): ``copy`` (Vars) and
``copied`` (Constraints) by element.
Does not apply: where the equations do not determine the argument; a warning then says that switches may go unnoticed.
"""

from collections.abc import Iterable
from dataclasses import replace

from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.core import Block, Constraint, Set, Var
from pyomo.mpec import Complementarity

from pyomo_fesd.core import MovingGrid, Pair, TimeIndex, all_switched_systems, derivatives, exchanged
from pyomo_fesd.finite_elements.algebraic_graph import rule_of
from pyomo_fesd.finite_elements.continuity import Continuity
from pyomo_fesd.finite_elements.relations import Relations, variables_in, variables_in_sides
from pyomo_fesd.finite_elements.time_complementarities import TimeComplementarity


def with_mode_limits(
    moving: MovingGrid, conditions: list[TimeComplementarity], continuity: Continuity, given: Iterable
) -> list[TimeComplementarity]:
    """Return the conditions, with right limits where arguments jump with the modes.

    Parameters
    ----------
    given : iterable of Var
        controls that are held on each control stage
    """
    elements = moving.grid.elements
    opening = [e for e in elements[1:] if e.inputs_change]
    within = {id(c): elements if _jumps_with_modes(c, continuity) else opening * any(c.jumps_with_controls) for c in conditions}
    if not any(within.values()):
        return conditions
    limits = _ModeLimits(moving, conditions, continuity, given)
    return [limits.of(c, within[id(c)]) if within[id(c)] else c for c in conditions]


def _jumps_with_modes(condition, continuity):
    """Whether a condition defines a positive part whose argument is not known to be continuous."""
    if any(condition.continuous) or condition.follows:
        return False
    s = next(iter(condition.sides.values()))[0]
    rule = rule_of(s, continuity.rules) if s.is_variable_type() else None
    return rule is not None and rule.ctype is Complementarity


class _ModeLimits:
    def __init__(self, moving, conditions, continuity, given):
        self._moving, self._times, self._rules = moving, TimeIndex(moving.wrt), continuity.rules
        model = moving.block.model()
        self._continuity, self._given = continuity, ComponentSet(given)
        self._states = ComponentSet(d.get_state_var() for d in derivatives(model, moving.wrt))
        self._names = self._names_of(continuity.across)
        self._selectors = self._read_selectors(model, conditions)
        self._ruled = ComponentSet(rule for rule in self._rules.values() if rule.ctype is Constraint)
        labels = {e.points[0] for e in moving.grid.elements}
        self._relations = Relations(model, self._times, labels, self._rules, self._is_algebraic)
        self._copies = {e.n: ComponentMap() for e in moving.grid.elements}
        moving.limits = moving.block.limits = block = Block()
        block.place = Set(dimen=1)
        block.copy = Var(moving.block.element, block.place, dense=False)
        block.copied = Constraint(moving.block.element, block.place)

    def of(self, condition, elements):
        """The condition with its starts at some elements; as it is where the equations do not determine them."""
        found = dict(condition.starts)
        for element in elements:
            if condition.points(element):
                swap = self._swap(element, condition.sides.get(element.points[0]))
                if swap is None:
                    return condition
                pair = condition.sides[element.points[0]]
                found[element.n] = Pair(*(exchanged(side, swap) for side in pair))
        continuous = condition.continuous if any(condition.continuous) else (True, True)
        return replace(condition, starts=found, continuous=continuous, jumps_with_controls=(False, False), has_right_limits=True)

    def _swap(self, element, pair):
        """id of each variable of a pair at the first point -> its value at the left boundary; None if that is not determined."""
        label = element.points[0]
        wanted = [] if pair is None else [v for v in variables_in_sides(pair) if self._is_algebraic(v, label)]
        tied, relations = self._relations.closure(label, wanted)
        copied, equations = ComponentSet([*tied, *wanted]), [r.equation for r in relations if r.equation is not None]
        if pair is None or not self._determine(equations, copied):
            return None
        new = self._copy(element, copied)
        relevant = ComponentSet([*copied, *variables_in_sides(e.expr for e in equations), *variables_in_sides(pair)])
        swap = {id(v): self._at_left(element, v) for v in relevant}
        self._copy_equations(element, [e for e in equations if any(v in new for v in variables_in(e.expr))], swap)
        return swap

    def _determine(self, equations, variables):
        """Whether the equations are as many as the variables; parts p and n, lam and mu come with the equations of their rule."""
        own = sum(1 for e in equations if e.parent_component() not in self._ruled)
        return own == sum(1 for v in variables if rule_of(v, self._rules) is None)

    def _copy(self, element, variables):
        """Add copies of those variables that have none in this element; returns these."""
        copies, component = self._copies[element.n], self._moving.limits.copy
        new = ComponentSet(v for v in variables if v not in copies)
        for v in new:
            copies[v] = copy = component[element.n, self._place(element, component)]
            copy.bounds, copy.value = (v.lower, v.upper), v.value
        return new

    def _copy_equations(self, element, equations, swap):
        component = self._moving.limits.copied
        for equation in equations:
            component.add((element.n, self._place(element, component)), exchanged(equation.expr, swap))

    def _at_left(self, element, v):
        """The value of a variable right of the left boundary."""
        copy = self._copies[element.n].get(v)
        if copy is not None:
            return copy
        if not self._moves(v, element.points[0]):
            return v
        left = self._times.at(v, element.left)
        before = self._moving.grid.elements[element.n - 2] if element.n > 1 else None
        jumps = self._moving.state_jumps
        return left if jumps is None or before is None else jumps.values_after(before).get(left, left)

    def _moves(self, v, label):
        """Whether a variable at the first point has a value of its own, the same one, at the left boundary."""
        return self._times.time(v) == label and not self._is_constant(v) and self._is_continuous(v)

    def _is_constant(self, v):
        """Multipliers, held controls and data have one value in an element, or none at the boundary."""
        return v.fixed or v in self._selectors or v.parent_component() in self._given

    def _is_continuous(self, v):
        if self._moving.state_jumps is not None:
            return v.parent_component() in self._states
        across = self._continuity.across
        return v in across or self._times.split(v)[1] in self._names

    def _names_of(self, known):
        return {self._times.split(v)[1] for some in (known.given, known.tied) for v in some if not v.is_indexed()}

    def _read_selectors(self, model, conditions):
        """The multipliers of switched systems, at all labels."""
        found = ComponentSet()
        for v in all_switched_systems(model).selectors:
            found.update(v.values() if v.is_indexed() else [v])
        for condition in conditions:
            if condition.continuous == (False, True):
                found.update(v for pair in condition.sides.values() for v in variables_in(pair[0]))
        return found

    def _is_algebraic(self, v, label):
        return self._times.time(v) == label and not self._is_constant(v) and not self._is_continuous(v)

    def _place(self, element, component):
        place = sum(1 for n, _ in component if n == element.n) + 1
        self._moving.limits.place.add(place)
        return place
