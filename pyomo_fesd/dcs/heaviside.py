"""The Heaviside form: one step variable for each switching function (theory, eq. 6).

    c_k(x) = p_k - n_k,    0 <= alpha_k  perp  n_k >= 0,    0 <= 1 - alpha_k  perp  p_k >= 0
    nu_i = prod over k with S_ik != 0 of  (1 - S_ik)/2 + S_ik alpha_k

so alpha_k is 1 where c_k > 0; p_k and n_k are the positive and the negative part of c_k, continuous in time.  A sign that does
not matter to a mode (S_ik = 0) leaves no factor, and a function that matters to no mode leaves nothing.

Takes: a ``System`` whose ``cubes`` say which signs matter.
Leaves: ``alpha``, ``p``, ``n``, ``switching`` (c_k = p_k - n_k) by function, ``complementarity`` (index 2k - 1 and 2k: the two
    sides of function k), ``mode`` (eq. 7).
Does not apply: where the weights would not sum up to 1 at some point at which several surfaces meet (cubes.py).
"""

from math import prod

from pyomo.core import Constraint, RangeSet, Var
from pyomo.mpec import Complementarity, complements

from pyomo_fesd import marks
from pyomo_fesd.dcs.cubes import not_covered_once
from pyomo_fesd.dcs.regions import value_now

NAME = 'heaviside'


def applies(system):
    """Every pattern of signs that can be touched belongs to one mode."""
    return system.regions.geometry.cubes is not None


def why_not(system):
    """The pattern of signs that is in the way."""
    pattern, number = not_covered_once(system.regions.geometry.signs, system.regions.geometry.touchable)
    where = ' and '.join(f"{c} {'>=' if s > 0 else '<='} 0" for c, s in zip(system.regions.functions, pattern))
    return f"where {where}, which can be so only where surfaces meet, the signs of {number} modes fit instead of one"


def size(system):
    """Number of switching functions that matter."""
    return len(system.regions.geometry.cubes.used)


def count(system):
    """Variables, constraints and pairs of one time."""
    return 6 * size(system)


def declare(block, index, functions):
    """Declare the components of the form over ``index`` (a tuple of sets) for a number of switching ``functions``."""
    block.functions = RangeSet(functions)
    block.alpha = Var(*index, block.functions, dense=False, bounds=(0, 1))
    block.p = Var(*index, block.functions, dense=False, bounds=(0, None))
    block.n = Var(*index, block.functions, dense=False, bounds=(0, None))
    block.switching = Constraint(*index, block.functions)
    block.sides = RangeSet(2 * functions)
    block.complementarity = Complementarity(*index, block.sides)
    marks.mark(block, marks.SELECTOR, block.alpha)
    for part in (block.p, block.n):
        marks.mark(block, marks.CONTINUOUS, part, block.switching)


def add(block, index, system):
    """Add one time of one Disjunction."""
    for k, position in zip(block.functions, system.regions.geometry.cubes.used):
        c = system.regions.functions[position]
        alpha, p, n = (var[(*index, k)] for var in (block.alpha, block.p, block.n))
        now = value_now(c) or 0.0
        # on the side of c_k as it is now, but not at the bound: with 1/2 the solver took longer, from the bound much longer
        alpha.value, p.value, n.value = 0.5 + 0.4 * ((now > 0) - (now < 0)), max(now, 0.0), max(-now, 0.0)
        block.switching.add((*index, k), c == p - n)
        block.complementarity.add((*index, 2 * k - 1), complements(alpha >= 0, n >= 0))
        block.complementarity.add((*index, 2 * k), complements(1 - alpha >= 0, p >= 0))


def weight(block, index, system, modes):
    """The sum of nu_i over some of the ``modes``, by number."""
    cubes = system.regions.geometry.cubes
    alpha = [block.alpha[(*index, k)] for k in block.functions]
    own = cubes.covering(frozenset(modes))
    others = cubes.covering(frozenset(range(len(system.modes))) - frozenset(modes))
    if len(others) == 1 and sum(map(abs, others[0])) == 1:
        # the other side of one function
        own = [tuple(-sign for sign in others[0])]
    return sum(prod(a if sign > 0 else 1 - a for a, sign in zip(alpha, row) if sign) for row in own)


def owners(system):
    """The modes whose multiplier each pair holds; None where a step variable is no mode's own."""
    rows, found = system.regions.geometry.cubes.rows, []
    for k in range(len(rows[0])):
        for sign in (1, -1):
            alone = tuple(sign if j == k else 0 for j in range(len(rows[0])))
            found.append(rows.index(alone) if alone in rows else None)
    return found


def equations(block, index):
    """The equations of one time."""
    return [block.switching[(*index, k)] for k in block.functions]
