"""The discretisation that the optimal control problems share."""

import pyomo.environ as pyo

import pyomo_fesd  # noqa: F401  registers the transformations


def moving_grid(m, elements, ncp, scheme):
    """Apply ``fesd.finite_elements`` with ``elements`` elements in each control stage and the control ``m.u`` constant on it."""
    number = elements * (len(m.t) - 1)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=number, ncp=ncp, scheme=scheme, piecewise_constant=[m.u])
    return m
