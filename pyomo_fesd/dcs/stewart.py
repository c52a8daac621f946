"""Stewart's form for any number of modes with regions given by signs (theory, eq. 3 and 4).

    g_i(x) - lam_i - mu = 0,    sum_i nu_i = 1,    0 <= nu_i  perp  lam_i >= 0,    g = -S c(x)

Takes: a ``System`` whose regions are full sign patterns; a mode that leaves a sign open owns several patterns.
Leaves: ``nu``, ``lam`` (by region), ``mu``, ``stationarity``, ``simplex``, ``complementarity``, ``mode`` (eq. 7).
Does not apply: never; for two modes eq. (5) is smaller.
"""

from pyomo.core import Constraint, RangeSet, Var
from pyomo.mpec import Complementarity, complements

from pyomo_fesd import marks
from pyomo_fesd.dcs.regions import value_now

NAME = 'stewart'


def applies(system):
    """Any system of modes."""
    return True


def size(system):
    """Number of regions, counting each full sign pattern."""
    return len(owners(system))


def count(system):
    """Variables, constraints and pairs of one time."""
    return 4 * size(system) + 2


def owners(system):
    """The modes whose multiplier each pair holds: one region after the other."""
    return [mode for mode, patterns in enumerate(system.regions.geometry.patterns) for _ in patterns]


def declare(block, index, regions):
    """Declare the components of the form over ``index`` (a tuple of sets) for a number of ``regions``."""
    block.regions = RangeSet(regions)
    block.nu = Var(*index, block.regions, dense=False, bounds=(0, 1))
    block.lam = Var(*index, block.regions, dense=False, bounds=(0, None))
    block.mu = Var(*index, **({'dense': False} if index else {}))
    block.stationarity = Constraint(*index, block.regions)
    block.simplex = Constraint(*index)
    block.complementarity = Complementarity(*index, block.regions)
    for part in (block.lam, block.mu):
        marks.mark(block, marks.CONTINUOUS, part, block.stationarity)


def add(block, index, system):
    """Add one time of one Disjunction."""
    patterns = [pattern for owned in system.regions.geometry.patterns for pattern in owned]
    minimise(
        block,
        index,
        [sum(-c if sign > 0 else c for sign, c in zip(pattern, system.regions.functions)) for pattern in patterns],
    )


def minimise(block, index, g):
    """Add the linear program that puts the weight on the smallest of the functions g_i; returns nu."""
    nu = [block.nu[(*index, i)] for i in block.regions]
    lam = [block.lam[(*index, i)] for i in block.regions]
    mu = block.mu[index or None]
    now = [value_now(g_i) or 0.0 for g_i in g]
    mu.value = min(now)
    for i, g_i in enumerate(g):
        nu[i].value, lam[i].value = 1 / len(g), now[i] - mu.value
        block.stationarity.add((*index, i + 1), g_i - lam[i] - mu == 0)
        block.complementarity.add((*index, i + 1), complements(nu[i] >= 0, lam[i] >= 0))
        if i:
            # all but one: the last follows from the simplex
            marks.mark(block, marks.SELECTOR, nu[i])
    block.simplex.add(index or None, sum(nu) == 1)
    return nu


def weight(block, index, system, modes):
    """The sum of nu over the regions of some of the ``modes``, by number."""
    return sum(block.nu[(*index, i)] for i, mode in enumerate(owners(system), start=1) if mode in modes)


def equations(block, index):
    """The equations of one time."""
    return [block.simplex[index or None], *(block.stationarity[(*index, i)] for i in block.regions)]
