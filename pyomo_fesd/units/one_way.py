"""Flow in one direction, driven by a positive head or pressure drop: overflow weirs and check valves (theory, eq. 14).

    0 <= F  perp  r(F) - d >= 0          d: drive of the flow F,   r(F): drive that F needs

d is the head over the crest of a weir, or the pressure drop across a check valve; a negative d causes no flow.  Without r the
weir, or the valve, has no resistance: d never becomes positive, and F keeps it at zero (a sliding mode).

Takes: the flow, a variable; d as an expression; r.
Leaves: ``pair``, a Complementarity; neither variable nor equation.  With r the flow is marked as continuous where d is.
Does not apply: to a law of the head h = max(0, d) that has no slope at 0, such as h**1.5: its inverse has an infinite one there.
"""

from pyomo.mpec import Complementarity, complements

from pyomo_fesd.core import switched_systems


def one_way(block, flow, drive, resistance=None) -> None:
    """Add the pair to ``block``.

    Parameters
    ----------
    block : BlockData
    flow : VarData
    drive : expression
    resistance : callable flow -> expression, optional
    """
    needed = drive if resistance is None else drive - resistance(flow)
    block.pair = Complementarity(expr=complements(flow >= 0, needed <= 0))
    if resistance is not None:
        switched_systems(block).continuous[flow] = block.pair
