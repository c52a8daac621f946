"""A Pyomo model read as an MPCC: which pairs, which decided pairs, which penalty terms (theory, eq. 14)."""

from dataclasses import dataclass, field

from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.core import Block, LogicalConstraint, Objective, SOSConstraint, Var
from pyomo.dae import DerivativeVar, Integral
from pyomo.gdp import Disjunct, Disjunction
from pyomo.mpec import Complementarity

from pyomo_fesd import marks
from pyomo_fesd.complementarity import Mixed, read
from pyomo_fesd.errors import FesdError

#: Active components that the solver must not pass over in silence.
REFUSED = {
    Disjunction: "apply fesd.dcs (over time) or a pyomo.gdp transformation first",
    Disjunct: "deactivate it, or apply fesd.dcs (over time) or a pyomo.gdp transformation first",
    LogicalConstraint: "apply core.logical_to_linear and a GDP transformation, or deactivate it",
    SOSConstraint: "write it as a Complementarity, or deactivate it",
    Integral: "discretise the model first, e.g. with fesd.finite_elements",
    DerivativeVar: "discretise the model first, e.g. with fesd.finite_elements",
}


#: Marks that only moving elements can give their meaning.
UNDONE = {marks.MEMORY: "a mode with memory", marks.GUARD: "a state jump"}


@dataclass(frozen=True)
class Condition:
    """One scalar pair 0 <= G perp H >= 0, with the component that it came from."""

    source: object
    G: object
    H: object

    @property
    def name(self):
        """Name of the Complementarity, for messages."""
        return self.source.name


@dataclass(frozen=True)
class Decision:
    """A pair that the homotopy leaves out and the branch decides (theory, eq. 13).

    Attributes
    ----------
    source : ComplementarityData
    eta : expression
        where it is positive, ``constraint`` holds
    constraint : ConstraintData
        an inactive equality
    tentative : bool
        whether it is dropped where it leaves no solution
    """

    source: object
    eta: object
    constraint: object
    tentative: bool = False


@dataclass
class Mpcc:
    """What ``mpec_hybrid`` reads from a model.

    Attributes
    ----------
    conditions : list of Condition
    mixed : list of (ComplementarityData, Mixed)
        conditions l <= B <= u perp F, split into two pairs with two auxiliary variables when compiled
    decisions : list of Decision
    penalties : list of (Expression, float)
    artificial : ComponentMap Var -> (low, high)
        variables whose bounds belong to the method, with those that they have in the homotopy
    moves : list of lists of (component, value)
        marks MOVE
    objective : ObjectiveData or None
    sources : list of ComplementarityData
        every active condition
    """

    model: object
    conditions: list = field(default_factory=list)
    mixed: list = field(default_factory=list)
    decisions: list = field(default_factory=list)
    penalties: list = field(default_factory=list)
    artificial: object = field(default_factory=ComponentMap)
    moves: list = field(default_factory=list)
    objective: object = None
    sources: list = field(default_factory=list)


def read_problem(model, solver='mpec_hybrid'):
    """Read ``model`` for ``solver``; nothing is changed.

    Raises
    ------
    FesdError
        for active Disjunctions, logic, SOS, integer variables, more than one objective, and conditions that are no pairs
    """
    _refuse(model, solver)
    problem = Mpcc(model, objective=_objective(model))
    decided = {id(pair): constraint for pair, constraint in marks.marked(model, marks.DECIDED)}
    tentative = ComponentSet(pair for pair, _ in marks.marked(model, marks.TENTATIVE))
    for source in model.component_data_objects(Complementarity, active=True, descend_into=Block):
        problem.sources.append(source)
        condition = read(source)
        if isinstance(condition, Mixed):
            problem.mixed.append((source, condition))
        elif id(source) in decided:
            problem.decisions.append(Decision(source, condition.H, decided[id(source)], source in tentative))
        else:
            problem.conditions.append(Condition(source, *condition))
    problem.penalties = list(marks.marked(model, marks.PENALTY))
    problem.artificial = ComponentMap(marks.marked(model, marks.ARTIFICIAL))
    problem.moves = [list(together) for _, together in marks.marked(model, marks.MOVE)]
    return problem


def _refuse(model, solver):
    for ctype, fix in REFUSED.items():
        found = next(model.component_data_objects(ctype, active=True, descend_into=Block), None)
        if found is not None:
            raise FesdError(found, f"an active {ctype.__name__}, which {solver} does not handle", fix)
    for v in model.component_data_objects(Var, active=True, descend_into=Block):
        if not v.fixed and not v.is_continuous():
            raise FesdError(v, "an integer variable", f"fix it, or relax its domain: {solver} does not decide integers")

    for name, what in UNDONE.items():
        found = next(marks.marked(model, name), None)
        if found is not None:
            raise FesdError(found[0], f"{what} on a grid whose elements do not move", "apply fesd.finite_elements first")


def _objective(model):
    found = list(model.component_data_objects(Objective, active=True, descend_into=Block))
    if len(found) > 1:
        raise FesdError(
            found[1], f"{len(found)} active objectives, the first is '{found[0].name}'", "deactivate all but one objective"
        )
    return found[0] if found else None
