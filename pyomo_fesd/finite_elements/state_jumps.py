"""State jumps at element boundaries: x(t+) = J(x(t-)) where a guard falls to zero (events page, eq. E3).

At every inner boundary b, with the guard g and the states x_j that it resets:

    0 <= e_b  perp  g(x_b) >= 0,     0 <= e_b  perp  1 - e_b >= 0            (a jump, e = 1, only where g = 0)
    after_{b,j} = x_{b,j} + sum over jumps of e_b (J_j(x_b) - x_{b,j})

The element right of the boundary starts from ``after`` in place of x; the guard never becomes negative, so a trajectory that
arrives at g = 0 and would continue below it jumps there.

Takes: the resets of ``SwitchedSystems`` (``pyomo_fesd.state_jump``).
Leaves: ``jumps`` (a block): ``e``, ``after`` (Expressions), ``guarded``, the pairs ``happens`` and ``binary``, and empty ``copy``
and ``copied`` for the right limits; discretisation equations that start from ``after``.
Does not apply: at the first and the last time.
"""

from dataclasses import dataclass

from pyomo.common.collections import ComponentSet
from pyomo.core import Block, Constraint, ConstraintList, Expression, Set, Var, quicksum
from pyomo.core.expr.visitor import identify_variables, replace_expressions
from pyomo.dae import ContinuousSet
from pyomo.mpec import Complementarity, complements

from pyomo_fesd.core import (
    FesdError,
    MovingGrid,
    StateJumps,
    TimeIndex,
    all_switched_systems,
    derivatives,
    is_discretisation_equation,
    strip_time,
)
from pyomo_fesd.finite_elements.contacts import ContactLaw, declare_impacts
from pyomo_fesd.finite_elements.curved_contacts import stabilise
from pyomo_fesd.finite_elements.impact_laws import write_impacts


@dataclass(frozen=True)
class JumpLaw:
    """One law of state jumps over time.

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


def read_jumps(model: Block, wrt: ContinuousSet) -> list[JumpLaw]:
    """Return the laws of state jumps over ``wrt``.

    Raises
    ------
    FesdError
        if a reset variable is not a differential state with respect to ``wrt``
    """
    times, found = TimeIndex(wrt), {}
    states = ComponentSet(d.get_state_var() for d in derivatives(model, wrt))
    for reset in all_switched_systems(model).resets:
        label, name = times.split(reset.block)
        if label is None:
            continue
        resets = [(x, after.expr) for x, after in reset.resets]
        other = next((x for x, _ in resets if x.parent_component() not in states or times.time(x) != label), None)
        if other is not None:
            raise FesdError(
                reset.block,
                f"'{other.name}' is reset, but it is not a differential state at this time",
                "reset variables that have a DerivativeVar; algebraic variables follow from their equations",
            )
        law = found.setdefault(strip_time(name), JumpLaw(strip_time(name), {}, {}))
        law.guards[label], law.resets[label] = reset.guard.expr, resets
    return list(found.values())


def check_guards(laws: list[JumpLaw], controls: list) -> None:
    """Refuse guards that contain a held control: they would jump at the boundary of a control stage, where no state does."""
    for law in laws:
        for guard in law.guards.values():
            control = next((v for v in identify_variables(guard) if any(v.parent_component() is u for u in controls)), None)
            if control is not None:
                raise FesdError(
                    law.name,
                    f"its guard contains the control '{control.name}', which is held on each control stage and jumps between them",
                    "let the guard depend on states only",
                )


def add_state_jumps(moving: MovingGrid, laws: list[JumpLaw], contacts: list[ContactLaw]) -> None:
    """Add the state jumps and the impacts at the inner boundaries, and let elements start after them."""
    if not laws and not contacts:
        return
    inner = {e.n: e.right for e in moving.grid.elements[:-1]}
    moving.block.jumps = block = Block()
    _declare_jump_pairs(block, laws, inner)
    kept = (block.e, block.happens, block.binary, block.after, block.copy, block.copied)
    moving.state_jumps = StateJumps(laws, block, *kept, declare_impacts(moving, contacts, block))
    for law in laws:
        for b, label in inner.items():
            e = block.e[law.name, b]
            block.happens.add((law.name, b), complements(e >= 0, law.guards[label] >= 0))
            block.binary.add((law.name, b), complements(e >= 0, 1 - e >= 0))
        # the pairs keep the guard's sign at the inner boundaries
        for label in law.guards.keys() - inner.values():
            block.guarded.add(law.guards[label] >= 0)
    _add_after(moving)
    write_impacts(moving)
    _start_after(moving)
    stabilise(moving)


def _declare_jump_pairs(block, laws, inner):
    block.law = Set(initialize=[law.name for law in laws], ordered=True)
    block.boundary = Set(initialize=list(inner), ordered=True)
    block.e = Var(block.law, block.boundary, bounds=(0, 1), initialize=0)
    block.happens = Complementarity(block.law, block.boundary)
    block.binary = Complementarity(block.law, block.boundary)
    block.guarded = ConstraintList()
    block.number = Set(dimen=1)
    block.after = Expression(block.boundary, block.number, rule=lambda *_: Expression.Skip)
    block.place = Set(dimen=1)
    block.copy = Var(block.boundary, block.place, dense=False)
    block.copied = Constraint(block.boundary, block.place)


def _add_after(moving):
    """The values of reset states after each inner boundary."""
    jumps = moving.state_jumps
    for element in moving.grid.elements[:-1]:
        for j, (x, laws) in enumerate(jumps.jumping(element.right).items(), start=1):
            jumps.block.number.add(j)
            jumps.after[element.n, j] = x + quicksum(jumps.e[name, element.n] * (J - x) for name, J in laws)


def _start_after(moving):
    """Elements start from the values after the boundary on their left."""
    jumps, times, owner, starts = moving.state_jumps, TimeIndex(moving.wrt), moving.grid.element_of(), {}
    for element in moving.grid.elements[:-1]:
        starts[element.n + 1] = {id(x): after for x, after in jumps.values_after(element).items()}
    for equation in filter(is_discretisation_equation, _active_constraints(jumps.block.model())):
        label = times.time(equation)
        start = starts.get(owner[label].n) if label in owner else None
        if start is not None:
            equation.set_value(replace_expressions(equation.expr, start))


def _active_constraints(model):
    return model.component_data_objects(Constraint, active=True, descend_into=Block)


def no_jump(state_jumps: StateJumps | None, before) -> list:
    """Return the factors of eta (eq. 12) at the boundary after element ``before``: 0 where a state is reset."""
    return [] if state_jumps is None else [1 - state_jumps.e[law.name, before.n] for law in state_jumps.laws]
