"""Rigid contacts: the laws of impact at element boundaries (theory, eq. 20 and 21).

At boundary b between elements n and n + 1, with the normal velocity gamma = d gap/dt and the impulse Lambda,

    M (v+ - v-) = J^T Lambda                                                                            (20)
    gamma(v+) + e gamma(v-) = P - N,      0 <= Lambda perp P + N >= 0,
    0 <= Lambda perp gap(q_b) - sigma h_{n+1} N >= 0,      P, N >= 0                                    (21)
    0 <= sum_r normal_{n+1,r}  perp  Q + gap(q_b) + sum_r gap_{n+1,r} >= 0,      gamma(v+) <= Q

so an impulse acts only where the gap is 0, and then reverses the normal velocity by e.  The gap less sigma h N, sigma = 1/100,
is what (21) has in place of the gap: where the gap is 0, N = 0, so without an impulse the bodies must not approach; in front of
a wall N is free.  (With the gap alone, a body could enter a resting contact with a velocity that the first contact forces take
away.)  The last line is the cross complementarity of the contact force: a contact is closed only from a boundary on at which the
bodies do not part, Q = 0.

Takes: the contacts of ``SwitchedSystems`` (``pyomo_fesd.contact``).
Leaves: ``impulse``, ``above`` (P), ``below`` (N), ``leaving`` (Q, with restitution only), ``parts``, ``impact``, ``balance`` on
the block of the state jumps; velocities after impacts among its ``after``.
Does not apply: at the last time.  At the first time there is no impulse, but Q and N.
"""

from dataclasses import dataclass, replace

from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.core import Block, Constraint, Set, Var, quicksum
from pyomo.core.expr.visitor import identify_variables, replace_expressions
from pyomo.dae import ContinuousSet
from pyomo.mpec import Complementarity, complements

from pyomo_fesd.core import (
    FesdError,
    Impacts,
    MovingGrid,
    TimeIndex,
    all_switched_systems,
    is_discretisation_equation,
    strip_time,
    value_or_nan,
)
from pyomo_fesd.finite_elements.impulse_balance import BoundaryEquations
from pyomo_fesd.finite_elements.time_complementarities import TimeComplementarity

#: sigma: bodies that would meet before this part of an element are in contact.
AHEAD = 0.01
#: Keeps the drift 0 where gap and force are both 0.
NOWHERE = 1e-12
#: Largest approach of bodies that touch at the first time.
APPROACH = 1e-8


@dataclass(frozen=True)
class ContactLaw:
    """One rigid contact over time.

    Attributes
    ----------
    name : str
    gaps, normals, touching : dict label -> expression, VarData, ComplementarityData
    restitution : number or expression
    """

    name: str
    gaps: dict
    normals: dict
    touching: dict
    restitution: object


def read_contacts(model: Block, wrt: ContinuousSet) -> list[ContactLaw]:
    """Return the contacts over ``wrt``."""
    times, found = TimeIndex(wrt), {}
    for contact in all_switched_systems(model).contacts:
        label, name = times.split(contact.block)
        if label is not None and contact.touching.active:
            law = found.setdefault(strip_time(name), ContactLaw(strip_time(name), {}, {}, {}, contact.restitution))
            law.gaps[label], law.normals[label], law.touching[label] = contact.gap.expr, contact.normal, contact.touching
    return list(found.values())


def declare_impacts(moving: MovingGrid, laws: list[ContactLaw], block: Block) -> Impacts | None:
    """Declare the impacts of contacts on ``block``, without boundaries."""
    if not laws:
        return None
    block.contact = Set(initialize=[law.name for law in laws], ordered=True)
    block.left = Set(initialize=[e.n - 1 for e in moving.grid.elements], ordered=True)
    block.coupled, sparse = Set(dimen=1), {'initialize': 0, 'dense': False}
    block.impulse, block.above, block.below, block.leaving = (
        Var(block.contact, block.left, bounds=(0, None), **sparse) for _ in range(4)
    )
    block.velocity = Var(block.left, block.coupled, dense=False)
    block.balance, block.parts = Constraint(block.left, block.coupled), Constraint(block.contact, block.left, [1, 2])
    block.impact = Complementarity(block.contact, block.left, [1, 2])
    block.direction, block.weights = Var(block.left, block.coupled, dense=False), Constraint(block.left, block.coupled)
    block.slipping = Set(dimen=1)
    block.slip = Complementarity(block.slipping, block.left)
    kept = (block.impulse, block.above, block.below, block.leaving, block.parts, block.impact, block.velocity, block.balance)
    return Impacts(laws, block, *kept, block.direction, block.weights, block.slip, {}, {})


def write_impacts(moving: MovingGrid) -> None:
    """Write the laws of impact at every boundary but the last; the velocities after them are among ``after`` of the jumps.

    Raises
    ------
    FesdError
        for equations of which the impulses do not follow, velocities that a ``state_jump`` resets, and bodies that approach one
        another at the first time although they touch
    """
    impacts, elements = moving.state_jumps.impacts, moving.grid.elements
    if impacts is None:
        return
    labels = {e.left for e in elements}
    equations = BoundaryEquations(impacts.block.model(), TimeIndex(moving.wrt), labels)
    for element in elements:
        _write_boundary(moving, equations, element)


