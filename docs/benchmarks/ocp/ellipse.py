"""Projected dynamics on an ellipse (examples/projected_ellipse.py): 20 control stages of 2 elements, Radau with three points.

nosnoc 0.2.0 does not have projected dynamics.
"""

from functools import partial

import numpy as np
import projected_ellipse
from benchmarks.ocp import automaton
from benchmarks.ocp.discretisation import moving_grid

HORIZON, STAGES, ELEMENTS, NCP = projected_ellipse.HORIZON, 20, 2, 3
REFERENCE = 1.540945
#: A square inside the unit disc of the controls.
U_RANGE, CONTROLS = (-(0.5**0.5), 0.5**0.5), 2


def build(stages=STAGES, side='right'):
    """The model with the given number of control stages, as a user writes it."""
    return projected_ellipse.build(stages, side)


def discretise(m, elements=ELEMENTS, ncp=NCP, scheme='LAGRANGE-RADAU'):
    """Apply the moving grid, with ``elements`` elements in each control stage; a projection does not need ``fesd.dcs``."""
    return moving_grid(m, elements, ncp, scheme)


def outside(x, u=None):
    """The function that the ellipse keeps nonnegative."""
    return (x[0] / projected_ellipse.HALF_AXES[0]) ** 2 + (x[1] / projected_ellipse.HALF_AXES[1]) ** 2 - 1


def _normal(x):
    return 2 * np.asarray(x) / np.square(projected_ellipse.HALF_AXES)


def _free(x, u):
    return np.array([-0.2 * (x[0] + 1) ** 2 + u[0], -0.4 * (x[1] + 3) + u[1]])


def _inwards(x, u):
    """Speed of the field into the ellipse; where it is positive, the wall takes it off."""
    return -_normal(x) @ _free(x, u)


def _along(x, u):
    n = _normal(x)
    return _free(x, u) + n * _inwards(x, u) / (n @ n)


#: For the replay: off the ellipse, and sliding along it while the field points into it.
MODES = {
    'free': automaton.Mode(_free, ((outside, 'wall'),)),
    'wall': automaton.Mode(_along, ((_inwards, 'free'),)),
}
replay_controls = partial(automaton.replay, MODES, lambda x, u: 10 * (u @ u), projected_ellipse.START, 'free')


def missed(x):
    """Largest distance of a final coordinate to the goal."""
    return float(np.abs(x - projected_ellipse.GOAL).max())


with_nosnoc = None
