"""Variables x_i, x_j >= 0 of which objective and rows contain only the difference a x_i - b x_j: a common part of both is free.

Such are the parts p and n of a slip velocity, w = p - n, where no force acts.  Ipopt moves them to the middle of their free
direction, at 1e5; there the row loses the digits that a branch asks for, and the last iterations change nothing.  Beside this,
pairs whose side is p + n look decided, though p = n = 0 may satisfy them too.

In a branch that has neither of them at a bound x_i is 0, and x_j takes the whole difference, with either sign.  At its solution
each gets its part, and one of them is 0.

Takes: a compiled MPCC, and bounds of variables.
Leaves: bounds, start and trust region with one variable for each difference; and the values of both.
"""

import numpy as np

from pyomo_fesd.mpcc.compile import LastPoints

#: Digits to which the entries of two columns agree.
DIGITS = 12
NONE = np.zeros(0, dtype=int), np.zeros(0, dtype=int), np.zeros(0)


class Differences:
    """The differences of one MPCC's branch NLPs.

    Parameters
    ----------
    c : MpccFunctions
    rows : int array
        stacked numbers of the rows of these NLPs
    """

    def __init__(self, c, rows):
        self._c, self._rows = c, rows
        (self._among,) = np.nonzero(c.only_in_rows & (c.lbx == 0.0) & (c.ubx == np.inf))
        # slopes may contain parameters
        self._known = LastPoints(self._found)

    def join(self, w, lbx, ubx, box) -> tuple:
        """Give differences one variable each, in place; ``box`` is a trust region or None.  Returns what ``parted`` takes."""
        i, j, ratio = self._known(self._c.x0, self._c.parameters)
        free = np.all([(lbx[k] == 0.0) & (ubx[k] == np.inf) for k in (i, j)], axis=0)
        i, j, ratio = i[free], j[free], ratio[free]
        w[j] -= ratio * w[i]
        w[i] = ubx[i] = 0.0
        lbx[j] = -np.inf
        if box is not None:
            box[0][j], box[1][j] = -np.inf, np.inf
        return i, j, ratio

    @staticmethod
    def parted(w, joined):
        """``w`` with the parts of differences that are joined."""
        i, j, ratio = joined
        w = w.copy()
        w[i] = np.maximum(-w[j], 0.0) / ratio
        w[j] = np.maximum(w[j], 0.0)
        return w

    def _found(self, w, _):
        """The variables x_i and x_j of all differences, and a / b."""
        if len(self._among) < 2:
            return NONE
        J = self._c.stacked_jacobian(w)[self._rows].tocsc()
        J.eliminate_zeros()
        unpaired, found = {}, []
        for k in self._among.tolist():
            rows, slopes = (part[J.indptr[k] : J.indptr[k + 1]] for part in (J.indices, J.data))
            if not len(rows):
                continue
            # with the other sign the columns of x_i and x_j agree but for a factor
            key = rows.tobytes(), np.round(slopes / slopes[0], DIGITS).tobytes()
            other = unpaired.pop((*key, slopes[0] < 0), None)
            if other is None:
                unpaired[(*key, slopes[0] > 0)] = k, slopes[0]
            else:
                found.append((other[0], k, -other[1] / slopes[0]))
        return tuple(map(np.array, zip(*found))) if found else NONE
