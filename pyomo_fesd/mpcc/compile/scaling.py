"""Scaling: the solver works with s_x x, s_g g, s_f f and sides s_G G, s_H H.

The user's factors are Pyomo's: a Suffix ``scaling_factor`` on any block, for variables, constraints, the objective and
complementarities.  A side that is a plain variable has that variable's factor; any other side without a factor of its own is
scaled to a largest gradient entry of 1 when that is far from 1, because absolute tolerances decide whether both sides are zero.
"""

from dataclasses import dataclass

import numpy as np
from pyomo.core.base.suffix import SuffixFinder

SUFFIX = 'scaling_factor'
#: Gradients of a side within these bounds are left as they are.
MILD = (1e-2, 1e2)


@dataclass(frozen=True)
class Scale:
    """Factors of variables x (n), rows g (m), the objective f and sides (2q): solver's value = factor * model's value.

    The objective is factor * (model's value - ``offset``).
    """

    x: np.ndarray
    g: np.ndarray
    f: float
    sides: np.ndarray
    offset: float = 0.0


class UserFactors:
    """Pyomo's ``scaling_factor`` suffixes, also on blocks above the one that is solved; 1 without one or if not ``enabled``."""

    def __init__(self, enabled):
        self._find = SuffixFinder(SUFFIX, 1.0).find if enabled else None
        self._scaled = {None: False}

    def of(self, components):
        """Factors of ``components``, as an array."""
        if self._find is None:
            return np.ones(len(components))
        return np.array([1.0 if c is None else self._factor(c) for c in components])

    def _factor(self, component):
        return abs(float(self._find(component))) or 1.0 if self._is_scaled(component.parent_block()) else 1.0

    def _is_scaled(self, block):
        """Whether a block, or one above it, has such a suffix: Pyomo looks for the component in each, which takes longer."""
        if block not in self._scaled:
            self._scaled[block] = block.component(SUFFIX) is not None or self._is_scaled(block.parent_block())
        return self._scaled[block]


def side_factors(largest, given):
    """Factors for sides whose largest gradient entries are ``largest``; a factor of the user (not 1) is kept."""
    extreme = (given == 1.0) & (largest > 0) & ((largest < MILD[0]) | (largest > MILD[1]))
    return np.where(extreme, 1.0 / np.where(largest > 0, largest, 1.0), given)
