"""State jumps as a user writes them: a guard and a law of reset."""

from pyomo.common.collections import ComponentSet
from pyomo.core import Block, Expression

from pyomo_fesd import marks
from pyomo_fesd.errors import FesdError


def state_jump(*sets, guard, reset):
    """A jump of differential states: where ``guard`` falls to zero, x(t+) = J(x(t-)).

    ``fesd.finite_elements`` puts an element boundary on every jump; the elements on its two sides are separated there.  The
    guard stays >= 0 all the time: a state that reaches zero and would go on below must jump.

    Parameters
    ----------
    sets
        index sets, the ContinuousSet among them
    guard : function -> expression
        called as a rule: with the parent block and the index
    reset : function -> list of (VarData, expression)
        called likewise: the states that jump with their values J after the jump, written with the values before it

    Returns
    -------
    Block over ``sets``, to be added to the model: ``m.impact = state_jump(m.t, guard=..., reset=...)``

    Raises
    ------
    FesdError
        when the Block is added: for a guard that is no expression, and a reset that is no list of states with values

    Example
    -------
    A ball: ``state_jump(m.t, guard=lambda m, t: m.q[t], reset=lambda m, t: [(m.v[t], -0.9*m.v[t])])``

    Source: Nurkanovic, Frey, Pozharskiy, Diehl (2023), FESD-J.
    """

    def rule(block, *index):
        parent = block.parent_block()
        block.guard = Expression(expr=_guard(block, guard(parent, *index)))
        marks.mark(block, marks.GUARD, block.guard)
        resets = _resets(block, reset(parent, *index))
        values = Expression(range(1, len(resets) + 1))
        block.add_component(marks.GENERATED + 'after', values)
        for j, (state, after) in enumerate(resets, start=1):
            values[j] = after
            marks.mark(block, marks.RESET, state, values[j])

    return Block(*sets, rule=rule)


def _guard(block, given):
    if not _is_numeric(given):
        raise FesdError(block, f"its guard is '{given}', not an expression", "give c for the condition c >= 0")
    return given


def _resets(block, given):
    pairs = list(given) if isinstance(given, (list, tuple)) else []
    if not pairs or not all(map(_is_pair, pairs)):
        shown = str([str(part) for part in given] if isinstance(given, (list, tuple)) else given)
        raise FesdError(
            block,
            f"its reset is {shown}, not a list of (state, value after)",
            "e.g. [(m.v[t], -m.v[t])], written with values before",
        )
    known = ComponentSet()
    for state, _ in pairs:
        if state in known:
            raise FesdError(block, f"'{state.name}' is reset twice", "give each state one value after the jump")
        known.add(state)
    return pairs


def _is_pair(given):
    return isinstance(given, (list, tuple)) and len(given) == 2 and _is_variable(given[0]) and _is_numeric(given[1])


def _is_variable(given):
    return getattr(given, 'is_variable_type', bool)() and not given.is_indexed()


def _is_numeric(given):
    if hasattr(given, 'is_expression_type'):
        return given.is_numeric_type() and not given.is_indexed()
    return isinstance(given, (int, float))
