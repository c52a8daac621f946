"""Switching functions with one multiplier, c = p - n (theory, eq. 5), read back from the conditions that ``fesd.dcs`` made."""

from dataclasses import dataclass

from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.core import Block, Constraint, value
from pyomo.mpec import Complementarity

from pyomo_fesd import marks
from pyomo_fesd.complementarity import read
from pyomo_fesd.timeindex import TimeIndex, strip_time

#: A function that is nowhere larger than this is zero.
LEAST = 1e-3


@dataclass(frozen=True)
class SwitchingFunction:
    """One switching function over time.

    Attributes
    ----------
    name : str
        of the Disjunction
    nu : dict label -> VarData
        the multiplier of its positive side
    c : dict label -> expression
    """

    name: str
    nu: dict
    c: dict


def switching_functions(model, wrt):
    """The switching functions of a transformed model; Stewart's lam belong to modes, so that form has none."""
    rules = ComponentMap(marks.marked(model, marks.CONTINUOUS))
    selectors = ComponentSet(v for v, _ in marks.marked(model, marks.SELECTOR))
    times, found = TimeIndex(wrt), {}
    for component in model.component_objects(Complementarity, descend_into=Block):
        parts = component.parent_block().component('p')
        if parts is None or not marks.is_generated(component):
            continue
        for condition in component.values():
            nu, n = read(condition)
            rule = rules.get(n.parent_component()) if is_variable(n) and is_variable(nu) else None
            if rule is not None and rule.ctype is Constraint and (nu in selectors or nu.parent_component() in selectors):
                label, name = times.split(condition)
                family = found.setdefault(name, SwitchingFunction(public_name(name), {}, {}))
                equation = rule[n.index()]
                # c == p - n
                family.nu[label], family.c[label] = nu, equation.body - equation.upper + parts[n.index()] - n
    return list(found.values())


def size(functions):
    """The largest value of a function of time, given as {label: expression}; not less than what solvers leave of zero."""
    return max([LEAST, *(abs(value(c)) for c in functions.values())])


def is_variable(expr):
    """Whether a side is a plain variable."""
    return getattr(expr, 'is_variable_type', bool)()


def public_name(name):
    """A family's name for people: the Disjunction or mode without time and without the package's own blocks."""
    parts = [p for p in strip_time(name).split('.') if not p.startswith(marks.GENERATED)]
    return '.'.join(parts[:-1]) or parts[-1]
