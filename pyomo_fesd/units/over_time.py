"""What the unit additions have in common: a Block over time whose rule reads what it was given at each time.

Takes: quantities as the user has them: a component over time (also a Reference, as IDAES' ports hold), an expression or number
that does not change, or a function (parent block, index, ...) -> expression.  A bare number has the unit of what it is compared
with.
Leaves: an unconstructed Block; its rule is an object and no closure, so that a clone's rule means the clone's own components.
"""

from inspect import isroutine

from pyomo.common.numeric_types import native_numeric_types
from pyomo.core import Block
from pyomo.environ import units

from pyomo_fesd.errors import FesdError


def block_over(sets, build, **given):
    """A Block over ``sets``; at each index ``build(block, **quantities there)`` fills it."""
    return Block(*sets, rule=_Rule(build, given))


class _Rule:
    """``build`` with what it was given; copied with the model."""

    def __init__(self, build, given):
        self._build, self._given = build, given

    def __call__(self, block, *index):
        self._build(block, **{name: _at(given, block, index, name) for name, given in self._given.items()})


class Law:
    """A function that is no function of the time, such as that of a head."""

    def __init__(self, function):
        self.function = function

    def __call__(self, x):
        """The law's expression; a number stands for a proportional one."""
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
        return given[key]  # not 'key in given': while pyomo.dae expands a model, data come into being when they are asked for
    except KeyError as error:
        raise FesdError(
            block, f"{name}: '{given.name}' has no index {key}", "give a component over the same sets, or a function of them"
        ) from error


def variable(given, block, name):
    """``given``, which must be one variable: the addition defines it.

    Raises
    ------
    FesdError
        for anything else
    """
    if getattr(given, 'is_variable_type', bool)():
        return given
    raise FesdError(block, f"{name}: '{given}' is no variable", "give the Var that is to be defined, e.g. a flow over time")


def like(number, quantity):
    """A bare number with the unit of ``quantity``; everything else as it is."""
    unit = None if number.__class__ not in native_numeric_types else units.get_units(quantity)
    return number if unit in (None, units.dimensionless) or not number else number * unit


def refuse_order(block, low, high, names):
    """Refuse limits in the wrong order, as far as they are numbers."""
    both = [low, high]
    if all(limit.__class__ in native_numeric_types for limit in both) and low >= high:
        raise FesdError(block, f"{names[0]} = {low} is not below {names[1]} = {high}", "exchange them")
