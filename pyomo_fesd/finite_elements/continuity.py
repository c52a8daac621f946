"""Find from the equations which variables are continuous in time.

Cross complementarity lets a side that is continuous enter with its value at the left boundary of an element (theory, eq. 11),
so a switch cannot hide between two elements.  Continuous are differential states; variables that ``SwitchedSystems`` ties to a
continuous quantity; algebraic variables that equations tie to continuous ones; and those that the user names with the keyword
``continuous``.  Held controls and fixed inputs are continuous inside a control stage and may jump at its boundaries.

Only the equations at the requested times are read, in general those of one time.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial

from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.core import Block, Constraint, Param, Var
from pyomo.dae import ContinuousSet

from pyomo_fesd.core import FesdError, TimeIndex, all_switched_systems, derivatives, is_indexed_by
from pyomo_fesd.finite_elements.algebraic_graph import AlgebraicGraph, rule_of, variables_of
from pyomo_fesd.finite_elements.monotone_conditions import monotone_conditions


class Known:
    """Variables that are continuous: components or data.

    Attributes
    ----------
    given : ComponentSet
        by themselves
    tied : ComponentSet
        by equations
    constant : callable VarData -> bool
        whether another one is, because it is fixed
    """

    def __init__(self, constant: Callable, *given: Iterable):
        self.constant = constant
        self.given = ComponentSet(v for some in given for v in some)
        self.tied = ComponentSet()

    def __contains__(self, v):
        component = v.parent_component()
        return v in self.given or component in self.given or v in self.tied or component in self.tied or self.constant(v)

    def determines(self, expr) -> bool:
        """Whether ``expr`` is a function of these variables."""
        variables = list(variables_of(expr)) if hasattr(expr, 'is_expression_type') else []
        return bool(variables) and all(v in self for v in variables)


@dataclass(frozen=True)
class Continuity:
    """The continuous variables, as components over time or their data at the requested times.

    Attributes
    ----------
    rules : ComponentMap Var -> Constraint, Complementarity or Expression
        the component that ties a variable to the states
    inside : Known
        continuous inside every control stage
    across : Known
        continuous at the boundaries of control stages too
    graph : AlgebraicGraph or None
        the algebraic equations, where they were read
    """

    rules: ComponentMap
    inside: Known
    across: Known
    graph: AlgebraicGraph | None

    def holds(self, expr) -> bool:
        """Whether ``expr`` is a function of variables that are continuous inside every control stage."""
        return self.inside.determines(expr)

    def jumps_at_stages(self, expr) -> bool:
        """Whether ``expr`` contains a held control, or a variable that follows from one."""
        return not self.across.determines(expr)

    def rule(self, expr) -> Constraint | None:
        """Return the Constraint that ties a variable to the states; None for any other side."""
        rule = rule_of(expr, self.rules) if expr.is_variable_type() else None
        return rule if rule is not None and rule.ctype is Constraint else None

    def curved(self, expr) -> bool:
        """Whether ``expr``, or an equation that its variables follow from, is nonlinear."""
        known = Known(_is_fixed, self.inside.given)
        return any(e.polynomial_degree() not in (0, 1) for e in self.graph.definitions(expr, known))

    def add(self, variable, rule: Constraint, expr) -> None:
        """Let a generated ``variable`` be as continuous as ``expr``, to which the Constraint ``rule`` ties it."""
        for known in (self.inside, self.across):
            if known.determines(expr):
                known.given.add(variable)
        self.rules[variable] = rule


def inner_label(by_time: dict, wrt: ContinuousSet) -> float | None:
    """Return the first of the times of a condition that is not the first of all, at which continuity is read."""
    return next((t for t in wrt if t in by_time and t != wrt.first()), None)


def _components_or_data(variables):
    """The components themselves; of a Reference its data, which belong to other components."""
    return [v for c in variables for v in (c.values() if c.is_reference() else [c])]


def check_continuous(continuous: list, controls: list, wrt: ContinuousSet) -> None:
    """Refuse components that cannot be continuous in time.

    Raises
    ------
    FesdError
        for components that are not Vars over time, and for controls that are held
    """
    for v in continuous:
        if getattr(v, 'ctype', None) is not Var or not is_indexed_by(v, wrt):
            raise FesdError(v, f"continuous: not a Var indexed by '{wrt.name}'", "give Vars over the ContinuousSet, e.g. m.y")
        if any(v is u for u in controls):
            raise FesdError(
                v, "continuous: it is held on each control stage, so it jumps", "leave it out of one of the two keywords"
            )


def read_continuity(
    model: Block, times: TimeIndex, labels: set[float], controls: list, continuous: list, trace: bool
) -> Continuity:
    """Find the continuous variables of a discretised model.

    Parameters
    ----------
    times : TimeIndex
    labels : set of float
        the times whose equations are read
    controls : list of Var
        constant on each control stage
    continuous : list of Var
        continuous by the user's word
    trace : bool
        whether algebraic variables matter in any case: not where ``fesd.dcs`` wrote every condition, on a single control stage
    """
    rules = all_switched_systems(model).continuous
    rules.update(monotone_conditions(model, times, labels, rules))
    trace = trace or any(r.ctype is not Constraint for r in rules.values())
    graph = AlgebraicGraph(model, times, labels, rules) if trace else None
    states = (d.get_state_var() for d in derivatives(model, times.wrt))
    start, held = _components_or_data([*states, *continuous]), _components_or_data(controls)
    inside = _continuous_closure(Known(_is_fixed, start, held), rules, graph)
    across = _across(start, times, rules, held, inside, graph) if trace else inside
    return Continuity(rules, inside, across, graph)


def _is_fixed(v):
    return not v.is_indexed() and (v.ctype is Param or v.fixed)


def _keeps_value(times, v):
    """Whether ``v`` is fixed to the same value at all times."""
    if not _is_fixed(v):
        return False
    among = v.parent_component()
    return times.time(v) is None or (among.is_indexed() and all(_is_fixed(u) and u.value == v.value for u in among.values()))


def _across(start, times, rules, controls, inside, graph):
    """The continuous variables without held controls, and without rules of variables that follow from them."""
    controls, jumping = Known(lambda v: False, controls), {}
    constraints = [rule for rule in rules.values() if rule.ctype is Constraint]
    while True:
        across = _continuous_closure(Known(partial(_keeps_value, times), start), rules, graph, jumping)
        jumps = partial(_jumps_between_stages, controls, inside, across)
        found = {id(rule): graph.mentioning(rule, jumps) for rule in constraints}
        if found == jumping:
            return across
        jumping = found


def _jumps_between_stages(controls, inside, across, v):
    """Whether ``v`` is continuous inside the control stages only."""
    return v in controls or (v in inside and v not in across)


def _continuous_closure(known, rules, graph, jumping=None):
    """``known`` and all variables that follow from it.

    Parameters
    ----------
    jumping : dict, optional
        by id of a Constraint, the indices at which it ties nothing
    """
    for v, rule in rules.items():
        if rule.ctype is Constraint:
            apart = jumping.get(id(rule)) if jumping else None
            known.given.update(graph.tied_by(v, rule, apart) if apart else [v])
    if graph is not None:
        known.tied.update(graph.tied(known))
    return known
