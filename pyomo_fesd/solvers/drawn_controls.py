"""Random controls of several starts (option ``starts_vary='controls'``), each a function of the seed and its number only."""

from collections import defaultdict

import numpy as np

from pyomo_fesd.core import FesdError, MovingGrid, TimeIndex, held_controls

#: The reach of a start is drawn log-uniformly between these, as powers of ten.
REACH = (-2.0, 0.0)


def draw_controls(moving: MovingGrid, seed: int, number: int) -> None:
    """Set the free controls that are held on control stages to random values; even numbers give each control one for all stages.

    With x its present value and a reach r between 0.01 and 1, log-uniform, one for the whole start: a control between finite bounds
    is uniform within r times their difference around x and the bounds, any other one within x +- r max(1, |x|) and its bounds.
    """
    random = np.random.default_rng([seed, number])
    reach = 10.0 ** random.uniform(*REACH)
    for stages in _free_controls(moving).values():
        parts = random.uniform(-1, 1, size=len(stages)) if number % 2 else np.full(len(stages), random.uniform(-1, 1))
        for controls, part in zip(stages, parts):
            value = _drawn(controls[-1], reach * part)
            for v in controls:
                v.set_value(value, skip_validation=True)


def refuse_without_controls(moving: MovingGrid) -> None:
    """Refuse a grid without a free control that is held on control stages.

    Raises
    ------
    FesdError
    """
    if not _free_controls(moving):
        raise FesdError(
            moving.wrt,
            "starts_vary='controls': no free variable over it is held constant on control stages",
            "name the controls in piecewise_constant of fesd.finite_elements, or let starts_vary be 'variables'",
        )


def _free_controls(moving):
    """The held controls without those that are fixed: control -> lists of variables, one for each stage."""
    times, found = TimeIndex(moving.wrt), defaultdict(list)
    for controls in held_controls(moving, times):
        if not any(v.fixed for v in controls):
            found[times.split(controls[-1])[1]].append(controls)
    return found


def _drawn(v, part):
    x = v.value or 0.0
    lower, upper = (-np.inf if v.lb is None else v.lb), (np.inf if v.ub is None else v.ub)
    size = upper - lower if np.isfinite(upper - lower) else max(1.0, abs(x))
    return float(np.clip(x + part * size, lower, upper))
