"""Fitted power laws."""

import numpy as np


def exponent(sizes, values):
    """Exponent p of the power law ``values = c sizes^p`` fitted to the logarithms."""
    return np.polyfit(np.log(np.asarray(sizes, dtype=float)), np.log(np.asarray(values, dtype=float)), 1)[0]
