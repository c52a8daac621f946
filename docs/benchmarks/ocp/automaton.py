"""Replay of controls on an automaton: scipy integrates the field of the mode, and located events lead from mode to mode.

Checks solutions without any code of pyomo_fesd or nosnoc.  A mode is left where the function of one of its exits falls through
zero; controls jump at the start of a stage, and so may modes.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

#: Value of an exit's function that counts as zero; relative and absolute tolerance of the integration; the step of its derivative.
NEAR, RTOL, ATOL, STEP = 1e-8, 1e-11, 1e-13, 1e-6
#: Largest number of switches in one stage.
MOST = 50


@dataclass(frozen=True)
class Mode:
    """``field(x, u)``: the rates of the state; ``exits``: pairs of a function (x, u) and the name of the next mode."""

    field: Callable
    exits: tuple


def replay(modes, rate, start, mode, controls, lengths):
    """State at the end, and integral of the cost.

    Parameters
    ----------
    modes : dict
        the modes by name
    rate : callable (x, u)
        rate of the cost
    start, mode : sequence, str
        state and name of the mode at the start
    controls, lengths : sequences, stage by stage
    """
    y = np.append(np.array(start, dtype=float), 0.0)
    for u, length in zip(controls, lengths):
        y, mode = _stage(modes, rate, y, mode, np.atleast_1d(u), length)
    return y[:-1], y[-1]


def _stage(modes, rate, y, mode, u, length):
    t, mode = 0.0, _consistent(modes, mode, y[:-1], u)
    for _ in range(MOST):
        run = solve_ivp(_rates(modes[mode], rate, u), (t, length), y, rtol=RTOL, atol=ATOL, events=_events(modes[mode], u))
        t, y = run.t[-1], run.y[:, -1]
        if run.status == 0:
            return y, mode
        mode = next(name for (_, name), times in zip(modes[mode].exits, run.t_events) if len(times))
    raise RuntimeError("too many switches in one stage")


def _rates(mode, rate, u):
    return lambda t, y: np.append(mode.field(y[:-1], u), rate(y[:-1], u))


def _events(mode, u):
    return [_event(function, u) for function, _ in mode.exits]


def _event(function, u):
    def event(t, y):
        return function(y[:-1], u)

    event.terminal, event.direction = True, -1
    return event


def _consistent(modes, mode, x, u):
    """The mode after the jump of the controls at the start of a stage."""
    for _ in range(MOST):
        due = [name for function, name in modes[mode].exits if _is_due(function, modes[mode].field, x, u)]
        if not due:
            return mode
        mode = due[0]
    raise RuntimeError("no mode is consistent")


def _is_due(function, field, x, u):
    """Whether the function of an exit is negative, or is zero and falls."""
    now = function(x, u)
    return now < -NEAR or now <= NEAR and function(x + STEP * np.asarray(field(x, u)), u) < now
