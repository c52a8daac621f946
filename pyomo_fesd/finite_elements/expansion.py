"""Discretise with pyomo.dae, and expand hybrid components too; the caller undoes the changes if it fails.

``dae.collocation`` raises on a Disjunct, Disjunction or Complementarity over time (Pyomo issue #3101) and leaves the model half
expanded.  Here, while pyomo.dae works, Disjuncts and Complementarities have the type Block (which expands by its rule),
Disjunctions and LogicalConstraints the type Suffix (which is passed over); these get their new indices by their rule afterwards.
So do Disjuncts that hold nothing that pyomo.dae would expand, as most do: it would walk over their contents at every time.
"""

from collections.abc import Sequence
from contextlib import contextmanager

from pyomo.core import (
    Block,
    BooleanVar,
    Constraint,
    Expression,
    LogicalConstraint,
    Objective,
    Param,
    Piecewise,
    Set,
    SOSConstraint,
    Suffix,
    Var,
)
from pyomo.core.base.block import BlockData
from pyomo.core.base.misc import apply_indexed_rule
from pyomo.dae import ContinuousSet, DerivativeVar, Integral
from pyomo.gdp import Disjunct, Disjunction
from pyomo.mpec import Complementarity

from pyomo_fesd.core import (
    DeferredInterrupt,
    FesdError,
    TimeIndex,
    all_switched_systems,
    is_discretisation_equation,
    is_generated,
    is_indexed_by,
    label_decimals,
    make_data,
    own_components,
    own_data,
    paused_collection,
    withheld_messages,
)
from pyomo_fesd.finite_elements.collocation import Collocation
from pyomo_fesd.finite_elements.given_inputs import complete_params, fix_at_new_times, read_fixed_inputs
from pyomo_fesd.finite_elements.objectives import objectives_as_stated

#: Types over time that pyomo.dae expands itself, or correctly ignores.
NATIVE = (Var, Constraint, Expression, Block, DerivativeVar, Param, Suffix, Integral, Piecewise, ContinuousSet)
#: Types over time that are treated here.
HYBRID = (Disjunct, Disjunction, Complementarity, LogicalConstraint)
#: Those of them that get their new indices when pyomo.dae has finished, in this order: logic refers to disjuncts.
AFTERWARDS = (Disjunction, LogicalConstraint)
#: Types of components of which pyomo.dae expands nothing where they are scalar.
SIMPLE = {Constraint, Var, BooleanVar, Expression, Param}
#: Types over time that cannot be expanded, each with an alternative.
REFUSED = {
    Objective: "write one Objective, e.g. with a pyomo.dae.Integral",
    SOSConstraint: "put it in a Block over time, or declare it after the discretisation",
    BooleanVar: "let the state decide the mode, by the regions of a Disjunction; write logic between their indicators",
    Set: "use a Set that does not depend on time",
}
PLACES = (Block, Disjunct)


def discretise(block: Block, wrt: ContinuousSet, shares: list[int], ncp: int, scheme: str, controls: Sequence = ()) -> None:
    """Put elements of ``ncp`` points on ``wrt``, ``shares`` of them in each control stage, and expand everything over it.

    Parameters
    ----------
    controls : sequence of components
        whose new times get the value of their control stage later

    Raises
    ------
    FesdError
        for components over time that cannot be expanded, rules that fail at a new time, and inputs that are given at the present
        times only
    """
    _refuse_unexpandable(block, wrt)
    with paused_collection():
        inputs = read_fixed_inputs(block, wrt, controls)
        decimals = label_decimals(wrt, shares, ncp)
        place_boundaries(wrt, shares, decimals)
        try:
            with objectives_as_stated(block), hybrid_expansion(block, wrt):
                Collocation(decimals).apply_to(block, wrt=wrt, nfe=sum(shares), ncp=ncp, scheme=scheme)
                # here, since Disjuncts that are made afterwards are complete, or their rules raise
                call_rules_again(block, wrt)
        except (KeyError, ValueError) as error:
            complete_params(block, wrt, controls, error)
            raise FesdError(
                wrt,
                f"a rule failed at a new time: {error}",
                "give its data for all times; if this model is a clone, its rules may still refer to the original: use "
                "d.model().x[t] instead of m.x[t]",
            ) from error
        fix_at_new_times(inputs, wrt)


def call_rules_again(block, wrt):
    """Call rules of Constraints again that left out an index: Pyomo treats a KeyError in a rule as Skip, and loses the equation."""
    for component in own_components(block, Constraint, PLACES):
        if not is_indexed_by(component, wrt) or component.rule is None or len(component) == len(component.index_set()):
            continue
        if not is_discretisation_equation(component) and not is_generated(component):
            for index in (i for i in component.index_set() if i not in component._data):
                component.rule(component.parent_block(), index)


def place_boundaries(wrt: ContinuousSet, shares: list[int], decimals: int) -> None:
    """Divide each control stage (between two present points) into elements of equal length, with labels of so many decimals."""
    stages = list(wrt)
    for left, right, each in zip(stages, stages[1:], shares):
        for k in range(1, each):
            wrt.add(round(left + k * (right - left) / each, decimals))
    wrt._fe = list(wrt)
    wrt.set_changed(True)


