"""A pump that level switches turn on and off (relay).

    empties:   on from L = high down to L = low            fills:   on from L = low up to L = high

Takes: the level, the two switches, the flow, and the pump's rate.
Leaves: the Disjuncts ``running`` and ``stopped`` with their Disjunction ``switch``.
Does not apply: to a pump whose speed is controlled (``saturation``).
"""

from pyomo_fesd.units.relay import relay


def pump(*sets, level, low, high, flow, rate, fills=False, start='stopped'):
    """A pump between two level switches.

    Name the Block in ``memory``: ``TransformationFactory('fesd.dcs').apply_to(m, memory=[m.pump])``.

    Parameters
    ----------
    sets : Set, ...
        index sets, the ContinuousSet among them
    level : Var, Expression, expression or function (block, index, ...) -> expression
    low, high : number, Param, expression or function
        the level switches
    flow : Var over ``sets``
        what the pump conveys, which nothing else defines
    rate : number, Var, Expression, expression or function
        the flow while it runs, e.g. a pump curve
    fills : bool
        whether it fills the vessel or empties it
    start : 'stopped', 'running' or None
        at the first time; None: free

    Returns
    -------
    Block over ``sets``, to be added to the model

    Raises
    ------
    FesdError
        as ``relay``
    """
    acts = 'below' if fills else 'above'
    return relay(
        *sets, signal=level, low=low, high=high, output=flow, on=rate, acts=acts, start=start, names=('running', 'stopped')
    )
