"""A triangulation as the lower side of a convex function.

    sum_v w_v phi_v  <=  phi_u - margin

for any two neighbouring simplices, u being the vertex of one that is opposite to their facet and w its affine coordinates in the
other.  A triangulation for which there are such heights phi is called regular; every Delaunay triangulation is.  The heights
within [0, 1] with the largest margin solve a linear program.  On a grid, where |v|**2 lifts the corners of a cell into one
plane, they still separate its simplices.

Takes: the vertices and the simplices.
Leaves: the heights, one a vertex.
Does not apply: to triangulations that are not regular, or do not fill the convex hull of their vertices.
"""

import numpy as np
from scipy.optimize import linprog
from scipy.sparse import csr_array
from scipy.spatial import ConvexHull

from pyomo_fesd.core import FesdError

#: A margin below this does not separate two simplices; HiGHS' own tolerance is 1e-7.
LEAST_MARGIN = 1e-6


class RegularTriangulation:
    """A regular triangulation.

    Parameters
    ----------
    key : (vertices, simplices)
        nested tuples of numbers
    source : component that is named in messages

    Attributes
    ----------
    corner, size : array, shape (d,)
        the box around the vertices
    unit : array, shape (n, d)
        the vertices within the unit cube
    heights : array, shape (n,)

    Raises
    ------
    FesdError
        for a triangulation with holes or overlaps, and for one that is not regular
    """

    def __init__(self, key, source):
        self.key = self.vertices, self.simplices = key
        points = np.array(self.vertices)
        self.corner, self.size = points.min(axis=0), np.ptp(points, axis=0)
        self.unit = self.local(points)
        corners = np.swapaxes(self.unit[np.array(self.simplices)], 1, 2)
        self._matrices = np.concatenate([corners, np.ones((len(corners), 1, corners.shape[2]))], axis=1)
        self._refuse_holes(source)
        self.heights = self._heights(source)
        #: for each simplex the affine function through its heights: a, then b; the function is the largest of them
        self.planes = np.stack([np.linalg.solve(M.T, self.heights[list(s)]) for M, s in zip(self._matrices, self.simplices)])

    def local(self, x):
        """Return coordinates in the unit cube; x may hold expressions."""
        return (x - self.corner) / self.size

    def at(self, x):
        """Return the simplex at or nearest to x, its weights among those of all vertices, and its slope: a, then b."""
        weights = np.linalg.solve(self._matrices, np.append(self.local(x), 1.0)[:, None])[:, :, 0]
        number = int(weights.min(axis=1).argmax())
        simplex = list(self.simplices[number])
        w = np.zeros(len(self.unit))
        w[simplex] = np.clip(weights[number], 0, 1)
        return simplex, w, self.planes[number]

    def facets(self):
        """Return the sides of the domain, each as numbers c, e with ``c^T x + e <= 0`` inside."""
        return np.unique(ConvexHull(self.unit).equations.round(12), axis=0)

    def _refuse_holes(self, source):
        """Refuse simplices that do not fill the convex hull of their vertices."""
        dimension = len(self.size)
        filled = np.abs(np.linalg.det(self._matrices)).sum() / np.prod(range(1, dimension + 1))
        hull = ConvexHull(self.unit).volume
        if abs(filled - hull) > 1e-9 * hull:
            _refuse_shape(source, 'leave holes' if filled < hull else 'overlap')

    def _heights(self, source):
        rows, n = list(self._folds(source)), len(self.unit)
        if not rows:
            return np.zeros(n)
        positions = tuple(zip(*((i, v) for i, row in enumerate(rows) for v in row)))
        A = csr_array(([c for row in rows for c in row.values()], positions), shape=(len(rows), n + 1))
        result = linprog(np.append(np.zeros(n), -1.0), A_ub=A, b_ub=np.zeros(len(rows)), bounds=[(0, 1)] * n + [(None, 1)])
        if result.status or -result.fun < LEAST_MARGIN:
            raise FesdError(
                source,
                "its triangulation is not regular: it is not the lower side of any convex function, so no linear program "
                "finds the simplex of a point",
                "give the points without simplices: Pyomo's own triangulation is regular",
            )
        return result.x[:n]

    def _folds(self, source):
        """For each facet between two simplices the coefficients of the heights, and of the margin as entry n."""
        facets, n = {}, len(self.unit)
        for i, simplex in enumerate(self.simplices):
            for u in simplex:
                other = facets.setdefault(frozenset(simplex) - {u}, i)
                if other != i:
                    w = np.linalg.solve(self._matrices[other], np.append(self.unit[u], 1.0))
                    weights = dict(zip(self.simplices[other], w))
                    if any(weights[v] >= 0 for v in weights if v not in simplex):
                        _refuse_shape(source, 'overlap')
                    yield {**weights, u: -1.0, n: 1.0}


def _refuse_shape(source, fault):
    raise FesdError(source, f"its simplices {fault} in the convex hull of their vertices", "triangulate a convex domain")
