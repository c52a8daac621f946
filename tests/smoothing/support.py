"""Helpers for the tests of nonsmooth terms: complementary values, and smoothed functions as users write them."""

import pyomo.environ as pyo
from pyomo.mpec import Complementarity

from pyomo_fesd.core import is_generated
from pyomo_fesd.core.complementarity import read_complementarity


def settle(model):
    """Give every generated s the value max(0, z), in the order in which they were made."""
    for condition in filter(is_generated, conditions(model)):
        s, gap = read_complementarity(condition)
        s.value = 0.0
        s.value = max(0.0, -pyo.value(gap))
    return model


def conditions(model):
    """All conditions of a model."""
    return list(model.component_data_objects(Complementarity, descend_into=True))


def smooth_abs(z, eps=1e-4):
    """As in IDAES."""
    return (z**2 + eps**2) ** 0.5


def smooth_max(a, b, eps=1e-4):
    """As in IDAES."""
    return 0.5 * (a + b + smooth_abs(a - b, eps))


def smooth_min(a, b, eps=1e-4):
    """As in IDAES."""
    return 0.5 * (a + b + (-1) * smooth_abs(a - b, eps))


def exact(model, **options):
    """Apply the transformation; returns its summary."""
    return pyo.TransformationFactory('fesd.smooth_to_complementarity').apply_to(model, **options)
