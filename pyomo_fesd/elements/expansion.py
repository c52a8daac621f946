"""pyomo.dae's discretisation, made to expand hybrid components too, and undone if it fails.

``dae.collocation`` raises on a Disjunct, Disjunction or Complementarity over time (Pyomo issue #3101) and leaves the model half
expanded.  Here they take part: while pyomo.dae works, Disjuncts and Complementarities pass as Blocks (which expand by their
rule), Disjunctions and LogicalConstraints step aside and get their new indices by their rule afterwards.
"""

import logging
from contextlib import contextmanager

from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.common.gc_manager import PauseGC
from pyomo.common.log import LoggingIntercept
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
from pyomo.core.base.misc import apply_indexed_rule
from pyomo.dae import ContinuousSet, DerivativeVar, Integral
from pyomo.gdp import Disjunct, Disjunction
from pyomo.mpec import Complementarity

from pyomo_fesd.elements.collocation import Collocation
from pyomo_fesd.elements.restore import restored_on_error
from pyomo_fesd.errors import FesdError
from pyomo_fesd.marks import REPLACED, is_generated, marked
from pyomo_fesd.timeindex import DISCRETISATION, TimeIndex, derivatives, is_indexed_by, strip_time

logger = logging.getLogger('pyomo_fesd')

#: Types over time that pyomo.dae expands itself, or rightly leaves alone.
NATIVE = (Var, Constraint, Expression, Block, DerivativeVar, Param, Suffix, Integral, Piecewise, ContinuousSet)
#: Types over time that are treated here.
HYBRID = (Disjunct, Disjunction, Complementarity, LogicalConstraint)
#: Those of them that get their new indices when pyomo.dae has finished, in this order: logic speaks of disjuncts.
AFTERWARDS = (Disjunction, LogicalConstraint)
#: Types over time that cannot be expanded, and what to do instead.
REFUSED = {
    Objective: "write one Objective, e.g. with a pyomo.dae.Integral",
    SOSConstraint: "put it in a Block over time, or declare it after the discretisation",
    BooleanVar: "let the state decide the mode, by the regions of a Disjunction; write logic between their indicators",
    Set: "use a Set that does not depend on time",
}
PLACES = (Block, Disjunct)
#: Names that one warning lists.
SHOWN = 5


def discretise(block, wrt, shares, ncp, scheme, held=()):
    """Put elements of ``ncp`` points on ``wrt``, ``shares`` of them in each control stage, and expand everything over it.

    Parameters
    ----------
    held : list of components
        controls whose new times get the value of their stage later

    Raises
    ------
    FesdError
        for components over time that cannot be expanded, and rules that fail at a new time
    """
    _check(block, wrt)
    with restored_on_error(block, wrt), PauseGC():
        inputs = _fixed_everywhere(block, wrt, held)
        place_boundaries(wrt, shares)
        try:
            with hybrid_expansion(block, wrt):
                Collocation().apply_to(block, wrt=wrt, nfe=sum(shares), ncp=ncp, scheme=scheme)
            _ask_missing_constraints(block, wrt)
        except KeyError as error:
            raise FesdError(
                wrt,
                f"a rule failed at a new time: {error}",
                "give its data for all times; if this model is a clone, its rules may still refer to the original: use "
                "d.model().x[t] instead of m.x[t]",
            ) from error
    _warn_unfixed(inputs)


def _ask_missing_constraints(block, wrt):
    """Pyomo takes a KeyError in a Constraint's rule for a Skip; ask once more, so that no equation is lost in silence."""
    for component in block.component_objects(Constraint, descend_into=PLACES):
        own = component.local_name.endswith(DISCRETISATION) or is_generated(component)
        if is_indexed_by(component, wrt) and component.rule is not None and not own:
            for index in component.index_set():
                if index not in component._data:
                    component.rule(component.parent_block(), index)


def place_boundaries(wrt, shares):
    """Divide each control stage (gap between the present points) into elements of equal length."""
    stages = list(wrt)
    for left, right, each in zip(stages, stages[1:], shares):
        for k in range(1, each):
            wrt.add(round(left + k * (right - left) / each, 6))
    wrt._fe = list(wrt)
    wrt.set_changed(True)


