"""The minimal form for two modes and one switching function: one multiplier (theory, eq. 5).

    c(x) = p - n,    0 <= 1 - nu  perp  p >= 0,    0 <= nu  perp  n >= 0

with mode 1 where c > 0 and nu its multiplier; p and n are the positive and the negative part of c, continuous in time.

Takes: a ``System`` of two modes that share one switching function.
Leaves: ``nu``, ``p``, ``n``, ``switching`` (c = p - n), ``complementarity`` (index 1 and 2: the modes), ``mode`` (eq. 7).
Does not apply: more than two modes, or a region of more than one condition.
"""

from pyomo.core import Constraint, Var
from pyomo.mpec import Complementarity, complements

from pyomo_fesd import marks
from pyomo_fesd.dcs.regions import value_now

NAME = 'two_mode'


def applies(system):
    """Two modes on the two sides of one switching function."""
    return len(system.modes) == 2 and len(system.regions.functions) == 1


def why_not(system):
    """What is too much for it."""
    return f"{len(system.modes)} modes with {len(system.regions.functions)} switching function(s)"


def size(system):
    """Nothing to count: there is one size only."""
    return None


def count(system):
    """Variables, constraints and pairs of one time."""
    return 6


def declare(block, index, size):
    """Declare the components of the form over ``index`` (a tuple of sets, empty for a scalar Disjunction)."""
    sparse = {'dense': False} if index else {}
    block.nu = Var(*index, **sparse, bounds=(0, 1))
    block.p = Var(*index, **sparse, bounds=(0, None))
    block.n = Var(*index, **sparse, bounds=(0, None))
    block.switching = Constraint(*index)
    block.complementarity = Complementarity(*index, [1, 2])
    marks.mark(block, marks.SELECTOR, block.nu)
    for part in (block.p, block.n):
        marks.mark(block, marks.CONTINUOUS, part, block.switching)


def add(block, index, system):
    """Add one time of one Disjunction; ``index`` is a tuple."""
    nu, p, n = (getattr(block, name)[index or None] for name in ('nu', 'p', 'n'))
    (c,) = system.regions.functions  # the first mode's own condition: it holds where c >= 0
    now = value_now(c) or 0.0
    nu.value, p.value, n.value = 0.5, max(now, 0.0), max(-now, 0.0)
    block.switching.add(index or None, c == p - n)
    block.complementarity.add((*index, 1), complements(nu >= 0, n >= 0))
    block.complementarity.add((*index, 2), complements(1 - nu >= 0, p >= 0))


def weight(block, index, system, modes):
    """The multiplier of one of the two modes: nu or 1 - nu."""
    (mode,) = modes
    nu = block.nu[index or None]
    return 1 - nu if mode else nu


def owners(system):
    """The modes whose multiplier each pair holds."""
    return [0, 1]


def equations(block, index):
    """The equations of one time."""
    return [block.switching[index or None]]
