"""Conditions that determine a continuous variable: a diode with a resistor, a valve that needs a pressure drop.

    0 <= G(i, w)  perp  H(i, w) >= 0        G and H grow with i:  0 <= i  perp  v + R i - u >= 0,  i = max(0, (u - v) / R)

For each w there is one i, and it is continuous in w; so the condition is an equation for i, as that of a positive part.

Takes: the pairs of the user at a few times.
Leaves: nothing on the model.
Does not apply: where G or H does not contain i, as of an ideal diode, whose current jumps.
"""

from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.core import Block, value
from pyomo.core.expr.calculus.derivatives import Modes, differentiate
from pyomo.core.expr.calculus.diff_with_pyomo import DifferentiationException
from pyomo.core.expr.visitor import identify_variables
from pyomo.mpec import Complementarity

from pyomo_fesd.core import (
    Pair,
    TimeIndex,
    data_of,
    derivatives,
    is_generated,
    known_sign,
    own_components,
    read_complementarity,
)


def monotone_conditions(model: Block, times: TimeIndex, labels: set[float], known) -> ComponentMap:
    """Return the variables that pairs at some times determine as continuous functions of others: variable -> condition.

    Parameters
    ----------
    known : container of Var and VarData
        variables that have a rule already
    """
    found = ComponentMap()
    dynamic = ComponentSet(v for d in derivatives(model, times.wrt) for v in (d, d.get_state_var()))
    # by component: most are generated, and have a condition at every time
    components = (c for c in own_components(model, Complementarity, Block, active=True) if not is_generated(c))
    for condition in (data for component in components for data in data_of(component)):
        if condition.active and times.time(condition) in labels - {None}:
            v = _determined(read_complementarity(condition))
            if v is not None and not any(u in has for u in (v, v.parent_component()) for has in (dynamic, known, found)):
                found[v] = condition
    return found


def _determined(pair):
    """The variable with which both sides grow: a side of its own, or in both; None without one."""
    if not isinstance(pair, Pair):
        return None
    G, H = (ComponentSet(identify_variables(side)) for side in pair)
    common = sorted((v for v in G if v in H), key=lambda v: not any(side is v for side in pair))
    return next((v for v in common if all(_grows(side, v) for side in pair)), None)


def _grows(side, v):
    """Whether the derivative with respect to v is positive, or not negative by the declared bounds."""
    try:
        slope = differentiate(side, wrt=v, mode=Modes.reverse_symbolic)
    except (DifferentiationException, ArithmeticError):
        return False
    if not hasattr(slope, 'is_potentially_variable') or not slope.is_potentially_variable():
        return value(slope) > 0
    return known_sign(slope) > 0
