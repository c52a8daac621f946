"""Read a Pyomo model as an MPCC: its pairs, the pairs that each branch decides, its hints (theory, eq. 14)."""

from dataclasses import dataclass, field

from pyomo.core import Block, Objective
from pyomo.mpec import Complementarity

from pyomo_fesd.core import FesdError, HomotopyHints, Mixed, all_hints, read_complementarity


@dataclass(frozen=True)
class Condition:
    """One scalar pair 0 <= G perp H >= 0, with the ComplementarityData that it comes from."""

    source: object
    G: object
    H: object

    @property
    def name(self) -> str:
        """Name of the Complementarity, for messages."""
        return self.source.name


@dataclass(frozen=True)
class Decision:
    """A pair that the homotopy leaves out and the branch decides (eq. 13): where ``eta`` is positive, ``constraint`` holds.

    The constraint is inactive in the model.  A branch that has no solution with a ``tentative`` decision is solved without it.
    """

    eta: object
    constraint: object
    tentative: bool


@dataclass
class Mpcc:
    """A model read as an MPCC.

    Attributes
    ----------
    model : Block
    hints : HomotopyHints
    objective : ObjectiveData or None
    sources : list of ComplementarityData, every active condition
    conditions : list of Condition
    mixed : list of (ComplementarityData, Mixed)
        conditions l <= B <= u perp F; each becomes two pairs with two auxiliary variables when it is compiled
    decisions : list of Decision
    """

    model: object
    hints: HomotopyHints
    objective: object = None
    sources: list = field(default_factory=list)
    conditions: list = field(default_factory=list)
    mixed: list = field(default_factory=list)
    decisions: list = field(default_factory=list)


def read_mpcc(model: Block) -> Mpcc:
    """Read ``model``; nothing is changed.  Its active components are constraints, conditions and at most one objective.

    Raises
    ------
    FesdError
        for more than one objective, and for conditions that are not pairs
    """
    problem = Mpcc(model, all_hints(model), _objective(model))
    decided = {id(hint.pair): hint for hint in problem.hints.branch_constraints}
    for source in model.component_data_objects(Complementarity, active=True, descend_into=Block):
        problem.sources.append(source)
        condition, hint = read_complementarity(source), decided.get(id(source))
        if isinstance(condition, Mixed):
            problem.mixed.append((source, condition))
        elif hint is not None:
            problem.decisions.append(Decision(condition.H, hint.constraint, hint.tentative))
        else:
            problem.conditions.append(Condition(source, *condition))
    return problem


def _objective(model):
    found = list(model.component_data_objects(Objective, active=True, descend_into=Block))
    if len(found) > 1:
        raise FesdError(
            found[1], f"{len(found)} active objectives, the first is '{found[0].name}'", "deactivate all but one objective"
        )
    return found[0] if found else None