def _fixed_everywhere(block, wrt, held):
    """Names of variables over time that are fixed at all present points; states excepted, whose ends may both be given."""
    known = ComponentSet([*(d.get_state_var() for d in derivatives(block, wrt)), *(v for u in held for v in (u, *u.values()))])
    variables = block.component_data_objects(Var, descend_into=PLACES)
    fixed = (v for v in variables if v.fixed and v not in known and v.parent_component() not in known)
    families = TimeIndex(wrt).families(fixed)
    return [strip_time(name) for name, family in families.items() if len(family) == len(wrt)]


def _warn_unfixed(names):
    if names:
        more = f' and {len(names) - SHOWN} more' if len(names) > SHOWN else ''
        logger.warning(
            "fixed at every time that the model had, but not at the times that discretisation adds: %s%s. "
            "Fix them again if they are inputs.",
            ', '.join(names[:SHOWN]),
            more,
        )


def _check(block, wrt):
    for component in block.component_objects(descend_into=PLACES):
        if not is_indexed_by(component, wrt) or is_generated(component):
            continue
        if component.ctype in HYBRID:
            if _rule(component) is None and len(component):
                raise FesdError(
                    component,
                    f"this {component.ctype.__name__} over time was filled by hand: it has no rule for new times",
                    "declare it with a rule, e.g. @m.Disjunct(m.t)",
                )
        elif component.ctype not in NATIVE and not isinstance(component, Var):
            raise FesdError(
                component,
                f"components of type {component.ctype.__name__} over time cannot be discretised",
                REFUSED.get(component.ctype, "put it in a Block over time, or declare it after the discretisation"),
            )


def _rule(component):
    """The rule by which a hybrid component gets its indices."""
    return component._rule if component.ctype in (Disjunct, LogicalConstraint) else component._init_rule


@contextmanager
def hybrid_expansion(block, wrt):
    """While this lasts, pyomo.dae's discretisation of ``wrt`` expands hybrid components too."""
    hybrid = [c for c in block.component_objects(HYBRID, descend_into=PLACES) if c.parent_component() is c]
    off = _switched_off(block, wrt)
    aside = [c for c in hybrid if c.ctype in AFTERWARDS or is_generated(c) or not c.index_set().isfinite() or _without(c)]
    waiting = ComponentMap((c, None) for c in aside)
    # pyomo.dae passes over Suffixes, and so over whatever bears their type; nothing changes its place in the model
    passing = [(c, c.ctype, Suffix if c in waiting else Block) for c in hybrid]
    for component, _, disguise in passing:
        component.parent_block().reclassify_component_type(component, disguise)
    try:
        with LoggingIntercept(None, 'pyomo.dae', logging.WARNING):
            yield
    finally:
        for component, ctype, _ in passing:
            component.parent_block().reclassify_component_type(component, ctype)
    for ctype in AFTERWARDS:
        for component in aside:
            if component.ctype is ctype and is_indexed_by(component, wrt) and _rule(component) is not None:
                _expand(component, component.parent_block())
    _switch_off_again(block, wrt, off)


def _without(component):
    """Whether an indexed component has neither rule nor data: nothing to expand."""
    return component.is_indexed() and _rule(component) is None and not len(component)


def _switched_off(block, wrt):
    """Families of hybrid components that are off at every present time, by the user's will and not by a transformation."""
    times, off = TimeIndex(wrt), []
    replaced = ComponentSet(c for c, _ in marked(block.model(), REPLACED))
    for ctype in HYBRID:
        families = times.families(block.component_data_objects(ctype, descend_into=PLACES))
        off += [(ctype, name) for name, family in families.items() if not any(c in replaced or _in_use(c) for c in family.values())]
    return off


def _in_use(data):
    """Whether a hybrid component is active, or inactive only because a transformation has taken its place."""
    if data.active or is_generated(data):
        return True
    disjuncts = [data] if data.ctype is Disjunct else getattr(data, 'disjuncts', [])
    return any(d.transformation_block is not None for d in disjuncts)


def _switch_off_again(block, wrt, off):
    """What was off at every time that the model had stays off at the new ones."""
    if not off:
        return
    times = TimeIndex(wrt)
    for ctype in HYBRID:
        for name, family in times.families(block.component_data_objects(ctype, descend_into=PLACES)).items():
            if (ctype, name) in off:
                for data in family.values():
                    if data.active:
                        data.deactivate()


def _expand(component, home):
    """Give a Disjunction or LogicalConstraint its missing indices by its own rule."""
    for index in component.index_set():
        if index not in component._data:
            if component.ctype is Disjunction:
                stated = apply_indexed_rule(component, component._init_rule, home, index)
            else:
                stated = component.rule(home, index)
            if stated is not component.Skip:
                component[index] = stated
