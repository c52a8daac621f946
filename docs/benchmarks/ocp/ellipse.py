"""Projected dynamics on an ellipse (examples/projected_ellipse.py): 20 control stages of 2 elements, Radau with three points.

nosnoc 0.2.0 does not have projected dynamics.
"""

import projected_ellipse
from benchmarks.ocp.discretisation import moving_grid

STAGES, ELEMENTS, NCP = 20, 2, 3
REFERENCE = 1.540945


def build(stages=STAGES, side='right'):
    """The model with the given number of control stages, as a user writes it."""
    return projected_ellipse.build(stages, side)


def discretise(m, elements=ELEMENTS, ncp=NCP, scheme='LAGRANGE-RADAU'):
    """Apply the moving grid, with ``elements`` elements in each control stage; a projection does not need ``fesd.dcs``."""
    return moving_grid(m, elements, ncp, scheme)


with_nosnoc = None
