"""The Heaviside form: one step function for each switching function (theory, eq. 5 and 6).

    c_k(x) = p_k - n_k,    0 <= alpha_k  perp  n_k >= 0,    0 <= 1 - alpha_k  perp  p_k >= 0
    nu_i = prod over k with S_ik != 0 of  (1 - S_ik)/2 + S_ik alpha_k

so alpha_k is 1 where c_k > 0; p_k and n_k are the positive and the negative part of c_k, continuous in time.  A sign that does
not matter to a mode (S_ik = 0) leaves no factor, and a function that matters to no mode leaves nothing.  For two modes on the
two sides of one function, nu_1 = alpha and nu_2 = 1 - alpha (eq. 5): the smallest form.

Takes: a ``ModeSystem`` whose ``implicants`` say which signs matter.
Leaves: the step functions (``core/step.py``), with an index k in front of the side where there are several; ``mode`` (eq. 7).
Does not apply: where the weights would not sum up to 1 at some point at which several boundaries meet
    (``reading/sign_implicants.py``).
"""

from collections.abc import Iterable

from pyomo.core import RangeSet
from pyomo.core.base.block import BlockData

from pyomo_fesd.core import add_step, declare_step, product_of, start_step, stored_index, sum_of
from pyomo_fesd.dcs.reading import ModeSystem, not_covered_once

NAME = 'heaviside'


def applies(system: ModeSystem) -> bool:
    """Whether every sign pattern that some point touches belongs to one mode."""
    return system.regions.geometry.implicants is not None


def why_not(system: ModeSystem) -> str:
    """Describe the sign pattern that does not belong to one mode."""
    pattern, number = not_covered_once(system.regions.geometry.signs, system.regions.geometry.touchable)
    where = ' and '.join(f"{c} {'>=' if s > 0 else '<='} 0" for c, s in zip(system.regions.functions, pattern))
    return f"where {where}, which can be so only where surfaces meet, the signs of {number} modes fit instead of one"


def size(system: ModeSystem) -> int:
    """Return the number of switching functions that matter."""
    return len(system.regions.geometry.implicants.used)


def count(system: ModeSystem) -> int:
    """Return the number of variables, constraints and pairs of one time."""
    return 6 * size(system)


def declare(block: BlockData, sets: tuple, functions: int) -> None:
    """Declare the components of the form over ``sets`` for a number of switching ``functions``."""
    block.functions = RangeSet(functions)
    declare_step(block, *sets, *([block.functions] if functions > 1 else []))


def _indices(block, index):
    """The index of each step function at one time."""
    return [(*index, k) for k in block.functions] if len(block.functions) > 1 else [index]


def add(block: BlockData, index: tuple, system: ModeSystem) -> None:
    """Add one time of one Disjunction."""
    for key, position in zip(_indices(block, index), system.regions.geometry.implicants.used):
        add_step(block, key, system.regions.functions[position], _lean(block))


def _lean(block):
    """The start of several alpha on the side of c_k, but not at the bound: with 1/2 the solver took longer, from it much longer."""
    return 0.4 if len(block.functions) > 1 else 0.0


def start(block: BlockData, variables: tuple, arguments: tuple) -> None:
    """Set the start values of the ``variables`` of one step from its switching function."""
    start_step(variables, *arguments, _lean(block))


def weight(block: BlockData, index: tuple, system: ModeSystem, modes):
    """Return the sum of nu_i over some of the ``modes``, by number."""
    implicants = system.regions.geometry.implicants
    alpha = [block.alpha[stored_index(key)] for key in _indices(block, index)]
    rows = implicants.weighing(frozenset(modes), len(system.modes))
    return sum_of([product_of([a if sign > 0 else 1 - a for a, sign in zip(alpha, row) if sign]) for row in rows])


def owners(block: BlockData, index: tuple, system: ModeSystem) -> Iterable:
    """Yield each pair with the mode whose multiplier it holds; None where a step is not the multiplier of a single mode."""
    rows = system.regions.geometry.implicants.rows
    for k, key in enumerate(_indices(block, index)):
        for side, sign in ((1, 1), (2, -1)):
            alone = tuple(sign if j == k else 0 for j in range(len(rows[0])))
            yield block.complementarity[(*key, side)], rows.index(alone) if alone in rows else None


def equations(block: BlockData, index: tuple) -> list:
    """Return the equations of one time."""
    return [block.switching[stored_index(key)] for key in _indices(block, index)]


def shortfall(block: BlockData, index: tuple, system: ModeSystem, mode: int, k: int):
    """Return max(0, -S_ik c_k): 0 where the mode is active; None for a function without a step."""
    used = list(system.regions.geometry.implicants.used)
    if k not in used:
        return None
    key = stored_index(_indices(block, index)[used.index(k)])
    return block.n[key] if system.regions.geometry.signs[mode][k] > 0 else block.p[key]
