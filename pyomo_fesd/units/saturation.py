"""An actuator that saturates: v = mid(low, u, high), one pair for each limit (theory, eq. 8).

    one limit     0 <= v - low  perp  v - u >= 0
    two limits    0 <= s  perp  s - (u - low) >= 0,     0 <= high - v  perp  low + s - v >= 0         v = min(high, low + s)

Takes: the command u and the output v, a variable.
Leaves: ``lower`` and ``upper``, and with two limits the variable ``s``; no equation.
Does not apply: to limits that cross.
"""

from pyomo.core import Var
from pyomo.environ import units
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
    reached = command
    if low is not None and high is not None:
        reached = _lift(block, command, like(low, output))
    elif low is not None:
        low = like(low, output)
        block.lower = Complementarity(expr=complements(output >= low, command - output <= 0))
        marks.mark(block, marks.CONTINUOUS, output, block.lower)
    if high is not None:
        high = like(high, output)
        block.upper = Complementarity(expr=complements(output <= high, output - reached <= 0))
        marks.mark(block, marks.CONTINUOUS, output, block.upper)


def _lift(block, command, low):
    """max(low, command) as low + s."""
    z = command - low
    block.s = Var(bounds=(0, None), initialize=max(0.0, finite(z)), units=units.get_units(z))
    block.lower = Complementarity(expr=complements(block.s >= 0, z - block.s <= 0))
    marks.mark(block, marks.CONTINUOUS, block.s, block.lower)
    return low + block.s
