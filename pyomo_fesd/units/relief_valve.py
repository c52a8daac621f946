"""A relief valve with hysteresis: it pops at one pressure and reseats at a lower one (relay).

    closed while p <= opens:   F = 0,          open while p >= reseats:   F = capacity

Takes: the pressure and the flow; the capacity as an expression of the states, e.g. k (p - p_atm).
Leaves: the Disjuncts ``open`` and ``closed`` with their Disjunction ``switch``.
Does not apply: to a proportional relief valve, which opens with the excess of pressure: that is a ``weir`` of the pressure.
"""

from pyomo_fesd.units.relay import relay


def relief_valve(*sets, pressure, opens, reseats, flow, capacity, start='closed'):
    """Closed up to ``opens``; once open, down to ``reseats``.

    Name the Block in ``memory``: ``TransformationFactory('fesd.dcs').apply_to(m, memory=[m.relief])``.

    Parameters
    ----------
    sets : Set, ...
        index sets, the ContinuousSet among them
    pressure : Var, Expression, expression or function (block, index, ...) -> expression
    opens, reseats : number, Param, expression or function
        set pressure, and the lower one at which it closes
    flow : Var over ``sets``
        what it lets out, which nothing else defines
    capacity : number, Var, Expression, expression or function
        the flow while it is open
    start : 'closed', 'open' or None
        at the first time; None: free

    Returns
    -------
    Block over ``sets``, to be added to the model

    Raises
    ------
    FesdError
        as ``relay``
    """
    switched = dict(signal=pressure, low=reseats, high=opens, output=flow, on=capacity, acts='above', start=start)
    return relay(*sets, **switched, names=('open', 'closed'))
