"""The runs of the work-precision study: problems, methods, grids, and the known answers."""

from functools import partial
from itertools import product
from typing import NamedTuple

import numpy as np
from benchmarks.ocp import cartpole, motor, sliding
from benchmarks.work_precision import pyomo_methods, scipy_peer
from benchmarks.work_precision.models import ControlModel, SystemModel
from benchmarks.work_precision.systems import SYSTEMS

#: Costs on the finest certified grids that end in the best known minimum (see benchmarks.ocp).
CONTROLS = {
    'sliding-mode control': ControlModel(sliding, {'objective': 5.592183}),
    'friction motor': ControlModel(motor, {'objective': 0.855622}),
    'cart-pole': ControlModel(cartpole, {'objective': 677.4705}),
}
PROBLEMS = {name: SystemModel(system) for name, system in SYSTEMS.items()} | CONTROLS
EXACT = {name: (p.system if hasattr(p, 'system') else p).exact for name, p in PROBLEMS.items()}

OURS, SIMULATE, REFINE, FIXED, TANH, SQRT, BIG_M, EVENTS = (
    'pyomo_fesd',
    'simulate',
    'refine',
    'fixed grid',
    'smoothing, tanh',
    'smoothing, sqrt',
    'big-M',
    'events by hand',
)
NOSNOC, TIGHT, STEPS, TIGHT_STEPS = 'nosnoc', 'nosnoc, 1e-12', 'nosnoc, steps', 'nosnoc, steps, 1e-12'
NOSNOCS = (NOSNOC, TIGHT, STEPS, TIGHT_STEPS)


def _nosnoc(*args, **kwds):
    from benchmarks.work_precision import nosnoc_peer  # an optional package

    return nosnoc_peer.nosnoc(*args, **kwds)


METHODS = {
    OURS: pyomo_methods.mpec_hybrid,
    SIMULATE: pyomo_methods.simulate,
    REFINE: pyomo_methods.refine,
    FIXED: pyomo_methods.fixed_grid,
    TANH: partial(pyomo_methods.smoothing, shape='tanh'),
    SQRT: partial(pyomo_methods.smoothing, shape='sqrt'),
    BIG_M: pyomo_methods.big_m,
    EVENTS: scipy_peer.events,
    NOSNOC: _nosnoc,
    TIGHT: partial(_nosnoc, tolerance=1e-12),
    STEPS: partial(_nosnoc, by_steps=True),
    TIGHT_STEPS: partial(_nosnoc, by_steps=True, tolerance=1e-12),
}


class Run(NamedTuple):
    """One run; ``width`` is that of a smoothed step, or a tolerance (refine, events by hand)."""

    problem: str
    method: str
    scheme: str = ''
    K: int = 0
    N: int = 0
    width: float = 0.0
    start: float = 0.0


def _runs(problem, methods, K=(0,), N=(0,), width=(0.0,), scheme=('Radau',), start=(0.0,)):
    methods = (methods,) if isinstance(methods, str) else methods
    return [Run(problem, *rest) for rest in product(methods, scheme, K, N, width, start)]


BOTH = ('Radau', 'Gauss')
WIDTHS = tuple(10.0**-k for k in range(1, 7))
SMOOTH = (TANH, SQRT)
#: oscillator: scheme, K -> numbers of elements from the coarsest that shows the order to the finest above round-off
ORDERS = {
    ('Radau', 1): (800, 1600, 3200),
    ('Radau', 2): (40, 80, 160, 320),
    ('Radau', 3): (20, 40, 80, 160),
    ('Radau', 4): (12, 20, 40, 80),
    ('Gauss', 1): (40, 80, 160, 320),
    ('Gauss', 2): (20, 40, 80, 160),
    ('Gauss', 3): (20, 40, 80, 160),
    ('Gauss', 4): (12, 20, 40),
}
STARTS = tuple(np.linspace(-2.0, -0.8, 50).round(6).tolist())

