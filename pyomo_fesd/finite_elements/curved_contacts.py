"""Contacts on curved surfaces: drifts of the positions, with which velocities keep the order of the scheme (theory, eq. 22).

Takes: contacts whose gap is nonlinear in the positions.
Leaves: ``drift`` (mu) with its limit ``turned``, ``rate`` (gamma) with its equation ``rates``, and ``closed`` by contact, element
and point on the block of the state jumps, and mu in the collocation equations of the positions.
Does not apply: where the gap is linear, as the normal velocity is 0 by itself.
"""

from pyomo.common.collections import ComponentSet
from pyomo.core import Block, Constraint, Set, Var, quicksum
from pyomo.core.expr.visitor import identify_variables

from pyomo_fesd.core import (
    DriftSides,
    MovingGrid,
    TimeIndex,
    homotopy_hints,
    is_discretisation_equation,
    without_unit,
)
from pyomo_fesd.finite_elements.impulse_balance import BoundaryEquations
from pyomo_fesd.finite_elements.other_side import step_to_other_side

#: Keeps the drift 0 where gap and force are both 0.
NOWHERE = 1e-25
#: |h mu kappa| is at most this, where 2 is another side of the surface.
PART = 0.5


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
    block.rate = Var(block.contact, moving.block.element, block.point, initialize=0, dense=False)
    by_point = block.contact, moving.block.element, block.point
    block.rates, block.closed, block.turned = (Constraint(*by_point) for _ in range(3))
    equations = BoundaryEquations(block.model(), times, {t for e in moving.grid.elements for t in e.points})
    shifts = {}
    for law in curved:
        distance = step_to_other_side(law, equations, times)
        for element in moving.grid.elements:
            _stabilise_element(moving, block, law, element, equations, shifts)
            if distance is not None:
                _limit_turns(moving, block, law.name, element, 2 / distance)
    _shift_positions(block.model(), shifts)


def _is_curved(law):
    # positions that are fixed, as at the first time, count as numbers
    return any(gap.polynomial_degree() not in (0, 1) for gap in law.gaps.values())


def _stabilise_element(moving, block, law, element, equations, shifts):
    distances, forces = law.distances_in(element), law.forces_in(element)
    gap, force = quicksum(distances), quicksum(forces)
    for r, t in enumerate(element.points, start=1):
        index = law.name, element.n, r
        drift, rate = block.drift[index], block.rate[index]
        gamma = equations.normal_velocity(law.gaps[t], law.forces[t][0].parent_block(), ComponentSet())
        # the opposite sign of gamma would allow a drift that keeps the gap closed while the bodies approach, where both are small
        block.rates.add(index, without_unit(gamma) == rate)
        row = block.closed.add(index, ((gap + NOWHERE) * drift - force * gamma) / (gap + force + NOWHERE) == 0)
        homotopy_hints(block).drifts.append(DriftSides(drift, rate, row, distances, forces))
        for xdot, slope in equations.gradient(law.gaps[t]):
            shifts[id(xdot)] = shifts.get(id(xdot), 0) + slope * drift * moving.r[element.n]


def _limit_turns(moving, block, name, element, kappa):
    """Let drifts not bring the body to another side of the surface (eq. 22a)."""
    for r in block.point:
        way = element.length * moving.r[element.n] * block.drift[name, element.n, r]
        block.turned.add((name, element.n, r), (-PART, kappa * way, PART))


def _shift_positions(model, shifts):
    """Add the drifts to the increments r xdot of the positions, so that they count in an element of no length too."""
    for equation in model.component_data_objects(Constraint, active=True, descend_into=Block):
        if is_discretisation_equation(equation):
            increment, others = equation.expr.args
            for v in identify_variables(increment):
                if id(v) in shifts:
                    equation.set_value(increment + shifts[id(v)] == others)
