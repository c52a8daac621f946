"""The common part of the unit additions: a Block over time whose rule reads the user's quantities at each time.

Takes: quantities: a component over time (also a Reference, as in IDAES' ports), an expression or number that does not change, or
a function (parent block, index, ...) -> expression.  A bare number has the unit of the quantity that it is compared with.
Leaves: an unconstructed Block; its rule is an object and not a closure, so that the rule of a clone refers to the clone.
"""

from inspect import isroutine

from pyomo.common.numeric_types import native_numeric_types
from pyomo.core import Block
from pyomo.environ import units

from pyomo_fesd.core import FesdError


def block_over(sets, build, **given) -> Block:
    """Return a Block over ``sets``; at each index ``build(block, **quantities at the index)`` fills it."""
    return Block(*sets, rule=_Rule(build, given))


class _Rule:
    """``build`` with the quantities; copied with the model."""

    def __init__(self, build, given):
        self._build, self._given = build, given

    def __call__(self, block, *index):
        self._build(block, **{name: _at(given, block, index, name) for name, given in self._given.items()})


class Law:
    """A function of a quantity and not of time, such as a flow as a function of the head."""

    def __init__(self, function):
        self.function = function

    def __call__(self, x):
        """The law as an expression; a number means proportional to ``x``."""
        given = self.function
        return given(x) if callable(given) and not hasattr(given, 'is_expression_type') else given * x


def _at(given, block, index, name):
    """A quantity at one index."""
    if isroutine(given):
        return given(block.parent_block(), *index)
    if not getattr(given, 'is_indexed', bool)():
        return given
    key = index if len(index) != 1 else index[0]
    try:
        return given[key]  # not 'key in given': while pyomo.dae expands a model, access creates the data
    except KeyError as error:
        raise FesdError(
            block, f"{name}: '{given.name}' has no index {key}", "give a component over the same sets, or a function of them"
        ) from error


def variable(given, block, name: str):
    """Return ``given``, which must be a Var since the addition defines it.

    Raises
    ------
    FesdError
        if it is not a Var
    """
    if getattr(given, 'is_variable_type', bool)():
        return given
    raise FesdError(block, f"{name}: '{given}' is not a Var", "give the Var that is to be defined, e.g. a flow over time")


def with_unit(number, quantity):
    """Return a bare number with the unit of ``quantity``, and anything else as it is."""
    unit = None if number.__class__ not in native_numeric_types else units.get_units(quantity)
    return number if unit in (None, units.dimensionless) or not number else number * unit


def refuse_order(block, **limits) -> None:
    """Refuse two limits, given as ``lower=..., upper=...`` by their own names, in the wrong order; only numbers are checked."""
    (lower, low), (upper, high) = limits.items()
    if all(limit.__class__ in native_numeric_types for limit in (low, high)) and low >= high:
        raise FesdError(block, f"{lower} = {low} is not below {upper} = {high}", "exchange them")