def stabilise(moving: MovingGrid) -> None:
    """Keep the order on curved contacts: in a closed element the normal velocity is 0 at the collocation points too (eq. 22).

    Where the gap is linear in the positions, that follows from gap = 0.
    """
    impacts = None if moving.state_jumps is None else moving.state_jumps.impacts
    curved = [] if impacts is None else [law for law in impacts.laws if _is_curved(law)]
    if not curved:
        return
    block, times = impacts.block, TimeIndex(moving.wrt)
    block.point = Set(initialize=range(1, len(moving.grid.tau) + 1))
    block.drift = Var(block.contact, moving.block.element, block.point, initialize=0, dense=False)
    block.closed = Constraint(block.contact, moving.block.element, block.point)
    equations = BoundaryEquations(block.model(), times, {t for e in moving.grid.elements for t in e.points})
    shifts = {}
    for law in curved:
        for element in moving.grid.elements:
            _stabilise_element(block, law, element, equations, shifts)
    _shift_positions(block.model(), shifts)


def _is_curved(law):
    # positions that are fixed, as at the first time, count as numbers
    return any(gap.polynomial_degree() not in (0, 1) for gap in law.gaps.values())


def _stabilise_element(block, law, element, equations, shifts):
    gap = quicksum(law.gaps[t] for t in dict.fromkeys((element.left, *element.points)))
    force = quicksum(law.normals[t] for t in element.points)
    for r, t in enumerate(element.points, start=1):
        drift = block.drift[law.name, element.n, r]
        gamma = equations.normal_velocity(law.gaps[t], law.normals[t].parent_block(), ComponentSet())
        # the opposite sign of gamma would allow a drift that keeps the gap closed while the bodies approach, where both are small
        block.closed.add((law.name, element.n, r), ((gap + NOWHERE) * drift - force * gamma) / (gap + force + NOWHERE) == 0)
        for xdot, slope in equations.gradient(law.gaps[t]):
            shifts[id(xdot)] = shifts.get(id(xdot), xdot) + slope * drift


def _shift_positions(model, shifts):
    """Add the drifts to the rates of the positions, in the discretisation equations only."""
    for equation in model.component_data_objects(Constraint, active=True, descend_into=Block):
        if is_discretisation_equation(equation) and any(id(v) in shifts for v in identify_variables(equation.body)):
            equation.set_value(replace_expressions(equation.expr, shifts))


def _write_boundary(moving, equations, element):
    impacts, label, b = moving.state_jumps.impacts, element.left, element.n - 1
    laws = [law for law in impacts.laws if label in law.gaps]
    impulses = ComponentMap((law.normals[label], impacts.impulse[law.name, b] if b else 0) for law in laws)
    groups, after = equations.momentum(impulses), ComponentMap()
    impacts.directions[b] = directions = _directions(impacts, b, groups, equations) if b else ComponentMap()
    swap = {id(nu): beta for nu, beta in directions.items()}
    groups = [group.with_directions(swap) for group in groups]
    for group in groups if b else ():
        after.update(_velocities_after(impacts, b, group, impulses))
    impacts.velocities[b] = list(after)
    _add_after(moving.state_jumps, label, b, after)
    moving_states = ComponentSet(v for group in groups for v in group.states)
    for law in laws:
        gamma = equations.normal_velocity(law.gaps[label], law.normals[label].parent_block(), moving_states)
        _add_parts(impacts, law, b, gamma, replace_expressions(gamma, {id(v): new for v, new in after.items()}))
        _add_pairs(moving, law, element)
        if not b:
            _check_start(law, label, gamma)


def _directions(impacts, b, groups, equations):
    """A multiplier of the impulse for each multiplier of the friction forces in the balances."""
    found = ComponentMap()
    for nu in equations.multipliers(groups):
        found[nu] = beta = impacts.direction[b, _place(impacts.block, len(found) + 1)]
        beta.bounds, beta.value = (nu.lower, nu.upper), nu.value
    for k, equation in enumerate(equations.between(found), start=1):
        swap = {id(nu): beta for nu, beta in found.items()}
        impacts.weights.add((b, _place(impacts.block, k)), replace_expressions(equation.expr, swap))
    return found


def _add_after(jumps, label, b, after):
    resets = jumps.jumping(label) if b else ()
    for j, (v, new) in enumerate(after.items(), start=1 + len(resets)):
        if v in resets:
            raise FesdError(
                v, "a state_jump resets it, and a contact force acts on its balance", "let the contact alone change this velocity"
            )
        jumps.block.number.add(j)
        jumps.after[b, j] = new


def _velocities_after(impacts, b, group, impulses):
    """The velocities v+ of one group (eq. 20): by division for one balance, as variables where masses couple several."""
    given = [quicksum(slope * impulses[f] for f, slope in row.items()) for row in group.forces]
    if len(group.states) == 1:
        return [(group.states[0], group.states[0] - given[0] / group.masses[0][0])]
    new = [_next_velocity(impacts, b, v) for v in group.states]
    for row, impulse in zip(group.masses, given):
        k = _place(impacts.block, sum(1 for left, _ in impacts.balance if left == b) + 1)
        impacts.balance.add((b, k), quicksum(a * (w - v) for a, w, v in zip(row, new, group.states)) + impulse == 0)
    return zip(group.states, new)


