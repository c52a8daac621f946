"""pyomo_fesd: hybrid dynamic systems in Pyomo, solved exactly at their switches.

Importing this registers ``fesd.dcs``, ``fesd.smooth_to_complementarity``, ``fesd.finite_elements``, ``mpec_hybrid`` and
``casadi_ipopt`` with Pyomo.  Each room is loaded when something of it is first used: numpy, scipy, casadi and the rooms themselves
take several times as long to import as Pyomo.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

import pyomo.environ  # noqa: F401  registers Pyomo's own plug-ins first
from pyomo.contrib.solver.common.factory import SolverFactory
from pyomo.core import TransformationFactory

if TYPE_CHECKING:  # the same names as in _ROOMS, for editors and type checkers
    from pyomo_fesd import units
    from pyomo_fesd.analysis import branch_equations, report, structure
    from pyomo_fesd.control import Controller, ControlStep, MovingModelInterface, Plant, receding_horizon
    from pyomo_fesd.core import FesdError, __version__
    from pyomo_fesd.estimation import at, parmest_solver
    from pyomo_fesd.finite_elements import recollocate
    from pyomo_fesd.integers import decide_integers, sum_up_rounding
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
    from pyomo_fesd.solvers import casadi_ipopt, certify
    from pyomo_fesd.starts import start_from

__all__ = [
    'ControlStep',
    'Controller',
    'FesdError',
    'MovingModelInterface',
    'Plant',
    'absolute',
    'at',
    'branch_equations',
    'casadi_ipopt',
    'certify',
    'clip',
    'clock',
    'contact',
    'covariance',
    'decide_integers',
    'element_lengths',
    'friction',
    'maximum',
    'minimum',
    'parmest_solver',
    'physical_time',
    'plot',
    'positive_part',
    'projection',
    'receding_horizon',
    'recollocate',
    'refine',
    'report',
    'sensitivity',
    'signal',
    'simulate',
    'start_from',
    'state_jump',
    'structure',
    'sum_up_rounding',
    'sweep',
    'switches',
    'trajectory',
    'units',
]

#: Room -> the public names that it defines.
_ROOMS = {
    'analysis': ('branch_equations', 'report', 'structure'),
    'control': ('ControlStep', 'Controller', 'MovingModelInterface', 'Plant', 'receding_horizon'),
    'core': ('FesdError', '__version__'),
    'estimation': ('at', 'parmest_solver'),
    'finite_elements': ('recollocate',),
    'integers': ('decide_integers', 'sum_up_rounding'),
    'modeling': (
        *('absolute', 'clip', 'clock', 'contact', 'friction', 'maximum', 'minimum', 'positive_part', 'projection', 'signal'),
        'state_jump',
    ),
    'refinement': ('refine',),
    'results': ('element_lengths', 'physical_time', 'plot', 'switches', 'trajectory'),
    'scenarios': ('sweep',),
    'sensitivities': ('covariance', 'sensitivity'),
    'simulation': ('simulate',),
    'solvers': ('casadi_ipopt', 'certify'),
    'starts': ('start_from',),
}
_HOMES = {name: room for room, names in _ROOMS.items() for name in names}


def __getattr__(name: str) -> Any:
    """Load the room of a public name; called once for each."""
    if name == 'units':
        return import_module('pyomo_fesd.units')
    if name not in _HOMES:
        raise AttributeError(f"module 'pyomo_fesd' has no attribute '{name}'")
    found = globals()[name] = getattr(import_module(f'pyomo_fesd.{_HOMES[name]}'), name)
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__, '__version__'})


class _Deferred:
    """Makes instances of a class of the last of some rooms, which are loaded at the first one."""

    def __init__(self, *rooms: str, cls: str):
        self._rooms, self._cls = rooms, cls

    def __call__(self, *args, **kwds):
        for room in self._rooms:
            loaded = import_module(f'pyomo_fesd.{room}')
        return getattr(loaded, self._cls)(*args, **kwds)


for _name, _room, _cls, _doc in (
    ('fesd.dcs', 'dcs', 'DynamicComplementaritySystem', "Time-indexed Disjunctions to a dynamic complementarity system (Filippov)"),
    (
        *('fesd.smooth_to_complementarity', 'smoothing', 'SmoothToComplementarity'),
        "abs() and its smoothings (IDAES smooth_abs, _max, _min, _bound) to complementarity",
    ),
    ('fesd.finite_elements', 'finite_elements', 'FiniteElements', "Finite elements with switch detection, on top of pyomo.dae"),
):
    TransformationFactory.register(_name, doc=_doc)(_Deferred(_room, cls=_cls))
for _name, _cls, _doc in (
    ('mpec_hybrid', 'MpecHybrid', "Certified MPCC solutions: Reg(eps) in Ipopt and a reduced LPEC in HiGHS"),
    ('casadi_ipopt', 'CasadiIpopt', "The Ipopt in casadi's wheel: an NLP solver without an executable"),
):
    # simulation, above solvers, registers its march with them
    SolverFactory.register(_name, doc=_doc)(*(_Deferred('simulation', 'solvers', cls=legacy + _cls) for legacy in ('', 'Legacy')))
