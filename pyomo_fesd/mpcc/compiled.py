"""The MPCC as numbers and functions: what relaxations, branches and the LPEC are formed from.

Everything here is in the solver's own scaling (see ``scaling``); ``values``, ``objective`` and ``absolute`` lead back to that of
the model.
A ``Compiled`` can be pickled and sent to another process: the casadi graph goes along, the Pyomo components do not.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property

import casadi as ca
import numpy as np
from scipy import sparse

from pyomo_fesd.mpcc.derivatives import ModelDerivatives


@dataclass(frozen=True)
class Evaluation:
    """Values at one point w (numpy vectors; see ``Compiled``)."""

    f: float
    g: np.ndarray
    G: np.ndarray
    H: np.ndarray
    eta: np.ndarray


@dataclass
class Numbers:
    """The bounds, start and facts of an MPCC besides its functions.

    Attributes
    ----------
    lbx, ubx : arrays (n), the variables' bounds with the signs that plain-variable sides imply
    lbg, ubg : arrays (m)
    side_of : int array (2q), equal numbers for equal sides among G (first q) and H
    artificial : bool array (n), variables whose bounds belong to the method
    guide_lbx, guide_ubx : arrays (n), bounds in the homotopy: those of such variables are tighter there
    x0 : array (n), the model's values projected to the bounds
    parameters : array (l), values of the parameters that a new solve may change
    missing : int, number of variables without a value
    sign : +1.0, or -1.0 for a model that maximises (f is always minimised)
    has_objective : bool
    scale : Scale
    moves : list of Move
    tentative : bool array, decisions that are dropped where they leave no solution
    """

    lbx: np.ndarray
    ubx: np.ndarray
    lbg: np.ndarray
    ubg: np.ndarray
    side_of: np.ndarray
    artificial: np.ndarray
    guide_lbx: np.ndarray
    guide_ubx: np.ndarray
    x0: np.ndarray
    parameters: np.ndarray
    missing: int
    sign: float
    has_objective: bool
    scale: object
    moves: list = field(default_factory=list)
    tentative: np.ndarray = None


@dataclass(frozen=True)
class Move:
    """A branch next to a solution that no small step reaches: some pairs take over the zero sides of others.

    Attributes
    ----------
    targets, sources : int arrays
        pairs
    ended : int array
        pairs whose first side becomes zero
    short : int array
        variables; unless one of them is at its lower bound the move is not worth a look (none: always)
    starts : int array
        variables that start elsewhere
    at : array
        where
    """

    targets: np.ndarray
    sources: np.ndarray
    ended: np.ndarray
    short: np.ndarray
    starts: np.ndarray
    at: np.ndarray


class Compiled:
    """A compiled MPCC; attributes of ``Numbers`` are attributes here too.

    Parameters
    ----------
    x, p : SX, symbols of the variables w (n) and of the parameters (l)
    outputs : list of SX, in terms of these: f, penalty, g (m), G, H (q), eta, equal (one each decision)
    numbers : Numbers
    variables : list of VarData, length n
    constraints : list of ConstraintData, length m (rows of g)
    conditions : list of Condition, length q
    decisions : list of Decision
    source : Source
        where those numbers come from that a new solve reads again

    Attributes
    ----------
    x : SX (n);  p : SX (l);  f, penalty : SX scalars;  g : SX (m);  G, H : SX (q);  eta, equal : SX (one each decision)
    """

    NAMES = ('f', 'penalty', 'g', 'G', 'H', 'eta', 'equal')

    def __init__(self, x, p, outputs, numbers, variables=(), constraints=(), conditions=(), decisions=(), source=None):
        self._numbers = numbers
        self.__dict__.update(vars(numbers))
        self.variables, self.constraints, self.conditions, self.decisions = variables, constraints, conditions, decisions
        self._source = source
        self.x, self.p = x, p
        for name, expression in zip(self.NAMES, outputs):
            setattr(self, name, expression)
        self._values = ca.Function('values', [self.x, self.p], [self.f, self.g, self.G, self.H, self.eta])

    @cached_property
    def derivatives(self):
        """Derivatives of all functions, found when they are first needed."""
        return ModelDerivatives(self)

    @cached_property
    def _gradients(self):
        return ca.Function('gradients', [self.x, self.p], [self.derivatives.f, *self.derivatives.parts])

    def __getstate__(self):
        # casadi pickles functions, not expressions
        outputs = [getattr(self, name) for name in self.NAMES]
        return ca.Function('mpcc', [self.x, self.p], outputs), self._numbers

    def __setstate__(self, state):
        graph, numbers = state
        x, p = ca.SX.sym('w', graph.size1_in(0)), ca.SX.sym('p', graph.size1_in(1))
        self.__init__(x, p, graph(x, p), numbers)

    def refresh(self):
        """Read bounds, start and parameters from the model again; see ``Source.read``."""
        self._numbers = replace(self._numbers, **self._source.read())
        self.__dict__.update(vars(self._numbers))

    def narrow(self):
        """Where bounds belong to the method, a branch has the lower ones of the homotopy, too."""
        self.lbx = self.guide_lbx

    def widen(self):
        """Undo ``narrow``; returns whether that makes a difference."""
        narrow, self.lbx = self.lbx, self._numbers.lbx
        return bool((narrow > self.lbx).any())

    @property
    def nonzeros(self):
        """Entries of the Jacobians, by what they belong to."""
        names = ('objective', 'constraints', 'G', 'H', 'decisions')
        return {name: self._gradients.sparsity_out(i).nnz() for i, name in enumerate(names)}

    def evaluate(self, w):
        """f, g, G, H and eta at ``w``."""
        f, g, G, H, eta = (np.asarray(v, dtype=float).ravel() for v in self._values(w, self.parameters))
        return Evaluation(float(f[0]), g, G, H, eta)

    def gradients(self, w):
        """Gradient of f (array) and Jacobians of g, G, H and the decisions' equations (scipy csr) at ``w``."""
        grad, *jacobians = self._gradients(w, self.parameters)
        return np.asarray(grad, dtype=float).ravel(), *(csr(J) for J in jacobians)

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
        return self.sign * f / self.scale.f

    def absolute(self, rows, bounds, sides):
        """Violations of rows (m) and bounds (n) and values of sides (2q) in the model's units."""
        return rows / self.scale.g, bounds / self.scale.x, sides / self.scale.sides


def csr(J):
    """casadi DM to scipy csr."""
    colptr, row = np.array(J.sparsity().colind()), np.array(J.sparsity().row())
    data = np.array(J.nonzeros(), dtype=float)
    return sparse.csc_matrix((data, row, colptr), shape=J.shape).tocsr()


def csr_pattern(J):
    """Ones where casadi's J has entries, as scipy csr."""
    return csr(ca.DM(J.sparsity(), 1.0))
