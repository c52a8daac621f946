"""``Integral`` on moving elements: the quadrature of the scheme with the variable lengths.

    int y dt = sum_n h_n sum_r b_r y(t_{n,r})

pyomo.dae itself uses the trapezoid rule on the labels, which is wrong as soon as an element moves.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache

from pyomo.core import Block, Expression
from pyomo.dae import ContinuousSet, Integral

from pyomo_fesd.core import FesdError, MovingGrid, index_tuple, integrand_rewriter, own_components


@dataclass(frozen=True)
class Integrand:
    """The integrand of one integral.

    Attributes
    ----------
    integral : Integral
    index : index of the integral, None if it is not indexed
    at : callable label -> expression
        the user's function, each value built once and rewritten by the transformations that were applied before
    """

    integral: Integral
    index: object
    at: Callable

    @property
    def name(self) -> str:
        """Name and index of the integral."""
        index = index_tuple(self.index)
        return f'{self.integral.name}[{",".join(map(str, index))}]' if index else self.integral.name


def integrands(block: Block, wrt: ContinuousSet) -> Iterator[Integrand]:
    """Yield the integrands of every Integral over ``wrt``, also after pyomo.dae made it an Expression."""
    for integral in integrals(block, wrt):
        rule, rewrite = _integrand_rule(integral), integrand_rewriter(integral, wrt)
        for index in integral.index_set() if integral.is_indexed() else [None]:
            yield Integrand(integral, index, cache(_at(integral, index_tuple(index), rule, rewrite)))


def integrals(block: Block, wrt: ContinuousSet) -> Iterator[Integral]:
    """Yield every Integral over ``wrt``, also after pyomo.dae made it an Expression."""
    for integral in own_components(block, (Integral, Expression), Block):
        if isinstance(integral, Integral) and integral.get_continuousset() is wrt:
            yield integral


def _at(integral, index, rule, rewrite):
    before, after = index[: integral.loc], index[integral.loc :]
    return lambda label: rewrite(rule(integral.parent_block(), *before, label, *after))


def _integrand_rule(integral):
    """The user's own function; pyomo.dae keeps it inside the rule that it builds."""
    try:
        return integral._rule._fcn.__globals__['rule']
    except (AttributeError, KeyError):
        raise FesdError(
            integral,
            "its integrand cannot be read back from this version of pyomo.dae",
            "integrate with a state of its own: m.dJ[t] == ..., m.J[0] = 0",
        ) from None


def rebuild(moving: MovingGrid, integrand: Integrand) -> None:
    """Set an integral to the moving quadrature."""
    integral, grid = integrand.integral, moving.grid
    if integral.ctype is Integral:
        integral.parent_block().reclassify_component_type(integral, Expression)
    integral[integrand.index] = sum(
        moving.duration(e) * sum(b * integrand.at(t) for b, t in zip(grid.weights, e.points)) for e in grid.elements
    )
