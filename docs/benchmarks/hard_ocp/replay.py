"""Replay of controls on rigid bodies that touch: every event is located, and the laws of impact and friction are written by hand.

    M v' = f(q, v, u) + sum_i (n_i(q) N_i + t_i(q) F_i),    q' = v,    0 <= N_i perp gap_i(q) >= 0,    |F_i| <= mu N_i

Checks solutions without any code of pyomo_fesd or nosnoc.  Contacts that are closed are open (None), frictionless (0), sticking
('stick'), or slipping forward or backward (1, -1).  All modes are tried, and the first that satisfies its own conditions is taken;
the same at an impact, where Newton's law holds for each contact that takes part:

    0 <= P_i perp n_i^T (v+ + e v-) >= 0,    |impulse of friction| <= mu P_i, against the slip after the impact
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise, product

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize_scalar

#: A contact is closed below this gap; an event is where a function falls below -CROSSED; velocities below SLOW count as zero.
NEAR, CROSSED, SLOW = 1e-9, 1e-12, 1e-8
#: A rebound slower than this is not followed: the body stays.
REBOUND = 1e-6
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
        _impact(plant, out, began + t)
        modes = _modes(plant, out.q, out.v, u, known)
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
        a, _, _ = _accelerations(plant, q, v, u, modes)
        return np.concatenate([v, a, [plant.rate(q, v, u, stage), _slip(plant, q, v, modes)]])

    start = np.concatenate([out.q, out.v, [out.cost, out.slipped]])
    run = solve_ivp(rates, (t, length), start, method='DOP853', rtol=rtol, atol=ATOL, dense_output=True)
    watched = _watched(plant, u, modes, run.sol, n)
    grid = np.union1d(np.linspace(t, run.t[-1], samples), run.t)
    event = min((found for w in watched if (found := _first_crossing(w, grid))), key=lambda pair: pair[0], default=None)
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


# ---- modes -------------------------------------------------------------------------------------------------------------------


def _modes(plant, q, v, u, known):
    """The consistent modes of all contacts; contacts that are apart are open."""
    gaps, speeds = plant.gap(q), plant.normal(q) @ v
    closed = [i for i in range(len(gaps)) if gaps[i] <= NEAR and speeds[i] <= SLOW]
    for chosen in product(*((known[i],) if i in known else plant.modes for i in closed)):
        modes = dict.fromkeys(range(len(gaps))) | dict(zip(closed, chosen))
        if _persists(plant, q, v, u, modes, closed, known):
            return modes
    raise RuntimeError(f"no mode is consistent at q = {q}, v = {v}")


def _persists(plant, q, v, u, modes, closed, known):
    a, normal, friction = _accelerations(plant, q, v, u, modes)
    scale = 1 + np.abs(a).max()
    apart = plant.normal(q) @ a + _turn(plant.normal, q, v)
    slips = None if plant.tangent is None else (plant.tangent(q) @ v, plant.tangent(q) @ a + _turn(plant.tangent, q, v))

    def stays(i):
        if modes[i] is None:
            # an event has opened this contact: its force has fallen below zero, and only rounding can say otherwise
            return i in known or apart[i] >= -NEAR * scale
        if normal[i] < -NEAR * scale:
            return False
        if modes[i] == 0:
            return True
        slip, change = slips[0][i], slips[1][i]
        if modes[i] == 'stick':
            return abs(slip) <= SLOW and abs(friction[i]) <= plant.friction * normal[i] + NEAR * scale
        return modes[i] * slip > SLOW or (abs(slip) <= SLOW and modes[i] * change >= -NEAR * scale)

    return all(map(stays, closed))


def _turn(rows, q, v, step=1e-30):
    """The rate of ``rows(q)`` along v, times v."""
    return np.imag(rows(q + 1j * step * v)) / step @ v


def _accelerations(plant, q, v, u, modes):
    """Accelerations, normal forces and friction forces in these modes."""
    free = plant.force(q, v, u) / plant.mass
    if all(mode is None for mode in modes.values()):
        zero = np.zeros(len(modes))
        return free, zero, zero
    along = None if plant.tangent is None else -_turn(plant.tangent, q, v)
    return _with_reactions(plant, q, free, modes, -_turn(plant.normal, q, v), along)


def _with_reactions(plant, q, x, modes, across, along):
    """x + M^-1 (n N + t F) such that n^T of it is ``across`` at closed contacts, and t^T of it ``along`` where they stick; N; F."""
    n, t, mu = plant.normal(q), None if plant.tangent is None else plant.tangent(q), plant.friction
    rows, directions, right = [], [], []
    for i, mode in modes.items():
        if mode is not None:
            rows.append(n[i])
            directions.append(n[i] - mode * mu * t[i] if mode in (1, -1) else n[i])
            right.append(across[i])
        if mode == 'stick':
            rows.append(t[i])
            directions.append(t[i])
            right.append(along[i])
    normal, friction = np.zeros(len(modes)), np.zeros(len(modes))
    if not rows:
        return x, normal, friction
    rows, directions = np.array(rows), np.array(directions)
    reactions = np.linalg.lstsq(rows / plant.mass @ directions.T, np.array(right) - rows @ x, rcond=None)[0]
    given = iter(reactions)
    for i, mode in modes.items():
        if mode is not None:
            normal[i] = next(given)
            friction[i] = next(given) if mode == 'stick' else -mode * mu * normal[i]
    return x + (directions / plant.mass).T @ reactions, normal, friction


# ---- impacts -----------------------------------------------------------------------------------------------------------------


def _impact(plant, out, time):
    """Change the velocities where closed contacts approach; all closed contacts take part."""
    speeds = plant.normal(out.q) @ out.v
    closed = [i for i, gap in enumerate(plant.gap(out.q)) if gap <= NEAR]
    if not any(speeds[i] < -SLOW for i in closed):
        return
    bounce = np.where(speeds < -REBOUND, -plant.restitution * speeds, 0.0)
    for chosen in product(plant.modes, repeat=len(closed)):
        modes = dict.fromkeys(range(len(speeds))) | dict(zip(closed, chosen))
        v, normal, friction = _with_reactions(plant, out.q, out.v, modes, bounce, np.zeros(len(speeds)))
        if _holds(plant, out.q, v, normal, friction, modes, closed, bounce):
            out.impacts.append((time, tuple(i for i in closed if normal[i] > 0), speeds[closed]))
            out.v = v
            return
    raise RuntimeError(f"no law of impact is consistent at time {time:g}")


def _holds(plant, q, v, normal, friction, modes, closed, bounce):
    apart = plant.normal(q) @ v

    def holds(i):
        if modes[i] is None:
            return apart[i] >= bounce[i] - SLOW
        if normal[i] < -NEAR:
            return False
        if modes[i] == 'stick':
            return abs(friction[i]) <= plant.friction * normal[i] + NEAR
        return modes[i] == 0 or modes[i] * (plant.tangent(q)[i] @ v) >= -NEAR

    return all(map(holds, closed))


# ---- events ------------------------------------------------------------------------------------------------------------------


def _watched(plant, u, modes, solution, n):
    """(function of time that is positive while the mode lasts, modes known after it) for each contact."""

    def at(t):
        y = solution(t)
        return y[:n], y[n : 2 * n]

    def gap(i):
        return lambda t: plant.gap(at(t)[0])[i]

    def force(i):
        return lambda t: _accelerations(plant, *at(t), u, modes)[1][i]

    def slip(i, side):
        def speed(t):
            q, v = at(t)
            return side * (plant.tangent(q)[i] @ v)

        return speed

    def cone(i, side):
        def left(t):
            _, normal, friction = _accelerations(plant, *at(t), u, modes)
            return plant.friction * normal[i] - side * friction[i]

        return left

    watched = []
    for i, mode in modes.items():
        if mode is None:
            watched.append((gap(i), {}))
            continue
        watched.append((force(i), {i: None}))
        if mode in (1, -1):
            watched.append((slip(i, mode), {}))
        if mode == 'stick':
            watched += [(cone(i, side), {i: -side}) for side in (1, -1)]
    return watched


def _first_crossing(watched, grid):
    """The first time at which a function falls below -CROSSED, and the modes known then; None if it does not.

    Between samples a function that falls and rises again is found at its minimum.
    """
    function, known = watched

    def f(t):
        return float(function(t)) + CROSSED

    values = [f(t) for t in grid]
    for k, (left, right) in enumerate(pairwise(grid)):
        if values[k + 1] < 0:
            return (brentq(f, left, right, xtol=1e-14) if values[k] > 0 else left), known
        # the lowest value of a parabola is an eighth of the second difference below its middle sample at most
        if 0 < k and 4 * values[k] < values[k - 1] - 2 * values[k] + values[k + 1]:
            lowest = minimize_scalar(f, bounds=(grid[k - 1], right), method='bounded', options={'xatol': 1e-10})
            if lowest.fun < 0:
                return brentq(f, grid[k - 1], lowest.x, xtol=1e-14), known
    return None
