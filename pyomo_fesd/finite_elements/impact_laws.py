"""The laws of impact of rigid contacts at element boundaries (theory, eq. 20 and 21).

At boundary b between elements n and n + 1, with the normal velocity gamma = d gap/dt and the impulse Lambda,

    M (v+ - v-) = J^T Lambda                                                                            (20)
    gamma(v+) + e gamma(v-) = P - N,      0 <= Lambda perp P + N >= 0,
    0 <= Lambda perp d_b >= 0,      d_b >= sigma h_{n+1} N,      d = gap(q),      P, N >= 0               (21)
    0 <= sum_r normal_{n+1,r}  perp  Q + d_b + sum_r d_{n+1,r} >= 0,      gamma(v+) <= Q

so an impulse acts only where the gap is 0, and then reverses the normal velocity by e.  The row of N, sigma = 1/100: where the gap
is 0, N = 0, so without an impulse the bodies must not approach; in front of a wall N is free.  (Without it, a body could enter a
resting contact with a velocity that the first contact forces take away.)

Takes: the ``Impacts`` of ``contacts``, and the balances of momentum (``impulse_balance``).
Leaves: their data at each boundary; velocities after impacts among ``after`` of the state jumps.
Does not apply: at the last time.  At the first time there is no impulse, but Q and N.
"""

from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.core import quicksum
from pyomo.core.expr.visitor import identify_variables, replace_expressions
from pyomo.mpec import complements

from pyomo_fesd.core import FesdError, ImpactSides, MovingGrid, TimeIndex, homotopy_hints, value_or_nan
from pyomo_fesd.finite_elements.impulse_balance import BoundaryEquations

#: sigma: bodies that would meet before this part of an element are in contact.
AHEAD = 0.01
#: Largest approach of bodies that touch at the first time.
APPROACH = 1e-8


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


def _write_boundary(moving, equations, element):
    impacts, label, b = moving.state_jumps.impacts, element.left, element.n - 1
    laws = [law for law in impacts.laws if label in law.gaps]
    impulses = ComponentMap(pair for law in laws for pair in _impulses(impacts, law, label, b))
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
        gamma = equations.normal_velocity(law.gaps[label], law.forces[label][0].parent_block(), moving_states)
        _add_parts(impacts, law, b, gamma, replace_expressions(gamma, {id(v): new for v, new in after.items()}))
        _add_pairs(moving, law, element)
        _add_room(moving, law, element, gamma)
        if not b:
            _check_start(law, label, gamma)


def _impulses(impacts, law, label, b):
    """The forces of a contact, each with its impulse."""
    return [(force, some[law.name, b] if b else 0) for force, some in zip(law.forces[label], (impacts.impulse, impacts.second))]


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


def _add_pairs(moving, law, element):
    impacts, b = moving.state_jumps.impacts, element.n - 1
    if b:
        impulse, moved = impacts.normal_impulse(law.name, b), impacts.above[law.name, b] + impacts.below[law.name, b]
        if law.sticking:
            # a force that gives the impulse within an element: both are relaxed alike
            impulse = impulse / element.length
        impacts.impact.add((law.name, b, 1), complements(impulse >= 0, law.distances[element.left] >= 0))
        impacts.impact.add((law.name, b, 2), complements(impulse >= 0, moved >= 0))


def _add_room(moving, law, element, gamma):
    """What keeps N at 0; N is free after an element that is closed, where the velocity is 0 by itself."""
    impacts, b, distance = moving.state_jumps.impacts, element.n - 1, law.distances[element.left]
    if not b and _is_fixed(law.gaps[element.left]) and _is_fixed(gamma):
        return
    before = moving.grid.elements[b - 1] if b else None
    forces = law.forces_in(before) if b else ()
    # with Legendre's points the velocity at the end of a closed element on a curve is not 0 by itself
    ends = b and moving.grid.right_is_collocated
    distances = law.distances_in(before) if ends else ()
    P, N = impacts.above[law.name, b], impacts.below[law.name, b]
    # with the forces N is free in a relaxation too
    room = quicksum([distance, *forces]) if law.sticking else distance
    row = impacts.room.add((law.name, b), room - AHEAD * moving.duration(element) * N >= 0)
    pairs = tuple(impacts.impact[law.name, b, k] for k in (1, 2) if b)
    homotopy_hints(moving.block).impacts.append(ImpactSides(b, pairs, P, N, row, (distance, *forces), distances))


def _is_fixed(expr):
    return all(v.fixed for v in identify_variables(expr, include_fixed=True))


def _check_start(law, label, gamma):
    gap = law.gaps[label]
    if _is_fixed(gap) and _is_fixed(gamma) and value_or_nan(gap) < APPROACH and value_or_nan(gamma) < -APPROACH:
        raise FesdError(
            law.forces[label][0].parent_block(),
            f"contact: the gap is closed at the first time and closes at a rate of {-value_or_nan(gamma):g}; there is no impact at "
            "the first time",
            "start with the velocities after the impact, or a little earlier",
        )
