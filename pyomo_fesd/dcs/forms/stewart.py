"""Stewart's form for any number of modes with regions given by signs (theory, eq. 3 and 4).

    g_i(x) - lam_i - mu = 0,    sum_i nu_i = 1,    0 <= nu_i  perp  lam_i >= 0,    g = -S c(x)

Takes: a ``ModeSystem`` whose regions are full sign patterns; a mode that leaves a sign open owns several patterns.
Leaves: ``nu``, ``lam`` (by region), ``mu``, ``stationarity``, ``simplex``, ``complementarity``, ``mode`` (eq. 7).
Applies always; for two modes the Heaviside form is smaller.
"""

from collections.abc import Iterable

from pyomo.core.base.block import BlockData

from pyomo_fesd.core import add_smallest, declare_smallest, start_smallest, stored_index, without_unit
from pyomo_fesd.dcs.reading import ModeSystem

NAME = 'stewart'


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
    declare_smallest(block, sets, regions)


def add(block: BlockData, index: tuple, system: ModeSystem) -> None:
    """Add one time of one Disjunction."""
    patterns = [pattern for owned in system.regions.geometry.patterns for pattern in owned]
    functions = [without_unit(c) for c in system.regions.functions]
    add_smallest(
        block,
        index,
        [sum(-c if sign > 0 else c for sign, c in zip(pattern, functions)) for pattern in patterns],
    )


def start(block: BlockData, variables: tuple, arguments: tuple) -> None:
    """Set the start values of the ``variables`` of one time from the functions g_i."""
    start_smallest(variables, arguments)


def weight(block: BlockData, index: tuple, system: ModeSystem, modes):
    """Return the sum of nu over the regions of some of the ``modes``, by number."""
    return sum(block.nu[(*index, i)] for i, mode in enumerate(_modes_of_regions(system), start=1) if mode in modes)


def owners(block: BlockData, index: tuple, system: ModeSystem) -> Iterable:
    """Yield each pair with the mode whose multiplier it holds."""
    for i, mode in enumerate(_modes_of_regions(system), start=1):
        yield block.complementarity[(*index, i)], mode


def equations(block: BlockData, index: tuple) -> list:
    """Return the equations of one time."""
    return [block.simplex[stored_index(index)], *(block.stationarity[(*index, i)] for i in block.regions)]


def shortfall(block: BlockData, index: tuple, system: ModeSystem, mode: int, k: int):
    """Return lam_i / 2, the sum of max(0, -S_ij c_j) over all functions: 0 where the mode is active.

    None for a mode with several regions, in one of which its lam is not 0.
    """
    own = [region for region, owner in enumerate(_modes_of_regions(system), start=1) if owner == mode]
    return 0.5 * block.lam[(*index, own[0])] if len(own) == 1 else None
