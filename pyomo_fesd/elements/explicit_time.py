"""Data that depend on time labels become wrong when elements move: find them and point to a clock state."""

import logging
from functools import partial
from math import isfinite

from pyomo.core import Block, Constraint, value
from pyomo.core.expr.visitor import identify_variables
from pyomo.mpec import Complementarity

from pyomo_fesd.complementarity import side
from pyomo_fesd.timeindex import DISCRETISATION, TimeIndex, strip_time

logger = logging.getLogger('pyomo_fesd')


def warn_explicit_time(block, wrt, grid, integrands):
    """Warn once for each family of constraints, conditions or integrands whose numbers change over time.

    With every variable at one value, all points of a family that has no explicit time give the same number.  Control stages
    may have data of their own, so points are compared within a stage.

    Parameters
    ----------
    integrands : list of (Integral, function)
    """
    stage = {t: e.stage for e in grid.elements for t in e.points}
    for name, family in _families(block, wrt, grid, integrands).items():
        points = _spread([t for t in family if t in stage])
        if any(differ([family[t] for t in points if stage[t] == s]) for s in {stage[t] for t in points}):
            logger.warning(
                "%s: its numbers depend on the time label (a Param over time, or t itself in a rule). Labels are not physical "
                "time once elements move. Take time from a clock state, pyomo_fesd.clock(m, m.%s)[t], or name inputs that are "
                "constant on each control stage in piecewise_constant.",
                strip_time(name),
                wrt.local_name,
            )


def _families(block, wrt, grid, integrands):
    """``{name: {label: function that gives an expression}}`` of everything over time that a user's rule made."""
    components = block.component_objects((Constraint, Complementarity), active=True, descend_into=Block)
    datas = (d for c in components if not c.local_name.endswith(DISCRETISATION) for d in c.values() if d.active)
    families = TimeIndex(wrt).families(datas)
    found = {name: {t: partial(_expression, d) for t, d in family.items()} for name, family in families.items()}
    points = _spread([t for e in grid.elements for t in e.points])
    for integral, rule in integrands:
        for name, (before, after) in _indices(integral):
            found[name] = {t: partial(rule, integral.parent_block(), *before, t, *after) for t in points}
    return found


def _indices(integral):
    """Name and index, before and after time, of each of the integrals that a component stands for."""
    for index in integral.index_set() if integral.is_indexed() else [()]:
        index = index if isinstance(index, tuple) else (index,)
        name = f'{integral.name}[{",".join(map(str, index))}]' if index else integral.name
        yield name, (index[: integral.loc], index[integral.loc :])


def _expression(data):
    """One expression whose value tells the numbers of a constraint or condition."""
    if data.ctype is Complementarity:
        sides = [side(a) for a in getattr(data, '_args', None) or ()]
        parts = [part for s in sides for part in s if part is not None]
        return sum((k + 1) * part for k, part in enumerate(parts))
    bounds = [b for b in (data.lower, data.upper) if b is not None]
    return data.body - sum((k + 1) * b for k, b in enumerate(bounds))


def _spread(points, most=12):
    """At most about a dozen of many points, spread over all of them."""
    return points[:: max(1, len(points) // most)]


def differ(expressions):
    """Whether the expressions differ where all variables have the same values."""
    numbers = [n for n in map(_at_fixed_values, expressions) if n is not None]
    return bool(numbers) and max(numbers) - min(numbers) > 1e-9 * max(1.0, *map(abs, numbers))


def _at_fixed_values(expression):
    """Value where the k-th variable of the expression is 0.7 + 0.11 k; None where it has none."""
    body = expression()
    kept = [(v, v.value, v.stale) for v in identify_variables(body, include_fixed=True)]
    try:
        for k, (v, _, _) in enumerate(kept):
            v.set_value(0.7 + 0.11 * k, skip_validation=True)
        number = value(body, exception=False)
        return number if isinstance(number, (int, float)) and isfinite(number) else None
    except (ArithmeticError, ValueError):
        return None
    finally:
        for v, old, stale in kept:
            v.set_value(old, skip_validation=True)
            v.stale = stale
