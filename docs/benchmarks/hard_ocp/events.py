"""Events of a piece of a replay, on the dense output of its integration."""

from itertools import pairwise

import numpy as np
from benchmarks.hard_ocp.laws import accelerations
from scipy.optimize import brentq, minimize_scalar

#: An event is where a function falls below -CROSSED: round-off is none.
CROSSED = 1e-12


def watched_functions(plant, u, modes, solution, n):
    """(function of time that is positive while the mode lasts, modes known after it) for each contact."""

    def at(t):
        y = solution(t)
        return y[:n], y[n : 2 * n]

    def gap(i):
        return lambda t: plant.gap(at(t)[0])[i]

    def force(i):
        return lambda t: accelerations(plant, *at(t), u, modes)[1][i]

    def slip(i, side):
        def speed(t):
            q, v = at(t)
            return side * (plant.tangent(q)[i] @ v)

        return speed

    def cone(i, side):
        def left(t):
            _, normal, friction = accelerations(plant, *at(t), u, modes)
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


def first_crossing(watched, grid):
    """The first time at which a function falls below -CROSSED, and the modes known then; None if it does not.

    Between samples a function that falls and rises again is found at its minimum.  One that begins below, by the round-off of the
    event before, has to fall further.
    """
    function, known = watched
    least = float(np.clip(function(grid[0]), -2 * CROSSED, -CROSSED))

    def f(t):
        return float(function(t)) - least

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
