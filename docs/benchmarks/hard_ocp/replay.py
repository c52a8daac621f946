"""Replay of controls on rigid bodies that touch: every event is located, and the laws of impact and friction are written by hand.

    M v' = f(q, v, u) + sum_i (n_i(q) N_i + t_i(q) F_i),    q' = v,    0 <= N_i perp gap_i(q) >= 0,    |F_i| <= mu N_i

Checks solutions without any code of pyomo_fesd or nosnoc.  Contacts that are closed are open (None), frictionless (0), sticking
('stick'), or slipping forward or backward (1, -1).  All modes are tried, and the first that satisfies its own conditions is taken;
the same at an impact, where Newton's law holds for each contact that takes part:

    0 <= P_i perp n_i^T (v+ + e v-) >= 0,    |impulse of friction| <= mu P_i, against the slip after the impact
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from benchmarks.hard_ocp.events import first_crossing, watched_functions
from benchmarks.hard_ocp.laws import accelerations, consistent_modes, impact
from scipy.integrate import solve_ivp

#: Relative and absolute tolerance of the integration, and samples of each piece in which events are looked for.
RTOL, ATOL, SAMPLES = 1e-10, 1e-12, 60
#: Largest number of events in one stage.
MOST = 200


@dataclass(frozen=True)
class Plant:
    """Rigid bodies with n coordinates and c contacts.

    ``mass`` (n) is the diagonal of M; ``force(q, v, u)`` (n); ``gap(q)`` (c), ``normal(q)`` (c, n) its gradients; ``tangent(q)``
    (c, n) for contacts with friction; ``rate(q, v, u, stage)`` the running cost.  They are functions of numpy that are analytic:
    the time derivatives of normals and tangents are complex steps.
    """

    mass: np.ndarray
    force: Callable
    gap: Callable
    normal: Callable
    rate: Callable
    restitution: float = 0.0
    friction: float = 0.0
    tangent: Callable | None = None

    @property
    def modes(self):
        """Modes of a closed contact, in the order in which they are tried."""
        return ('stick', 1, -1, None) if self.friction else (0, None)


@dataclass
class Outcome:
    """End of a replay: state, integral of the running cost, impacts, and sampled times, positions and velocities.

    ``impacts`` are (time, contacts, normal velocities before); ``slipped`` is the way that closed contacts have slipped.
    """

    q: np.ndarray
    v: np.ndarray
    cost: float = 0.0
    impacts: list = field(default_factory=list)
    slipped: float = 0.0
    times: list = field(default_factory=list)
    positions: list = field(default_factory=list)
    velocities: list = field(default_factory=list)


def replay(plant, start, controls, lengths, rtol=RTOL, samples=SAMPLES):
    """Outcome of controls that are constant on each stage.

    Parameters
    ----------
    start : (q, v)
    controls, lengths : sequences, stage by stage

    Raises
    ------
    RuntimeError
        where no mode is consistent, events accumulate, or the integration fails
    """
    out, began = Outcome(*(np.array(part, dtype=float) for part in start)), 0.0
    for stage, (u, length) in enumerate(zip(controls, lengths)):
        _stage(plant, out, np.atleast_1d(u), stage, began, length, (rtol, samples))
        began += length
    return out


def _stage(plant, out, u, stage, began, length, precision):
    t, known = 0.0, {}
    for _ in range(MOST):
        impact(plant, out, began + t)
        modes = consistent_modes(plant, out.q, out.v, u, known)
        t, known, found = _piece(plant, out, u, stage, (began, t, length), modes, precision)
        if not found:
            return
    raise RuntimeError(f"more than {MOST} events from {began:g} to {began + length:g}")


def _piece(plant, out, u, stage, span, modes, precision):
    """Integrate in these modes to the next event or the end; return the time, the modes after the event, and if there was one."""
    began, t, length = span
    n, (rtol, samples) = len(out.q), precision

    def rates(_, y):
        q, v = y[:n], y[n : 2 * n]
        a, _, _ = accelerations(plant, q, v, u, modes)
        return np.concatenate([v, a, [plant.rate(q, v, u, stage), _slip(plant, q, v, modes)]])

    start = np.concatenate([out.q, out.v, [out.cost, out.slipped]])
    run = solve_ivp(rates, (t, length), start, method='DOP853', rtol=rtol, atol=ATOL, dense_output=True)
    watched = watched_functions(plant, u, modes, run.sol, n)
    grid = np.union1d(np.linspace(t, run.t[-1], samples), run.t)
    event = min((found for w in watched if (found := first_crossing(w, grid))), key=lambda pair: pair[0], default=None)
    if run.status != 0 and event is None:
        raise RuntimeError(f"the integration stops at {began + run.t[-1]:g}: {run.message}")
    end, known = event or (length, {})
    y = run.sol(end)
    _record(out, began, [s for s in grid if s < end] + [end], run.sol, n)
    out.q, out.v, out.cost, out.slipped = y[:n].copy(), y[n : 2 * n].copy(), y[-2], y[-1]
    _project(plant, out, modes)
    return end, known, event is not None


def _record(out, began, times, solution, n):
    states = solution(np.array(times))
    out.times += [began + s for s in times]
    out.positions += list(states[:n].T)
    out.velocities += list(states[n : 2 * n].T)


def _slip(plant, q, v, modes):
    if plant.tangent is None:
        return 0.0
    return float(sum(abs(plant.tangent(q)[i] @ v) for i, mode in modes.items() if mode in (1, -1)))


def _project(plant, out, modes):
    """Remove the drift of closed contacts, in the metric of the masses."""
    closed = [i for i, mode in modes.items() if mode is not None]
    if closed:
        rows = plant.normal(out.q)[closed]
        out.q -= _correction(plant, rows, plant.gap(out.q)[closed])
        rows = plant.normal(out.q)[closed]
        out.v -= _correction(plant, rows, rows @ out.v)


def _correction(plant, rows, violated):
    return (rows / plant.mass).T @ np.linalg.lstsq(rows / plant.mass @ rows.T, violated, rcond=None)[0]
