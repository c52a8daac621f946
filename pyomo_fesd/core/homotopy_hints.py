"""Hints for the homotopy of an MPCC: what it may treat softly, and where better branches may be found.

Takes: nothing; a transformation or a user writes ``homotopy_hints(block)`` for the components of ``block``.
Leaves: a record in the private data of the block, which ``mpec_hybrid`` reads; it disappears with the block.
"""

from dataclasses import dataclass

from pyomo.common.autoslots import AutoSlots
from pyomo.common.collections import ComponentMap
from pyomo.core import Block
from pyomo.core.base.constraint import ConstraintData
from pyomo.core.base.expression import ExpressionData
from pyomo.core.base.var import VarData
from pyomo.mpec.complementarity import ComplementarityData

from pyomo_fesd.core.changes import Change
from pyomo_fesd.core.private_data import records_below

SCOPE = 'pyomo_fesd.core.homotopy_hints'


@dataclass(frozen=True, eq=False)
class BranchConstraint:
    """A pair 0 <= G perp eta >= 0 that the homotopy leaves out and each branch decides (theory, eq. 13).

    Attributes
    ----------
    pair : ComplementarityData
        its second side is eta
    constraint : ConstraintData
        an inactive equation, equivalent to G = 0, which a branch imposes if eta is positive there
    tentative : bool
        whether a branch without a solution is solved again without it
    """

    pair: ComplementarityData
    constraint: ConstraintData
    tentative: bool = False


@dataclass(frozen=True, eq=False)
class Penalty:
    """A term ``weight * expression`` (a named Expression) that guides the homotopy; never part of the reported objective."""

    expression: ExpressionData
    weight: float


@dataclass(frozen=True, eq=False)
class NeighbourBranch:
    """A branch beside a solution that no small step reaches, because several pairs have to change together: changes move.

    Attributes
    ----------
    starts : tuple of (VarData, float)
        values at which variables start in this branch
    if_at_lower_bound : tuple of VarData
        the branch is tried only from a solution with one of these at its lower bound; empty: from every solution
    changes : tuple of Change
        of these, the ones that are there in the solution come one place later, or earlier
    later : bool
    """

    starts: tuple[tuple[VarData, float], ...] = ()
    if_at_lower_bound: tuple[VarData, ...] = ()
    changes: tuple[Change, ...] = ()
    later: bool = True


@dataclass(frozen=True, eq=False)
class Follower:
    """A pair that has a solution wherever another one, its leader, is solved with the same side at zero.

    Every branch gives it that side: its own values, which may be free, would choose at random.

    Attributes
    ----------
    pair, leader : ComplementarityData
    swapped : bool
        whether the first side of one belongs to the second side of the other
    """

    pair: ComplementarityData
    leader: ComplementarityData
    swapped: bool = False


@dataclass(frozen=True, eq=False)
class Filling:
    """Places that are filled in their order up to an amount: sum_k s_k extent_k = amount, 0 <= 1 - s_k perp s_{k+1} >= 0.

    Every branch gets the sides that the extents of its start show: where other pairs move the places, another one is the last to be
    filled, and the branch with the sides of before has no solution.

    Attributes
    ----------
    pairs : list of ComplementarityData
        between each place and the next
    shares : list of VarData, s_k
    extents : list of (coefficient, VarData)
    amount : float
    """

    pairs: list
    shares: list
    extents: list
    amount: float


@dataclass(frozen=True, eq=False)
class ImpactSides:
    """A contact at one boundary: its law of impact has sides that the forces and distances beside it decide.

    Where bodies meet that touch from then on, the impulse is free, as N has no room.  Where they have touched before and nothing
    else has an impact there, there is no impulse, and N follows from velocities that are 0 by themselves.  With the other sides, or
    with the bounds of P and N, the same solutions have no interior.

    Attributes
    ----------
    boundary : int
    pairs : tuple of ComplementarityData
        with the impulse as their first side; none at the first time
    above, below : VarData
        P and N
    room : ConstraintData
        the row that keeps N at 0 unless one of ``within`` is not 0
    within : tuple of VarData
    before : tuple of VarData
        the distances in the element before; none where velocities need not be 0 at its end
    """

    boundary: int
    pairs: tuple[ComplementarityData, ...]
    above: VarData
    below: VarData
    room: ConstraintData
    within: tuple[VarData, ...]
    before: tuple[VarData, ...]


@dataclass(frozen=True, eq=False)
class StickingSides:
    """Bodies that must not slip, at one boundary: where they meet and touch from then on, their impulse is free (theory, eq. 24).

    Without an impulse the bodies could only meet at no velocity: a branch without interior.  What is lost is a meeting at no
    velocity of bodies that then slip while they touch without a force.

    Attributes
    ----------
    pair : ComplementarityData
        with the impulse as its first side, the slip velocity after it as the second one
    meeting : tuple of VarData
        the distance at the boundary and the forces before it
    after : tuple of VarData
        the distances in the element after
    """

    pair: ComplementarityData
    meeting: tuple[VarData, ...]
    after: tuple[VarData, ...]


