"""An actuator that saturates: v = mid(low, u, high), one pair for each limit (theory, eq. 8).

    one limit     0 <= v - low  perp  v - u >= 0
    two limits    0 <= s  perp  s - (u - low)/R >= 0,   0 <= (high - v)/R  perp  s - (v - low)/R >= 0,   R = high - low

With two limits s = max(0, u - low)/R and v = min(high, low + R s); division by the range R makes all sides free of units.

Takes: the command u and the output v, a variable.
Leaves: ``lower`` and ``upper``, and with two limits the variable ``s``; no equations.
Does not apply: to limits that cross.
"""

from pyomo.core import Block, Var
from pyomo.mpec import Complementarity, complements

from pyomo_fesd.core import FesdError, switched_systems, value_or_zero
from pyomo_fesd.units.over_time import block_over, refuse_order, variable, with_unit


def saturation(*sets, command, output, low=None, high=None) -> Block:
    """Return a Block over ``sets`` that makes ``output`` follow ``command`` within its limits, exactly and without a parameter.

    For smooth bounds in an existing model see ``fesd.smooth_to_complementarity``.

    Parameters
    ----------
    sets : Set, ...
        index sets, the ContinuousSet among them
    command : Var, Expression, expression or function (block, index, ...) -> expression
        the value requested; of an IDAES PIDController, ``mv_unbounded``
    output : Var over ``sets``
        the actuator's value, defined by nothing else
    low, high : number, Param, expression or function, optional
        one of them, or both

    Raises
    ------
    FesdError
        without a limit, and for limits in the wrong order; when the Block is added, for an output that is not a Var
    """
    if low is None and high is None:
        raise FesdError('saturation', "no limit is given", "give low, high or both")
    refuse_order('saturation', low=low, high=high)
    return block_over(sets, _build_saturation, command=command, output=output, low=low, high=high)


def _build_saturation(block, command, output, low, high):
    output = variable(output, block, 'output')
    if low is None:
        _limit(block, 'upper', output, with_unit(high, output) - output, command - output)
    elif high is None:
        _limit(block, 'lower', output, output - with_unit(low, output), output - command)
    else:
        _limits(block, command, output, with_unit(low, output), with_unit(high, output))


def _limit(block, name, variable, distance, excess):
    """0 <= distance perp excess >= 0, which makes ``variable`` as continuous as the command."""
    pair = Complementarity(expr=complements(distance >= 0, excess >= 0))
    block.add_component(name, pair)
    switched_systems(block).continuous[variable] = pair


def _limits(block, command, output, low, high):
    span = high - low
    above = (command - low) / span
    block.s = Var(bounds=(0, None), initialize=max(0.0, value_or_zero(above)))
    _limit(block, 'lower', block.s, block.s, block.s - above)
    _limit(block, 'upper', output, (high - output) / span, block.s - (output - low) / span)
