"""The laws of contact: which modes the closed contacts have, their forces, and the impulses at an impact.

Each mode has its own conditions, and all combinations are tried.  ``plant`` is a ``replay.Plant``; ``modes`` maps every contact to
None (open), 0 (closed, without friction), 'stick', or 1 and -1 (slips forward and backward).
"""

from itertools import product

import numpy as np

#: A contact is closed below this gap; velocities below SLOW count as zero.
NEAR, SLOW = 1e-9, 1e-8
#: A rebound slower than this is not followed: the body stays.
REBOUND = 1e-6


def consistent_modes(plant, q, v, u, known):
    """The consistent modes of all contacts; contacts that are apart are open."""
    gaps, speeds = plant.gap(q), plant.normal(q) @ v
    closed = [i for i in range(len(gaps)) if gaps[i] <= NEAR and speeds[i] <= SLOW]
    for chosen in product(*((known[i],) if i in known else plant.modes for i in closed)):
        modes = dict.fromkeys(range(len(gaps))) | dict(zip(closed, chosen))
        if _persists(plant, q, v, u, modes, closed, known):
            return modes
    raise RuntimeError(f"no mode is consistent at q = {q}, v = {v}")


def _persists(plant, q, v, u, modes, closed, known):
    a, normal, friction = accelerations(plant, q, v, u, modes)
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


def accelerations(plant, q, v, u, modes):
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


def impact(plant, out, time):
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
