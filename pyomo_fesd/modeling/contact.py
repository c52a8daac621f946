"""Rigid contacts: the distance of two bodies, the force that keeps it from becoming negative, and dry friction.

    0 <= normal  perp  gap >= 0,      |friction| <= mu normal, against the slip velocity

At an impact the force is an impulse.  Velocities jump by it, and ``fesd.finite_elements`` puts an element boundary there
(theory, eq. 20 and 21).
"""

from pyomo.core import Block, Expression, Var, value
from pyomo.core.expr.visitor import identify_variables
from pyomo.dae import ContinuousSet
from pyomo.mpec import Complementarity, complements

from pyomo_fesd.core import GENERATED, Contact, FesdError, switched_systems
from pyomo_fesd.modeling.distance import add_distance
from pyomo_fesd.modeling.friction import add_friction
from pyomo_fesd.modeling.rules import refuse_wrong_rules, whole_or_none
from pyomo_fesd.modeling.sticking_contact import add_sticking_contact


def contact(*sets, gap, restitution=0, friction=None, slip=None, directions: int = 8, sticks: bool = False) -> Block:
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

    friction : number, Param, or function (block, index, ...) -> one of them or an expression, optional
        mu; the Block then has the force ``friction`` too, which belongs in the balances like ``normal``.  At an impact it is an
        impulse against the slip velocity after it.
    slip : function (block, index, ...) -> expression, or list of two
        velocity of one body along the other, written with differential states, in the direction in which ``friction`` acts in the
        balances; two components in space, where ``friction[1]`` and ``friction[2]`` are those of the force
    directions : int
        corners of the polygon of friction forces in space (:func:`friction`)
    sticks : bool
        True: closed bodies must not slip, as the foot of a walking robot.  This is a condition on the controls, not a law of
        motion: controls with which the bodies would slip are infeasible, and such a model cannot be simulated.

    Raises
    ------
    FesdError
        when the Block is added: for a gap that is not an expression, a restitution that is not between 0 and 1, a negative
        friction coefficient, a slip without friction or the other way round, and ``sticks`` without friction, with restitution, or
        in space

    Example
    -------
    A ball on a floor: ``m.floor = contact(m.t, gap=lambda m, t: m.y[t] - radius, restitution=0.8)``

    With friction: ``contact(m.t, gap=..., friction=0.3, slip=lambda m, t: m.vx[t] + radius * m.omega[t])``, and
    ``mass * m.dvx[t] == m.floor[t].friction``, ``inertia * m.domega[t] == radius * m.floor[t].friction``.

    Source: Nurkanovic, Frey, Pozharskiy, Diehl (2024), FESD-J.
    """

    refuse_wrong_rules('contact', sets, gap=gap, **({} if slip is None else {'slip': slip}))
    if (friction is None) != (slip is None):
        raise FesdError('contact', "friction and slip belong together, and one of them was not given", "give both, or none")
    if sticks and (friction is None or not (isinstance(restitution, (int, float)) and restitution == 0)):
        missing = "no friction" if friction is None else f"restitution={restitution!r}"
        raise FesdError('contact', f"sticks=True with {missing}", "give friction and slip, and no restitution")
    time = next((s for s in sets if getattr(s, 'ctype', None) is ContinuousSet), None)

    def fill(block, *index):
        parent = block.parent_block()
        block.gap = Expression(expr=_gap(block, gap(parent, *index)))
        e = _restitution(block, _given(restitution, parent, index))
        mu = None if friction is None else _coefficient(block, _given(friction, parent, index))
        if sticks:
            switched_systems(block).contacts.append(add_sticking_contact(block, slip(parent, *index), mu))
            return
        block.normal = Var(bounds=(0, None), initialize=0)
        law = Block()
        block.add_component(GENERATED + 'contact', law)
        add_distance(law, block.gap)
        block.touching = Complementarity(expr=complements(block.normal >= 0, law.d >= 0))
        switched_systems(block).contacts.append(Contact(block, block.gap, law.d, (block.normal,), block.touching, e))
        if friction is not None:
            add_friction(block, 'friction', slip(parent, *index), mu * block.normal, directions, time)

    return Block(*sets, rule=whole_or_none(fill))


def _given(given, parent, index):
    """The value of a rule, or what was given in its place."""
    # Params are callable too
    return given if hasattr(given, 'is_expression_type') or not callable(given) else given(parent, *index)


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


def _coefficient(block, given):
    if not _is_numeric(given) or (isinstance(given, (int, float)) and given < 0):
        raise FesdError(block, f"its friction is '{given}', not a coefficient >= 0", "give e.g. 0.3")
    return given


def _is_numeric(given):
    if hasattr(given, 'is_expression_type'):
        return given.is_numeric_type() and not given.is_indexed()
    return isinstance(given, (int, float))
