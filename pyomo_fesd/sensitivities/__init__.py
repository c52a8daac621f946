"""Exact derivatives of a certified solution by parameters: ``sensitivity``; ``covariance`` of estimates; ``LinearSolution``.

Read in this order: ``sensitivity`` and ``covariance`` (what a user calls), ``outputs`` (which quantities, and their gradients),
``branch_system`` (the first-order conditions of the active branch, and the reasons to refuse) with ``active_rows`` (its equations),
``linearisation`` (their derivatives), ``multipliers`` (which inequalities hold strictly) and ``kkt`` (the linear system, and the
proof that its answer is unique); ``linear_solution`` (all variables for other parameters, for advanced-step control).
"""

from pyomo_fesd.sensitivities.covariance import covariance
from pyomo_fesd.sensitivities.linear_solution import LinearSolution
from pyomo_fesd.sensitivities.sensitivity import sensitivity
