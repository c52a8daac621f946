"""Replay of controls: scipy integrates the plant stage by stage, with events and hand-coded sliding.

Checks solutions without any code of pyomo_fesd or nosnoc.  Plants are relay systems

    x' = f(x, u) + sum_i s_i g_i(x, u),   s_i = sgn c_i(x);   where x slides on c_i = 0, s_i is such that dc_i/dt = 0.
"""

from itertools import product

import numpy as np
from scipy.integrate import solve_ivp

#: Distance within which x counts as on a surface; relative and absolute tolerance of the integration.
NEAR, RTOL, ATOL = 1e-9, 1e-11, 1e-13
#: Largest number of switches in one stage.
MOST = 50


def replay(plant, start, controls, lengths):
    """State at the end, and integral of the cost.

    Parameters
    ----------
    plant : callable (x, u) -> (f, g, c, dc, rate)
        f (n), columns g (n, k), surfaces c (k), their gradients dc (k, n), and the rate of the cost
    controls, lengths : sequences, stage by stage
    """
    x, cost = np.array(start, dtype=float), 0.0
    for u, length in zip(controls, lengths):
        x, cost = _stage(plant, x, cost, np.atleast_1d(u), length)
    return x, cost


def _stage(plant, x, cost, u, length):
    t, known, n = 0.0, {}, len(x)
    for _ in range(MOST):
        modes = _modes(plant, x, u, known)
        watched = _events(plant, u, modes)
        start = np.append(x, cost)
        run = solve_ivp(_field(plant, u, modes), (t, length), start, rtol=RTOL, atol=ATOL, events=[event for _, event in watched])
        t, x, cost = run.t[-1], run.y[:n, -1], run.y[n, -1]
        if run.status == 0:
            return x, cost
        # a relay that reaches its surface may take any mode; one that leaves a slide takes the side that s has reached
        (i, event) = watched[next(k for k, times in enumerate(run.t_events) if len(times))]
        known = {} if modes[i] else {i: int(np.sign(_relays(plant, x, u, modes)[i]))}
    raise RuntimeError("too many switches in one stage")


def _relays(plant, x, u, modes):
    """s; where a relay slides (mode 0), such that dc/dt = 0."""
    f, g, _, dc, _ = plant(x, u)
    s, slides = np.array(modes, dtype=float), np.array(modes) == 0
    if slides.any():
        s[slides] = np.linalg.solve(dc[slides] @ g[:, slides], -dc[slides] @ (f + g[:, ~slides] @ s[~slides]))
    return s


def _field(plant, u, modes):
    def field(t, y):
        f, g, _, _, rate = plant(y[:-1], u)
        return np.append(f + g @ _relays(plant, y[:-1], u, modes), rate)

    return field


def _events(plant, u, modes):
    """For each relay its surface, or while it slides, s = 1 and s = -1."""

    def surface(i):
        return lambda t, y: plant(y[:-1], u)[2][i]

    def end(i, side):
        return lambda t, y: side - _relays(plant, y[:-1], u, modes)[i]

    watched = []
    for i, mode in enumerate(modes):
        for event, direction in [(surface(i), -mode)] if mode else [(end(i, 1), -1), (end(i, -1), 1)]:
            event.terminal, event.direction = True, direction
            watched.append((i, event))
    return watched


def _modes(plant, x, u, known):
    """Mode of each relay: +1, -1, or 0 (sliding); on a surface, the mode that is consistent with the vector field."""
    f, g, c, dc, _ = plant(x, u)
    sides = [(known[i],) if i in known else (int(np.sign(c[i])),) if abs(c[i]) > NEAR else (0, 1, -1) for i in range(len(c))]
    for modes in product(*sides):
        s = _relays(plant, x, u, modes)
        speed = dc @ (f + g @ s)
        if all(_stays(modes[i], s[i], speed[i]) for i in range(len(c)) if len(sides[i]) > 1):
            return modes
    raise RuntimeError("no mode is consistent")


def _stays(mode, s, speed):
    return abs(s) <= 1 if mode == 0 else mode * speed >= 0
