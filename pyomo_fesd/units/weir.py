"""An overflow weir (``one_way``; with a law of the head theory, eq. 8).

    ideal          0 <= F  perp  crest - level >= 0                      the level never rises above the crest
    resistance r   0 <= F  perp  crest + r(F) - level >= 0               F = k (level - crest): r(F) = F/k
    discharge Q    F = Q(h),   0 <= h  perp  h - (level - crest) >= 0    Francis: Q(h) = C h**1.5

Takes: the level (or the volume), the crest in the same unit, and the flow over the weir.
Leaves: ``pair``; with ``discharge`` also the variable ``head`` and the equation ``flow``.
Does not apply: to a weir under water on its far side.
"""

from pyomo.core import Block, Constraint, Var
from pyomo.environ import units
from pyomo.mpec import Complementarity, complements

from pyomo_fesd.core import FesdError, switched_systems, value_or_zero
from pyomo_fesd.units.one_way import one_way
from pyomo_fesd.units.over_time import Law, block_over, variable, with_unit


def weir(*sets, level, crest, flow, resistance=None, discharge=None) -> Block:
    """Return a Block over ``sets`` with the overflow of a weir: zero below the crest, and by the law at or above it.

    Parameters
    ----------
    sets : Set, ...
        index sets, the ContinuousSet among them
    level : Var, Expression, expression or function (block, index, ...) -> expression
        liquid level or volume
    crest : number, Param, expression or function
        the level at which the overflow begins
    flow : Var over ``sets``
        the flow over the weir, defined by nothing else
    resistance : number or function flow -> head, optional
        the head over the crest that the flow needs; a number r means r*flow.  Default: none, an ideal weir
    discharge : function head -> flow, optional
        the flow that the head causes, in place of ``resistance``

    Raises
    ------
    FesdError
        for both laws at once; when the Block is added, for a flow that is not a Var

    Example
    -------
    ``m.fs.weir = weir(m.fs.time, level=m.fs.tank.volume, crest=1.2, flow=m.fs.tank.outlet.flow_vol)``
    """
    if resistance is not None and discharge is not None:
        raise FesdError('weir', "both a resistance and a discharge are given", "give one of them")
    if discharge is not None:
        return block_over(sets, _by_head, level=level, crest=crest, flow=flow, discharge=Law(discharge))
    law = None if resistance is None else Law(resistance)
    return block_over(sets, _by_flow, level=level, crest=crest, flow=flow, resistance=law)


def _by_flow(block, level, crest, flow, resistance):
    one_way(block, variable(flow, block, 'flow'), level - with_unit(crest, level), resistance)


def _by_head(block, level, crest, flow, discharge):
    above = level - with_unit(crest, level)
    block.head = Var(bounds=(0, None), initialize=max(0.0, value_or_zero(above)), units=units.get_units(above))
    block.pair = Complementarity(expr=complements(block.head >= 0, above - block.head <= 0))
    block.flow = Constraint(expr=variable(flow, block, 'flow') == discharge(block.head))
    switched_systems(block).continuous[block.head] = block.pair
