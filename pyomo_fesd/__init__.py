"""pyomo_fesd: hybrid dynamic systems in Pyomo, solved exactly at their switches.

Importing this registers ``fesd.dcs``, ``fesd.smooth_to_complementarity``, ``fesd.finite_elements``, ``mpec_hybrid`` and
``casadi_ipopt`` with Pyomo.
"""

import pyomo.environ  # noqa: F401  registers Pyomo's own plug-ins first

from pyomo_fesd import dcs as _dcs  # noqa: F401
from pyomo_fesd import finite_elements as _finite_elements  # noqa: F401
from pyomo_fesd import smoothing as _smoothing  # noqa: F401
from pyomo_fesd import units
from pyomo_fesd.analysis import report, structure
from pyomo_fesd.core import FesdError, __version__
from pyomo_fesd.estimation import at, parmest_solver
from pyomo_fesd.modeling import (
    absolute,
    clip,
    clock,
    contact,
    friction,
    maximum,
    minimum,
    positive_part,
    projection,
    signal,
    state_jump,
)
from pyomo_fesd.refinement import refine
from pyomo_fesd.results import element_lengths, physical_time, plot, switches, trajectory
from pyomo_fesd.scenarios import sweep
from pyomo_fesd.sensitivities import covariance, sensitivity
from pyomo_fesd.simulation import simulate
from pyomo_fesd.solvers import certify
from pyomo_fesd.starts import start_from

__all__ = [
    'FesdError',
    'absolute',
    'at',
    'certify',
    'clip',
    'clock',
    'contact',
    'covariance',
    'element_lengths',
    'friction',
    'maximum',
    'minimum',
    'parmest_solver',
    'physical_time',
    'plot',
    'positive_part',
    'projection',
    'refine',
    'report',
    'sensitivity',
    'signal',
    'simulate',
    'start_from',
    'state_jump',
    'structure',
    'sweep',
    'switches',
    'trajectory',
    'units',
]
