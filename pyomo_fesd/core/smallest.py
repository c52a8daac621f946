"""Weights of the smallest of several functions, from which Stewart's form and friction in space are made (theory, eq. 3).

    g_i - lam_i - mu = 0,    sum_i nu_i = 1,    0 <= nu_i  perp  lam_i >= 0

nu solves min_nu g^T nu on the simplex; lam and mu are continuous in time where the g_i are.

Takes: a block of its own, and the functions g_i.
Leaves: ``nu``, ``lam`` (by function), ``mu``, ``stationarity``, ``simplex``, ``complementarity`` on that block.
Does not apply: to two functions, where one step is smaller (``step.py``).
"""

from collections.abc import Sequence
from math import nan

from pyomo.core import Constraint, RangeSet, Var
from pyomo.core.base.block import BlockData
from pyomo.mpec import Complementarity, complements

from pyomo_fesd.core.evaluation import value_or_zero
from pyomo_fesd.core.switched_systems import Dependents, switched_systems
from pyomo_fesd.core.time_index import stored_index
from pyomo_fesd.core.units_of_measure import without_unit

#: Distances below this are 0.
ZERO = 1e-8


def declare_smallest(block: BlockData, sets: tuple, number: int) -> None:
    """Declare the components on ``block`` over ``sets`` for a ``number`` of functions."""
    block.regions = RangeSet(number)
    block.nu = Var(*sets, block.regions, dense=False, bounds=(0, 1))
    block.lam = Var(*sets, block.regions, dense=False, bounds=(0, None))
    block.mu = Var(*sets, **({'dense': False} if sets else {}))
    block.stationarity = Constraint(*sets, block.regions)
    block.simplex = Constraint(*sets)
    block.complementarity = Complementarity(*sets, block.regions)
    for variable in (block.lam, block.mu):
        switched_systems(block).continuous[variable] = block.stationarity


def add_smallest(block: BlockData, index: tuple, g: list) -> list:
    """Add the linear program whose solution nu weights the smallest of the functions g_i at ``index``; return nu."""
    nu, lam = ([variable[stored_index((*index, i))] for i in block.regions] for variable in (block.nu, block.lam))
    mu = block.mu[stored_index(index)]
    start_smallest((mu, *lam, *nu), g)
    for i, g_i in enumerate(g):
        block.stationarity.add(stored_index((*index, i + 1)), without_unit(g_i) - lam[i] - mu == 0)
        block.complementarity.add(stored_index((*index, i + 1)), complements(nu[i] >= 0, lam[i] >= 0))
        if i:
            # all but one: the last follows from the simplex
            switched_systems(block).selectors.add(nu[i])
    block.simplex.add(stored_index(index), sum(nu) == 1)
    switched_systems(block).dependents.append(Dependents((mu, *lam, *nu), tuple(g), smallest_values))
    return nu


def start_smallest(variables: Sequence, g: Sequence) -> None:
    """Set the start values of mu, lam and nu from the present values of the functions g_i."""
    mu, *lam = smallest_values([value_or_zero(g_i) for g_i in g])[: 1 + len(g)]
    for variable, start in zip(variables, (mu, *lam, *[1 / len(g)] * len(g))):
        variable.value = start


def smallest_values(g: list[float]) -> list[float]:
    """Return mu, lam and nu of values of the functions g_i; nu of the smallest ones is nan, open, where there are several."""
    mu = min(g)
    lam = [g_i - mu for g_i in g]
    zero = [distance <= ZERO for distance in lam]
    return [mu, *lam, *(0.0 if not small else 1.0 if sum(zero) == 1 else nan for small in zero)]