def _refuse_unexpandable(block, wrt):
    """Refuse components over time that cannot be expanded."""
    for component in block.component_objects(descend_into=PLACES):
        if is_indexed_by(component, wrt) and not is_generated(component):
            if component.ctype in HYBRID:
                _check_rule(component)
            elif component.ctype not in NATIVE and not isinstance(component, Var):
                raise FesdError(
                    component,
                    f"components of type {component.ctype.__name__} over time cannot be discretised",
                    REFUSED.get(component.ctype, "put it in a Block over time, or declare it after the discretisation"),
                )


def _check_rule(component):
    if _index_rule(component) is None and len(component):
        raise FesdError(
            component,
            f"this {component.ctype.__name__} over time was filled by hand: it has no rule for new times",
            "declare it with a rule, e.g. @m.Disjunct(m.t)",
        )


def _index_rule(component):
    """The rule by which a hybrid component gets its indices."""
    return component._rule if component.ctype in (Disjunct, LogicalConstraint) else component._init_rule


@contextmanager
def hybrid_expansion(block: Block, wrt: ContinuousSet):
    """Within the body, let pyomo.dae's discretisation of ``wrt`` expand hybrid components too."""
    hybrid = [c for c in block.component_objects(HYBRID, descend_into=PLACES) if c.parent_component() is c]
    off, simple = _switched_off(block, wrt), [c for c in hybrid if _is_simple(c, wrt)]
    types = [(c, Suffix if any(c is s for s in simple) or _is_passed_over(c) else Block) for c in hybrid]
    with DeferredInterrupt() as interrupt, _reclassified(types), withheld_messages('pyomo.dae'), interrupt.raising():
        yield
    with withheld_messages('pyomo.core'):
        for disjunct in simple:
            _make_missing(disjunct)
    for ctype in AFTERWARDS:
        for component in hybrid:
            if component.ctype is ctype and is_indexed_by(component, wrt) and _index_rule(component) is not None:
                _expand(component)
    _switch_off_again(block, wrt, off)


@contextmanager
def _reclassified(types):
    """Within the body, let components have other types; their order in the model does not change."""
    own = [(component, component.ctype) for component, _ in types]
    for component, ctype in types:
        component.parent_block().reclassify_component_type(component, ctype)
    try:
        yield
    finally:
        for component, ctype in own:
            component.parent_block().reclassify_component_type(component, ctype)


def _is_passed_over(component):
    """Whether pyomo.dae passes over a hybrid component, as over Suffixes; it expands the others like Blocks, by their rule."""
    empty = component.is_indexed() and _index_rule(component) is None and not len(component)
    return component.ctype in AFTERWARDS or is_generated(component) or not component.index_set().isfinite() or empty


def _is_simple(component, wrt):
    """Whether a component is a Disjunct over time in which pyomo.dae would expand nothing."""
    if component.ctype is not Disjunct or not is_indexed_by(component, wrt) or _is_passed_over(component):
        return False
    return all(inner.ctype in SIMPLE and not inner.is_indexed() for d in component.values() for inner in d.component_map().values())


def _make_missing(disjunct):
    """Make the missing data of a Disjunct by its rule."""
    for index in disjunct.index_set():
        if index not in disjunct._data:
            # as ``disjunct[index]`` does when it has searched the index set
            data = make_data(disjunct, index)
            returned = disjunct._rule(data, index)
            if isinstance(returned, BlockData) and returned is not data:
                data.transfer_attributes_from(returned)


def _hybrid_over_time(block, wrt):
    """``(type, name, data)`` of all hybrid components over time."""
    times = TimeIndex(wrt)
    for ctype in HYBRID:
        for name, by_time in times.families_in(own_components(block, ctype, PLACES)).items():
            yield ctype, name, by_time.values()


def _switched_off(block, wrt):
    """Type and name of hybrid components that are off at every present time, by the user's will and not by a transformation."""
    if all(map(_in_use, own_data(block, HYBRID, PLACES))):
        return set()
    excluded = all_switched_systems(block.model()).excluded
    found = _hybrid_over_time(block, wrt)
    return {(ctype, name) for ctype, name, datas in found if not any(c in excluded or _in_use(c) for c in datas)}


def _in_use(data):
    """Whether a hybrid component is active, or inactive only because a transformation has replaced it."""
    if data.active or is_generated(data):
        return True
    disjuncts = [data] if data.ctype is Disjunct else getattr(data, 'disjuncts', [])
    return any(d.transformation_block is not None for d in disjuncts)


def _switch_off_again(block, wrt, off):
    """Deactivate at the new times the components that were off at every time that the model had."""
    for ctype, name, datas in _hybrid_over_time(block, wrt) if off else ():
        for data in datas if (ctype, name) in off else ():
            if data.active:
                data.deactivate()


def _expand(component):
    """Give a Disjunction or LogicalConstraint its missing indices by its own rule."""
    block = component.parent_block()
    for index in component.index_set():
        if index not in component._data:
            if component.ctype is Disjunction:
                stated = apply_indexed_rule(component, component._init_rule, block, index)
            else:
                stated = component.rule(block, index)
            if stated is not component.Skip:
                component[index] = stated
