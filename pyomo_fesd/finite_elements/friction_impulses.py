"""Friction impulses: against the slip velocity after an impact, or so large that there is none (theory, eq. 23 and 24).

Takes: the ``directions`` that ``impact_laws`` has put in place of the multipliers of friction, and the conditions of these.
Leaves: ``slip`` by condition and boundary.
"""

from pyomo.common.collections import ComponentSet
from pyomo.core.expr.visitor import identify_variables, replace_expressions
from pyomo.mpec import complements

from pyomo_fesd.core import FesdError, MovingGrid, StickingSides, homotopy_hints
from pyomo_fesd.finite_elements.time_complementarities import TimeComplementarity


def add_friction_impulses(moving: MovingGrid, conditions: list[TimeComplementarity]) -> None:
    """Add the pairs of friction impulses: those of the friction forces, with the slip velocities after the impact (eq. 23).

    Raises
    ------
    FesdError
        for directions of contact forces that depend on algebraic variables, or on slip velocities that do not follow from states
    """
    impacts = None if moving.state_jumps is None else moving.state_jumps.impacts
    for element in moving.grid.elements[1:] if impacts is not None else ():
        found, b = ComponentSet(), element.n - 1
        directions = impacts.directions[b]
        for condition in conditions if directions else ():
            pair = condition.sides.get(element.left)
            own = [] if pair is None else [v for v in identify_variables(pair[0]) if v in directions]
            if own and condition.continuous[1]:
                swap = {id(nu): directions[nu] for nu in own}
                _add_pair(impacts, condition, element, replace_expressions(pair[0], swap))
                found.update(own)
        for law, condition in _sticking(impacts, conditions, element.left):
            pair = _add_pair(impacts, condition, element, impacts.normal_impulse(law.name, b) / element.length)
            homotopy_hints(moving.block).stickings.append(_sides(moving, law, element, pair))
        other = next((nu for nu in directions if nu not in found), None)
        if other is not None:
            raise FesdError(
                other,
                "contact: the direction of a contact force depends on it, and no law says its value at an impact",
                "write directions as functions of positions, and slip velocities as functions of differential states",
            )


def _add_pair(impacts, condition, element, impulse):
    """An impulse only where the second side of a condition is 0 after the impact."""
    after = condition.starts.get(element.n, condition.sides[element.left])[1]
    impacts.block.slipping.add(condition.name)
    return impacts.slip.add((condition.name, element.n - 1), complements(impulse >= 0, after >= 0))


def _sides(moving, law, element, pair):
    """The hint for the pair of bodies that must not slip."""
    before = moving.grid.elements[element.n - 2]
    return StickingSides(pair, (law.distances[element.left], *law.forces_in(before)), law.distances_in(element))


def _sticking(impacts, conditions, label):
    """The contacts at ``label`` whose bodies must not slip, each with its condition."""
    by_condition = {id(law.sticking[label]): law for law in impacts.laws if label in law.sticking}
    for condition in conditions if by_condition else ():
        law = by_condition.get(id(condition.conditions.get(label)))
        if law is not None:
            yield law, condition
