"""Coulomb friction: a force against the slip, at most as large as its limit while there is none.

In the plane, with the slip velocity w = p - n (theory, eq. 5):

    force = -limit (2 nu - 1),    0 <= 1 - nu  perp  p >= 0,    0 <= nu  perp  n >= 0

In space the circle of directions is a polygon with unit vectors d_i, and nu the weights of the smallest d_i^T w (theory, eq. 3):

    force = limit sum_i nu_i d_i,    sum_i nu_i = 1,    0 <= nu_i  perp  d_i^T w - min_j d_j^T w >= 0

Both are Filippov's solution of dry friction: |force| <= limit where the bodies stick.  The limit may be any expression, such as
mu times a contact force.
"""

from math import cos, pi, sin

from pyomo.core import Block, Expression, RangeSet
from pyomo.core.base.block import BlockData
from pyomo.dae import ContinuousSet

from pyomo_fesd.core import (
    GENERATED,
    FesdError,
    Surface,
    TimeIndex,
    add_smallest,
    add_step,
    declare_smallest,
    declare_step,
    public_name,
    switched_systems,
)
from pyomo_fesd.modeling.rules import refuse_wrong_rules, whole_or_none

#: The sides of dry friction in the plane, as reports name them.
FORWARD, BACKWARD, STICKS = 'slips forward', 'slips backward', 'sticks'


def friction(*sets, velocity, limit, directions: int = 8) -> Block:
    """Return a Block over ``sets`` with the ``force`` of dry friction; add it to the balances of momentum on which it acts.

    Parameters
    ----------
    sets : Set, ...
        index sets, the ContinuousSet among them
    velocity : function (block, index, ...) -> expression, or list of two
        slip velocity; two components in space, where ``force[1]`` and ``force[2]`` are those of the force
    limit : function (block, index, ...) -> expression
        largest force, >= 0: mu times the normal force
    directions : int
        corners of the polygon in space, at least 4; the force is exact in these directions and up to 1 - cos(pi/directions) too
        small between them

    Raises
    ------
    FesdError
        when the Block is added: for a velocity that is not an expression or a list of two

    Example
    -------
    A block on a table: ``m.rub = friction(m.t, velocity=lambda m, t: m.v[t], limit=lambda m, t: mu * mass * g)`` and
    ``mass * m.dv[t] == m.push[t] + m.rub[t].force``
    """
    refuse_wrong_rules('friction', sets, velocity=velocity, limit=limit)
    _check_directions(directions)
    time = next((s for s in sets if getattr(s, 'ctype', None) is ContinuousSet), None)

    def fill(block, *index):
        parent = block.parent_block()
        add_friction(block, 'force', velocity(parent, *index), limit(parent, *index), directions, time)

    return Block(*sets, rule=whole_or_none(fill))


def _check_directions(directions):
    if isinstance(directions, bool) or not isinstance(directions, int) or directions < 4:
        raise FesdError('friction', f"directions={directions!r}", "give at least 4, so that forces of all directions exist")


def add_friction(block: BlockData, name: str, velocity, limit, directions: int, time: ContinuousSet | None) -> None:
    """Add the friction force ``name`` to ``block``: an Expression, in space over 1 and 2."""
    _check_directions(directions)
    components = list(velocity) if isinstance(velocity, (list, tuple)) else [velocity]
    if len(components) > 2 or not all(hasattr(w, 'is_expression_type') and w.is_numeric_type() for w in components):
        shown = str([str(w) for w in components])
        raise FesdError(block, f"its slip velocity is {shown}", "give one expression, or a list of two in space")
    law = Block()
    block.add_component(GENERATED + name, law)
    if len(components) == 1:
        block.add_component(name, Expression(expr=_in_the_plane(block, law, name, components[0], limit, time)))
        return
    block.add_component(name, Expression(RangeSet(2)))
    for k, part in enumerate(_in_space(law, components, limit, directions), start=1):
        block.component(name)[k] = part


def _in_the_plane(block, law, name, w, limit, time):
    declare_step(law)
    nu = add_step(law, (), w)
    sides = {FORWARD: law.p, BACKWARD: law.n, STICKS: nu * (1 - nu)}
    shown = block.name if time is None else public_name(TimeIndex(time).split(block)[1])
    switched_systems(law).surfaces.append(Surface(nu, f'{shown}.{name}', sides))
    return -limit * (2 * nu - 1)


def _in_space(law, w, limit, number):
    corners = [(cos(2 * pi * k / number), sin(2 * pi * k / number)) for k in range(number)]
    # numbers such as 6e-17 would be terms of the model
    corners = [tuple(round(part, 15) for part in corner) for corner in corners]
    declare_smallest(law, (), number)
    nu = add_smallest(law, (), [x * w[0] + y * w[1] for x, y in corners])
    return [limit * sum(weight * corner[k] for weight, corner in zip(nu, corners)) for k in (0, 1)]
