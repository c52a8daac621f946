"""The MPCC as data and functions, from which relaxations, branches and the LPEC are formed.

Everything here is in the solver's own scaling (see ``scaling``); ``values``, ``objective`` and ``absolute`` convert to the units of
the model.  ``MpccFunctions`` can be pickled and sent to another process: with the casadi graph, without the Pyomo components.
"""

from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np
from scipy import sparse

from pyomo_fesd.mpcc.compile.derivatives import ModelDerivatives
from pyomo_fesd.mpcc.compile.last_points import LastPoints


@dataclass(frozen=True)
class Evaluation:
    """Values at one point w (numpy vectors; see ``MpccFunctions``)."""

    f: float
    g: np.ndarray
    G: np.ndarray
    H: np.ndarray
    eta: np.ndarray


@dataclass
class MpccData:
    """The bounds, start values and facts of an MPCC besides its functions.

    Attributes
    ----------
    lbx, ubx : arrays (n), the variables' bounds with the signs that plain-variable sides imply
    lbg, ubg : arrays (m)
    side_of : int array (2q), equal numbers for equal sides among G (first q) and H
    guided : bool array (n), variables with guide bounds, whose own bounds belong to the method
    guide_lbx, guide_ubx : arrays (n), bounds in the homotopy, tighter for these variables
    x0 : array (n), the model's values projected to the bounds
    parameters : array (l), values of the parameters that a new solve may change
    missing : int, number of variables without a value
    sign : +1.0, or -1.0 for a model that maximises (f is always minimised)
    has_objective : bool
    scale : Scale
    neighbours : list of NeighbourIndices
    coincidences : list of CoincidenceIndices
    arrivals : list of ArrivalIndices
    followers : FollowerIndices
    fillings : list of FillingIndices
    tentative : bool array, decisions that are dropped where they leave no solution
    """

    lbx: np.ndarray
    ubx: np.ndarray
    lbg: np.ndarray
    ubg: np.ndarray
    side_of: np.ndarray
    guided: np.ndarray
    guide_lbx: np.ndarray
    guide_ubx: np.ndarray
    x0: np.ndarray
    parameters: np.ndarray
    missing: int
    sign: float
    has_objective: bool
    scale: object
    neighbours: list
    coincidences: list
    arrivals: list
    followers: object
    fillings: list
    tentative: np.ndarray


