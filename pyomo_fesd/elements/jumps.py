"""State jumps at element boundaries: x(t+) = J(x(t-)) where a guard falls to zero.

At every inner boundary b, with the guard g and the states x_j that it resets:

    0 <= e_b  perp  g(x_b) >= 0,     0 <= e_b  perp  1 - e_b >= 0            (a jump, e = 1, only where g = 0)
    after_{b,j} = x_{b,j} + sum over jumps of e_b (J_j(x_b) - x_{b,j})

The element right of the boundary starts from ``after`` in place of x; the guard never becomes negative, so a trajectory that
arrives at g = 0 and would go on jumps there.

Takes: the marks GUARD and RESET (``pyomo_fesd.state_jump``).
Leaves: ``jumps`` (a block): ``e``, ``after``, ``reset``, ``guarded``, the pairs ``happens`` and ``binary``; discretisation
equations that start from ``after``.
Does not apply: at the first and the last time.
"""

from dataclasses import dataclass, replace

from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.core import Block, Constraint, ConstraintList, Set, Var, quicksum
from pyomo.core.expr.visitor import identify_variables, replace_expressions
from pyomo.mpec import Complementarity, complements

from pyomo_fesd import marks
from pyomo_fesd.errors import FesdError
from pyomo_fesd.timeindex import DISCRETISATION, TimeIndex, derivatives, strip_time


@dataclass(frozen=True)
class Jump:
    """One law of reset over time.

    Attributes
    ----------
    name : str
    guards : dict label -> expression
    resets : dict label -> list of (VarData, expression)
        states with their values after the jump
    """

    name: str
    guards: dict
    resets: dict


def read_jumps(model, wrt):
    """The laws of reset of a model, from the marks, also after they are used up.

    Raises
    ------
    FesdError
        if something is reset that is no differential state with respect to ``wrt``
    """
    times, found = TimeIndex(wrt), {}
    states = ComponentSet(d.get_state_var() for d in derivatives(model, wrt))
    for guard, _ in marks.marked(model, marks.GUARD, used=True):
        home = guard.parent_block()
        label, name = times.split(home)
        resets = [(x, after.expr) for x, after in marks.marked(home, marks.RESET)]
        for x, _ in resets:
            if x.parent_component() not in states or times.time(x) != label:
                raise FesdError(
                    home,
                    f"'{x.name}' is reset, but it is no differential state at this time",
                    "reset variables that have a DerivativeVar; algebraic variables follow from their equations",
                )
        jump = found.setdefault(strip_time(name), Jump(strip_time(name), {}, {}))
        jump.guards[label], jump.resets[label] = guard.expr, resets
    return list(found.values())


def add_jumps(block, jumps, grid, wrt):
    """Put the jumps at the inner boundaries of ``grid`` on ``block``, and let elements start after them."""
    if not jumps:
        return
    marks.use_up(block.model(), marks.GUARD)
    block.jumps = home = Block()
    home.law = Set(initialize=[j.name for j in jumps], ordered=True)
    home.boundary = Set(initialize=range(1, len(grid.elements)), ordered=True)
    home.e = Var(home.law, home.boundary, bounds=(0, 1), initialize=0)
    home.happens = Complementarity(home.law, home.boundary)
    home.binary = Complementarity(home.law, home.boundary)
    home.guarded = ConstraintList()
    for jump in jumps:
        for element in grid.elements[:-1]:
            e = home.e[jump.name, element.n]
            home.happens.add((jump.name, element.n), complements(e >= 0, jump.guards[element.right] >= 0))
            home.binary.add((jump.name, element.n), complements(e >= 0, 1 - e >= 0))
        # the pairs keep the guard's sign at the inner boundaries
        paired = {element.right for element in grid.elements[:-1]}
        for label in jump.guards.keys() - paired:
            home.guarded.add(jump.guards[label] >= 0)
    _add_values_after(home, jumps, grid, wrt)


def _add_values_after(home, jumps, grid, wrt):
    """One value after the boundary for each state that jumps there, whatever the number of laws."""
    times = TimeIndex(wrt)
    home.number = Set(dimen=1)
    home.after = Var(home.boundary, home.number, dense=False)
    home.reset = Constraint(home.boundary, home.number)
    starts = {}
    for element in grid.elements[:-1]:
        for j, (x, laws) in enumerate(jumping_states(jumps, element.right).items(), start=1):
            home.number.add(j)
            after = home.after[element.n, j]
            after.value = x.value
            home.reset.add((element.n, j), after == x + quicksum(home.e[name, element.n] * (J - x) for name, J in laws))
            starts.setdefault(element.n + 1, {})[id(x)] = after
    owner = grid.element_of()
    for equation in home.model().component_data_objects(Constraint, active=True, descend_into=Block):
        if equation.parent_component().local_name.endswith(DISCRETISATION):
            label = times.time(equation)
            start = starts.get(owner[label].n) if label in owner else None
            if start is not None:
                equation.set_value(replace_expressions(equation.expr, start))


