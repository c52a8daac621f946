"""pyomo_fesd: hybrid dynamic systems in Pyomo, solved exactly at their switches.

Importing this registers ``fesd.dcs``, ``fesd.smooth_to_complementarity``, ``fesd.finite_elements``, ``mpec_hybrid`` and
``casadi_ipopt`` with Pyomo.
"""

import pyomo.environ  # noqa: F401  registers Pyomo's own plug-ins first

from pyomo_fesd import casadi_ipopt as _casadi_ipopt  # noqa: F401
from pyomo_fesd import units
from pyomo_fesd.accuracy.refine import refine
from pyomo_fesd.clock import clock
from pyomo_fesd.dcs import transformation as _dcs  # noqa: F401
from pyomo_fesd.elements import transformation as _elements  # noqa: F401
from pyomo_fesd.errors import FesdError
from pyomo_fesd.kinks import transformation as _kinks  # noqa: F401
from pyomo_fesd.kinks.functions import absolute, clip, maximum, minimum, positive_part
from pyomo_fesd.march.simulate import simulate
from pyomo_fesd.plot import plot
from pyomo_fesd.projected import projection
from pyomo_fesd.report import report
from pyomo_fesd.solver import certify
from pyomo_fesd.state_jump import state_jump
from pyomo_fesd.structure import structure
from pyomo_fesd.trajectory import element_lengths, physical_time, switches, trajectory

__version__ = '0.1.0'
__all__ = [
    'FesdError',
    'absolute',
    'certify',
    'clip',
    'clock',
    'element_lengths',
    'maximum',
    'minimum',
    'physical_time',
    'plot',
    'positive_part',
    'projection',
    'refine',
    'report',
    'simulate',
    'state_jump',
    'structure',
    'switches',
    'trajectory',
    'units',
]
