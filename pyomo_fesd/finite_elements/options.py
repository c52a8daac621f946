"""The options of ``fesd.finite_elements``."""

from pyomo.common.config import ConfigDict, ConfigValue, In, NonNegativeFloat, PositiveInt

from pyomo_fesd.core import Renamed
from pyomo_fesd.finite_elements.cross_complementarity import FORMS
from pyomo_fesd.finite_elements.equilibration import MODES

#: Keywords and values of version 0.1.
RENAMED = Renamed('fesd.finite_elements', values={'cross_complementarity': {'stage': 'point'}})


def _gamma(arg):
    """gamma, with 0 <= gamma < 1."""
    gamma = float(arg)
    if not 0 <= gamma < 1:
        raise ValueError(f"length_bounds (gamma) must lie in [0, 1), not {arg}")
    return gamma


def _numbers(arg):
    """A positive integer, or a list of them."""
    return [PositiveInt(n) for n in arg] if isinstance(arg, (list, tuple)) else PositiveInt(arg)


def _list_of_components(arg):
    return list(arg) if isinstance(arg, (list, tuple)) else [arg]


def _lengths(arg):
    """Vars in the order of the control stages, from a list or an indexed Var."""
    return None if arg is None else list(arg.values() if hasattr(arg, 'values') else arg)


#: keyword -> default, domain, description
OPTIONS = {
    'wrt': (None, None, "the ContinuousSet of time; may be left out if there is only one"),
    'nfe': (
        10,
        _numbers,
        "number of finite elements, all control stages together; or a list with one number for each control stage",
    ),
    'ncp': (3, PositiveInt, "collocation points in each element (K)"),
    'scheme': (
        'LAGRANGE-RADAU',
        In(['LAGRANGE-RADAU', 'LAGRANGE-LEGENDRE']),
        "'LAGRANGE-RADAU' (order 2K-1, L-stable) or 'LAGRANGE-LEGENDRE' (order 2K)",
    ),
    'cross_complementarity': ('element', In(list(FORMS)), "'element' (eq. 11a), 'point' (11b) or 'full' (11c)"),
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
    'stages': (None, list, "labels of inner control-stage boundaries, only for a model that is discretised already"),
}


def declare_options() -> ConfigDict:
    """Return the options with their defaults."""
    options = ConfigDict('fesd.finite_elements')
    for name, (default, domain, description) in OPTIONS.items():
        options.declare(name, ConfigValue(default=default, domain=domain, description=description))
    return options
