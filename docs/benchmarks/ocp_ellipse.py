"""Projected dynamics on an ellipse (examples/projected_ellipse.py): 20 control stages of 2 elements, Radau with three points.

nosnoc 0.2.0 has no projected dynamics.
"""

import sys
from pathlib import Path

import pyomo.environ as pyo

sys.path.append(str(Path(__file__).parents[2] / 'examples'))

import projected_ellipse  # noqa: E402

STAGES, ELEMENTS, NCP = 20, 2, 3
REFERENCE = 1.540945


def build(stages=STAGES, side='right'):
    """The model with so many control stages, as a user writes it."""
    return projected_ellipse.build(stages, side)


def discretise(m, elements=ELEMENTS, ncp=NCP, scheme='LAGRANGE-RADAU'):
    """The transformation, with so many elements in each stage; a projection needs no ``fesd.dcs``."""
    number = elements * (len(m.t) - 1)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=number, ncp=ncp, scheme=scheme, piecewise_constant=[m.u])
    return m


with_nosnoc = None
