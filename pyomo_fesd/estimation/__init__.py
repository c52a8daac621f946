"""Measurements at given times of a model whose elements move: ``at``; ``parmest_solver``, by which Pyomo's parmest can be used.

Read in this order: ``at`` (what a user calls), ``instants`` (which element contains a time) and ``parmest_solver``.
"""

from pyomo_fesd.estimation.at import at
from pyomo_fesd.estimation.parmest_solver import parmest_solver
