"""Smooth exits: a slide, or a contact, that ends without a kink of the trajectory (theory, section 3; not in the paper).

A slide ends where its multiplier arrives at zero, G(t_s) = 0, and the side H that then grows leaves zero without a slope.  The
signs of both at the collocation points leave the boundary free between t_s - c_1 h/2 and t_s: with eq. (11) alone the boundary is
accurate to O(h), the state to O(h^2).  The missing condition is that G itself arrives at zero,

    G_n(1) = 0    where  theta_n = 1,  theta_{n+1} = 0  and  (H'_{n+1}(0) <= 0  or  G_n(1) <= 0)

with the activity theta of step equilibration, G_n(1) by the polynomial through the values at the collocation points of element n,
and H'_{n+1}(0) by that through the values of element n + 1 with its left boundary (an exit that is too early has H' < 0; one that
is too late, which only Gauss allows, has G_n(1) < 0).  An exit enforced by a jump of another quantity has H' > 0, and G stays
positive.

Takes: the time complementarities with one continuous side, and their activity.
Leaves: ``slope`` and ``below`` (positive where H has no slope, where G ends below zero), ``arrival`` (inactive), ``exit``
(Complementarities), decided by the branch like equal lengths, and dropped where they leave no solution.
Does not apply: with one collocation point, whose polynomial has no slope; at boundaries of control stages.
"""

from functools import cache

import numpy as np
from pyomo.core import Constraint, Expression
from pyomo.mpec import Complementarity, complements

from pyomo_fesd.core import BranchConstraint, MovingGrid, homotopy_hints, insert, interpolation_weights, sum_of, weighted_sum
from pyomo_fesd.finite_elements.equilibration import TINY

#: H'(0), relative to the sum of its terms' sizes, below which H leaves zero without a slope.
FLAT = 0.1


def add_sliding_exits(moving: MovingGrid) -> None:
    """Add the condition on every boundary inside the control stages, for every time complementarity that can leave a slide."""
    block, tau = moving.block, moving.grid.tau
    if len(tau) < 2:
        return
    slope, end = derivative_at_zero(tau), value_at_one(tau)
    block.arrival = Constraint(block.condition, block.element)
    # named expressions: a solver's file states them once
    block.slope = Expression(block.condition, block.element)
    block.below = Expression(block.condition, block.element)
    block.exit = Complementarity(block.condition, block.element)
    inner, hints = list(moving.grid.inner_boundaries()), homotopy_hints(block).branch_constraints
    for condition in moving.complementarities:
        if condition.continuous == (False, True) and not condition.follows:
            for e, f in inner:
                if len(condition.points(e)) == len(tau) == len(condition.points(f)) and f.left in condition.sides:
                    hints.append(_exit_condition(block, condition, e, f, slope, end))
    block.arrival.deactivate()


def _exit_condition(block, condition, e, f, slope, end):
    """Add the exit of one time complementarity at the boundary between elements e and f; return it for the homotopy."""
    index, values = (condition.name, e.n), [condition.sides[t][0] for t in e.points]
    G = sum_of([weight * value for weight, value in zip(end, values) if weight])
    H = [condition.starts.get(f.n, condition.sides[f.left])[1], *(condition.sides[t][1] for t in f.points)]
    flat = _positive(_stated(block.slope[index], 1 - _relative_slope(slope, H) / FLAT))
    if min(end) < 0:
        # with Radau the last collocation point is the end, and its value not negative
        flat += _positive(_stated(block.below[index], -_relative_slope(end, values) / FLAT))
    leaves = block.activity[index] * (1 - block.activity[condition.name, f.n])
    arrival = insert(block.arrival, index, G == 0)
    pair = insert(block.exit, index, complements(G**2 >= 0, leaves * flat >= 0))
    return BranchConstraint(pair, arrival, tentative=True)


def _relative_slope(weights, values):
    """sum_j w_j f_j in relation to sum_j |w_j| f_j."""
    sizes = map(abs, weights)
    return weighted_sum(list(zip(weights, values))) / (weighted_sum(list(zip(sizes, values))) + TINY)


def _stated(named, expr):
    """A named Expression that gets the content ``expr``."""
    named.set_value(expr)
    return named


def _positive(expr):
    return (abs(expr) + expr) / 2


@cache
def derivative_at_zero(tau: tuple[float, ...]) -> tuple[float, ...]:
    """Return d with f'(0) = sum_j d_j f(c_j) for polynomials through 0, c_1, ..., c_K."""
    return tuple(interpolation_weights([0.0, *tau], np.eye(len(tau) + 1)[1]).tolist())


@cache
def value_at_one(tau: tuple[float, ...]) -> tuple[float, ...]:
    """Return l with f(1) = sum_j l_j f(c_j) for polynomials through c_1, ..., c_K; exact zeros where c_K = 1."""
    if tau[-1] == 1:
        return (*[0.0] * (len(tau) - 1), 1.0)
    return tuple(interpolation_weights(tau, np.ones(len(tau))).tolist())
