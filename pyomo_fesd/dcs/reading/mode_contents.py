"""Check the contents of modes: components that no mode can contain, and variables that cannot decide or be defined twice."""

from itertools import chain

from pyomo.common.collections import ComponentSet
from pyomo.core import Block, BooleanVar, Constraint, LogicalConstraint, Var
from pyomo.core.expr.visitor import identify_variables
from pyomo.dae import DerivativeVar
from pyomo.gdp import Disjunct
from pyomo.mpec import Complementarity

from pyomo_fesd.core import FesdError, count_of, variables_that_count

#: Types of the components of most disjuncts; one Var is the binary of the indicator.
PLAIN = {BooleanVar, Var, Constraint}
#: Components that a disjunct over time cannot contain (a Disjunct only if it belongs to another tree): cause and fix.
REFUSED_INSIDE = {
    Disjunct: (
        "contains the Disjunct '{}', which belongs to no active Disjunction at the same time",
        "write a Disjunction of the inner disjuncts, or deactivate it",
    ),
    LogicalConstraint: ("contains a LogicalConstraint, '{}'", "state the mode by its region and its equations only"),
    Complementarity: ("contains a Complementarity, '{}'", "declare it outside the disjuncts, over time"),
}


def refuse_contents(tree, modes) -> None:
    """Refuse modes with disjuncts that contain components for which there is no rule."""
    disjuncts = {id(d): d for mode in modes for d in mode.disjuncts}
    for disjunct in disjuncts.values():
        for component in _other_components(disjunct):
            if isinstance(component, DerivativeVar):
                raise FesdError(component, "a DerivativeVar inside a disjunct", "declare it on the block that holds its state")
            if component.ctype in REFUSED_INSIDE and component.active:
                _refuse_active(disjunct, component, tree)


def _other_components(disjunct):
    """The components of a disjunct and of the Blocks in it; none where it holds its indicators and Constraints only, as most do."""
    ctypes = disjunct._ctypes
    if Block in ctypes:
        return disjunct.component_objects(descend_into=Block)
    plain = ctypes.keys() <= PLAIN and count_of(disjunct, Var) == 1
    return () if plain else disjunct.component_map().values()


def _refuse_active(disjunct, component, tree):
    cause, fix = REFUSED_INSIDE[component.ctype]
    known = ComponentSet(tree.disjuncts())
    for inside in component.values():
        if inside.active and inside not in known:
            raise FesdError(disjunct, cause.format(inside.name), fix)


def refuse_derivatives_in_regions(inequalities, variables) -> None:
    """Refuse region conditions (lists of ConstraintData, one a mode) that contain a derivative."""
    for con in chain(*inequalities):
        for v in variables_that_count(con.body):
            if variables.is_derivative(v):
                raise FesdError(
                    con,
                    f"the region condition contains the derivative '{v.name}'",
                    "write the condition on states; a derivative here would make the mode depend on itself",
                )


def refuse_defined_in_regions(disjunction, functions, equations) -> None:
    """Refuse region conditions that contain a variable defined by the modes: it would jump at the switch."""
    defined = ComponentSet(equations.defined)
    for c in functions:
        for v in identify_variables(c, include_fixed=True):
            if v in defined:
                raise FesdError(
                    disjunction,
                    f"the region condition '{c} >= 0' contains '{v.name}', which the modes themselves define",
                    "write the condition on states, or on variables that do not jump at the switch",
                )


def refuse_twice_defined(systems, known) -> None:
    """Refuse a variable that two Disjunctions define.

    Parameters
    ----------
    known : ComponentMap VarData -> DisjunctionData
        the variables that Disjunctions transformed earlier define
    """
    owners = {id(v): disjunction for v, disjunction in known.items()}
    for system in systems:
        for v in system.defined:
            if id(v) in owners:
                raise FesdError(
                    v,
                    f"both '{owners[id(v)].name}' and '{system.disjunction.name}' define it",
                    "let each Disjunction define a contribution of its own, and add them up: m.dx[t] == m.F1[t] + m.F2[t]",
                )
            owners[id(v)] = system.disjunction
