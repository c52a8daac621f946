"""``Integral`` on moving elements: the quadrature of the scheme with the variable lengths.

    int y dt = sum_n h_n sum_r b_r y(t_{n,r})

pyomo.dae itself uses the trapezoid rule on the labels, which is wrong as soon as an element moves.
"""

from functools import cache

from pyomo.core import Block, Expression
from pyomo.dae import Integral

from pyomo_fesd.elements.lengths import duration
from pyomo_fesd.errors import FesdError
from pyomo_fesd.records import rewriter


def integrals(block, wrt):
    """Every Integral with respect to ``wrt``, also after pyomo.dae made it an Expression."""
    found = block.component_objects((Integral, Expression), descend_into=Block)
    return [c for c in found if isinstance(c, Integral) and c.get_continuousset() is wrt]


def integrand(integral, wrt):
    """The function that the user integrates, each value built once and passed on to the transformations applied before."""
    rule, rewrite = _rule(integral), rewriter(integral, wrt)
    return cache(lambda *args: rewrite(rule(*args)))


def _rule(integral):
    """The user's own function; pyomo.dae keeps it inside the rule that it builds."""
    try:
        return integral._rule._fcn.__globals__['rule']
    except (AttributeError, KeyError):
        raise FesdError(
            integral,
            "its integrand cannot be read back from this version of pyomo.dae",
            "integrate with a state of its own: m.dJ[t] == ..., m.J[0] = 0",
        ) from None


def rebuild(integral, rule, block, grid):
    """Set an Integral to the moving quadrature."""
    home = integral.parent_block()
    if integral.ctype is Integral:
        home.reclassify_component_type(integral, Expression)
    indices = list(integral.index_set()) if integral.is_indexed() else [()]
    for index in indices:
        index = index if isinstance(index, tuple) else (index,)
        before, after = index[: integral.loc], index[integral.loc :]
        total = sum(
            duration(block, e) * sum(b * rule(home, *before, t, *after) for b, t in zip(grid.weights, e.points))
            for e in grid.elements
        )
        if integral.is_indexed():
            integral[index if len(index) > 1 else index[0]] = total
        else:
            integral.set_value(total)
