"""Random switching systems, as data, and the Pyomo model of each.

    dx/dt = A x + b + a sin(w t) + sum_j F_j(x),      c_j(x) = w_j' x + q_j x_1^2

Part j has levels l_1 < ... < l_K of c_j and K + 1 modes; mode k holds between l_k and l_(k+1) and adds the rates g_k + G_k x.
A part with hysteresis has two modes, whose regions overlap.  A state jump reverses one rate where its guard falls to zero.
"""

from dataclasses import dataclass, field

import numpy as np
import pyomo.dae as dae
import pyomo.environ as pyo
from pyomo.gdp import Disjunction

import pyomo_fesd


@dataclass(frozen=True)
class Part:
    """Modes by the levels of one switching function.

    Attributes
    ----------
    weights : array (n)
    curvature : float
        q_j
    levels : tuple
        rising; of a part with hysteresis the lower and the upper level of the overlap
    rates : array (K + 1, n)
        g_k, from below the first level to above the last
    gains : array (K + 1, n, n)
        G_k
    first : int or None
        the mode at time 0 of a part with hysteresis; None: a part without hysteresis
    """

    weights: np.ndarray
    curvature: float
    levels: tuple
    rates: np.ndarray
    gains: np.ndarray
    first: int = None

    @property
    def hysteresis(self):
        """Whether modes go on beyond the end of their neighbour's region."""
        return self.first is not None

    def c(self, x):
        """Return the switching function; x holds numbers or Pyomo expressions."""
        return sum(w * v for w, v in zip(self.weights, x) if w) + self.curvature * x[0] ** 2

    def gradient(self, x):
        """Return its gradient at an array x."""
        return self.weights + np.eye(len(x))[0] * (2 * self.curvature * x[0])

    def rate(self, k, x):
        """Return the rates of mode k; x holds numbers or Pyomo expressions."""
        return [g + sum(G * v for G, v in zip(row, x) if G) for g, row in zip(self.rates[k], self.gains[k])]


@dataclass(frozen=True)
class Impact:
    """The state ``position`` stays above zero; where it reaches zero, ``velocity`` v jumps to -e v."""

    position: int
    velocity: int
    e: float


@dataclass(frozen=True)
class RandomSystem:
    """A system, its grid and its units.

    Attributes
    ----------
    kind : str
    seed : int
    A, b, x0 : arrays
    amplitude : array (n), with the angular ``frequency``
    end : float
    parts : list of Part
    impact : Impact or None
    time_unit, state_unit : float
        the model's time and states are those of the data, times these
    nfe : int
    """

    kind: str
    seed: int
    A: np.ndarray
    b: np.ndarray
    x0: np.ndarray
    end: float
    parts: list = field(default_factory=list)
    impact: Impact = None
    amplitude: np.ndarray = None
    frequency: float = 0.0
    time_unit: float = 1.0
    state_unit: float = 1.0
    nfe: int = 12


def model(system):
    """Return the Pyomo model, in the units of the system."""
    m = pyo.ConcreteModel()
    T, X = system.time_unit, system.state_unit
    m.t = dae.ContinuousSet(bounds=(0, system.end * T))
    m.i = pyo.RangeSet(0, len(system.x0) - 1)
    m.x = pyo.Var(m.t, m.i, initialize=lambda m, t, i: system.x0[i] * X)
    m.dx = dae.DerivativeVar(m.x, wrt=m.t)
    for i in m.i:
        m.x[0, i].fix(system.x0[i] * X)
    m.j = pyo.RangeSet(0, len(system.parts) - 1)
    m.F = pyo.Var(m.t, m.j, m.i, initialize=0)
    tau = _time(m, system)

    @m.Constraint(m.t, m.i)
    def ode(m, t, i):
        smooth = sum(a * m.x[t, k] / X for k, a in enumerate(system.A[i]) if a) + system.b[i] + tau(t, i)
        return m.dx[t, i] == (smooth + sum(m.F[t, j, i] for j in m.j)) * (X / T)

    for j, part in enumerate(system.parts):
        m.add_component(f'part{j}', Disjunction(m.t, rule=lambda m, t, j=j, part=part: _modes(m, t, j, part, X)))
        if part.hysteresis:
            m.component(f'part{j}')[0].disjuncts[part.first].indicator_var.fix(True)
    if system.impact:
        q, v, e = system.impact.position, system.impact.velocity, system.impact.e
        m.impact = pyomo_fesd.state_jump(m.t, guard=lambda m, t: m.x[t, q], reset=lambda m, t: [(m.x[t, v], -e * m.x[t, v])])
    return m


def _time(m, system):
    """Return a function (t, i) -> forcing of state i, on physical time."""
    if not system.frequency:
        return lambda t, i: 0.0
    tau = pyomo_fesd.clock(m, m.t)
    factor = system.frequency / system.time_unit
    return lambda t, i: system.amplitude[i] * pyo.sin(factor * tau[t]) if system.amplitude[i] else 0.0


def _modes(m, t, j, part, X):
    """Return the disjuncts of one part: region and rates."""
    x = [m.x[t, i] / X for i in m.i]
    c = part.c(x)
    for k in range(len(part.rates)):
        rates = [m.F[t, j, i] == rate for i, rate in zip(m.i, part.rate(k, x))]
        yield _region(part, k, c * X, X) + rates


def _region(part, k, c, X):
    if part.hysteresis:
        low, high = part.levels
        return [c <= high * X] if k == 0 else [c >= low * X]
    lower = [c >= part.levels[k - 1] * X] if k > 0 else []
    return lower + ([c <= part.levels[k] * X] if k < len(part.levels) else [])


def to_complementarity(m, system):
    """Apply ``fesd.dcs``."""
    held = [m.component(f'part{j}') for j, part in enumerate(system.parts) if part.hysteresis]
    pyo.TransformationFactory('fesd.dcs').apply_to(m, **({'hysteresis': held} if held else {}))
    return m


def transform(m, system, **options):
    """Apply ``fesd.dcs`` and ``fesd.finite_elements``."""
    to_complementarity(m, system)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, wrt=m.t, nfe=system.nfe, ncp=3, **options)
    return m


def end_state(m, system):
    """Return the states at the end, in the units of the data."""
    return np.array([m.x[m.t.last(), i].value for i in m.i], dtype=float) / system.state_unit
