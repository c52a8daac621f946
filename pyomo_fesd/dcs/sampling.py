"""Set variables for a moment, as functions are compared by their values at random points."""

from collections.abc import Iterator
from contextlib import contextmanager
from math import isfinite

from pyomo.core.expr.visitor import identify_variables

#: A start value below this is left from a computation; powers of it vanish.
NOTHING = 1e-100


def start_of(v, default: float = 1.0) -> float:
    """Return the value of a variable; ``default`` where it has none that is finite, or is as good as 0."""
    return float(v.value) if v.value and isfinite(v.value) and abs(v.value) > NOTHING else default


@contextmanager
def values_kept(expressions) -> Iterator[list]:
    """Yield the variables of ``expressions``, whose values and stale flags come back afterwards."""
    variables = list({id(v): v for e in expressions for v in identify_variables(e, include_fixed=True)}.values())
    kept = [(v.value, v.stale) for v in variables]
    try:
        yield variables
    finally:
        for v, (old, stale) in zip(variables, kept):
            v.set_value(old, skip_validation=True)
            v.stale = stale
