"""Units of measure in generated equations: generated variables have none, expressions enter as multiples of their unit.

    c/[c] = p - n,    max(0, z) = s [z]

Takes: an expression.
Leaves: nothing.
Does not apply: to expressions whose own units are inconsistent; they are left as they are.
"""

from pyomo.core.base.units_container import UnitsError, units

from pyomo_fesd.core.node_search import leaves_of


def unit_of(expr):
    """Return the unit of ``expr``, a Pyomo unit; None where it has none, or inconsistent ones."""
    if not _mentions_units(expr):
        return None
    try:
        return _unless_dimensionless(units.get_units(expr))
    except (UnitsError, TypeError):
        return None


def without_unit(expr):
    """Return ``expr`` divided by its unit; itself where it has none."""
    return divided_by(expr, unit_of(expr))


def divided_by(expr, unit):
    """Return ``expr`` in multiples of ``unit``, which may be None."""
    return expr if unit is None else expr / unit


def in_unit_of(number, expr):
    """Return ``number``, a multiple of the unit of ``expr``, with that unit; itself where ``expr`` has none."""
    unit = unit_of(expr)
    return number if unit is None else number * unit


def time_unit(x, xdot):
    """Return [x]/[xdot], the unit of the time in which a derivative is taken; None where neither has a unit."""
    own = [unit_of(v) for v in (x, xdot)]
    if own == [None, None]:
        return None
    above, below = (1 if unit is None else unit for unit in own)
    return _unless_dimensionless(units.get_units(above / below))


def _unless_dimensionless(unit):
    return None if str(unit) == 'dimensionless' else unit


def _mentions_units(expr):
    """Whether anything in ``expr`` has a unit; without, pint is not asked, which takes long to import."""
    # a unit itself is neither
    return any(not (v.is_variable_type() or v.is_parameter_type()) or v.get_units() is not None for v in leaves_of(expr))
