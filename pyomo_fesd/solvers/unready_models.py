"""Refuse models that are not ready for a solver: active components that it would ignore, and a time that is not discretised."""

from pyomo.core import Block, LogicalConstraint, SOSConstraint
from pyomo.core.expr.compare import compare_expressions
from pyomo.core.expr.visitor import identify_variables
from pyomo.dae import DerivativeVar, Integral
from pyomo.gdp import Disjunct, Disjunction
from pyomo.mpec import Complementarity

from pyomo_fesd.core import (
    FesdError,
    all_switched_systems,
    continuous_sets,
    discretised,
    moving_grids,
    refuse_no_model,
    variables_below,
)
from pyomo_fesd.finite_elements import refuse_first_modes

#: Components that must not be active -> fix.
REFUSED = {
    Disjunction: "apply fesd.dcs (over time) or a pyomo.gdp transformation first",
    Disjunct: "deactivate it, or apply fesd.dcs (over time) or a pyomo.gdp transformation first",
    LogicalConstraint: "apply core.logical_to_linear and a GDP transformation, or deactivate it",
    SOSConstraint: "write it as a Complementarity, or deactivate it",
    DerivativeVar: "discretise the model first, e.g. with fesd.finite_elements",
}
INTEGERS = "pyomo_fesd.decide_integers solves for its values one after the other; or fix it, or relax its domain"


def refuse_integers(variables, solver: str) -> None:
    """Refuse free integer variables.

    Those that a solver has read may lie where ``refuse_unready`` does not look, such as on a block that is not active.
    """
    for v in variables:
        if not v.is_continuous():
            raise FesdError(v, f"an integer variable, which {solver} does not decide", INTEGERS)


def refuse_unready(model: Block, solver: str) -> None:
    """Check that ``solver`` (its name) can solve ``model``.

    Raises
    ------
    FesdError
        for active Disjunctions, logic, SOS, derivatives and integrals, for integer variables, for modes with hysteresis or
        state jumps on elements that do not move, and for a first mode outside of its region
    """
    refuse_no_model(model, solver)
    if next(model.component_data_objects(tuple(REFUSED), active=True, descend_into=Block), None) is not None:
        _refuse_first(model, solver)
    for integral in model.component_objects(Integral, active=True, descend_into=Block):
        _refuse_stale(integral, solver)
    refuse_integers((v for v in variables_below(model, active=True) if not v.fixed), solver)
    grids = moving_grids(model)
    for component, kind in _need_moving_elements(model):
        if not any(wrt in grids for wrt in continuous_sets(component)):
            raise FesdError(component, f"{kind} on a grid whose elements do not move", "apply fesd.finite_elements first")
    _refuse_half_scaled(model, solver)
    refuse_first_modes(model)


def _refuse_first(model, solver):
    """Refuse the first component that must not be active, in the order of ``REFUSED``."""
    for ctype, fix in REFUSED.items():
        found = next(model.component_data_objects(ctype, active=True, descend_into=Block), None)
        if found is not None:
            raise FesdError(found, f"an active {ctype.__name__}, which {solver} does not handle", fix)


def _refuse_half_scaled(model, solver):
    """Refuse pairs with variables that ``core.scale_model`` has scaled: it changes Constraints, and no Complementarity."""
    factors = getattr(model.model(), 'component_scaling_factor_map', None)
    for pair in model.component_data_objects(Complementarity, active=True, descend_into=Block) if factors is not None else ():
        for side in getattr(pair, '_args', None) or ():
            for v in identify_variables(side, include_fixed=True) if hasattr(side, 'is_expression_type') else ():
                if factors.get(v, 1.0) != 1.0:
                    raise FesdError(
                        pair,
                        f"core.scale_model has scaled '{v.name}' in Constraints only, so this condition means another value",
                        f"do not apply it: {solver} takes the factors of the Suffix scaling_factor by itself",
                    )


def _refuse_stale(integral, solver):
    """Refuse an Integral over other times than those of its set.

    pyomo.dae builds an Integral again only where it lies on the block that is discretised; one declared afterwards is right.
    """
    wrt = integral.get_continuousset()
    if not discretised(wrt):
        raise FesdError(
            integral, f"an active Integral, which {solver} does not handle", "discretise first, e.g. with fesd.finite_elements"
        )
    for index, data in integral.items():
        if not compare_expressions(data.expr, integral._rule(integral.parent_block(), index)):
            raise FesdError(
                integral,
                f"this Integral is a sum over the times that '{wrt.name}' had before it was discretised: pyomo.dae builds only "
                "those again that lie on the block to which it is applied",
                "declare it after the discretisation, or apply fesd.finite_elements, which builds it again",
            )


def _need_moving_elements(model):
    """Components whose equations only ``fesd.finite_elements`` can write, with their kind."""
    systems = all_switched_systems(model)
    yield from ((mode.disjunction, "a mode with hysteresis") for mode in systems.hysteresis)
    yield from ((reset.block, "a state jump") for reset in systems.resets)
