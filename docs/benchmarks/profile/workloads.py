"""The workloads: each builds, transforms and solves, and marks the end of what it does outside of the solver.

A workload is a function ``(clock, timer)``: ``clock('build')`` counts the seconds since the last mark to 'build',
``clock.restart()`` forgets everything until now, and ``timer`` is given to the solvers.
"""

import random
import sys
from functools import partial
from pathlib import Path

import gas_liquid_tank
import pyomo.environ as pyo
import signum
from benchmarks.ocp import tank as controlled_tank
from benchmarks.scale import cascade

import pyomo_fesd

#: Elements of Radau's scheme with 3 points of the cascade, and its tanks.
TANKS, ELEMENTS = 6, 200
#: Solves of the controller after the first, each from an initial state that differs a little, in mol.
STEPS, NOISE = 10, 0.2
#: Instances of MacMPEC with 500 to 600 variables and 225 pairs, and one with 246 and 244.
MACMPEC = ('pack-rig1-16', 'pack-comp1p-16', 'pack-comp2-16', 'incid-set1-16', 'TSC-1')


def _transformed(m, clock, **options):
    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, **options)
    clock('transform')


def _cold(build, nfe, ncp, clock, timer):
    """A model that ``mpec_hybrid`` solves without a simulation before."""
    m = build()
    clock('build')
    _transformed(m, clock, nfe=nfe, ncp=ncp)
    pyo.SolverFactory('mpec_hybrid').solve(m, timer=timer, simulate_first=False)
    clock('solve')


def flowsheet(nfe, clock, timer):
    """The IDAES reactor with a saturating level controller: initialise, march, solve."""
    import idaes_level  # IDAES takes seconds to import

    clock.restart()
    m = idaes_level.exact(idaes_level.build())
    clock('build')
    idaes_level.move(m, nfe, 3)
    clock('transform')
    idaes_level.specify(m)
    clock('initialise')
    pyomo_fesd.simulate(m.fs)
    clock('march')
    pyo.SolverFactory('mpec_hybrid').solve(m, warm_start=True, timer=timer)
    clock('solve')


def controller(clock, timer):
    """The steps of model predictive control of the tank after the first, solved again by ``set_instance``."""
    m = controlled_tank.discretise(controlled_tank.build())
    solver, disturbance = pyo.SolverFactory('mpec_hybrid'), random.Random(0)
    solver.set_instance(m, parameters=[m.G[0], m.L[0]])
    solver.solve(m)
    clock.restart()
    for _ in range(STEPS):
        m.L[0] = controlled_tank.START[1] + NOISE * disturbance.uniform(-1, 1)
        solver.solve(m, warm_start=True, timer=timer)
    clock('solve')


def macmpec(folder, clock, timer):
    """Instances of MacMPEC of medium size, one after the other."""
    sys.path.insert(0, str(folder.parent))
    import mpcc_json  # beside the instances

    clock.restart()
    for name in MACMPEC:
        m = mpcc_json.to_pyomo(mpcc_json.load(str(folder / f'{name}.json')))
        clock('build')
        pyo.SolverFactory('mpec_hybrid').solve(m, timer=timer)
        clock('solve')


def workloads(instances: Path | None) -> dict:
    """Return the workloads by name, with the number of their runs; MacMPEC only with the folder of its instances."""
    found = {
        'signum': (5, partial(_cold, signum.build, 10, 2)),
        'tank N = 100': (5, partial(_cold, gas_liquid_tank.build, 100, 3)),
        'tank N = 400': (3, partial(_cold, gas_liquid_tank.build, 400, 3)),
        'tank N = 1600': (1, partial(_cold, gas_liquid_tank.build, 1600, 3)),
        f'cascade S = {TANKS}': (3, partial(_cold, partial(cascade.build, TANKS), ELEMENTS, 3)),
        'IDAES N = 60': (3, partial(flowsheet, 60)),
        'IDAES N = 400': (1, partial(flowsheet, 400)),
        f'MPC, {STEPS} steps': (5, controller),
    }
    return found | ({} if instances is None else {'MacMPEC, 5 medium': (3, partial(macmpec, instances))})
