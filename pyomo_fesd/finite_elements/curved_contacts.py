"""Contacts on curved surfaces: drifts of the positions, with which velocities keep the order of the scheme (theory, eq. 22).

Takes: contacts whose gap is nonlinear in the positions.
Leaves: ``drift`` (mu), ``rate`` (gamma) with its equation ``rates``, and ``closed`` by contact, element and point on the block of
the state jumps, and mu in the collocation equations of the positions.
Does not apply: where the gap is linear, as the normal velocity is 0 by itself.
"""

import numpy as np
from pyomo.common.collections import ComponentSet
from pyomo.core import Block, Constraint, Set, Var, quicksum, value
from pyomo.core.expr.calculus.derivatives import differentiate
from pyomo.core.expr.visitor import identify_variables

from pyomo_fesd.core import (
    DriftSides,
    MovingGrid,
    TimeIndex,
    homotopy_hints,
    is_discretisation_equation,
    kept_values,
    value_or_nan,
    without_unit,
)
from pyomo_fesd.finite_elements.impulse_balance import BoundaryEquations

#: Keeps the drift 0 where gap and force are both 0.
NOWHERE = 1e-25
#: A drift turns the normal of the surface by less than this part of what would bring it to another point with the same tangent.
PART = 0.5
#: Newton's steps to the surface, and what is left of the gap there, relative to the gradient.
STEPS, LEFT = 20, 1e-6
#: Another side is looked for so many times as far away as the inverse of the second derivatives, at so many places.
FARTHEST, SAMPLES = 8.0, 4000


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
        curvature = _curvature(law, equations, times)
        for element in moving.grid.elements:
            _stabilise_element(moving, block, law, element, equations, shifts)
            _limit_turns(block, law.name, element, moving.r[element.n], curvature)
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


def _limit_turns(block, name, element, r, curvature):
    """Let drifts not turn the normal so far that the body is at another point of the surface with the same tangent."""
    for k in block.point if curvature else ():
        way = element.length * r * block.drift[name, element.n, k]
        block.turned.add((name, element.n, k), (-PART, curvature * way, PART))


def _curvature(law, equations, times):
    """2/s for the step s along the gradient to the other side of the surface, from where it is nearest to the first positions.

    None without another side.  For a disc it is the norm of the second derivatives.
    """
    gap = next(gap for t, gap in law.gaps.items() if t != times.wrt.first())
    positions, slopes = equations.positions(gap), [slope for _, slope in equations.gradient(gap)]
    starts = [times.at(v, times.wrt.first()) for v in positions]
    with kept_values(positions):
        for v, start in zip(positions, starts):
            v.set_value(start.value, skip_validation=True)
        try:
            return _curvature_at_surface(gap, positions, slopes)
        except (ArithmeticError, ValueError, TypeError):
            return None


def _curvature_at_surface(gap, positions, slopes):
    for _ in range(STEPS):
        gradient = np.array([value(slope) for slope in slopes])
        size = float(gradient @ gradient)
        if not size > 0.0:
            return None
        step = -value(gap) / size * gradient
        for v, change in zip(positions, step):
            v.set_value(v.value + change, skip_validation=True)
    if not abs(value(gap)) <= LEFT * size**0.5:
        return None
    hessian = [differentiate(slope + 0 * positions[0], wrt_list=positions) for slope in slopes]
    reach = FARTHEST / float(np.linalg.norm(np.array(hessian, dtype=float), 2))
    here, steps = [v.value for v in positions], np.linspace(-reach, reach, SAMPLES) if np.isfinite(reach) else ()
    gaps = [_gap_at(gap, positions, here, s * gradient) for s in steps]
    # between two steps on one side of the point, beyond the surface itself
    others = [abs(a + b) / 2 for a, b, g, k in zip(steps, steps[1:], gaps, gaps[1:]) if a * b > 0 > g * k]
    return 2.0 / min(others) if others else None


def _gap_at(gap, positions, here, step):
    for v, number, change in zip(positions, here, step):
        v.set_value(number + change, skip_validation=True)
    return value_or_nan(gap)


def _shift_positions(model, shifts):
    """Add the drifts to the increments r xdot of the positions, so that they count in an element of no length too."""
    for equation in model.component_data_objects(Constraint, active=True, descend_into=Block):
        if is_discretisation_equation(equation):
            increment, others = equation.expr.args
            for v in identify_variables(increment):
                if id(v) in shifts:
                    equation.set_value(increment + shifts[id(v)] == others)