@dataclass(frozen=True, eq=False)
class DriftSides:
    """The drift of a curved contact and its normal velocity at one point, one of which is 0 (theory, eq. 22).

    A branch decides which one by the forces and distances of the element; the row that weighs both for the homotopy is as good as
    singular where a force ends.

    Attributes
    ----------
    drift, rate : VarData
    row : ConstraintData
        the weighted one
    distances, forces : tuple of VarData
        the rate is 0 where all distances are 0, the drift is 0 where all forces are
    """

    drift: VarData
    rate: VarData
    row: ConstraintData
    distances: tuple[VarData, ...]
    forces: tuple[VarData, ...]


class HomotopyHints(AutoSlots.Mixin):
    """The hints on one block; ``mpec_hybrid`` without them solves the same problem, perhaps to a worse local solution.

    Attributes
    ----------
    branch_constraints : list of BranchConstraint
    penalties : list of Penalty
    guide_bounds : ComponentMap Var -> (low, high)
        tighter bounds of a Var (all its indices) in the homotopy.  Its own bounds belong to the method and not to the problem: a
        certificate also asks for descent beyond them.
    neighbour_branches : list of NeighbourBranch
    coincidences : list of Coincidence (``changes``)
    arrivals : list of Arrival (``changes``)
    chains : list of tuple of Part (``parts``)
    followers : list of Follower
    fillings : list of Filling
    impacts : list of ImpactSides
    stickings : list of StickingSides
    drifts : list of DriftSides
    alike : list of tuples of VarData
        variables that are the same quantity at different places, and have one size
    """

    __slots__ = (
        'branch_constraints',
        'penalties',
        'guide_bounds',
        'neighbour_branches',
        'coincidences',
        'arrivals',
        'chains',
        'followers',
        'fillings',
        'impacts',
        'stickings',
        'drifts',
        'alike',
    )

    def __init__(self):
        self.branch_constraints = []
        self.penalties = []
        self.guide_bounds = ComponentMap()
        self.neighbour_branches = []
        self.coincidences = []
        self.arrivals = []
        self.chains = []
        self.alike = []
        self.followers = []
        self.fillings = []
        self.impacts = []
        self.stickings = []
        self.drifts = []


Block.register_private_data_initializer(HomotopyHints, scope=SCOPE)


def homotopy_hints(block: Block) -> HomotopyHints:
    """The hints of ``block``, to add to.

    Parameters
    ----------
    block : Block
        a scalar Block or one element of an indexed one, best the one that holds the components

    Examples
    --------
    Two equal parts of a plant meet a demand.  Where both run (eta = x y > 0) they are to run alike, x = y.  As a pair
    (x - y)^2 perp eta this degenerates at every solution, so the homotopy only prefers x = y and each branch imposes it:

    >>> import pyomo.environ as pyo
    >>> from pyomo.mpec import Complementarity, complements
    >>> from pyomo_fesd.core import BranchConstraint, Penalty, homotopy_hints
    >>> m = pyo.ConcreteModel()
    >>> m.x, m.y = pyo.Var(bounds=(0, 4), initialize=1), pyo.Var(bounds=(0, 4), initialize=2)
    >>> m.demand = pyo.Constraint(expr=m.x + m.y == 3)
    >>> m.cost = pyo.Objective(expr=(m.x - 1) ** 2 + (m.y - 1.5) ** 2)
    >>> m.alike = Complementarity(expr=complements((m.x - m.y) ** 2 >= 0, m.x * m.y >= 0))
    >>> m.equal = pyo.Constraint(expr=m.x == m.y)
    >>> m.equal.deactivate()
    >>> m.difference = pyo.Expression(expr=(m.x - m.y) ** 2)
    >>> hints = homotopy_hints(m)
    >>> hints.branch_constraints.append(BranchConstraint(m.alike, m.equal))
    >>> hints.penalties.append(Penalty(m.difference, 0.1))
    >>> results = pyo.SolverFactory('mpec_hybrid').solve(m)
    >>> print(f'{m.x.value:.3f} {m.y.value:.3f}')
    1.500 1.500
    """
    return block.private_data(SCOPE)


def all_hints(model: Block) -> HomotopyHints:
    """The hints on ``model`` and the active blocks below it, in one record; writing to it changes none of them."""
    total = HomotopyHints()
    for hints in records_below(model, SCOPE):
        total.branch_constraints += hints.branch_constraints
        total.penalties += hints.penalties
        total.guide_bounds.update(hints.guide_bounds)
        total.neighbour_branches += hints.neighbour_branches
        total.coincidences += hints.coincidences
        total.arrivals += hints.arrivals
        total.chains += hints.chains
        total.alike += hints.alike
        total.followers += hints.followers
        total.fillings += hints.fillings
        total.impacts += hints.impacts
        total.stickings += hints.stickings
        total.drifts += hints.drifts
    return total
