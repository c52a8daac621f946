"""Simulation by scipy's integrator with located events and the sliding mode written by hand."""

from time import perf_counter

import numpy as np
from benchmarks.work_precision.systems import Found
from scipy.integrate import solve_ivp

#: The sign of c in a mode.
SIDE = {'above': 1.0, 'below': -1.0}
#: Next mode on the surface, by whether the vector field (above, below) points upwards.
NEXT = {(True, True): 'above', (False, False): 'below', (False, True): 'slide', (True, False): 'above'}


def events(problem, width, **_):
    """Integrate mode by mode; ``width`` is the tolerance."""
    started = perf_counter()
    system, tolerance = problem.system, width

    def drift(x, field):
        return float(np.dot(system.gradient(x), field(x, None)))

    def slide(x, _):
        up, down = drift(x, system.above), drift(x, system.below)
        share = down / (down - up)
        return share * np.array(system.above(x, None)) + (1 - share) * np.array(system.below(x, None))

    def leaves(mode, begin):
        """Events that end a mode; c is zero where a mode begins on the surface, which does not count."""
        if mode == 'slide':
            return [lambda t, x: drift(x, system.above), lambda t, x: drift(x, system.below)]
        return [lambda t, x: system.switching(x) if t > begin + 1e-9 else SIDE[mode]]

    fields = {'above': system.above, 'below': system.below, 'slide': slide}
    time, x, switch = 0.0, np.array(system.x0), None
    mode = 'above' if system.switching(x) > 0 else 'below'
    while True:
        found = leaves(mode, time)
        for event in found:
            event.terminal = True
        field, span = fields[mode], (time, system.horizon)
        run = solve_ivp(lambda t, x: field(x, None), span, x, 'DOP853', events=found, rtol=tolerance, atol=tolerance)  # noqa: B023
        time, x = run.t[-1], run.y[:, -1]
        if run.status != 1:
            break
        switch = time if switch is None else switch
        mode = NEXT[drift(x, system.above) > 0, drift(x, system.below) > 0]
    found = Found('integrated' if run.status == 0 else run.message, run.status == 0, 0.0, perf_counter() - started)
    found.state, found.switch = list(x), switch
    return found
