"""State jumps as a user writes them: a guard and a law of reset."""

from pyomo.core import Block, Expression

from pyomo_fesd import marks


def state_jump(*sets, guard, reset):
    """A jump of differential states: where ``guard`` falls to zero, x(t+) = J(x(t-)).

    ``fesd.finite_elements`` puts an element boundary on every jump; the elements on its two sides are separated there.  The
    guard stays >= 0 all the time: a state that reaches zero and would go on below must jump.

    Parameters
    ----------
    sets : Set, ...
        index sets, the ContinuousSet among them
    guard : function (block, index, ...) -> expression
        block is the parent, as in every Pyomo rule
    reset : function (block, index, ...) -> list of (VarData, expression)
        the states that jump with their values J after the jump, written with the values before it

    Returns
    -------
    Block over ``sets``, to be added to the model: ``m.impact = state_jump(m.t, guard=..., reset=...)``

    Example
    -------
    A ball: ``state_jump(m.t, guard=lambda m, t: m.q[t], reset=lambda m, t: [(m.v[t], -0.9*m.v[t])])``

    Source: Nurkanovic, Frey, Pozharskiy, Diehl (2023), FESD-J.
    """

    def rule(block, *index):
        parent = block.parent_block()
        block.guard = Expression(expr=guard(parent, *index))
        marks.mark(block, marks.GUARD, block.guard)
        resets = reset(parent, *index)
        values = Expression(range(1, len(resets) + 1))
        block.add_component(marks.GENERATED + 'after', values)
        for j, (state, after) in enumerate(resets, start=1):
            values[j] = after
            marks.mark(block, marks.RESET, state, values[j])

    return Block(*sets, rule=rule)
