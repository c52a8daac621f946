"""Which variables are continuous in time, found from the equations.

Cross complementarity lets a side that is continuous enter with its value at the left boundary of an element (theory, eq. 11),
so a switch cannot hide between two elements.  Continuous are differential states; what ``fesd.dcs`` and the kinks have marked,
where the quantity that switches is continuous itself; algebraic variables that equations tie to continuous ones; and what the
user names with the keyword ``continuous``.  Held controls and fixed inputs are continuous inside a control stage and may jump at
its boundaries.

Only the equations of the times that are asked about are read, in general those of one time.
"""

from dataclasses import dataclass
from functools import partial

from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.core import Constraint, Param, Var

from pyomo_fesd import marks
from pyomo_fesd.elements.equations import Equations, rule_of, variables_of
from pyomo_fesd.errors import FesdError
from pyomo_fesd.timeindex import derivatives, is_indexed_by


@dataclass(frozen=True)
class Continuity:
    """What is continuous, for components over time or their data at the times that were asked about.

    Attributes
    ----------
    rules : ComponentMap Var -> Constraint, Complementarity or Expression
        what ties each marked variable to the states
    inside : Known
        continuous inside every control stage
    across : Known
        continuous at the boundaries of control stages too
    equations : Equations or None
        the algebraic equations, where they were read
    """

    rules: ComponentMap
    inside: object
    across: object
    equations: object

    def holds(self, expr):
        """Whether ``expr`` is a function of variables that are continuous inside every stage."""
        return _all_in(expr, self.inside)

    def jumps_at_stages(self, expr):
        """Whether ``expr`` contains a held control, or something that follows from one."""
        return not _all_in(expr, self.across)

    def rule(self, expr):
        """The Constraint that ties a marked variable to the states; None for any other side."""
        rule = rule_of(expr, self.rules) if expr.is_variable_type() else None
        return rule if rule is not None and rule.ctype is Constraint else None

    def curved(self, expr):
        """Whether ``expr``, or an equation that its variables follow from, is nonlinear."""
        known = Known(_is_fixed, self.inside.given)
        return any(e.polynomial_degree() not in (0, 1) for e in self.equations.behind(expr, self.rules, known))

    def add(self, variable, rule, expr):
        """Let a generated ``variable`` be as continuous as ``expr``, to which the Constraint ``rule`` ties it."""
        for known in (self.inside, self.across):
            if _all_in(expr, known):
                known.given.add(variable)
        self.rules[variable] = rule


class Known:
    """Variables that are continuous: components or data.

    Attributes
    ----------
    given : ComponentSet
        by themselves
    tied : ComponentSet
        by equations
    constant : callable VarData -> bool
        which others are, because they are fixed
    """

    def __init__(self, constant, *given):
        self.constant = constant
        self.given = ComponentSet(v for some in given for v in some)
        self.tied = ComponentSet()

    def __contains__(self, v):
        component = v.parent_component()
        return v in self.given or component in self.given or v in self.tied or component in self.tied or self.constant(v)


def _all_in(expr, known):
    variables = list(variables_of(expr)) if hasattr(expr, 'is_expression_type') else []
    return bool(variables) and all(v in known for v in variables)


def inner_label(family, wrt):
    """The first of the times of ``family`` that is not the first of all: where it is asked what is continuous."""
    return next((t for t in wrt if t in family and t != wrt.first()), None)


def each(variables):
    """The components themselves; of a Reference its data, which belong to other components."""
    return [v for c in variables for v in (c.values() if c.is_reference() else [c])]


def check_told(told, held, wrt):
    """Refuse what cannot be said to be continuous in time.

    Raises
    ------
    FesdError
        for what is no Var over time, and for controls that are held
    """
    for v in told:
        if getattr(v, 'ctype', None) is not Var or not is_indexed_by(v, wrt):
            raise FesdError(v, f"continuous: this is no Var indexed by '{wrt.name}'", "give Vars over the ContinuousSet, e.g. m.y")
        if any(v is u for u in held):
            raise FesdError(v, "continuous: it is held on each stage, so it jumps", "leave it out of one of the two keywords")


def read_continuity(model, times, labels, held, told, trace):
    """Find the continuous variables of a discretised model.

    Parameters
    ----------
    times : TimeIndex
    labels : set of float
        the times to look at
    held : list of Var
        controls that are constant on each stage
    told : list of Var
        variables of which the user says that they are continuous
    trace : bool
        whether algebraic variables matter in any case: they do not where ``fesd.dcs`` wrote every condition, on a single stage
    """
    rules = ComponentMap(marks.marked(model, marks.CONTINUOUS))
    trace = trace or any(r.ctype is not Constraint for r in rules.values())
    equations = Equations(model, times, labels, rules) if trace else None
    states = (d.get_state_var() for d in derivatives(model, times.wrt))
    start, held = each([*states, *told]), each(held)
    inside = _closure(Known(_is_fixed, start, held), rules, equations)

    def keeps_value(v):
        among = v.parent_component()
        return _is_fixed(v) and (
            times.time(v) is None or (among.is_indexed() and all(_is_fixed(u) and u.value == v.value for u in among.values()))
        )

    across = _across(Known(keeps_value, start), rules, held, inside, equations) if trace else inside
    return Continuity(rules, inside, across, equations)


def _is_fixed(v):
    return not v.is_indexed() and (v.ctype is Param or v.fixed)


def _across(start, rules, held, inside, equations):
    """What is continuous without held controls, and without marks on what follows from them."""
    held, late = Known(_never, held), {}
    while True:
        across = _closure(Known(start.constant, start.given), rules, equations, late)
        jumps = partial(_jumps, held, inside, across)
        marked = [rule for rule in rules.values() if rule.ctype is Constraint]
        found = {id(rule): equations.mentioning(rule, jumps) for rule in marked}
        if found == late:
            return across
        late = found


def _never(v):
    return False


def _jumps(held, inside, across, v):
    """Whether ``v`` is continuous inside the stages only."""
    return v in held or (v in inside and v not in across)


def _closure(known, rules, equations, late=None):
    """``known`` and all that follows from it.

    Parameters
    ----------
    late : dict, optional
        by id of a Constraint, the indices at which it ties nothing
    """
    for v, rule in rules.items():
        if rule.ctype is Constraint:
            jumping = late.get(id(rule)) if late else None
            known.given.update(equations.tied_by(v, rule, jumping) if jumping else [v])
    if equations is None:
        return known
    known.tied.update(equations.tied(known))
    return known
