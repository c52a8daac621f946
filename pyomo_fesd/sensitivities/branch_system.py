"""The first-order conditions of the branch of a certified point, differentiated: which derivatives exist, and their values."""

import numpy as np
from scipy import sparse

from pyomo_fesd.core import FesdError
from pyomo_fesd.sensitivities.active_rows import NEAR, active_rows
from pyomo_fesd.sensitivities.kkt import Kkt
from pyomo_fesd.sensitivities.linearisation import Linearisation
from pyomo_fesd.sensitivities.multipliers import implied, multipliers

#: An open row that moves by more than this, relative, does not stay as it is.
MOVES = 1e-6
#: Forward and adjoint derivatives agree to this, relative.
AGREE = 1e-6
#: What to do where there is no derivative.
BESIDE = "move the parameter, or compare solutions on both sides"


class BranchSystem:
    """The first-order conditions of the branch of a compiled model's present values.

    Parameters
    ----------
    ready : PersistentModel
        compiled with the parameters, its values certified
    parameters : list of VarData and ParamData
    name : callable
        the user's name of a component
    """

    def __init__(self, ready, parameters, name):
        self._c, self._parameters, self._name = ready.compiled, parameters, name
        self._at = at = Linearisation(self._c, parameters, self._c.x0)
        rows, A, D, lam = self._decided(self._rows(ready), *(b.toarray() for b in at.bounds))
        self._H, self._M = at.hessian(self._of_functions(rows, lam))
        self._A, self._D, self._open = A[~rows.open], D[~rows.open], (A[rows.open], D[rows.open])
        names = np.array(rows.names, dtype=object)
        self._names, self._open_names = names[~rows.open], names[rows.open]
        self._kkt = Kkt(self._H[self._free][:, self._free], self._A[:, self._free])

    def _rows(self, ready):
        near, eta = ready.options.biactive_tol, ready.options.eta_tol
        return active_rows(self._c, ready.cache.sides, self._c.x0, max(near, NEAR) if self._at.size else near, eta, self._name)

    def _decided(self, rows, low, high):
        """The active rows with those that hold strictly as equations, their derivatives A and D, and their multipliers.

        ``low`` and ``high`` are the derivatives of bounds by parameters; a variable that the branch fixes follows its bound.
        """
        at, side = self._at, rows.side[:, None]
        self._free = rows.fixed == 0
        self._fixed = np.where((rows.fixed < 0)[:, None], low, np.where((rows.fixed > 0)[:, None], high, 0.0))
        A, D = sparse.diags(rows.side) @ at.J[rows.rows], side * at.P[rows.rows].toarray()
        bounds = rows.rows >= at.functions
        j = rows.rows[bounds] - at.functions
        D[bounds] -= side[bounds] * np.where(side[bounds] > 0, high[j], low[j])
        rows = rows.settled(implied(A[:, self._free], rows.open))
        found = multipliers(at.gradient[self._free], A[:, self._free], rows.open, at.size)
        if found is None:
            raise FesdError(
                self._c.variables[0].model(),
                "the active constraints of its solution have no multipliers (LICQ is lost)",
                "solve it with a smaller branch_tol; if that does not help, its solution has no derivative",
            )
        return rows.settled(found[1]), A, D, found[0]

    def _of_functions(self, rows, lam):
        """Multipliers of the functions of the ``Linearisation``; several active rows may belong to one."""
        found, inside = np.zeros(self._at.functions), rows.rows < self._at.functions
        np.add.at(found, rows.rows[inside], (rows.side * lam)[inside])
        return found

    def derivatives(self, by_w, names):
        """Derivatives (k, l) by the parameters of outputs that depend on the variables with gradients ``by_w`` (k, n).

        Raises
        ------
        FesdError
            with the reason, where one of them does not exist
        """
        free, fixed = self._free, self._fixed
        b, d = self._right_hand_sides()
        forward = self._forward(b, d)
        self._refuse_open(self._with_fixed(forward.x), self._open[1], self._parameters)
        adjoint = self._adjoint(by_w[:, free].T, names)
        through, sizes = by_w[:, free] @ forward.x, np.maximum(1.0, np.abs(by_w[:, free]) @ np.abs(forward.x))
        self._refuse_inexact(through, np.asarray(adjoint.x.T @ b + adjoint.y.T @ d), sizes, names)
        return through + by_w @ fixed

    def by_parameters(self):
        """Derivatives (n, l) of the variables by the parameters, and the mask (l) of those that exist.

        A variable that the active equations do not determine gets one of its derivatives.
        """
        answer = self._kkt.solve(*self._right_hand_sides())
        return self._with_fixed(answer.x), answer.exists

    def moved(self, step, change):
        """First-order changes of g, G and H for a ``step`` of the variables and a ``change`` of the parameters."""
        m, q = len(self._c.lbg), self._c.pairs
        return np.split((self._at.J @ step + self._at.P @ change)[: m + 2 * q], [m, m + q])

    def refuse_moving(self, step, change):
        """Refuse a ``step`` of the variables and a ``change`` of the parameters with which open rows do not stay as they are.

        Raises
        ------
        FesdError
            naming the row
        """
        names = ["the change of its parameters"]
        self._refuse_open(step[:, None], (self._open[1] @ change)[:, None], names)

    def _right_hand_sides(self):
        """Of stationarity and of the active equations, a column for each parameter."""
        free, fixed = self._free, self._fixed
        return np.asarray(-(self._M + self._H @ fixed)[free]), -(self._D + self._A @ fixed)

    def _with_fixed(self, x):
        """Derivatives (n, l) of all variables from those of the free ones."""
        step = self._fixed.copy()
        step[self._free] = x
        return step

    def _forward(self, b, d):
        """Derivatives of the variables by the parameters."""
        answer = self._kkt.solve(b, d)
        if answer.exists.all():
            return answer
        j = int(np.argmin(answer.exists))
        left = np.abs(answer.left[1][:, j])
        row = f" near '{self._names[int(np.argmax(left))]}'" if left.size else ""
        raise FesdError(
            self._parameters[j],
            f"the solution has no derivative by it: the active equations contradict each other to first order{row} (LICQ is "
            "lost: switches that coincide, or a surface that is only touched)",
            BESIDE,
        )

    def _adjoint(self, b, names):
        """Derivatives of the outputs by the right-hand sides."""
        answer = self._kkt.solve(b, np.zeros((self._A.shape[0], b.shape[1])))
        if answer.exists.all():
            return answer
        i = int(np.argmin(answer.exists))
        moves = self._c.variables[np.flatnonzero(self._free)[int(np.argmax(np.abs(answer.left[0][:, i])))]]
        raise FesdError(
            names[i],
            f"it has no derivative: the active equations do not determine it, '{self._name(moves)}' may move",
            "give the model as many equations as unknowns, an objective with one minimum, or step equilibration",
        )

    def inverse(self, by_w, names):
        """W P W' for quantities with gradients W (k, n), P the inverse of the Hessian that is reduced to the active rows.

        Raises
        ------
        FesdError
            as ``derivatives``
        """
        answer = self._adjoint(by_w[:, self._free].T, names)
        step = np.zeros((by_w.shape[1], by_w.shape[0]))
        step[self._free] = answer.x
        self._refuse_open(step, 0.0, names)
        return by_w @ step

    def _refuse_open(self, step, D, causes):
        """Refuse open rows that do not stay as they are; those that do hold in every branch.

        ``step`` has a column for each of the ``causes``, ``D`` what these add to the rows.
        """
        A, _ = self._open
        moves = np.abs(A @ step + D)
        most = MOVES * np.maximum(1.0, np.abs(A) @ np.abs(step) + np.abs(D))
        if np.all(moves <= most):
            return
        i, j = np.unravel_index(np.argmax(moves - most), moves.shape)
        raise FesdError(
            causes[j],
            f"the solution has a kink there: '{self._open_names[i]}' is active without a positive multiplier (strict "
            "complementarity is lost), so derivatives to both sides differ",
            BESIDE,
        )

    def _refuse_inexact(self, forward, adjoint, sizes, names):
        """Refuse derivatives in which the forward and the adjoint system do not agree."""
        differences = np.abs(forward - adjoint) / sizes
        if np.all(differences <= AGREE):
            return
        i, j = np.unravel_index(np.argmax(differences), differences.shape)
        cause = f"forward {forward[i, j]:g}, adjoint {adjoint[i, j]:g}"
        raise FesdError(
            names[i],
            f"its derivative by '{self._parameters[j].name}' is not reliable: {cause}",
            "scale the model, or take fewer elements",
        )
