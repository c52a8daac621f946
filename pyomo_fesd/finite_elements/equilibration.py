"""Step equilibration: where nothing switches between two elements, their lengths are equal (theory, eq. 12 and 13).

For time complementarity i and element n let G_n and H_n be the sums of eq. (11a) (nu and lam).  In an exactly complementary
solution the activity theta_n = G_n/(G_n + H_n) is 1 or 0, whatever the scale of lam, so

    pi_i = theta_n theta_{n+1} + (1 - theta_n)(1 - theta_{n+1}),      eta_n = prod_i pi_i               (12)

is 1 where the active set is the same in both elements and 0 where it changes.  (The raw product B_lam F_lam + B_nu F_nu vanishes
with h.)  For a mode with hysteresis the weight takes the place of theta; a state jump is a change.

Takes: the time complementarities, hysteresis and state jumps of the moving grid.
Leaves: ``activity``, ``eta``, ``equal_length`` (inactive), ``equilibration`` (a Complementarity), ``deviation`` (the penalty term).
"""

from math import prod

from pyomo.core import Block, Constraint, Expression, quicksum
from pyomo.mpec import Complementarity, complements

from pyomo_fesd.core import BranchConstraint, MovingGrid, Penalty, divided_by, homotopy_hints, insert, unit_of
from pyomo_fesd.finite_elements.contacts import impulse_activity
from pyomo_fesd.finite_elements.state_jumps import no_jump

#: Keeps the activity defined where both sums vanish (a grazing contact); far below any relevant nu or lam.
TINY = 1e-12


def two_stage(block: Block, rho: float) -> None:
    """(13): the homotopy carries only the penalty, the branch imposes h_{n+1} = h_n where eta_n > 0."""
    hints = homotopy_hints(block)
    hints.branch_constraints += [BranchConstraint(pair, block.equal_length[n]) for n, pair in block.equilibration.items()]
    hints.penalties.append(Penalty(block.deviation, rho))


def complementarity(block: Block, rho: float) -> None:
    """The paper's (10d) unchanged: (h_{n+1} - h_n)**2 perp eta_n, relaxed like any other pair."""


def penalty(block: Block, rho: float) -> None:
    """rho sum_n (r_n - 1)**2 throughout; lengths are then only nearly equal."""
    none(block, rho)
    homotopy_hints(block).penalties.append(Penalty(block.deviation, rho))


def none(block: Block, rho: float) -> None:
    """No equilibration: the lengths are free within (10)."""
    block.equilibration.deactivate()


#: keyword ``equilibration`` -> function that finishes the pairs of this file
MODES = {'two_stage': two_stage, 'complementarity': complementarity, 'penalty': penalty, 'none': none}


def add_equilibration(moving: MovingGrid, mode: str, rho: float) -> None:
    """Add eta and the equilibration pairs between consecutive elements of each control stage."""
    block = moving.block
    independent = [c for c in moving.complementarities if not c.follows]
    block.activity = moving.activity = Expression(block.condition, block.element)
    for condition in independent:
        for n, activity in _activities(condition, moving.grid.elements):
            block.activity[condition.name, n].set_value(activity)
    block.eta = moving.eta = Expression(block.element)
    block.equal_length = Constraint(block.element)
    block.equilibration = moving.equilibration = Complementarity(block.element)
    for e, f in moving.grid.inner_boundaries():
        eta = block.eta[e.n]
        eta.set_value(prod(_unchanged(moving, independent, e, f)))
        difference = (moving.element_length(f) - moving.element_length(e)) / e.length
        insert(block.equal_length, (e.n,), difference == 0)
        insert(block.equilibration, (e.n,), complements(difference**2 >= 0, eta >= 0))
    block.equal_length.deactivate()
    block.deviation = Expression(expr=quicksum((r - 1) ** 2 for r in block.r.values() if not r.fixed))
    MODES[mode](block, rho)


def _activities(condition, elements):
    """``(n, G/(G + H))`` with the sums G and H of a condition's sides over each element; what has a unit has it in all of them."""
    units = None
    for element in elements:
        if condition.points(element):
            sums = condition.sums(element)
            units = units or list(map(unit_of, sums))
            G, H = map(divided_by, sums, units)
            yield element.n, G / (G + H + TINY)


def _unchanged(moving, independent, e, f):
    """The factors of eta between elements e and f: pi_i of conditions and modes, 1 - e of state jumps."""
    pairs = ((moving.activity[c.name, e.n], moving.activity[c.name, f.n]) for c in independent)
    # a condition that one of the elements does not have contributes nothing
    both = [(a, b) for a, b in pairs if a.expr is not None and b.expr is not None]
    if moving.hysteresis is not None:
        both += [(mode.weight(e), mode.weight(f)) for mode in moving.hysteresis.modes if mode.independent]
    unchanged = [a * b + (1 - a) * (1 - b) for a, b in both]
    return [*unchanged, *no_jump(moving.state_jumps, e), *_no_impact(moving, e, f)]


def _no_impact(moving, e, f):
    """Factors that are 0 where a contact opens again after an impact; one that stays closed, or closes, counts by its force."""
    impacts = None if moving.state_jumps is None else moving.state_jumps.impacts
    if impacts is None:
        return
    names = {id(condition): c.name for c in moving.complementarities for condition in c.conditions.values()}
    for law in impacts.laws:
        name = names[id(law.touching[f.left])]
        closed = moving.activity[name, e.n] * moving.activity[name, f.n]
        yield 1 - impulse_activity(impacts, law, e.n, law.gaps[f.left], TINY) * (1 - closed)
