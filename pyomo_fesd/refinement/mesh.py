"""The mesh of a round: fixed points inside control stages, and the number of elements of each stage between them."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass, replace

from pyomo.dae import ContinuousSet

from pyomo_fesd.core import finest_resolution, share_elements

#: Least distance of two labels on equal elements, as a part of the horizon.
LEAST = 2e-6


@dataclass(frozen=True)
class Mesh:
    """Boundaries that keep their time, and the numbers of elements between them.

    Attributes
    ----------
    stages : tuple of float
        labels of the control-stage boundaries, first and last time included
    points : tuple of float
        labels of fixed points
    numbers : list of int
    finest : float
        least distance of labels that floating-point numbers tell apart
    """

    stages: tuple[float, ...]
    points: tuple[float, ...]
    numbers: list[int]
    finest: float

    def most(self, ncp: int) -> list[int]:
        """Return the largest numbers of elements, with labels that can be told apart.

        Between fixed points they may be as many as in the whole control stage: points are placed where elements have to be short.
        """
        each, boundaries = (ncp + 1) ** 2, sorted({*self.stages, *self.points})
        least = max(self.finest, LEAST * (self.stages[-1] - self.stages[0]))
        sensible = [int((b - a) / (least * each)) for a, b in zip(self.stages, self.stages[1:])]
        return [
            min(sensible[bisect_right(self.stages, a) - 1], int((b - a) / (self.finest * each)))
            for a, b in zip(boundaries, boundaries[1:])
        ]

    def with_numbers(self, numbers: list[int]) -> Mesh:
        """Return the same boundaries with other numbers of elements."""
        return replace(self, numbers=numbers)


def first_mesh(wrt: ContinuousSet, nfe: int | list[int], points: Iterable[float]) -> Mesh:
    """Return the mesh of ``nfe`` elements with fixed ``points`` on a ContinuousSet that is not discretised yet."""
    points = tuple(sorted(points))
    return Mesh(tuple(wrt), points, share_elements(wrt, nfe, points), finest_resolution(wrt))
