"""The systems of the study by scipy's integrators, every switch located by an event, every slide written as a mode of its own."""

import gas_liquid_tank as tank
import numpy as np
import oscillator
import thermostat
from benchmarks.common.exact import error_of_times, thermostat_temperature
from benchmarks.scale import cascade
from scipy.integrate import solve_ivp


def integrate(x, horizon, mode, rhs, events, method, tolerance):
    """Integrate mode by mode.

    Parameters
    ----------
    rhs : function (mode) -> function (t, x)
    events : function (mode) -> list of (function (t, x), next mode)

    Returns
    -------
    list of switching times, array x at the end
    """
    time, switches = 0.0, []
    while True:
        found = events(mode)
        functions = [function for function, _ in found]
        for function in functions:
            function.terminal = True
        run = solve_ivp(rhs(mode), (time, horizon), x, method, events=functions, rtol=tolerance, atol=tolerance)
        time, x = run.t[-1], run.y[:, -1]
        if run.status != 1:
            return switches, x
        switches.append(time)
        mode = next(after for times, (_, after) in zip(run.t_events, found) if len(times))


def tank_by_hand(method, tolerance):
    """Error of the tank: liquid mode, then the slide on the outlet with nu L = F_L."""

    def out(x):
        return tank.VALVE * (x[0] * tank.R * tank.T / (tank.V - x[1] / tank.RHO_L) - tank.P_OUT)

    def liquid(t, x):
        return [tank.F_G, tank.F_L - out(x)]

    def slide(t, x):
        return [tank.F_G - (1 - tank.F_L / out(x)) * out(x), 0.0]

    def level(t, x):
        return x[1] / tank.RHO_L - tank.V_S

    rhs, events = {'liquid': liquid, 'slide': slide}, {'liquid': [(level, 'slide')], 'slide': []}
    start = [tank.M_G0, tank.M_L0]
    (t_s,), x = integrate(start, tank.HORIZON, 'liquid', rhs.get, events.get, method, tolerance)
    return max(abs(t_s - tank.EXACT['t_s']) / t_s, abs(x[0] / tank.EXACT['M_G'] - 1))


def oscillator_by_hand(method, tolerance):
    """Error of the oscillator: inside the unit circle, then outside."""
    A = {'inside': np.array(oscillator.A_INSIDE), 'outside': np.array(oscillator.A_OUTSIDE)}

    def circle(t, x):
        return x[0] ** 2 + x[1] ** 2 - 1

    def rhs(mode):
        return lambda t, x: A[mode] @ x

    events = {'inside': [(circle, 'outside')], 'outside': []}
    (t_s,), x = integrate(oscillator.X0, oscillator.HORIZON, 'inside', rhs, events.get, method, tolerance)
    return max(abs(t_s - oscillator.SWITCH), *np.abs(x - oscillator.X_END))


def thermostat_by_hand(method, tolerance, horizon):
    """Error of the thermostat: heating and cooling in turn."""

    def high(t, y):
        return y[0] - thermostat.HIGH

    def low(t, y):
        return y[0] - thermostat.LOW

    rhs = {'heating': lambda t, y: [10 - y[0] / 5], 'cooling': lambda t, y: [-y[0] / 5]}
    events = {'heating': [(high, 'cooling')], 'cooling': [(low, 'heating')]}
    switches, y = integrate([thermostat.START], horizon, 'heating', rhs.get, events.get, method, tolerance)
    error = error_of_times(switches, thermostat.switching_times(horizon))
    return max(error, abs(y[0] - thermostat_temperature(horizon)))


def cascade_by_hand(method, tolerance, S=20):
    """Error of the cascade; a mode is the set of heads that are not full yet, all other tanks overflow."""
    feeds = cascade.feeds(S)

    def rhs(waiting):
        overflows = np.array([0.0 if k in waiting else cascade.WEIR for k in range(S)])

        def field(t, x):
            q = overflows * (x - 1)
            return feeds - q + np.concatenate([[0.0], q[:-1]])

        return field

    def events(waiting):
        return [(lambda t, x, k=k: x[k] - 1, waiting - {k}) for k in waiting]

    switches, _ = integrate(cascade.start(S), cascade.HORIZON, frozenset(cascade.heads(S)), rhs, events, method, tolerance)
    return error_of_times(switches, cascade.exact(S))
