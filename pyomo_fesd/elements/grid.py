"""The grid that pyomo.dae has laid, read back as elements with their stage points (theory, section 2)."""

from bisect import bisect_right
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pyomo_fesd.errors import FesdError

#: pyomo.dae rounds the labels of collocation points to this resolution.
LABEL_RESOLUTION = 1e-6
#: Discretisations in which each equation belongs to one element.
ONE_ELEMENT_SCHEMES = ('LAGRANGE-RADAU', 'LAGRANGE-LEGENDRE', 'BACKWARD Difference')


@dataclass(frozen=True)
class Element:
    """Finite element n between two boundary labels.

    Attributes
    ----------
    n : int
        1..N
    stage : int
        control stage that it lies in, 1..
    opens_stage : bool
        whether it is the first of its control stage
    left, right : float
        boundary labels
    points : tuple of float
        labels of the K stage points (with Radau the last is ``right``)
    """

    n: int
    stage: int
    opens_stage: bool
    left: float
    right: float
    points: tuple

    @property
    def length(self):
        """Nominal length hbar_n, in labels of the ContinuousSet."""
        return self.right - self.left


@dataclass(frozen=True)
class Grid:
    """All elements of a discretised ContinuousSet and the quadrature that goes with its scheme.

    Attributes
    ----------
    elements : tuple of Element
    tau : tuple of float
        c_1..c_K, the stage points on (0, 1]
    weights : tuple of float
        b_1..b_K: sum_r b_r f(c_r) integrates polynomials up to degree K-1 (and more, by the choice of points) exactly
    """

    elements: tuple
    tau: tuple
    weights: tuple

    @property
    def right_is_stage(self):
        """Whether c_K = 1 (Radau): the right boundary is itself a stage point."""
        return self.tau[-1] == 1

    @cached_property
    def stages(self):
        """The elements of each control stage, as ``{stage: [elements]}``."""
        found = {}
        for e in self.elements:
            found.setdefault(e.stage, []).append(e)
        return found

    def element_of(self):
        """``{label: element}`` for every point but the first; a boundary belongs to the element on its left."""
        owner = {label: e for e in self.elements for label in e.points}
        owner.update((e.right, e) for e in self.elements)
        return owner


def read_grid(wrt, stages):
    """Read the grid of a discretised ContinuousSet.

    Parameters
    ----------
    wrt : ContinuousSet
    stages : list of float
        labels of the control-stage boundaries, the ends included

    Raises
    ------
    FesdError
        for difference schemes that connect two elements, and for stage boundaries that are not element boundaries
    """
    info = wrt.get_discretization_info()
    if info['scheme'] not in ONE_ELEMENT_SCHEMES:
        raise FesdError(
            wrt,
            f"it is discretised with '{info['scheme']}', whose equations join two elements",
            "use collocation (LAGRANGE-RADAU or LAGRANGE-LEGENDRE) or the BACKWARD difference",
        )
    tau = tuple(float(c) for c in info.get('tau_points', (0.0, 1.0)) if c > 0)
    tau = (*tau[:-1], 1.0) if abs(tau[-1] - 1) < 1e-12 else tau
    boundaries, points, opening = list(wrt.get_finite_elements()), list(wrt), set(stages)
    stray = sorted(opening.difference(boundaries))
    if stray:
        raise FesdError(wrt, f"the stage boundaries {stray} are not element boundaries", "discretise with these points in the set")
    elements = []
    for n, (left, right) in enumerate(zip(boundaries, boundaries[1:]), start=1):
        inside = _between(points, left, right)
        labels = (*inside, right) if tau[-1] == 1 else tuple(inside)
        if len(labels) != len(tau):
            raise FesdError(
                wrt,
                f"element [{left}, {right}] has {len(labels)} stage points instead of {len(tau)}: "
                f"its labels collide at pyomo.dae's resolution of {LABEL_RESOLUTION}",
                "scale time, e.g. write the model in milliseconds or over a horizon of length 1",
            )
        elements.append(Element(n, bisect_right(stages, left), left in opening, left, right, labels))
    return Grid(tuple(elements), tau, _quadrature(tau))


def _between(points, left, right):
    return points[bisect_right(points, left) : bisect_right(points, right) - 1]


def _quadrature(tau):
    """b with sum_r b_r c_r**k = 1/(k+1), k < K."""
    K = len(tau)
    moments = np.vander(tau, K, increasing=True).T
    return tuple(float(b) for b in np.linalg.solve(moments, [1 / (k + 1) for k in range(K)]))


def share_elements(wrt, nfe):
    """How many elements each control stage gets: as many as the others, or as ``nfe`` lists them.

    Raises
    ------
    FesdError
        if they cannot be shared equally, or if the list does not fit
    """
    stages = len(wrt) - 1
    if isinstance(nfe, list):
        if len(nfe) != stages:
            raise FesdError(
                wrt, f"nfe={nfe} lists {len(nfe)} numbers for {stages} control stages", "give one number for each stage"
            )
        return nfe
    if nfe % stages:
        raise FesdError(
            wrt,
            f"nfe={nfe} elements cannot be shared equally among {stages} control stages",
            f"take a multiple of {stages}, or a list with one number for each stage",
        )
    return [nfe // stages] * stages


def check_resolution(wrt, shares, ncp):
    """Refuse a grid whose labels would fall together when pyomo.dae rounds them to 6 decimals."""
    points = list(wrt)
    shortest = min((b - a) / n for a, b, n in zip(points, points[1:], shares))
    # the first of ncp Radau or Legendre points lies about 1/(ncp + 1)**2 from the boundary
    if shortest / (ncp + 1) ** 2 < 2 * LABEL_RESOLUTION:
        raise FesdError(
            wrt,
            f"elements of nominal length {shortest:g} with {ncp} points are finer than the {LABEL_RESOLUTION} to which "
            "pyomo.dae rounds its labels",
            "scale time, e.g. write the model in milliseconds or over a horizon of length 1",
        )
