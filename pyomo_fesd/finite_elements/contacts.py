"""Rigid contacts over time: read from the model, and the components that their impacts have at element boundaries.

Takes: the contacts of ``SwitchedSystems`` (``pyomo_fesd.contact``).
Leaves: ``impulse``, ``above`` (P), ``below`` (N), ``leaving`` (Q, with restitution only), ``parts``, ``impact``, ``balance`` on
the block of the state jumps, without boundaries; ``impact_laws`` writes these.

The cross complementarity of a contact force has Q: a contact is closed only from a boundary on at which the bodies do not part
(theory, eq. 21).
"""

from dataclasses import dataclass, replace

from pyomo.core import Block, Constraint, Set, Var
from pyomo.dae import ContinuousSet
from pyomo.mpec import Complementarity

from pyomo_fesd.core import Impacts, MovingGrid, TimeIndex, all_switched_systems, strip_time
from pyomo_fesd.finite_elements.time_complementarities import TimeComplementarity


@dataclass(frozen=True)
class ContactLaw:
    """One rigid contact over time.

    Attributes
    ----------
    name : str
    gaps, distances, forces, touching : dict label -> expression, expression, tuple of VarData, ComplementarityData
    restitution : number or expression
    sticking : dict label -> ComplementarityData
        the condition that closed bodies do not slip, where it is asked for
    """

    name: str
    gaps: dict
    distances: dict
    forces: dict
    touching: dict
    restitution: object
    sticking: dict

    def distances_in(self, element) -> tuple:
        """The distances at the left boundary and the points of an element."""
        return tuple(self.distances[t] for t in dict.fromkeys((element.left, *element.points)))

    def forces_in(self, element) -> tuple:
        """The forces at the points of an element."""
        return tuple(force for t in element.points for force in self.forces[t])


def read_contacts(model: Block, wrt: ContinuousSet) -> list[ContactLaw]:
    """Return the contacts over ``wrt``."""
    times, found = TimeIndex(wrt), {}
    for contact in all_switched_systems(model).contacts:
        label, name = times.split(contact.block)
        if label is not None and contact.touching.active:
            name = strip_time(name)
            law = found.setdefault(name, ContactLaw(name, {}, {}, {}, {}, contact.restitution, {}))
            law.gaps[label], law.distances[label] = contact.gap.expr, contact.distance
            law.forces[label], law.touching[label] = contact.forces, contact.touching
            if contact.sticking is not None:
                law.sticking[label] = contact.sticking
    return list(found.values())


def declare_impacts(moving: MovingGrid, laws: list[ContactLaw], block: Block) -> Impacts | None:
    """Declare the impacts of contacts on ``block``, without boundaries."""
    if not laws:
        return None
    block.contact = Set(initialize=[law.name for law in laws], ordered=True)
    block.left = Set(initialize=[e.n - 1 for e in moving.grid.elements], ordered=True)
    block.coupled, sparse = Set(dimen=1), {'initialize': 0, 'dense': False}
    block.impulse, block.second, block.above, block.below, block.leaving = (
        Var(block.contact, block.left, bounds=(0, None), **sparse) for _ in range(5)
    )
    block.velocity = Var(block.left, block.coupled, dense=False)
    block.balance, block.parts = Constraint(block.left, block.coupled), Constraint(block.contact, block.left, [1, 2])
    block.room = Constraint(block.contact, block.left)
    block.impact = Complementarity(block.contact, block.left, [1, 2])
    block.direction, block.weights = Var(block.left, block.coupled, dense=False), Constraint(block.left, block.coupled)
    block.slipping = Set(dimen=1)
    block.slip = Complementarity(block.slipping, block.left)
    kept = (block.impulse, block.second, block.above, block.below, block.leaving, block.parts, block.room, block.impact)
    return Impacts(laws, block, *kept, block.velocity, block.balance, block.direction, block.weights, block.slip, {}, {})


def with_departures(moving: MovingGrid, conditions: list[TimeComplementarity]) -> list[TimeComplementarity]:
    """Return the conditions, those of contact forces with Q: closed only from a boundary on at which the bodies do not part.

    Otherwise bodies could meet with a velocity with which they part, having been below the surface between two collocation points,
    and the forces of the closed element would take it away.
    """
    impacts = None if moving.state_jumps is None else moving.state_jumps.impacts
    if impacts is None:
        return conditions
    laws = {id(touching): law for law in impacts.laws for touching in law.touching.values()}
    return [_with_departures(impacts, c, laws.get(id(next(iter(c.conditions.values())))), moving.grid) for c in conditions]


def without_left_slip(moving: MovingGrid, conditions: list[TimeComplementarity]) -> list[TimeComplementarity]:
    """Return the conditions, those of bodies that must not slip without the slip at the left boundary of an element.

    Between closed elements it is 0 by that of the element before; a second equation would leave the first one no multiplier.  After
    an impact that of the impulse holds.
    """
    impacts = None if moving.state_jumps is None else moving.state_jumps.impacts
    known = {id(c) for law in ([] if impacts is None else impacts.laws) for c in law.sticking.values()}
    return [replace(c, from_left=False) if id(next(iter(c.conditions.values()))) in known else c for c in conditions]


def _with_departures(impacts, condition, law, grid):
    if law is None:
        return condition
    return replace(condition, departures={e.n: _departure(impacts, law, e.n - 1) for e in grid.elements if e.left in law.gaps})


def _departure(impacts, law, b):
    """Q: the velocity with which bodies part after the boundary, or 0."""
    return impacts.leaving[law.name, b] if (law.name, b) in impacts.leaving else impacts.above[law.name, b]


def impulse_activity(impacts: Impacts, law: ContactLaw, b: int, gap, tiny: float):
    """Return a number that is 1 where an impulse acts at a boundary and 0 where none does, like the activity of eq. (12)."""
    impulse = impacts.normal_impulse(law.name, b)
    return impulse / (impulse + gap + impacts.above[law.name, b] + impacts.below[law.name, b] + tiny)
