"""A relief valve with hysteresis: it pops at one pressure and reseats at a lower one (``relay``).

    closed while p <= opens:   F = 0,          open while p >= reseats:   F = capacity

Takes: the pressure and the flow; the capacity as an expression of the states, e.g. k (p - p_atm).
Leaves: the Disjuncts ``open`` and ``closed`` with their Disjunction ``switch``.
Does not apply: to a proportional relief valve, which opens with the excess of pressure: that is a ``weir`` of the pressure.
"""

from pyomo.core import Block

from pyomo_fesd.units.relay import relay


def relief_valve(*sets, pressure, opens, reseats, flow, capacity, start='closed') -> Block:
    """Return a Block over ``sets`` with a valve that is closed up to ``opens`` and, once open, stays open down to ``reseats``.

    Name the Block in ``hysteresis``: ``TransformationFactory('fesd.dcs').apply_to(m, hysteresis=[m.relief])``.

    Parameters
    ----------
    sets : Set, ...
        index sets, the ContinuousSet among them
    pressure, opens, reseats : number, Param, Var, Expression, expression or function (block, index, ...) -> expression
        pressure, set pressure, and the lower pressure at which the valve closes
    flow : Var over ``sets``
        the flow through the valve, defined by nothing else
    capacity : number, Var, Expression, expression or function
        the flow while it is open
    start : 'closed', 'open' or None
        at the first time; None: free

    Raises
    ------
    FesdError
        as ``relay``
    """
    names = ('open', 'closed')
    return relay(*sets, signal=pressure, low=reseats, high=opens, output=flow, on=capacity, start=start, names=names)
