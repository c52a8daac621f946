"""Rigid contacts: the distance of two bodies, and the force that keeps it from becoming negative.

    0 <= normal  perp  gap >= 0

At an impact the force is an impulse.  Velocities jump by it, and ``fesd.finite_elements`` puts an element boundary there
(theory, eq. 20 and 21).
"""

from pyomo.core import Block, Expression, Var, value
from pyomo.core.expr.visitor import identify_variables
from pyomo.mpec import Complementarity, complements

from pyomo_fesd.core import Contact, FesdError, switched_systems


def contact(*sets, gap, restitution=0) -> Block:
    """Return a Block over ``sets`` with a rigid contact: a gap that is never negative, and the force ``normal`` that keeps it so.

    Add ``normal`` to the balances of momentum on which the force acts, with the direction in which it acts on each, as you would
    any force: ``mass * m.dv[t] == -mass * g + m.floor[t].normal``.  Impacts follow from these equations: where the gap closes with
    a velocity, the same balances hold for the impulse, with the masses and directions that the derivatives and ``normal`` have in
    them.

    Parameters
    ----------
    sets : Set, ...
        index sets, the ContinuousSet among them
    gap : function (block, index, ...) -> expression
        the distance, written with differential states; block is the parent, as in every Pyomo rule.  Where it depends on several
        positions its gradient is the direction of the force.
    restitution : number, Param, or function (block, index, ...) -> one of them
        e between 0 (the bodies stay together) and 1 (no energy is lost): normal velocity after an impact = -e times that before

    Raises
    ------
    FesdError
        when the Block is added: for a gap that is not an expression, and a restitution that is not between 0 and 1

    Example
    -------
    A ball on a floor: ``m.floor = contact(m.t, gap=lambda m, t: m.y[t] - radius, restitution=0.8)``

    Source: Nurkanovic, Frey, Pozharskiy, Diehl (2024), FESD-J.
    """

    def rule(block, *index):
        parent = block.parent_block()
        block.gap = Expression(expr=_gap(block, gap(parent, *index)))
        block.normal = Var(bounds=(0, None), initialize=0)
        block.touching = Complementarity(expr=complements(block.normal >= 0, block.gap >= 0))
        e = _restitution(block, restitution(parent, *index) if callable(restitution) else restitution)
        switched_systems(block).contacts.append(Contact(block, block.gap, block.normal, block.touching, e))

    return Block(*sets, rule=rule)


def _gap(block, given):
    if not _is_numeric(given) or not hasattr(given, 'is_expression_type'):
        raise FesdError(block, f"its gap is '{given}', not an expression", "give d for the condition d >= 0")
    return given


def _restitution(block, given):
    if not _is_numeric(given) or any(True for _ in identify_variables(given)):
        raise FesdError(block, f"its restitution is '{given}', not a number or Param", "give e.g. 0.8")
    if not 0 <= value(given) <= 1:
        raise FesdError(block, f"its restitution is {value(given):g}", "give a number between 0 and 1")
    return given


def _is_numeric(given):
    if hasattr(given, 'is_expression_type'):
        return given.is_numeric_type() and not given.is_indexed()
    return isinstance(given, (int, float))
