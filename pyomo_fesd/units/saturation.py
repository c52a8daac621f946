"""An actuator that saturates: v = mid(low, u, high), one pair for each limit (theory, eq. 8).

    one limit     0 <= v - low  perp  v - u >= 0
    two limits    0 <= s  perp  s - (u - low)/R >= 0,   0 <= (high - v)/R  perp  s - (v - low)/R >= 0,   R = high - low

With two limits s = max(0, u - low)/R and v = min(high, low + R s); everything is measured by the range R, in whatever unit v is.

Takes: the command u and the output v, a variable.
Leaves: ``lower`` and ``upper``, and with two limits the variable ``s``; no equation.
Does not apply: to limits that cross.
"""

from pyomo.core import Var
from pyomo.mpec import Complementarity, complements

from pyomo_fesd import marks
from pyomo_fesd.errors import FesdError
from pyomo_fesd.units.over_time import block_over, like, refuse_order, variable
from pyomo_fesd.values import finite


def saturation(*sets, command, output, low=None, high=None):
    """``output`` follows ``command`` within its limits, exactly and without a parameter.

    For the smooth bounds of a model that is there already see ``fesd.smooth_to_complementarity``.

    Parameters
    ----------
    sets : Set, ...
        index sets, the ContinuousSet among them
    command : Var, Expression, expression or function (block, index, ...) -> expression
        what is asked for; of an IDAES PIDController, ``mv_unbounded``
    output : Var over ``sets``
        what the actuator does, which nothing else defines
    low, high : number, Param, expression or function, optional
        one of them, or both

    Returns
    -------
    Block over ``sets``, to be added to the model

    Raises
    ------
    FesdError
        without a limit, and for limits in the wrong order; when the Block is added, for an output that is no variable
    """
    if low is None and high is None:
        raise FesdError('saturation', "no limit is given", "give low, high or both")
    refuse_order('saturation', low, high, ('low', 'high'))
    return block_over(sets, _build, command=command, output=output, low=low, high=high)


def _build(block, command, output, low, high):
    output = variable(output, block, 'output')
    if low is None:
        _limit(block, 'upper', output, like(high, output) - output, command - output)
    elif high is None:
        _limit(block, 'lower', output, output - like(low, output), output - command)
    else:
        _limits(block, command, output, like(low, output), like(high, output))


def _limit(block, name, variable, distance, excess):
    """0 <= distance perp excess >= 0, which makes ``variable`` as continuous as the command."""
    pair = Complementarity(expr=complements(distance >= 0, excess >= 0))
    block.add_component(name, pair)
    marks.mark(block, marks.CONTINUOUS, variable, pair)


def _limits(block, command, output, low, high):
    span = high - low
    above = (command - low) / span
    block.s = Var(bounds=(0, None), initialize=max(0.0, finite(above)))
    _limit(block, 'lower', block.s, block.s, block.s - above)
    _limit(block, 'upper', output, (high - output) / span, block.s - (output - low) / span)
