"""Projected dynamics: a state is kept in a set by a force along the gradient of the active constraint, here called a wall.

    dx/dt = f(x, u) + E sum_j grad c_j(x) lam_j,     0 <= lam_j  perp  c_j(x) >= 0

lam is the force with which the wall c_j = 0 acts on the state; it jumps, c is continuous (theory, eq. 11).  The gradients are
derived from the expressions.

Takes: a block at one time, the walls, and the states on which they act.
Leaves: ``lam`` and ``contact`` (a Complementarity) on that block; the force is returned, for the user's own equation.
Does not apply: to walls in algebraic variables, whose gradient in the states is not available.
"""

from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.core import RangeSet, Var
from pyomo.core.base.block import BlockData
from pyomo.core.expr.calculus.derivatives import Modes, differentiate
from pyomo.core.expr.calculus.diff_with_pyomo import DifferentiationException
from pyomo.core.expr.visitor import identify_variables
from pyomo.dae import ContinuousSet
from pyomo.mpec import Complementarity, complements

from pyomo_fesd.core import FesdError, distance_to_bound, index_sets, value_or_nan

#: Largest distance of a fixed initial state outside of its walls.
OUTSIDE = 1e-8


def projection(block, c, states, metric=None) -> ComponentMap:
    """Keep ``states`` where c >= 0: add the multipliers and conditions, and return the force on each state.

    Write ``dx == f + push[x]`` with the returned map ``push``.

    Parameters
    ----------
    block : BlockData
        one block of a Block over time; gets ``lam`` and ``contact``
    c : expression or inequality, or a list of them
        ``c >= 0`` inside; an inequality gives the distance to its bound
    states : list of VarData
        at this time
    metric : n x n numbers or expressions, optional
        E, in the order of ``states``; default: the identity

    Returns
    -------
    ComponentMap VarData -> expression

    Raises
    ------
    FesdError
        for walls that cannot be differentiated or do not depend on the states, and for a fixed initial state outside of them
    """
    states, listed = list(states), isinstance(c, (list, tuple))
    _check_projection(block, states, metric)
    walls = [distance_to_bound(w, block) for w in (c if listed else [c])]
    gradients = [_gradient(wall, states, block) for wall in walls]
    for wall in walls:
        _check_start(wall, block)
    _declare_contact(block, walls if listed else walls[0], listed)
    return ComponentMap(zip(states, _forces(len(states), gradients, list(block.lam.values()), metric)))


def _forces(count, gradients, multipliers, metric):
    """E sum_j grad c_j lam_j, one entry for each state."""
    forces = [sum(slopes[i] * lam for slopes, lam in zip(gradients, multipliers)) for i in range(count)]
    return forces if metric is None else [sum(e * force for e, force in zip(row, forces)) for row in metric]


def _declare_contact(block, walls, listed):
    if listed:
        block.lam = Var(RangeSet(len(walls)), bounds=(0, None), initialize=0)
        block.contact = Complementarity(RangeSet(len(walls)), rule=lambda b, j: complements(walls[j - 1] >= 0, b.lam[j] >= 0))
    else:
        block.lam = Var(bounds=(0, None), initialize=0)
        block.contact = Complementarity(expr=complements(walls >= 0, block.lam >= 0))


def _check_projection(block, states, metric):
    if not isinstance(block, BlockData):
        raise FesdError(block, "projection: not one block", "call it in the rule of a Block over time, with the rule's own block")
    for name in ('lam', 'contact'):
        if block.component(name) is not None:
            raise FesdError(block, f"projection: it has a component '{name}' already", "give all walls in one call, as a list")
    if metric is not None and (len(metric) != len(states) or any(len(row) != len(states) for row in metric)):
        raise FesdError(
            block, f"projection: the metric is not {len(states)} x {len(states)}", "give one row and one column for each state"
        )


def _gradient(wall, states, block):
    """dc/dx for each state; 0 where ``wall`` does not contain it."""
    among = ComponentSet(identify_variables(wall))
    known = ComponentSet(states)
    if not any(x in among for x in states):
        raise FesdError(block, f"projection: '{wall}' does not depend on the states", "name the states that the wall limits")
    for v in among:
        if v not in known and not v.fixed and _is_algebraic(v):
            raise FesdError(
                v,
                f"projection: the wall '{wall}' contains it, and it is neither among the states nor differential",
                "write the wall in the states, e.g. with an Expression in place of the variable",
            )
    try:
        return [differentiate(wall, wrt=x, mode=Modes.reverse_symbolic) if x in among else 0 for x in states]
    except DifferentiationException as error:
        raise FesdError(block, f"projection: '{wall}' cannot be differentiated", "write the wall in smooth functions") from error


def _is_algebraic(v):
    """Whether ``v`` changes with time and no DerivativeVar is declared for it."""
    component = v.parent_component()
    return any(s.ctype is ContinuousSet for s in index_sets(component)) and not getattr(component, '_derivative', None)


def _check_start(wall, block):
    """Refuse fixed states outside the wall, which no force could bring back."""
    now = value_or_nan(wall)
    if now < -OUTSIDE and all(v.fixed for v in identify_variables(wall)):
        raise FesdError(block, f"projection: the start is outside, '{wall}' is {now:g} there", "start where it is not negative")