class MpccFunctions:
    """A compiled MPCC; attributes of ``MpccData`` are attributes here too.

    Parameters
    ----------
    functions : ScaledFunctions
    data : MpccData
    variables : list of VarData, length n
    constraints : list of ConstraintData, length m (rows of g)
    conditions : list of Condition, length q
    decisions : list of Decision
    model_values : ModelValues
        reads those data again that a new solve may find changed

    Attributes
    ----------
    kind : type of symbols, ca.SX or ca.MX
    pairs : int, q
    inner : int, number of the functions (G, H, equal)
    x, p : symbols of the variables w (n) and of the parameters (l)
    f, penalty, g, G, H, eta, equal, gauges : expressions of them
    """

    def __init__(self, functions, data, variables=(), constraints=(), conditions=(), decisions=(), model_values=None):
        self._functions, self._data = functions, data
        self.__dict__.update(vars(data))
        self.variables, self.constraints, self.conditions, self.decisions = variables, constraints, conditions, decisions
        self._model_values = model_values
        self.kind, self.pairs, self.inner = functions.kind, functions.pairs, 2 * functions.pairs + functions.decisions
        self.x, self.p = self.kind.sym('w', len(self.x0)), self.kind.sym('p', len(self.parameters))
        self.__dict__.update(functions.outputs(self.x, self.p))
        self._evaluated, self._differentiated = LastPoints(self._evaluate), LastPoints(self._gradients)

    def at(self, w, p) -> ModelDerivatives:
        """Return the functions and their derivatives at expressions ``w`` and ``p``."""
        return ModelDerivatives(self._functions, w, p)

    @cached_property
    def _values(self):
        return ca.Function('values', [self.x, self.p], [self.f, self.g, self.G, self.H, self.eta])

    @cached_property
    def _equal(self):
        return ca.Function('equal', [self.x, self.p], [ca.densify(self.equal)])

    @cached_property
    def _gauges(self):
        return ca.Function('gauges', [self.x, self.p], [ca.densify(self.gauges)])

    @cached_property
    def _jacobian(self):
        """Function of the nonzeros of the Jacobians of f, g, G, H and equal, and the matrices that they belong to."""
        c, at, q = self._functions, (self.x, self.p), self.pairs
        sides = c.sides.jacobian(*at)
        matrices = [c.cost.jacobian(*at)[0, :], c.rows.jacobian(*at), sides[:q, :], sides[q : 2 * q, :], sides[2 * q :, :]]
        return ca.Function('jacobian', list(at), [J.nz[:] for J in matrices]), [_Pattern(J.sparsity()) for J in matrices]

    @property
    def linear(self) -> bool:
        """Whether all rows and sides are linear."""
        return not (self._functions.rows.functions.nonlinear.any() or self.nonlinear_sides.any())

    @property
    def nonlinear_sides(self) -> np.ndarray:
        """Mask over the sides (2q) that are not linear."""
        return self._functions.sides.functions.nonlinear[: 2 * self.pairs]

    def parameter_terms(self, w) -> np.ndarray:
        """Return the sizes of the terms of parameters in g and in the sides at ``w``."""
        parts = [rows.parameter_terms(w, self.parameters) for rows in (self._functions.rows, self._functions.sides)]
        return np.concatenate(parts)[: len(self.lbg) + 2 * self.pairs]

    def __getstate__(self):
        return self._functions, self._data

    def __setstate__(self, state):
        self.__init__(*state)

    def refresh(self):
        """Read bounds, start and parameters from the model again; see ``ModelValues.read``."""
        self._data = replace(self._data, **self._model_values.read())
        self.__dict__.update(vars(self._data))

    def present_values(self):
        """The variables' present values in the model, projected to their bounds."""
        return self._model_values.read()['x0']

    def narrow(self):
        """Let branches, too, have the lower guide bounds."""
        self.lbx = self.guide_lbx

    def widen(self):
        """Undo ``narrow``; returns whether that makes a difference."""
        narrow, self.lbx = self.lbx, self._data.lbx
        return bool((narrow > self.lbx).any())

    @contextmanager
    def vanishing(self, variables):
        """Within the body, the least value of ``variables`` is 0, and the others have their own bounds."""
        kept, self.lbx = self.lbx, self._data.lbx.copy()
        self.lbx[variables] = 0.0
        try:
            yield
        finally:
            self.lbx = kept

    @property
    def nonzeros(self):
        """Number of entries of each Jacobian."""
        names = ('objective', 'constraints', 'G', 'H', 'decisions')
        return {name: pattern.nonzeros for name, pattern in zip(names, self._jacobian[1])}

    def evaluate(self, w) -> Evaluation:
        """f, g, G, H and eta at ``w``."""
        return self._evaluated(w, self.parameters)

    def _evaluate(self, w, parameters):
        f, *others = (_read_only(v.full().ravel()) for v in self._values(w, parameters))
        return Evaluation(float(f[0]), *others)

    def decided(self, w):
        """The residuals of the decisions' equations at ``w``."""
        return np.asarray(self._equal(w, self.parameters), dtype=float).ravel()

    def measured(self, w):
        """The gauges at ``w``."""
        return np.asarray(self._gauges(w, self.parameters), dtype=float).ravel()

    def gradients(self, w):
        """Gradient of f (array) and Jacobians of g, G, H and the decisions' equations (scipy csr) at ``w``."""
        return self._differentiated(w, self.parameters)

    def _gradients(self, w, parameters):
        function, patterns = self._jacobian
        grad, *jacobians = (pattern.with_numbers(v.full().ravel()) for pattern, v in zip(patterns, function(w, parameters)))
        return _read_only(grad.toarray().ravel()), *jacobians

    def violations(self, w, at=None):
        """How much each row (m) and each bound (n) is violated at ``w``."""
        at = at or self.evaluate(w)
        rows = np.maximum(np.maximum(self.lbg - at.g, at.g - self.ubg), 0.0)
        return rows, np.maximum(np.maximum(self.lbx - w, w - self.ubx), 0.0)

    def values(self, w):
        """The model's values of the variables."""
        return w / self.scale.x

    def objective(self, f):
        """The model's objective, in its own sense."""
        return self.sign * (f / self.scale.f + self.scale.offset)

    def minimised(self, objective):
        """f of the model's objective."""
        return (self.sign * objective - self.scale.offset) * self.scale.f

    def absolute(self, rows, bounds, sides):
        """Violations of rows (m) and bounds (n) and values of sides (2q) in the model's units."""
        return rows / self.scale.g, bounds / self.scale.x, sides / self.scale.sides


def _read_only(numbers):
    """An array that several callers may share."""
    numbers.flags.writeable = False
    return numbers


class _Pattern:
    """The entries of a casadi matrix in scipy's order."""

    def __init__(self, sparsity):
        numbers = np.arange(1.0, sparsity.nnz() + 1)
        matrix = sparse.csc_matrix((numbers, np.array(sparsity.row()), np.array(sparsity.colind())), shape=sparsity.shape).tocsr()
        self._order, self._matrix, self.nonzeros = matrix.data.astype(int) - 1, matrix, sparsity.nnz()

    def with_numbers(self, numbers):
        """csr with casadi's nonzeros ``numbers``."""
        return sparse.csr_matrix((numbers[self._order], self._matrix.indices, self._matrix.indptr), shape=self._matrix.shape)
