"""State jumps at element boundaries: x(t+) = J(x(t-)) where a guard falls to zero (events page, eq. E3).

At every inner boundary b, with the guard g and the states x_j that it resets:

    0 <= e_b  perp  g(x_b) >= 0,     0 <= e_b  perp  1 - e_b >= 0            (a jump, e = 1, only where g = 0)
    after_{b,j} = x_{b,j} + sum over jumps of e_b (J_j(x_b) - x_{b,j})

The element right of the boundary starts from ``after`` in place of x; the guard never becomes negative, so a trajectory that
arrives at g = 0 and would go on jumps there.

Takes: the marks GUARD and RESET (``pyomo_fesd.state_jump``).
Leaves: ``jumps`` (a block): ``e``, ``after`` (Expressions), ``guarded``, the pairs ``happens`` and ``binary``; discretisation
equations that start from ``after``.
Does not apply: at the first and the last time.
"""

from dataclasses import dataclass

from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.core import Block, Constraint, ConstraintList, Expression, Set, Var, quicksum
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
    """The laws of reset over ``wrt``, from the marks, also after they are used up.

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
        if label is None:
            continue
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


def check_guards(jumps, controls):
    """Refuse guards that contain a held control: they would jump at the boundary of a stage, where no state does."""
    for jump in jumps:
        for guard in jump.guards.values():
            control = next((v for v in identify_variables(guard) if any(v.parent_component() is u for u in controls)), None)
            if control is not None:
                raise FesdError(
                    jump.name,
                    f"its guard contains the control '{control.name}', which is held on each stage and jumps between them",
                    "let the guard depend on states only",
                )


def add_jumps(block, jumps, grid, wrt):
    """Put the jumps at the inner boundaries of ``grid`` on ``block``, and let elements start after them."""
    if not jumps:
        return
    marks.use_up(block.model(), marks.GUARD, wrt)
    block.jumps = home = Block()
    home.law = Set(initialize=[j.name for j in jumps], ordered=True)
    home.boundary = Set(initialize=range(1, len(grid.elements)), ordered=True)
    home.e = Var(home.law, home.boundary, bounds=(0, 1), initialize=0)
    home.happens = Complementarity(home.law, home.boundary)
    home.binary = Complementarity(home.law, home.boundary)
    home.guarded = ConstraintList()
    inner = [(e.n, e.right) for e in grid.elements[:-1]]
    for jump in jumps:
        for b, label in inner:
            e = home.e[jump.name, b]
            home.happens.add((jump.name, b), complements(e >= 0, jump.guards[label] >= 0))
            home.binary.add((jump.name, b), complements(e >= 0, 1 - e >= 0))
        # the pairs keep the guard's sign at the inner boundaries
        for label in jump.guards.keys() - {label for _, label in inner}:
            home.guarded.add(jump.guards[label] >= 0)
    _start_after(home, jumps, grid, wrt)


def _start_after(home, jumps, grid, wrt):
    """Elements start from the values after the boundary on their left."""
    times, owner, starts = TimeIndex(wrt), grid.element_of(), {}
    home.number = Set(dimen=1)
    home.after = Expression(home.boundary, home.number, rule=lambda *_: Expression.Skip)
    for element in grid.elements[:-1]:
        states = jumping_states(jumps, element.right)
        for j, (x, laws) in enumerate(states.items(), start=1):
            home.number.add(j)
            home.after[element.n, j] = x + quicksum(home.e[name, element.n] * (J - x) for name, J in laws)
        starts[element.n + 1] = {id(x): after for x, after in values_after(home, jumps, element).items()}
    for equation in home.model().component_data_objects(Constraint, active=True, descend_into=Block):
        if equation.parent_component().local_name.endswith(DISCRETISATION):
            label = times.time(equation)
            start = starts.get(owner[label].n) if label in owner else None
            if start is not None:
                equation.set_value(replace_expressions(equation.expr, start))


def jumping_states(jumps, label):
    """ComponentMap from the states that jump at ``label`` to ``[(law, value after)]``; the order is that of ``after``."""
    found = ComponentMap()
    for jump in jumps:
        for x, J in jump.resets.get(label, ()):
            found.setdefault(x, []).append((jump.name, J))
    return found


def values_after(home, jumps, before):
    """ComponentMap from the states that jump at the right boundary of element ``before`` to what stands for them after it."""
    states = jumping_states(jumps, before.right)
    return ComponentMap((x, home.after[before.n, j]) for j, x in enumerate(states, start=1))


def unchanged(block, before):
    """Factors of eta (eq. 12) at the boundary after element ``before``: 0 where a state jumps."""
    home = block.component('jumps')
    return [] if home is None else [1 - home.e[law, before.n] for law in home.law]