def _next_velocity(impacts, b, v):
    copy = impacts.velocity[b, _place(impacts.block, sum(1 for left, _ in impacts.velocity if left == b) + 1)]
    copy.bounds, copy.value = (v.lower, v.upper), v.value
    return copy


def _place(block, number):
    block.coupled.add(number)
    return number


def _add_parts(impacts, law, b, before, after):
    """P and N of the law of restitution, and Q; at the first time they are the parts of the normal velocity."""
    P, N = impacts.above[law.name, b], impacts.below[law.name, b]
    if not b or _is_zero(law.restitution):
        impacts.parts.add((law.name, b, 1), after - (P - N) == 0)
    else:
        impacts.parts.add((law.name, b, 1), after + law.restitution * before - (P - N) == 0)
        impacts.parts.add((law.name, b, 2), after - (impacts.leaving[law.name, b] - N) == 0)


def _is_zero(restitution):
    return isinstance(restitution, (int, float)) and restitution == 0


def _departure(impacts, law, b):
    """Q: the velocity with which bodies part after the boundary, or 0."""
    return impacts.leaving[law.name, b] if (law.name, b) in impacts.leaving else impacts.above[law.name, b]


def _add_pairs(moving, law, element):
    impacts, b = moving.state_jumps.impacts, element.n - 1
    P, N = impacts.above[law.name, b], impacts.below[law.name, b]
    distance = law.gaps[element.left] - AHEAD * moving.duration(element) * N
    if b:
        impulse = impacts.impulse[law.name, b]
        impacts.impact.add((law.name, b, 1), complements(impulse >= 0, distance >= 0))
        impacts.impact.add((law.name, b, 2), complements(impulse >= 0, P + N >= 0))
    else:
        impacts.parts.add((law.name, b, 2), distance >= 0)


def _check_start(law, label, gamma):
    gap = law.gaps[label]
    fixed = all(v.fixed for expr in (gap, gamma) for v in identify_variables(expr, include_fixed=True))
    if fixed and value_or_nan(gap) < APPROACH and value_or_nan(gamma) < -APPROACH:
        raise FesdError(
            law.normals[label].parent_block(),
            f"contact: the gap is closed at the first time and closes at a rate of {-value_or_nan(gamma):g}; there is no impact at "
            "the first time",
            "start with the velocities after the impact, or a little earlier",
        )


def add_friction_impulses(moving: MovingGrid, conditions: list[TimeComplementarity]) -> None:
    """Add the pairs of friction impulses: those of the friction forces, with the slip velocities after the impact (eq. 23).

    Raises
    ------
    FesdError
        for directions of contact forces that depend on algebraic variables, or on slip velocities that do not follow from states
    """
    impacts = None if moving.state_jumps is None else moving.state_jumps.impacts
    for element in moving.grid.elements[1:] if impacts is not None else ():
        found = ComponentSet()
        directions = impacts.directions[element.n - 1]
        for condition in conditions if directions else ():
            pair = condition.sides.get(element.left)
            own = [] if pair is None else [v for v in identify_variables(pair[0]) if v in directions]
            if own and condition.continuous[1]:
                swap = {id(nu): directions[nu] for nu in own}
                after = condition.starts.get(element.n, pair)[1]
                impacts.block.slipping.add(condition.name)
                impacts.slip.add((condition.name, element.n - 1), complements(replace_expressions(pair[0], swap) >= 0, after >= 0))
                found.update(own)
        other = next((nu for nu in directions if nu not in found), None)
        if other is not None:
            raise FesdError(
                other,
                "contact: the direction of a contact force depends on it, and no law says its value at an impact",
                "write directions as functions of positions, and slip velocities as functions of differential states",
            )


def with_departures(moving: MovingGrid, conditions: list[TimeComplementarity]) -> list[TimeComplementarity]:
    """Return the conditions, those of contact forces with Q: closed only from a boundary on at which the bodies do not part."""
    impacts = None if moving.state_jumps is None else moving.state_jumps.impacts
    if impacts is None:
        return conditions
    laws = {id(touching): law for law in impacts.laws for touching in law.touching.values()}
    return [_with_departures(impacts, c, laws.get(id(next(iter(c.conditions.values())))), moving.grid) for c in conditions]


def _with_departures(impacts, condition, law, grid):
    if law is None:
        return condition
    return replace(condition, departures={e.n: _departure(impacts, law, e.n - 1) for e in grid.elements if e.left in law.gaps})


def impulse_activity(impacts: Impacts, law: ContactLaw, b: int, gap, tiny: float):
    """Return a number that is 1 where an impulse acts at a boundary and 0 where none does, like the activity of eq. (12)."""
    impulse = impacts.impulse[law.name, b]
    return impulse / (impulse + gap + impacts.above[law.name, b] + impacts.below[law.name, b] + tiny)
