"""The options of ``fesd.finite_elements``."""

from collections.abc import Iterable
from math import isfinite

from pyomo.common.config import ConfigDict, ConfigValue, In, NonNegativeFloat, PositiveInt

from pyomo_fesd.core import Renamed
from pyomo_fesd.finite_elements.cross_complementarity import FORMS
from pyomo_fesd.finite_elements.equilibration import MODES

#: Keywords and values of version 0.1.
RENAMED = Renamed('fesd.finite_elements', values={'cross_complementarity': {'stage': 'point'}})


#: Largest number of collocation points: quadrature weights lose digits beyond (1e-10 at 12, 1e-6 at 18).
MOST_POINTS = 12


def _gamma(arg):
    """gamma, with 0 <= gamma < 1."""
    return _checked(float, arg, lambda gamma: 0 <= gamma < 1, "it is not a number in [0, 1)")


def points(arg) -> int:
    """Return a number of collocation points; a ValueError says why ``arg`` is none."""
    return _checked(PositiveInt, arg, lambda number: number <= MOST_POINTS, f"it is not an integer from 1 to {MOST_POINTS}")


def _numbers(arg):
    """A positive integer, or a list of them."""
    several = isinstance(arg, (list, tuple))
    found = [_checked(PositiveInt, n, bool, "it is not a positive integer, or a list of them") for n in (arg if several else [arg])]
    return found if several else found[0]


def _checked(convert, arg, holds, reason):
    """``convert(arg)`` where this works and the condition ``holds``."""
    try:
        found = None if isinstance(arg, bool) else convert(arg)
    except (TypeError, ValueError, OverflowError):
        found = None
    if found is None or not holds(found):
        raise ValueError(reason)
    return found


def _list_of_components(arg):
    return list(arg) if isinstance(arg, (list, tuple)) else [arg]


def _lengths(arg):
    """Vars in the order of the control stages, from a list or an indexed Var."""
    found = arg.values() if hasattr(arg, 'values') else arg
    if isinstance(found, str) or not isinstance(found, Iterable):
        raise ValueError("it is not a list of Vars")
    if not (found := list(found)):
        raise ValueError("it is empty")
    return found


def _labels(arg):
    """Labels of control-stage boundaries."""
    if not isinstance(arg, Iterable):
        raise ValueError("it is not a list of numbers")
    return [_checked(float, label, isfinite, "it is not a list of numbers") for label in arg]


#: keyword -> default, domain, description
OPTIONS = {
    'wrt': (None, None, "the ContinuousSet of time; may be left out if there is only one"),
    'nfe': (
        10,
        _numbers,
        "number of finite elements, all control stages together; or a list with one number for each control stage",
    ),
    'ncp': (3, points, f"collocation points in each element (K), at most {MOST_POINTS}"),
    'scheme': (
        'LAGRANGE-RADAU',
        In(['LAGRANGE-RADAU', 'LAGRANGE-LEGENDRE']),
        "'LAGRANGE-RADAU' (order 2K-1, L-stable) or 'LAGRANGE-LEGENDRE' (order 2K)",
    ),
    'cross_complementarity': (
        'auto',
        In(['auto', *FORMS]),
        "'element' (eq. 11a), 'point' (11b) or 'full' (11c); 'auto' is 'full' with contacts that must not slip, else 'element'",
    ),
    'equilibration': (
        'two_stage',
        In(list(MODES)),
        "'two_stage' (eq. 13), 'complementarity' (the paper's 10d), 'penalty' (lengths nearly equal) or 'none'",
    ),
    'rho': (
        1e-2,
        NonNegativeFloat,
        "weight of the length penalty sum (h_n/hbar_n - 1)**2 that guides the homotopy (eq. 13); small against the objective, "
        "never part of the reported one",
    ),
    'length_bounds': (
        0.9,
        _gamma,
        "gamma of eq. (10): |h_n - hbar_n| <= gamma hbar_n in the homotopy; a branch has shorter and longer ones",
    ),
    'piecewise_constant': (
        [],
        _list_of_components,
        "inputs (Vars or mutable Params over time) that are constant on each control stage; the value at its end counts",
    ),
    'continuous': (
        [],
        _list_of_components,
        "algebraic Vars over time that are continuous although no equation says so; states need not be named",
    ),
    'final_time': (
        None,
        None,
        "a Var: length of the horizon in time of the plant, in which the model is written",
    ),
    'stage_lengths': (None, _lengths, "the same for each control stage: one Var for each"),
    'fixed_points': (
        [],
        _labels,
        "labels inside control stages that are element boundaries and keep their time, as control-stage boundaries do, but inputs "
        "do not change there; elements on their two sides may differ in length. A list ``nfe`` has one number for each interval",
    ),
    'stages': (None, _labels, "labels of inner control-stage boundaries, only for a model that is discretised already"),
}


def declare_options() -> ConfigDict:
    """Return the options with their defaults."""
    options = ConfigDict('fesd.finite_elements')
    for name, (default, domain, description) in OPTIONS.items():
        options.declare(name, ConfigValue(default=default, domain=domain, description=description))
    return options
