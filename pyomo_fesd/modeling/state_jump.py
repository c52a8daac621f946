"""State jumps: a guard and the states after the jump, written in the model."""

from math import isfinite
from numbers import Real

from pyomo.common.collections import ComponentSet
from pyomo.core import Block, Expression

from pyomo_fesd.core import GENERATED, FesdError, Reset, switched_systems
from pyomo_fesd.modeling.rules import refuse_wrong_rules, whole_or_none


def state_jump(*sets, guard, reset) -> Block:
    """Return a Block over ``sets`` with a jump of differential states: where ``guard`` falls to zero, x(t+) = J(x(t-)).

    ``fesd.finite_elements`` puts an element boundary on every jump; the states are discontinuous there.  The guard stays >= 0 at
    all times: where it reaches zero and would become negative, the states must jump.

    Parameters
    ----------
    sets : Set, ...
        index sets, the ContinuousSet among them
    guard : function (block, index, ...) -> expression
        block is the parent, as in every Pyomo rule
    reset : function (block, index, ...) -> list of (VarData, expression)
        the states that jump with their values J after the jump, written with the values before it

    Raises
    ------
    FesdError
        when the Block is added: for a guard that is not an expression, and a reset that is not a list of states with values

    Example
    -------
    A ball: ``m.impact = state_jump(m.t, guard=lambda m, t: m.q[t], reset=lambda m, t: [(m.v[t], -0.9*m.v[t])])``

    Source: Nurkanovic, Frey, Pozharskiy, Diehl (2023), FESD-J.
    """

    refuse_wrong_rules('state_jump', sets, guard=guard, reset=reset)

    def fill(block, *index):
        parent = block.parent_block()
        block.guard = Expression(expr=_guard(block, guard(parent, *index)))
        resets = _resets(block, reset(parent, *index))
        values = Expression(range(1, len(resets) + 1))
        block.add_component(GENERATED + 'after', values)
        for j, (_, after) in enumerate(resets, start=1):
            values[j] = after
        states = tuple((state, values[j]) for j, (state, _) in enumerate(resets, start=1))
        switched_systems(block).resets.append(Reset(block, block.guard, states))

    return Block(*sets, rule=whole_or_none(fill))


def _guard(block, given):
    if not _is_numeric(given):
        raise FesdError(block, f"its guard is '{given}', not an expression", "give c for the condition c >= 0")
    return given


def _resets(block, given):
    pairs = list(given) if isinstance(given, (list, tuple)) else []
    if not pairs or not all(map(_is_pair, pairs)):
        raise FesdError(
            block,
            f"its reset is {_shown(given)}, not a list of (state, value after)",
            "e.g. [(m.v[t], -m.v[t])], written with values before",
        )
    known = ComponentSet()
    for state, _ in pairs:
        if state in known:
            raise FesdError(block, f"'{state.name}' is reset twice", "give each state one value after the jump")
        known.add(state)
    return pairs


def _shown(given):
    if isinstance(given, (list, tuple)):
        return f"[{', '.join(map(_shown, given))}]" if isinstance(given, list) else f"({', '.join(map(_shown, given))})"
    return str(given) if hasattr(given, 'ctype') or hasattr(given, 'is_expression_type') else repr(given)


def _is_pair(given):
    return isinstance(given, (list, tuple)) and len(given) == 2 and _is_variable(given[0]) and _is_numeric(given[1])


def _is_variable(given):
    return getattr(given, 'is_variable_type', bool)() and not given.is_indexed()


def _is_numeric(given):
    if hasattr(given, 'is_expression_type'):
        return given.is_numeric_type() and not given.is_indexed()
    return isinstance(given, Real) and not isinstance(given, bool) and isfinite(given)
