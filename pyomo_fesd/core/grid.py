"""Read the grid of a ContinuousSet that pyomo.dae has discretised, as elements with collocation points (theory, section 2)."""

import sys
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import groupby
from math import ceil, log10

import numpy as np
from pyomo.dae import ContinuousSet

from pyomo_fesd.core.errors import FesdError
from pyomo_fesd.core.interpolation import interpolation_weights
from pyomo_fesd.core.switched_systems import signal_breakpoints

#: Labels have as many decimals as pyomo.dae's, and more where elements have fewer than these digits then.
DECIMALS, DIGITS = 6, 4
#: Least number of elements between two breakpoints of a signal.
LEAST_EACH = 2
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
        stretch between two boundaries that keep their physical time, 1..: a control stage, or a part of one between fixed points
    opens_stage : bool
        whether it is the first of its stage
    inputs_change : bool
        whether inputs may change where it begins: at the first time and boundaries of control stages, not at fixed points
    left, right : float
        boundary labels
    points : tuple of float
        labels of the K collocation points (with Radau the last is ``right``)
    """

    n: int
    stage: int
    opens_stage: bool
    inputs_change: bool
    left: float
    right: float
    points: tuple

    @property
    def length(self) -> float:
        """Nominal length hbar_n, in labels of the ContinuousSet."""
        return self.right - self.left

    @cached_property
    def own_labels(self) -> tuple[float, ...]:
        """Labels of the collocation points and of the right boundary, each once."""
        return tuple(dict.fromkeys((*self.points, self.right)))


@dataclass(frozen=True)
class Grid:
    """All elements of a discretised ContinuousSet and the quadrature that goes with its scheme.

    Attributes
    ----------
    elements : tuple of Element
    tau : tuple of float
        c_1..c_K, the collocation points on (0, 1]
    weights : tuple of float
        b_1..b_K: sum_r b_r f(c_r) integrates polynomials up to degree K-1 (and more, by the choice of points) exactly
    """

    elements: tuple
    tau: tuple
    weights: tuple

    @property
    def right_is_collocated(self) -> bool:
        """Whether c_K = 1 (Radau): the right boundary is itself a collocation point."""
        return self.tau[-1] == 1

    @cached_property
    def stages(self) -> dict[int, list[Element]]:
        """The elements of each stage: they share its length."""
        return {stage: list(elements) for stage, elements in groupby(self.elements, key=lambda e: e.stage)}

    @cached_property
    def control_stages(self) -> list[list[Element]]:
        """The elements of each control stage: no input changes inside."""
        found = []
        for element in self.elements:
            if element.inputs_change:
                found.append([])
            found[-1].append(element)
        return found

    def inner_boundaries(self) -> Iterator[tuple[Element, Element]]:
        """Yield the two elements beside each boundary inside a stage."""
        for elements in self.stages.values():
            yield from zip(elements, elements[1:])

    def element_of(self) -> dict[float, Element]:
        """``{label: element}`` for every point but the first; a boundary belongs to the element on its left."""
        owner = {label: e for e in self.elements for label in e.points}
        owner.update((e.right, e) for e in self.elements)
        return owner


def read_grid(wrt: ContinuousSet, stages: list[float], fixed_points: Iterable[float] = ()) -> Grid:
    """Read the grid of a discretised ContinuousSet.

    Parameters
    ----------
    wrt : ContinuousSet
    stages : list of float
        labels of the control-stage boundaries, first and last time included
    fixed_points : iterable of float
        labels of other boundaries that keep their physical time

    Raises
    ------
    FesdError
        for difference schemes that connect two elements, and for stage boundaries or fixed points that are not element boundaries
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
    boundaries, points, changing = list(wrt.get_finite_elements()), list(wrt), set(stages)
    opening = sorted(changing.union(fixed_points))
    for name, given in (('control-stage boundaries', changing), ('fixed points', opening)):
        if stray := sorted(set(given).difference(boundaries)):
            raise FesdError(wrt, f"the {name} {stray} are not element boundaries", "discretise with these points in the set")
    elements = []
    for n, (left, right) in enumerate(zip(boundaries, boundaries[1:]), start=1):
        inside = _between(points, left, right)
        labels = (*inside, right) if tau[-1] == 1 else tuple(inside)
        if len(labels) != len(tau):
            raise FesdError(
                wrt,
                f"element [{left}, {right}] has {len(labels)} collocation points instead of {len(tau)}: "
                f"its labels collide at pyomo.dae's resolution of 1e-6",
                "let fesd.finite_elements discretise it, or scale time, e.g. write the model in milliseconds",
            )
        elements.append(Element(n, bisect_right(opening, left), left in opening, left in changing, left, right, labels))
    return Grid(tuple(elements), tau, _quadrature_weights(tau))


