"""Stewart's form for any number of modes with regions given by signs (theory, eq. 3 and 4).

    g_i(x) - lam_i - mu = 0,    sum_i nu_i = 1,    0 <= nu_i  perp  lam_i >= 0,    g = -S c(x)

Takes: a ``ModeSystem`` whose regions are full sign patterns; a mode that leaves a sign open owns several patterns.
Leaves: ``nu``, ``lam`` (by region), ``mu``, ``stationarity``, ``simplex``, ``complementarity``, ``mode`` (eq. 7).
Applies always; for two modes the Heaviside form is smaller.
"""

from collections.abc import Iterable
from math import nan

from pyomo.core import Constraint, RangeSet, Var
from pyomo.core.base.block import BlockData
from pyomo.mpec import Complementarity, complements

from pyomo_fesd.core import Dependents, switched_systems, value_or_zero
from pyomo_fesd.dcs.reading import ModeSystem

NAME = 'stewart'
#: Distances below this are 0.
ZERO = 1e-8


def applies(system: ModeSystem) -> bool:
    """Return True: the form takes any system of modes."""
    return True


def size(system: ModeSystem) -> int:
    """Return the number of regions, counting each full sign pattern."""
    return len(_modes_of_regions(system))


def count(system: ModeSystem) -> int:
    """Return the number of variables, constraints and pairs of one time."""
    return 4 * size(system) + 2


def _modes_of_regions(system):
    """The mode that owns each region."""
    return [mode for mode, patterns in enumerate(system.regions.geometry.patterns) for _ in patterns]


def declare(block: BlockData, sets: tuple, regions: int) -> None:
    """Declare the components of the form over ``sets`` for a number of ``regions``."""
    block.regions = RangeSet(regions)
    block.nu = Var(*sets, block.regions, dense=False, bounds=(0, 1))
    block.lam = Var(*sets, block.regions, dense=False, bounds=(0, None))
    block.mu = Var(*sets, **({'dense': False} if sets else {}))
    block.stationarity = Constraint(*sets, block.regions)
    block.simplex = Constraint(*sets)
    block.complementarity = Complementarity(*sets, block.regions)
    for variable in (block.lam, block.mu):
        switched_systems(block).continuous[variable] = block.stationarity


def add(block: BlockData, index: tuple, system: ModeSystem) -> None:
    """Add one time of one Disjunction."""
    patterns = [pattern for owned in system.regions.geometry.patterns for pattern in owned]
    minimise(
        block,
        index,
        [sum(-c if sign > 0 else c for sign, c in zip(pattern, system.regions.functions)) for pattern in patterns],
    )


def minimise(block: BlockData, index: tuple, g: list) -> list:
    """Add the linear program whose solution nu weights the smallest of the functions g_i; return nu."""
    nu = [block.nu[(*index, i)] for i in block.regions]
    lam = [block.lam[(*index, i)] for i in block.regions]
    mu = block.mu[index or None]
    mu.value, *found = minimum_values([value_or_zero(g_i) for g_i in g])
    for i, g_i in enumerate(g):
        nu[i].value, lam[i].value = 1 / len(g), found[i]
        block.stationarity.add((*index, i + 1), g_i - lam[i] - mu == 0)
        block.complementarity.add((*index, i + 1), complements(nu[i] >= 0, lam[i] >= 0))
        if i:
            # all but one: the last follows from the simplex
            switched_systems(block).selectors.add(nu[i])
    block.simplex.add(index or None, sum(nu) == 1)
    switched_systems(block).dependents.append(Dependents((mu, *lam, *nu), tuple(g), minimum_values))
    return nu


def minimum_values(g: list[float]) -> list[float]:
    """Return mu, lam and nu of values of the functions g_i; nu of the smallest ones is nan, open, where there are several."""
    mu = min(g)
    lam = [g_i - mu for g_i in g]
    zero = [distance <= ZERO for distance in lam]
    return [mu, *lam, *(0.0 if not small else 1.0 if sum(zero) == 1 else nan for small in zero)]


def weight(block: BlockData, index: tuple, system: ModeSystem, modes):
    """Return the sum of nu over the regions of some of the ``modes``, by number."""
    return sum(block.nu[(*index, i)] for i, mode in enumerate(_modes_of_regions(system), start=1) if mode in modes)


def owners(block: BlockData, index: tuple, system: ModeSystem) -> Iterable:
    """Yield each pair with the mode whose multiplier it holds."""
    for i, mode in enumerate(_modes_of_regions(system), start=1):
        yield block.complementarity[(*index, i)], mode


def equations(block: BlockData, index: tuple) -> list:
    """Return the equations of one time."""
    return [block.simplex[index or None], *(block.stationarity[(*index, i)] for i in block.regions)]


def shortfall(block: BlockData, index: tuple, system: ModeSystem, mode: int, k: int):
    """Return lam_i / 2, the sum of max(0, -S_ij c_j) over all functions: 0 where the mode is active.

    None for a mode with several regions, in one of which its lam is not 0.
    """
    own = [region for region, owner in enumerate(_modes_of_regions(system), start=1) if owner == mode]
    return 0.5 * block.lam[(*index, own[0])] if len(own) == 1 else None
