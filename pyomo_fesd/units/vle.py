"""Phases that appear and disappear in ideal vapour-liquid equilibrium (theory, below eq. 14).

    0 <= v <= 1  perp  sum_i (x_i - y_i),       x_i = z_i/(1 + v (K_i - 1)),   y_i = K_i x_i

v is the vapour fraction of a mixture z.  All liquid (v = 0): the vapour that would be in equilibrium does not add up,
sum y < sum x; between, both add up to 1 (Rachford and Rice); all vapour (v = 1): sum y > sum x.  Neither bubble nor dew point is
needed.

Takes: the vapour fraction, a variable; overall composition and K-values, K_i = p_i(T)/P for Raoult's law.
Leaves: ``x`` and ``y`` as Expressions over the components, and ``pair``, a mixed Complementarity.  v is marked as continuous where
equations tie temperature and composition to states.
Does not apply: to a pure component (K = 1 leaves v open; its modes have an enthalpy each), and where K depends on x or y.
"""

from pyomo.core import Block, Expression, inequality
from pyomo.mpec import Complementarity, complements

from pyomo_fesd.core import FesdError, index_tuple, switched_systems
from pyomo_fesd.units.over_time import block_over, variable


def vle(*sets, components, fraction, composition, ratio) -> Block:
    """Return a Block over ``sets`` with the phases of a mixture; its Expressions ``x[i]`` and ``y[i]`` are their compositions.

    Parameters
    ----------
    sets : Set, ...
        index sets, the ContinuousSet among them
    components : Set or list
        at least two
    fraction : Var over ``sets``
        mole fraction of the vapour, defined by nothing else (an energy balance defines the temperature)
    composition, ratio : function (block, index, ..., component) -> number or expression, or component over sets and components
        overall mole fractions, and K-values

    Raises
    ------
    FesdError
        for fewer than two components; when the Block is added, for a fraction that is not a Var
    """
    components = list(components)
    if len(components) < 2:
        raise FesdError('vle', f"{len(components)} component(s)", "a pure component boils at one temperature: write its modes")
    return block_over(sets, _Build(components, composition, ratio), fraction=fraction)


class _Build:
    """Fill one block."""

    def __init__(self, components, composition, ratio):
        self._components, self._composition, self._ratio = components, composition, ratio

    def __call__(self, block, fraction):
        v = variable(fraction, block, 'fraction')
        z, K = ({i: _of(given, block, i) for i in self._components} for given in (self._composition, self._ratio))
        block.x = Expression(self._components, rule=lambda b, i: z[i] / (1 + v * (K[i] - 1)))
        block.y = Expression(self._components, rule=lambda b, i: K[i] * block.x[i])
        missing = sum(block.x[i] - block.y[i] for i in self._components)
        block.pair = Complementarity(expr=complements(inequality(0, v, 1), missing))
        switched_systems(block).continuous[v] = block.pair


def _of(given, block, i):
    """A quantity of component ``i`` at the index of ``block``."""
    index = index_tuple(block.index())
    return given(block.parent_block(), *index, i) if callable(given) and not hasattr(given, 'ctype') else given[(*index, i)]
