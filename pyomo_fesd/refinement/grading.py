"""Where fixed points pay: behind a fast start, and about a transient that an input or a switch begins.

Between two boundaries that keep their time elements are equal, as short as the shortest transient asks for.  With the density D,

    h = c / Dbar,    Dbar = (int D**(p+1) dt / L)**(1/(p+1)),    W = sum_k L_k Dbar_k

equidistributes the error over stages k of length L_k, with W/c elements in all.  As M = W c**p (``element_density``), a tolerance
needs about

    W**(1+1/p) (c_K/tolerance)**(1/p)

of them, with the error constant c_K of the scheme, or a larger one that rounds so far have shown.  Points are placed one by one
where they reduce W most.  A transient that is shorter than an element shows as a dense element only: the next round, with more
elements there, places the next point.

Takes: the mesh and the solution of a round.
Leaves: the mesh of the next round with more fixed points, if they save enough elements.
Does not apply: to places at a switch, which moves; points keep a distance from it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import ceil, log10

import numpy as np

from pyomo_fesd.refinement.dense_output import Piece, RoundSolution
from pyomo_fesd.refinement.element_density import scales
from pyomo_fesd.refinement.error_estimate import error_constant
from pyomo_fesd.refinement.mesh import Mesh

#: Least part of W that one point saves, and factor by which all points of a round divide it.
WORTH, GAIN = 0.1, 1.5
#: Least number of elements that all points of a round save: without comparable rounds before it, another round is needed.
SAVED = 16
#: Distance of a point from a switch, as a part of the shorter element there.
FROM_SWITCH = 0.25
#: Elements that a round with new points has more than the one before.
MORE = 8
#: Labels of points are rounded to this part of an element.
ROUND = 0.05


@dataclass(frozen=True)
class Profile:
    """The density D over physical time, constant on each element.

    Attributes
    ----------
    nodes, density : ndarray, shape (n + 1,) and (n,)
    order : int
        p
    """

    nodes: np.ndarray
    density: np.ndarray
    order: int

    @property
    def error(self) -> float:
        """The error on these elements by their local scales, in error constants of the scheme."""
        return float(np.sum((self.density * np.diff(self.nodes)) ** (self.order + 1)))

    def weight(self, a: float, b: float) -> float:
        """Return L Dbar of a stage between two times."""
        power = self.order + 1
        return float((b - a) * (np.diff(np.clip(self.nodes, a, b)) @ self.density**power / (b - a)) ** (1 / power))

    def weights(self, boundaries: Sequence[float]) -> np.ndarray:
        """Return L Dbar of all stages between ``boundaries``."""
        return np.array([self.weight(a, b) for a, b in zip(boundaries, boundaries[1:])])

    def needed(self, weights: np.ndarray, constant: float) -> float:
        """Return the number of elements that stages with these weights need, for the error constant over the tolerance."""
        return float(weights.sum() ** (1 + 1 / self.order) * constant ** (1 / self.order))


def graded(mesh: Mesh, solution: RoundSolution, order: int, tolerance: float, estimate: float = 0.0) -> Mesh | None:
    """Return a mesh with more fixed points; None where they would not save enough elements.

    Parameters
    ----------
    estimate : float
        of the error by comparison of rounds, where there is one: larger than the local scales say if the order is not reached
    """
    profile = read_profile(solution, order)
    error = max(error_constant(solution.grid) * profile.error, estimate)
    if error <= tolerance:
        return None
    constant = error / profile.error / tolerance
    begin = solution.at_boundaries(solution.stage_labels()).tolist()
    candidates = dict(_candidates(solution.pieces))
    chosen = with_worthy_points(profile, begin, list(candidates))
    before, after = profile.weights(begin), profile.weights(chosen)
    saved = profile.needed(before, constant) - profile.needed(after, constant)
    if before.sum() < GAIN * after.sum() or saved < SAVED:
        return None
    new = {_label(solution, t, ROUND * candidates[t]) for t in chosen if t not in begin}
    more = replace(mesh, points=tuple(sorted({*mesh.points, *new})))
    least = [1 + _pieces_inside(solution, a, b) for a, b in zip(chosen, chosen[1:])]
    return _with_elements(more, after, least, more.most(len(solution.grid.tau)))


def read_profile(solution: RoundSolution, order: int) -> Profile:
    """Return the density of a solution."""
    nodes = np.array([solution.pieces[0].nodes[0], *(t for p in solution.pieces for t in p.nodes[1:])])
    return Profile(nodes, np.concatenate([scales(solution, p) / np.diff(p.nodes) for p in solution.pieces]), order)


def _candidates(pieces: Sequence[Piece]) -> Iterator[tuple[float, float]]:
    """Times of possible points, each with the length of the shorter element beside it."""
    for piece in pieces:
        h = np.diff(piece.nodes)
        yield from zip(piece.nodes[1:-1].tolist(), np.minimum(h[1:], h[:-1]).tolist())
    for before, after in zip(pieces, pieces[1:]):
        if before.stage == after.stage:
            switch, shorter = float(after.nodes[0]), float(min(np.diff(before.nodes)[-1], np.diff(after.nodes)[0]))
            yield from ((switch + side * FROM_SWITCH * shorter, shorter) for side in (-1, 1))


def with_worthy_points(profile: Profile, boundaries: Sequence[float], candidates: Sequence[float]) -> list[float]:
    """Return ``boundaries`` with those of the ``candidates`` that save enough, the best one first."""
    chosen = list(boundaries)
    while True:
        weights, saved = profile.weights(chosen), {}
        for t in (t for t in candidates if t not in chosen):
            k = int(np.searchsorted(chosen, t)) - 1
            saved[t] = weights[k] - profile.weight(chosen[k], t) - profile.weight(t, chosen[k + 1])
        best = max(saved, key=saved.get, default=None)
        if best is None or saved[best] <= WORTH * weights.sum():
            return chosen
        chosen = sorted([*chosen, best])


def _label(solution, time, error):
    """The label of a point, with few digits."""
    label = solution.label(time)
    return round(label, ceil(-log10(solution.label(time + error) - label)))


def _pieces_inside(solution, a, b):
    return sum(1 for p in solution.pieces if p.nodes[0] < b and p.nodes[-1] > a)


def _with_elements(mesh, weights, least, most):
    """``MORE`` elements than the mesh has, in proportion to the weights; None where labels would be too close."""
    if any(a > b for a, b in zip(least, most)):
        return None
    total = sum(mesh.numbers) + MORE
    return replace(mesh, numbers=np.clip((total * weights / weights.sum()).astype(int), least, most).tolist())
