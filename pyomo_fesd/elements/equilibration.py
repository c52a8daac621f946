"""Step equilibration: where nothing switches between two elements their lengths are equal (theory, eq. 12 and 13).

For family i and element n let G_n and H_n be the sums of eq. (11a) (nu and lam).  In an exactly complementary solution
theta_n = G_n/(G_n + H_n) is 1 or 0, whatever the scale of lam, so

    pi_i = theta_n theta_{n+1} + (1 - theta_n)(1 - theta_{n+1}),      eta_n = prod_i pi_i               (12)

is 1 where the active set goes on and 0 where it changes.  (The raw product B_lam F_lam + B_nu F_nu vanishes with h.)

A mode with memory has its weight in the place of theta; a jump of the state is a change.

Takes: the families of ``cross`` that switch by themselves, the modes of ``memory``, the jumps on the block.
Leaves: ``eta``, ``equal_length`` (inactive), ``equilibration`` (a Complementarity), ``deviation`` (the penalty term).
"""

from math import prod

from pyomo.core import Constraint, Expression, quicksum
from pyomo.mpec import Complementarity, complements

from pyomo_fesd import marks
from pyomo_fesd.elements import jumps
from pyomo_fesd.elements.lengths import element_length

#: Keeps theta defined where both sums vanish (a grazing contact); far below any nu or lam that means something.
TINY = 1e-12


def two_stage(block, rho):
    """(13): the homotopy carries only the penalty, the branch imposes h_{n+1} = h_n where eta_n > 0."""
    for n, pair in block.equilibration.items():
        marks.mark(block, marks.DECIDED, pair, block.equal_length[n])
    marks.mark(block, marks.PENALTY, block.deviation, rho)


def complementarity(block, rho):
    """The paper's (10d) as it stands: (h_{n+1} - h_n)**2 perp eta_n, relaxed like any other pair."""


def penalty(block, rho):
    """rho sum_n (r_n - 1)**2 throughout; lengths are then only nearly equal."""
    block.equilibration.deactivate()
    marks.mark(block, marks.PENALTY, block.deviation, rho)


def none(block, rho):
    """Nothing: the lengths are free within (10)."""
    block.equilibration.deactivate()


#: keyword ``equilibration`` -> how the pairs of this file are treated
MODES = {'two_stage': two_stage, 'complementarity': complementarity, 'penalty': penalty, 'none': none}


def add_equilibration(block, families, modes, grid, mode, rho):
    """Add eta and the equilibration pairs between consecutive elements of each control stage."""
    families = [f for f in families if not f.follows]
    by_number = {e.n: e for e in grid.elements}
    inner = [(e.n, f.n) for elements in grid.stages.values() for e, f in zip(elements, elements[1:])]
    block.theta = Expression(block.family, block.element)
    for family in families:
        for element in grid.elements:
            if family.points(element):
                G, H = (quicksum(family.values(element, side, grid.right_is_stage)) for side in (0, 1))
                block.theta[family.name, element.n] = G / (G + H + TINY)
    block.eta = Expression(block.element)
    block.equal_length = Constraint(block.element)
    block.equilibration = Complementarity(block.element)
    for n, m in inner:
        remembered = [a.unchanged(by_number[n], by_number[m]) for a in modes if a.independent]
        block.eta[n] = prod([*_unchanged(block, families, n, m), *remembered, *jumps.unchanged(block, by_number[n])])
        difference = element_length(block, by_number[m]) - element_length(block, by_number[n])
        block.equal_length.add(n, difference == 0)
        block.equilibration.add(n, complements((difference / by_number[n].length) ** 2 >= 0, block.eta[n] >= 0))
    block.equal_length.deactivate()
    block.deviation = Expression(expr=quicksum((r - 1) ** 2 for r in block.r.values() if not r.fixed))
    MODES[mode](block, rho)


def _unchanged(block, families, n, m):
    """pi_i of every family between elements n and m = n + 1."""
    pairs = [(block.theta[f.name, n], block.theta[f.name, m]) for f in families]
    # a family that is not there in one of them does not tell
    return [a * b + (1 - a) * (1 - b) for a, b in pairs if a.expr is not None and b.expr is not None]
