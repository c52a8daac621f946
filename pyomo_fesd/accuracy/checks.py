"""What ``refine`` refuses before it begins, and the quantities that it is to look at."""

from math import inf

from pyomo.core import Block, Objective

from pyomo_fesd.errors import FesdError
from pyomo_fesd.timeindex import TimeIndex, derivatives, discretised


def objectives(model):
    """The active objectives."""
    return model.component_data_objects(Objective, active=True, descend_into=Block)


def data_of(quantities):
    """``(component, index)`` of everything that is named; data may be replaced when a round is taken back."""
    named = quantities if isinstance(quantities, (list, tuple)) else [] if quantities is None else [quantities]
    found = []
    for q in named:
        if not hasattr(q, 'is_indexed'):
            raise FesdError(q, f"refine: quantities: this is a {type(q).__name__}, not a component", "give e.g. m.x[2] or m.cost")
        datas = q.values() if q.is_indexed() else [q]
        found += [(d.parent_component(), d.index()) for d in datas]
    return found


def check(model, wrt, tolerance, max_rounds):
    """Refuse numbers and models that cannot be meant."""
    if not 0 < tolerance < inf:
        raise FesdError('tolerance', f"refine: it is {tolerance}", "give a positive number, e.g. 1e-6")
    if max_rounds < 2:
        raise FesdError('max_rounds', f"refine: it is {max_rounds}", "an error is estimated by comparison: give 2 at least")
    if discretised(wrt):
        raise FesdError(wrt, "refine: it is discretised already", "leave fesd.finite_elements to refine")
    if not any(True for _ in objectives(model)):
        times, states = TimeIndex(wrt), [d.get_state_var() for d in derivatives(model, wrt)]
        for v in (v for x in states for v in x.values()):
            if v.fixed and times.time(v) != wrt.first():
                refuse_freedom(v, "fixed after the first time")


def refuse_freedom(v, what="free"):
    """Refuse what a simulation would leave out."""
    raise FesdError(
        v,
        f"refine: it is {what}, and there is no objective",
        "fix inputs, at the end of each stage if they are in piecewise_constant; where something is left to solve for, give an "
        "objective (0 is one)",
    )
