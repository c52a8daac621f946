"""Rules of Blocks over time: checks before a Block is made, and Blocks that are whole or not there."""

from collections.abc import Callable, Collection

from pyomo_fesd.core import FesdError


def refuse_wrong_rules(caller: str, sets: tuple, **rules) -> None:
    """Refuse rules that are not functions, and index sets that are none.

    Raises
    ------
    FesdError
    """
    for name, given in rules.items():
        if not callable(given):
            raise FesdError(caller, f"{name}={given!r} is not a function", f"give {name}=lambda m, t: ...")
    for given in sets:
        if isinstance(given, str) or not isinstance(given, Collection):
            raise FesdError(caller, f"{given!r} is not a Set", "give the ContinuousSet, and other Sets of the model")


def whole_or_none(fill: Callable) -> Callable:
    """Return a rule that deletes the Block where ``fill`` refuses to fill one of its data."""

    def rule(block, *index):
        try:
            fill(block, *index)
        except FesdError:
            # a Block with a part of its data is no component that a user could repair
            block.parent_block().del_component(block.parent_component())
            raise

    return rule
