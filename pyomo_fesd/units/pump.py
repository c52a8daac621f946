"""A pump that level switches turn on and off (``relay``).

    empties:   on from L = high down to L = low            fills:   on from L = low up to L = high

Takes: the level, the two switches, the flow, and the pump's rate.
Leaves: the Disjuncts ``running`` and ``stopped`` with their Disjunction ``switch``.
Does not apply: to a pump whose speed is controlled (``saturation``).
"""

from pyomo.core import Block

from pyomo_fesd.units.relay import relay


def pump(*sets, level, low, high, flow, rate, fills: bool = False, start='stopped') -> Block:
    """Return a Block over ``sets`` with a pump between two level switches.

    Name the Block in ``hysteresis``: ``TransformationFactory('fesd.dcs').apply_to(m, hysteresis=[m.pump])``.

    Parameters
    ----------
    sets : Set, ...
        index sets, the ContinuousSet among them
    level, low, high : number, Param, Var, Expression, expression or function (block, index, ...) -> expression
        the level and its switches
    flow : Var over ``sets``
        the flow through the pump, defined by nothing else
    rate : number, Var, Expression, expression or function
        the flow while it runs, e.g. a pump curve
    fills : bool
        whether it fills the vessel or empties it
    start : 'stopped', 'running' or None
        at the first time; None: free

    Raises
    ------
    FesdError
        as ``relay``
    """
    names = ('running', 'stopped')
    acts = 'below' if fills else 'above'
    return relay(*sets, signal=level, low=low, high=high, output=flow, on=rate, acts=acts, start=start, names=names)
