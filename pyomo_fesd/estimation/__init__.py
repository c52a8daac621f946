"""Measurements at given times of a model whose elements move: ``at``.

Read in this order: ``at`` (what a user calls) and ``instants`` (which element contains a time).
"""

from pyomo_fesd.estimation.at import at
