"""The step function of an expression, the one jump from which functions that jump are made (theory, eq. 5).

    c = p - n,    0 <= alpha  perp  n >= 0,    0 <= 1 - alpha  perp  p >= 0

so alpha is 1 where c > 0 and 0 where c < 0; p = max(0, c) and n = max(0, -c) come with it, continuous in time where c is.

Takes: a block of its own, and c as an expression.
Leaves: ``alpha``, ``p``, ``n``, ``switching`` (c = p - n) and ``complementarity`` (index 1 and 2) on that block.
Does not apply: to functions that have a kink but do not jump; they need one variable only (kink.py).
"""

from pyomo.core import Constraint, Var
from pyomo.mpec import Complementarity, complements

from pyomo_fesd import marks
from pyomo_fesd.dcs.regions import value_now


def declare(block, *index):
    """Declare the components on ``block`` over the sets ``index``."""
    block.alpha = Var(*index, dense=False, bounds=(0, 1))
    block.p = Var(*index, dense=False, bounds=(0, None))
    block.n = Var(*index, dense=False, bounds=(0, None))
    block.switching = Constraint(*index)
    block.complementarity = Complementarity(*index, [1, 2])
    marks.mark(block, marks.SELECTOR, block.alpha)
    for part in (block.p, block.n):
        marks.mark(block, marks.CONTINUOUS, part, block.switching)


def add(block, index, c):
    """Add the step function of c at ``index`` (a tuple)."""
    alpha, p, n = block.alpha[index], block.p[index], block.n[index]
    now = value_now(c) or 0.0
    alpha.value, p.value, n.value = 0.5, max(now, 0.0), max(-now, 0.0)
    block.switching.add(index, c == p - n)
    block.complementarity.add((*index, 1), complements(alpha >= 0, n >= 0))
    block.complementarity.add((*index, 2), complements(1 - alpha >= 0, p >= 0))