@cache
def _quadrature_weights(tau):
    """The weights of the integral over [0, 1]."""
    return tuple(interpolation_weights(tau, [1 / (k + 1) for k in range(len(tau))]).tolist())


def _between(points, left, right):
    return points[bisect_right(points, left) : bisect_right(points, right) - 1]


def share_elements(wrt: ContinuousSet, nfe: int | list[int], fixed_points: Iterable[float] = ()) -> list[int]:
    """Return the number of elements between the points of ``wrt``: equal for each control stage, or as ``nfe`` lists them.

    Between the breakpoints of signals, and ``fixed_points``, the elements of a control stage are shared by length, at least two for
    each interval; so they may be more than ``nfe``.

    Raises
    ------
    FesdError
        if they cannot be shared equally, or if the list does not fit
    """
    points, inner = with_points(wrt, fixed_points), signal_breakpoints(wrt).union(fixed_points)
    if isinstance(nfe, list) and len(nfe) == len(points) - 1:
        return nfe
    stages = [p for p in points if p not in inner]
    shares = _share_equally(wrt, nfe, len(stages) - 1)
    if not inner:
        return shares
    intervals = [[p for p in points if a <= p <= b] for a, b in zip(stages, stages[1:])]
    return [n for share, inside in zip(shares, intervals) for n in _share_by_length(share, np.diff(inside))]


def _share_equally(wrt, nfe, stages):
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


def _share_by_length(number, lengths):
    """Numbers in proportion to ``lengths``; two elements at least, as one alone cannot move to a switch."""
    if len(lengths) == 1:
        return [number]
    found = np.full(len(lengths), LEAST_EACH)
    while found.sum() < number:
        found[np.argmax(lengths / found)] += 1
    return found.tolist()


def numbers_of_elements(lengths: Sequence[float], total: int) -> list[int]:
    """Return numbers of elements with the sum ``total``, at least one for each length, that make the longest element shortest."""
    found = [1] * len(lengths)
    for _ in range(total - len(lengths)):
        found[int(np.argmax(np.divide(lengths, found)))] += 1
    return found


def finest_resolution(wrt: ContinuousSet) -> float:
    """Return the least distance of labels that floating-point numbers of this size tell apart."""
    return 16 * sys.float_info.epsilon * max(abs(wrt.first()), abs(wrt.last()))


def with_points(wrt: ContinuousSet, fixed_points: Iterable[float]) -> list[float]:
    """Return the points of ``wrt`` and ``fixed_points`` in order, each once."""
    return sorted({*wrt, *fixed_points})


def label_decimals(wrt: ContinuousSet, shares: list[int], ncp: int, fixed_points: Iterable[float] = ()) -> int:
    """Return the number of decimals to which labels are rounded: 6, or more where elements are short.

    Raises
    ------
    FesdError
        for elements whose labels floating-point numbers do not tell apart
    """
    points = with_points(wrt, fixed_points)
    shortest = min((b - a) / n for a, b, n in zip(points, points[1:], shares))
    # the first of ncp Radau or Legendre points lies about 1/(ncp + 1)**2 from the boundary
    distance = shortest / (ncp + 1) ** 2
    if distance < finest_resolution(wrt):
        raise FesdError(
            wrt,
            f"elements of nominal length {shortest:g} with {ncp} points are finer than floating-point numbers near "
            f"{max(map(abs, points)):g} tell apart",
            "let time begin at 0, or take fewer elements",
        )
    return max(DECIMALS, DIGITS + ceil(-log10(shortest)))
