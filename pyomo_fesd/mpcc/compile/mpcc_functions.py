"""The MPCC as data and functions, from which relaxations, branches and the LPEC are formed.

Everything here is in the solver's own scaling (see ``scaling``); ``values``, ``objective`` and ``absolute`` convert to the units of
the model.  ``MpccFunctions`` can be pickled and sent to another process: with the casadi graph, without the Pyomo components.
"""

from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np

from pyomo_fesd.mpcc.compile.casadi_matrices import between, csr
from pyomo_fesd.mpcc.compile.derivatives import ModelDerivatives
from pyomo_fesd.mpcc.compile.last_points import LastPoints
from pyomo_fesd.mpcc.compile.numeric_function import NumericFunction
from pyomo_fesd.mpcc.compile.sparse_entries import with_entries
from pyomo_fesd.mpcc.compile.stacked_jacobian import StackedJacobian


@dataclass(frozen=True)
class Evaluation:
    """Values at one point w (numpy vectors; see ``MpccFunctions``)."""

    f: float
    g: np.ndarray
    G: np.ndarray
    H: np.ndarray
    eta: np.ndarray


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

    @cached_property
    def derivatives(self) -> ModelDerivatives:
        """The functions and their derivatives, to compose NLPs of."""
        return ModelDerivatives(self._functions, len(self.x0), len(self.parameters), len(self.lbg), self.inner)

    @cached_property
    def jacobian(self) -> ca.SX:
        """The Jacobian of g, G, H and equal, one upon another, of a short model."""
        return ca.jacobian(ca.vertcat(self.g, self.G, self.H, self.equal), self.x)

    @cached_property
    def _values(self):
        outputs = [self.f, self.g, self.G, self.H, self.eta]
        return NumericFunction(ca.Function('values', [self.x, self.p], [ca.densify(output) for output in outputs]))

    @cached_property
    def _equal(self):
        return NumericFunction(ca.Function('equal', [self.x, self.p], [ca.densify(self.equal)]))

    @cached_property
    def _gauges(self):
        return NumericFunction(ca.Function('gauges', [self.x, self.p], [ca.densify(self.gauges)]))

    @cached_property
    def _jacobian(self):
        """Function of the gradient of f and of the nonzeros of all rows' Jacobian, and the matrix that they belong to."""
        at, q = (self.x, self.p), self.pairs
        if self.short:
            slopes = ca.jacobian(self.f, self.x)
            blocks = [self.jacobian]
        else:
            of_cost, *blocks = self.derivatives.slopes(*at)
            slopes = of_cost[0, :]
        pattern = StackedJacobian([J.sparsity() for J in blocks], [len(self.lbg), q, q, self.inner - 2 * q])
        numbers = ca.vertcat(self.kind(0, 1), *(ca.vec(J.nz[:]) for J in blocks))
        function = ca.Function('jacobian', list(at), [ca.densify(slopes), ca.densify(numbers)])
        return NumericFunction(function), pattern, slopes.nnz()

    @cached_property
    def _curvature(self):
        """Function of the nonzeros of the Lagrangian's Hessian in its upper triangle, their order in all of it, and its pattern."""
        m, factors = len(self.lbg), self.kind.sym('factors', 1 + len(self.lbg) + self.inner)
        weight, of_rows = factors[0], between(factors, 1, factors.numel())
        if self.short:
            rows = ca.vertcat(self.g, self.G, self.H, self.equal)
            cost = self.f + weight * self.penalty
            upper = ca.triu(ca.hessian(cost + ca.dot(of_rows, rows) if rows.numel() else cost, self.x)[0])
        else:
            of_g, of_z = between(of_rows, 0, m), between(of_rows, m, m + self.inner)
            upper = self.derivatives.hessian(self.x, self.p, ca.vertcat(self.kind(1), weight), of_g, of_z)
        function = ca.Function('curvature', [self.x, self.p, factors], [ca.densify(upper.nz[:])])
        order = ca.DM(upper.sparsity(), list(range(1, upper.nnz() + 1)))
        pattern = csr(ca.tril2symm(order.T))
        return NumericFunction(function), pattern.data.astype(int) - 1, pattern

    @cached_property
    def only_in_rows(self) -> np.ndarray:
        """Mask over the variables that are in neither objective nor penalty, and linear in all rows and sides."""
        used = np.diff(self._curvature[2].indptr)
        used[ca.jacobian_sparsity(ca.vertcat(self.f, self.penalty), self.x).get_col()] += 1
        return used == 0

    @property
    def has_penalty(self) -> bool:
        """Whether there are penalty terms."""
        cost = self._functions.cost.functions
        return bool(cost.linear[1].nnz or cost.constants[1] or any((k.rows == 1).any() for k in cost.classes))

    @property
    def short(self) -> bool:
        """Whether the functions are so short that casadi differentiates them in no time."""
        return self._functions.short

    @property
    def linear(self) -> bool:
        """Whether all rows and sides are linear."""
        return not (self._functions.rows.functions.nonlinear.any() or self.nonlinear_sides.any())

    @property
    def nonlinear_sides(self) -> np.ndarray:
        """Mask over the sides (2q) that are not linear."""
        return self._functions.sides.functions.nonlinear[: 2 * self.pairs]

    @cached_property
    def single_rows(self) -> tuple[np.ndarray, np.ndarray]:
        """The linear equations that contain one variable only, and these variables."""
        linear = ~self._functions.rows.functions.nonlinear[: len(self.lbg)]
        rows = self.gradients(self.x0)[1]
        single = np.flatnonzero(linear & (self.lbg == self.ubg) & (np.diff(rows.indptr) == 1))
        columns = rows.indices[rows.indptr[single]]
        has_slope = rows.data[rows.indptr[single]] != 0.0
        return single[has_slope], columns[has_slope]

    def parameter_terms(self, w) -> np.ndarray:
        """Return the sizes of the terms of parameters in g and in the sides at ``w``."""
        if not self.p.numel():
            return np.zeros(len(self.lbg) + 2 * self.pairs)
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
        _, pattern, of_objective = self._jacobian
        return dict(zip(('objective', 'constraints', 'G', 'H', 'decisions'), (of_objective, *pattern.nonzeros)))

    def evaluate(self, w) -> Evaluation:
        """f, g, G, H and eta at ``w``."""
        return self._evaluated(w, self.parameters)

    def _evaluate(self, w, parameters):
        f, *others = (_read_only(numbers) for numbers in self._values(w, parameters))
        return Evaluation(float(f[0]), *others)

    def decided(self, w):
        """The residuals of the decisions' equations at ``w``."""
        return self._equal(w, self.parameters)[0]

    def measured(self, w):
        """The gauges at ``w``."""
        return self._gauges(w, self.parameters)[0]

    def gradients(self, w):
        """Gradient of f (array) and Jacobians of g, G, H and the decisions' equations (scipy csr) at ``w``."""
        return self._differentiated(w, self.parameters)[1:]

    def stacked_jacobian(self, w):
        """The Jacobian of g, G, H and the decisions' equations, one upon another (scipy csr), at ``w``."""
        return self._differentiated(w, self.parameters)[0]

    def hessian(self, w, factors):
        """The Hessian (scipy csr) at ``w`` of f plus the penalty, g, G, H and the decisions' equations times ``factors``."""
        function, order, pattern = self._curvature
        return with_entries(pattern, function(w, self.parameters, factors)[0][order])

    def _gradients(self, w, parameters):
        function, pattern, _ = self._jacobian
        slopes, numbers = function(w, parameters)
        stacked, *parts = pattern.at(numbers)
        return stacked, _read_only(slopes), *parts

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
