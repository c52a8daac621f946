"""The loops: three plants, each with predictive control by this package and by peers, with the same disturbances.

``cpu`` and ``ipopt`` of a step are seconds of CPU: of everything, and inside casadi's NLP solvers (their own functions included);
``cpu of preparation`` those of the next plan, solved before its measurement (advanced step).
"""

import importlib
import logging
import time
from contextlib import contextmanager
from functools import partial

from benchmarks.profile.clock import NlpClock

SEED = 1
#: Seconds that a step of this package may take, by plant.
DEADLINES = {'tank': 10.0, 'heater': 15.0, 'idaes': 30.0}
EXAMPLES = {'tank': 'mpc_tank', 'heater': 'mpc_heater', 'idaes': 'idaes_mpc'}
ADVANCED = ', advanced step'
METHODS = (
    *(('tank', 'pyomo_fesd'), ('tank', 'pyomo_fesd, levels=5'), ('tank', 'pyomo_fesd, levels=5' + ADVANCED)),
    *(('tank', 'pyomo_fesd, rise=0.1'), ('tank', 'smoothed on a fixed grid'), ('tank', 'nosnoc 0.2.0')),
    *(('heater', 'pyomo_fesd'), ('heater', 'pyomo_fesd, levels=5'), ('heater', 'pyomo_fesd, levels=5' + ADVANCED)),
    *(('heater', 'smoothed on a fixed grid'), ('idaes', 'pyomo_fesd'), ('idaes', 'pyomo_fesd' + ADVANCED)),
    *(('idaes', 'pyomo_fesd, levels=5'), ('idaes', 'smoothed on a fixed grid')),
)


def run_loop(plant, method, steps):
    """The table of steps of one loop, with ``cpu`` and ``ipopt``."""
    logging.getLogger('pyomo_fesd').setLevel(logging.ERROR)
    example, clock = importlib.import_module(EXAMPLES[plant]), NlpClock()
    timed, limit = _Timed(clock), DEADLINES[plant] if method.startswith('pyomo_fesd') else None
    with clock.running(), warnings_off():
        options = CONTROLS[method.removesuffix(ADVANCED)](plant, example) | {'advanced': method.endswith(ADVANCED)}
        control = options.pop('control')
        _, table = example.loop(steps, SEED, limit, control=lambda problem: timed.of(control(problem)), **options)
    table['cpu'], table['ipopt'] = timed.cpu, timed.ipopt
    if timed.preparing:
        table['cpu of preparation'] = timed.preparing
    return table


class _Timed:
    """A controller whose steps are timed."""

    def __init__(self, clock):
        self._clock, self.cpu, self.ipopt, self.preparing = clock, [], [], []

    def of(self, controller):
        """Time this one."""
        self._controller = controller
        return self

    def step(self, *given):
        """One step."""
        self._clock.reset()
        began = time.process_time()
        answer = self._controller.step(*given)
        self.cpu.append(time.process_time() - began)
        self.ipopt.append(self._clock.solving)
        return answer

    def prepare(self, time_limit):
        """The next plan."""
        began = time.process_time()
        answer = self._controller.prepare(time_limit)
        self.preparing.append(time.process_time() - began)
        return answer


@contextmanager
def warnings_off():
    """Without the messages of Pyomo about single loads of infeasible values."""
    logger = logging.getLogger('pyomo')
    level = logger.level
    logger.setLevel(logging.ERROR)
    try:
        yield
    finally:
        logger.setLevel(level)


def _own(plant, example):
    return {'control': partial(example.control, levels=None)}


def _with_rise(plant, example):
    return {'control': partial(example.control, rise=0.1, levels=None)}


def _with_levels(plant, example):
    return {'control': partial(example.control, levels=5)}


def _smoothed(plant, example):
    from benchmarks.mpc import smoothed  # needs IDAES

    def control(problem):
        place = problem.fs if plant == 'idaes' else problem
        wrt, name = (place.time, 'pid') if plant == 'idaes' else (place.t, None)
        u = place.pid.setpoint if name else place.u if plant == 'tank' else place.v
        return smoothed.SmoothedControl(problem, wrt, u, example.INTERVAL)

    return {'build': getattr(smoothed, plant), 'control': control}


def _nosnoc(plant, example):
    from benchmarks.mpc.nosnoc_peer import NosnocControl

    return {'control': NosnocControl}


#: Method -> function of the name of a plant and its example, which returns keywords of the example's ``loop``.
CONTROLS = {
    'pyomo_fesd': _own,
    'pyomo_fesd, rise=0.1': _with_rise,
    'pyomo_fesd, levels=5': _with_levels,
    'smoothed on a fixed grid': _smoothed,
    'nosnoc 0.2.0': _nosnoc,
}
