"""Weights of the smallest of several functions, from which Stewart's form and friction in space are made (theory, eq. 3).

    g_i - lam_i - mu = 0,    sum_i nu_i = 1,    0 <= nu_i  perp  lam_i >= 0

nu solves min_nu g^T nu on the simplex; lam and mu are continuous in time where the g_i are.

Takes: a block of its own, and the functions g_i.
Leaves: ``nu``, ``lam`` (by function), ``mu``, ``stationarity``, ``simplex``, ``complementarity`` on that block.
Does not apply: to two functions, where one step is smaller (``step.py``).
"""

from pyomo.core import Constraint, RangeSet, Var
from pyomo.core.base.block import BlockData
from pyomo.mpec import Complementarity, complements

from pyomo_fesd.core.evaluation import value_or_zero
from pyomo_fesd.core.switched_systems import switched_systems


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
    # with one index set only, Pyomo wants the index itself
    nu, lam = ([variable[(*index, i) if index else i] for i in block.regions] for variable in (block.nu, block.lam))
    mu = block.mu[index or None]
    now = [value_or_zero(g_i) for g_i in g]
    mu.value = min(now)
    for i, g_i in enumerate(g):
        nu[i].value, lam[i].value = 1 / len(g), now[i] - mu.value
        block.stationarity.add((*index, i + 1) if index else i + 1, g_i - lam[i] - mu == 0)
        block.complementarity.add((*index, i + 1) if index else i + 1, complements(nu[i] >= 0, lam[i] >= 0))
        if i:
            # all but one: the last follows from the simplex
            switched_systems(block).selectors.add(nu[i])
    block.simplex.add(index or None, sum(nu) == 1)
    return nu
