"""A check valve: no backflow (``one_way``).

    0 <= F  perp  r(F) - (upstream - downstream) >= 0            linear: r(F) = F/k,   turbulent: r(F) = (F/C)**2

Takes: the two pressures and the flow.
Leaves: ``pair``, a Complementarity; neither variable nor equation.
Does not apply: to a valve whose flap takes time, or stays open a little while (``relay``).
"""

from pyomo.core import Block

from pyomo_fesd.units.one_way import one_way
from pyomo_fesd.units.over_time import Law, block_over, variable, with_unit


def check_valve(*sets, upstream, downstream, flow, resistance=None) -> Block:
    """Return a Block over ``sets`` that lets ``flow`` pass from ``upstream`` to ``downstream`` and never back.

    Parameters
    ----------
    sets : Set, ...
        index sets, the ContinuousSet among them
    upstream, downstream : Var, Expression, number, expression or function (block, index, ...) -> expression
        pressures
    flow : Var over ``sets``
        defined by nothing else
    resistance : number or function flow -> pressure drop, optional
        a number r means r*flow.  Default: none; then the pressure upstream never exceeds that downstream

    Raises
    ------
    FesdError
        when the Block is added, for a flow that is not a Var
    """
    law = None if resistance is None else Law(resistance)
    return block_over(sets, _build_check_valve, upstream=upstream, downstream=downstream, flow=flow, resistance=law)


def _build_check_valve(block, upstream, downstream, flow, resistance):
    drop = with_unit(upstream, downstream) - with_unit(downstream, upstream)
    one_way(block, variable(flow, block, 'flow'), drop, resistance)
