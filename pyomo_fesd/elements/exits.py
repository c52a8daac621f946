"""Smooth exits: where a slide, or a contact, is left without a kink (theory, section 3; not in the paper).

A slide ends where its multiplier arrives at zero, G(t_s) = 0, and the side H that then grows leaves zero without a slope.  The
signs of both at the stage points leave the boundary free between t_s - c_1 h/2 and t_s: eq. (11) alone is right to O(h) there, the
state to O(h^2).  What is missing is that G itself arrives at zero,

    G_n(1) = 0    where  theta_n = 1,  theta_{n+1} = 0  and  (H'_{n+1}(0) <= 0  or  G_n(1) <= 0)

with G_n(1) by the polynomial through the stage values of element n and H'_{n+1}(0) by that through the values of element n + 1 with
its left boundary (too early an exit has H' < 0; too late a one, which only Gauss allows, G_n(1) < 0).  An exit that a jump of
something else enforces has H' > 0, and G stays positive.

Takes: the families of ``cross`` with one continuous side, ``theta`` of step equilibration.
Leaves: ``slope`` and ``below`` (positive where H has no slope, where G ends below zero), ``arrival`` (inactive), ``exit``
(Complementarities), decided by the branch like equal lengths, and dropped where they leave
no solution.
Does not apply: with one stage, whose polynomial has no slope to tell; at boundaries of control stages.
"""

import numpy as np
from pyomo.core import Constraint, Expression, quicksum
from pyomo.mpec import Complementarity, complements

from pyomo_fesd import marks
from pyomo_fesd.elements.equilibration import TINY

#: H'(0), relative to the sizes that it is the difference of, below which H leaves zero without a slope.
FLAT = 0.1


def add_exits(block, families, grid):
    """Add the condition on every boundary inside the control stages, for every family that can leave a slide."""
    if len(grid.tau) < 2:
        return
    slope, end = _derivative_at_zero(grid.tau), _value_at_one(grid.tau)
    block.arrival = Constraint(block.family, block.element)
    # by name, so that a solver's file says them once
    block.slope = Expression(block.family, block.element)
    block.below = Expression(block.family, block.element)
    block.exit = Complementarity(block.family, block.element)
    inner = [(e, f) for elements in grid.stages.values() for e, f in zip(elements, elements[1:])]
    for family in families:
        if family.continuous != (False, True) or family.follows:
            continue
        for e, f in inner:
            if len(family.points(e)) == len(grid.tau) == len(family.points(f)) and f.left in family.sides:
                _add(block, family, e, f, slope, end)
    block.arrival.deactivate()


def _add(block, family, e, f, slope, end):
    stages = [family.sides[t][0] for t in e.points]
    G = quicksum(weight * value for weight, value in zip(end, stages) if weight)
    H = [family.starts.get(f.n, family.sides[f.left])[1], *(family.sides[t][1] for t in f.points)]
    block.slope[family.name, e.n] = 1 - _relative(slope, H) / FLAT
    flat = _positive(block.slope[family.name, e.n])
    if min(end) < 0:
        # with Radau the last stage is the end, and its value not negative
        block.below[family.name, e.n] = -_relative(end, stages) / FLAT
        flat += _positive(block.below[family.name, e.n])
    leaves = block.theta[family.name, e.n] * (1 - block.theta[family.name, f.n])
    block.arrival.add((family.name, e.n), G == 0)
    pair = block.exit.add((family.name, e.n), complements(G**2 >= 0, leaves * flat >= 0))
    marks.mark(block, marks.DECIDED, pair, block.arrival[family.name, e.n])
    marks.mark(block, marks.TENTATIVE, pair)


def _relative(weights, values):
    """sum_j w_j f_j in relation to sum_j |w_j| f_j."""
    return quicksum(w * f for w, f in zip(weights, values)) / (quicksum(abs(w) * f for w, f in zip(weights, values)) + TINY)


def _positive(expr):
    return (abs(expr) + expr) / 2


def _derivative_at_zero(tau):
    """d_j with f'(0) = sum_j d_j f(c_j) for polynomials through 0, c_1, ..., c_K."""
    nodes = np.array([0.0, *tau])
    powers = np.vander(nodes, increasing=True).T
    return [float(d) for d in np.linalg.solve(powers, np.eye(len(nodes))[1])]


def _value_at_one(tau):
    """l_j with f(1) = sum_j l_j f(c_j) for polynomials through c_1, ..., c_K; exact zeros where c_K = 1."""
    if tau[-1] == 1:
        return [0.0] * (len(tau) - 1) + [1.0]
    powers = np.vander(tau, increasing=True).T
    return [float(v) for v in np.linalg.solve(powers, np.ones(len(tau)))]
