"""``at``: a state at a physical time, by the collocation polynomial of the element that contains it."""

import numpy as np
from pyomo.core import Reference, Var, quicksum
from pyomo.core.base.indexed_component_slice import IndexedComponent_slice
from pyomo.dae import ContinuousSet

from pyomo_fesd.core import FesdError, MovingGrid, derivatives, index_sets, interpolation_weights, moving_grids
from pyomo_fesd.estimation.instants import instant


def at(variable, time: float):
    """Return the value of a state at a physical time, as an expression for objectives and constraints.

    In element n, at the place 0 <= s <= 1, collocation gives the polynomial X_n(s) through the values at the left boundary and at
    the collocation points.  States are continuous, so with the shares s_n of the elements that pass before the time t

        x(t) = x_0 + sum_n (X_n(s_n) - X_n(0)),      sum_n s_n h_n = t - t_0,      0 <= 1 - s_n  perp  s_{n+1} >= 0

    The element that contains the time is part of the solution, however the elements move, and derivatives by their lengths are
    exact.  Each time adds one variable for each element of its control stage and the pairs between them; variables at the same
    time share these.  The shares begin at the present lengths: call this after ``simulate`` or ``start_from``.

    Parameters
    ----------
    variable : Var over one ContinuousSet, or a slice of a Var, such as ``m.x[:, 'A']``
        a state without state jumps; a function of states is written with ``at`` of each
    time : float

    Raises
    ------
    FesdError
        for a variable that is not a state over time alone, for a state that jumps, before the discretisation, with a free final
        time, and for a time outside of the horizon
    """
    variable = Reference(variable) if isinstance(variable, IndexedComponent_slice) else variable
    moving = _grid(variable)
    found = instant(moving, time)
    element = moving.grid.elements
    return variable[found.begin] + quicksum(_change(moving, variable, element[n - 1], s) for n, s in found.shares.items())


def _grid(variable) -> MovingGrid:
    """The moving grid of a state that ``at`` can evaluate.

    Raises
    ------
    FesdError
        for anything else
    """
    sets = index_sets(variable) if getattr(variable, 'ctype', None) is Var else []
    if len(sets) != 1 or sets[0].ctype is not ContinuousSet:
        raise FesdError(
            getattr(variable, 'name', str(variable)),
            "at: not a Var over one ContinuousSet alone",
            "give the Var itself, e.g. at(m.x, 0.5), or a slice over time, e.g. at(m.x[:, 'A'], 0.5)",
        )
    wrt, first = sets[0], variable[sets[0].first()]
    moving = moving_grids(first.model()).get(wrt)
    if moving is None:
        raise FesdError(wrt, "at: its elements are not known yet", "apply fesd.finite_elements first")
    if not any(first is state for d in derivatives(first.model(), wrt) for state in d.get_state_var().values()):
        raise FesdError(first, "at: not a state, so it may jump between two elements", "write it by at(...) of states")
    if moving.state_jumps is not None and any(_jumps(moving, variable, e) for e in moving.grid.elements[:-1]):
        raise FesdError(first, "at: this state may jump, so it has two values at a switch", "make this time a control stage")
    return moving


def _jumps(moving, variable, element):
    """Whether a law of state jumps names the state at the end of an element."""
    return any(x is variable[element.right] for x in moving.state_jumps.values_after(element))


def _change(moving, variable, element, s):
    """X_n(s) - X_n(0) by Lagrange's polynomials, in Horner's form."""
    coefficients = _coefficients(moving.grid.tau)
    rises = [variable[label] - variable[element.left] for label in element.points]
    return quicksum(rise * _horner(row, s) for rise, row in zip(rises, coefficients))


def _coefficients(tau):
    """Coefficients (K, K) of s, ..., s**K in the polynomial that is 1 at c_j and 0 at 0 and the other points."""
    nodes = [0.0, *tau]
    return interpolation_weights(nodes, np.eye(len(nodes)))[1:, 1:]


def _horner(row, s):
    found = 0.0
    for coefficient in reversed(row):
        found = (found + float(coefficient)) * s
    return found