RUNS = [
    *_runs('signum', OURS, (2,), (4, 10, 20), scheme=BOTH),
    *_runs('signum', SIMULATE, (2,), (10,)),
    *_runs('signum', FIXED, (1, 2), (10, 40, 160, 640)),
    *_runs('signum', SMOOTH, (2,), (160,), WIDTHS),
    *_runs('signum', BIG_M, (1,), (10, 20, 40, 160)),
    *_runs('signum', NOSNOCS, (2,), (4, 10, 20)),
    *_runs('signum', EVENTS, width=(1e-6, 1e-10), scheme=('',)),
    *_runs('tank', OURS, (1, 2, 3, 4), (12, 25, 50, 100), scheme=BOTH),
    *_runs('tank', SIMULATE, (2, 3, 4), (12, 25, 100)),
    *_runs('tank', (OURS, SIMULATE, *NOSNOCS), (6, 8), (4, 8)),
    *_runs('tank', REFINE, (4,), width=(1e-4, 1e-6, 1e-8, 1e-10)),
    *_runs('tank', FIXED, (1, 2, 3), (25, 100, 400)),
    *_runs('tank', SMOOTH, (3,), (50,), WIDTHS),
    *_runs('tank', SMOOTH, (3,), (200,), WIDTHS[:4]),
    *_runs('tank', NOSNOCS, (2, 3, 4), (12, 24, 50)),
    *_runs('tank', NOSNOCS, (3,), (100,)),
    *_runs('tank', EVENTS, width=(1e-4, 1e-6, 1e-8, 1e-10, 1e-12), scheme=('',)),
    *(run for (scheme, K), N in ORDERS.items() for run in _runs('oscillator', OURS, (K,), N, scheme=(scheme,))),
    *_runs('oscillator', OURS, (6, 8), (4, 6, 8, 12), scheme=BOTH),
    *_runs('oscillator', OURS, (9, 10, 12), (2, 4), scheme=BOTH),
    *_runs('oscillator', SIMULATE, (3, 4), (10, 20, 40, 80)),
    *_runs('oscillator', SIMULATE, (6, 8), (4, 8, 12)),
    *_runs('oscillator', SIMULATE, (10, 12), (2, 4, 6)),
    *_runs('oscillator', REFINE, (4,), width=(1e-4, 1e-6, 1e-8, 1e-10)),
    *_runs('oscillator', FIXED, (1, 2), (20, 80, 320)),
    *_runs('oscillator', FIXED, (3,), (20, 80, 320, 640)),
    *_runs('oscillator', SMOOTH, (3,), (80, 320), WIDTHS),
    *_runs('oscillator', BIG_M, (2,), (20, 80, 320)),
    *_runs('oscillator', NOSNOCS, (2, 3, 4), (10, 20, 40, 80)),
    *_runs('oscillator', NOSNOCS, (6, 8), (4, 6, 8, 12)),
    *_runs('oscillator', NOSNOCS, (9,), (2, 4, 6)),
    *_runs('oscillator', (NOSNOC, STEPS), (2, 3), (20, 40), scheme=('Gauss',)),
    *_runs('oscillator', EVENTS, width=(1e-4, 1e-6, 1e-8, 1e-10, 1e-12), scheme=('',)),
    *_runs('sensitivity', OURS, (2,), (4, 10, 20), scheme=BOTH),
    *_runs('sensitivity', SIMULATE, (2,), (10,)),
    *_runs('sensitivity', FIXED, (1, 2), (10, 40, 160)),
    *_runs('sensitivity', SMOOTH, (2,), (40, 160), WIDTHS),
    *_runs('sensitivity', BIG_M, (1,), (10, 40, 160)),
    *_runs('sensitivity', NOSNOCS, (2,), (4, 10, 20)),
    *_runs('sensitivity', EVENTS, width=(1e-6, 1e-10), scheme=('',)),
    *_runs('false minima', (OURS, NOSNOC, TIGHT), (2,), (10,), start=STARTS),
    *_runs('false minima', FIXED, (2,), (25,), start=STARTS),
    *_runs('false minima', SMOOTH, (2,), (25,), (1e-2,), start=STARTS),
    *_runs('tank control', OURS, (2, 3), (10, 25, 50), scheme=BOTH),
    *_runs('tank control', FIXED, (2,), (10, 25, 100)),
    *_runs('tank control', SMOOTH, (2,), (25,), WIDTHS[:4]),
    *_runs('tank control', (NOSNOC, TIGHT), (2, 3), (10, 25, 50)),
    *_runs('sliding-mode control', (OURS, NOSNOC, TIGHT), (2, 3), (12, 24, 36)),
    *_runs('sliding-mode control', FIXED, (2,), (12, 36, 120)),
    *_runs('sliding-mode control', SMOOTH, (2,), (36,), WIDTHS[:4]),
    *_runs('friction motor', (OURS, NOSNOC, TIGHT), (2, 3), (60,)),
    *_runs('friction motor', FIXED, (2,), (60, 120)),
    *_runs('friction motor', SMOOTH, (2,), (60,), WIDTHS[:4]),
    *_runs('cart-pole', (OURS, NOSNOC, TIGHT), (2, 3), (40,)),
    *_runs('cart-pole', FIXED, (2,), (40, 80)),
    *_runs('cart-pole', SMOOTH, (2,), (40,), WIDTHS[:4]),
]
