"""Reproducible random starts."""

import numpy as np


def random_starts(family, low, high, spread=1.0, number=50):
    """Yield ``(seed, initial state, initial value of all times)``: uniform in [low, high], and normal about the initial state."""
    for seed in range(number):
        draw = np.random.default_rng([seed, *map(ord, family)])
        x0 = draw.uniform(low, high)
        yield seed, float(x0), float(x0 + spread * draw.normal())