def start_after_jumps(block, families, jumps, grid, wrt):
    """Families whose continuous side depends on a state that jumps enter an element with the value after the jump.

    A side that is an expression of states is taken at ``after``.  What a Constraint ties to the states (lam, mu, p, n) gets a
    copy of variable and Constraint for the right limit of each inner boundary: ``copy`` and ``copied``.
    """
    if not jumps:
        return families
    copies = _Copies(block, jumps, grid, wrt)
    return [replace(f, starts=copies.starts(f)) if any(f.continuous) else f for f in families]


class _Copies:
    """Right limits at the inner boundaries of everything that depends on states that jump."""

    def __init__(self, block, jumps, grid, wrt):
        self._home, self._jumps, self._grid, self._times = block.jumps, jumps, grid, TimeIndex(wrt)
        self._rules = ComponentMap(marks.marked(block.model(), marks.CONTINUOUS))
        self._rows, self._known, self._made = {}, {}, ComponentSet()
        self._home.place = Set(dimen=1)
        self._home.copy = Var(self._home.boundary, self._home.place, dense=False)
        self._home.copied = Constraint(self._home.boundary, self._home.place)

    def starts(self, family):
        """Element number -> the pair of sides after the boundary on its left; elements where nothing differs are left out."""
        found = {}
        for before in self._grid.elements[:-1]:
            if before.right in family.sides:
                swap = self._swap(before, family.sides[before.right])
                if swap:
                    pair = family.sides[before.right]
                    found[before.n + 1] = type(pair)(*(replace_expressions(side, swap) for side in pair))
        return found

    def _swap(self, before, pair):
        """id of a variable at the boundary -> what stands for it after the jump."""
        states = jumping_states(self._jumps, before.right)
        after = {id(x): self._home.after[before.n, j] for j, x in enumerate(states, start=1)}
        variables = [v for side in pair for v in _variables(side)]
        rows = [row for v in variables for row in self._rows_of(v, before.right)]
        swap = {id(v): after[id(v)] for v in variables if id(v) in after}
        if any(id(v) in after for row in rows for v in _variables(row.body)):
            swap |= self._copy(before, ComponentSet(rows), after)
        return swap

    def _rows_of(self, v, label):
        """The Constraints at ``label`` that tie a marked variable to the states."""
        rule = self._rules.get(v.parent_component())
        if rule is None or rule.ctype is not Constraint:
            return []
        if rule not in self._rows:
            self._rows[rule] = self._times.families(rule.values())
        at_label = [family[label] for family in self._rows[rule].values() if label in family]
        return [row for row in at_label if any(u is v for u in _variables(row.body))]

    def _copy(self, before, rows, after):
        """Copies of the marked variables of ``rows``, and the rows for them."""
        home, known = self._home, self._known.setdefault(before.n, {})
        for row in rows:
            for v in _variables(row.body):
                if id(v) not in after and id(v) not in known and v.parent_component() in self._rules:
                    known[id(v)] = home.copy[before.n, self._place('copy', before.n)]
                    known[id(v)].bounds, known[id(v)].value = (v.lower, v.upper), v.value
        for row in (r for r in rows if r not in self._made):
            self._made.add(row)
            body = replace_expressions(row.body, after | known)
            home.copied.add((before.n, self._place('copied', before.n)), body == row.upper)
        return known

    def _place(self, name, boundary):
        """The next free place of an indexed component at a boundary."""
        component = self._home.component(name)
        place = 1 + sum(1 for b, _ in component if b == boundary)
        self._home.place.add(place)
        return place


def _variables(expr):
    return list(identify_variables(expr, include_fixed=True)) if hasattr(expr, 'is_expression_type') else []


def jumping_states(jumps, label):
    """ComponentMap from the states that jump at ``label`` to ``[(law, value after)]``; the order is that of ``after``."""
    found = ComponentMap()
    for jump in jumps:
        for x, J in jump.resets.get(label, ()):
            found.setdefault(x, []).append((jump.name, J))
    return found


def unchanged(block, before):
    """Factors of eta (eq. 12) at the boundary after element ``before``: 0 where a state jumps."""
    home = block.component('jumps')
    return [] if home is None else [1 - home.e[law, before.n] for law in home.law]
