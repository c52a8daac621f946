"""What a run of the hybrid algorithm is made of: tolerances, steps, starts, counts, points, and how it ended."""

from dataclasses import dataclass, field
from enum import Enum

import numpy as np


class Outcome(Enum):
    """How a run ended; the value is the sentence for the user."""

    CERTIFIED = "B-stationary point found and certified"
    SOLVED = "exactly complementary solution found; there is no objective to minimise"
    RELAXED = "relaxation solved down to the last eps; nothing is certified"
    FEASIBLE = "feasible, exactly complementary point found, not certified"
    INFEASIBLE = "no feasible point found: the problem is locally infeasible"
    UNBOUNDED = "the objective falls without bound along feasible points"
    TIME_LIMIT = "time limit reached"
    ITERATION_LIMIT = "iteration limit reached"
    INTERRUPTED = "interrupted"
    STOPPED = "stopped by the callback"


class Stop(Exception):
    """A limit was reached; carries the outcome."""

    def __init__(self, outcome):
        self.outcome = outcome


@dataclass(frozen=True)
class Tolerances:
    """Tolerances of the algorithm; see the options of ``mpec_hybrid`` for their meaning."""

    feasibility: float
    biactive: float
    descent: float
    eta: float
    radius: float

    @classmethod
    def of(cls, options):
        """Those among the options of ``mpec_hybrid``."""
        return cls(options.feasibility_tol, options.biactive_tol, options.descent_tol, options.eta_tol, options.trust_radius)


@dataclass(frozen=True)
class Step:
    """One line of the log: an NLP or LPEC with what came out of it; ``w`` is the point (order of ``Compiled.variables``)."""

    kind: str
    eps: float
    f: float
    violation: float
    complementarity: float
    biactive: int
    iterations: int
    status: str
    seconds: float
    w: np.ndarray = field(repr=False)


@dataclass(frozen=True)
class Start:
    """What became of one of several starts; ``pandas.DataFrame`` makes a table of a list of these.

    Attributes
    ----------
    start : int
        0 is the model's own values
    outcome : str
        a sentence; 'failed: ...' where the run was lost
    certified : bool
    objective : float or None
        in the model's own sense; None without a feasible point
    nlps, iterations : int
    seconds : float
    """

    start: int
    outcome: str
    certified: bool = False
    objective: float = None
    nlps: int = 0
    iterations: int = 0
    seconds: float = 0.0


@dataclass
class Counts:
    """Work done so far."""

    nlps: int = 0
    iterations: int = 0
    lpecs: int = 0
    binaries: int = 0


@dataclass
class Point:
    """An exactly complementary point: the solution of its branch NLP, with its certificate."""

    nlp: object
    f: float
    certificate: object
    equal: object = None

    @property
    def w(self):
        """Values of the variables."""
        return self.nlp.w


@dataclass
class Run:
    """Everything that a run leaves.

    Attributes
    ----------
    outcome : Outcome
    w : array or None
        the point to load: the incumbent, or the least infeasible one
    point : Point or None
    counts : Counts
    eps : float
        the last relaxation parameter
    steps : list of Step
    starts : list of Start
        where there were several; counts are those of all, everything else is the best one's
    """

    outcome: Outcome = None
    w: np.ndarray = None
    point: Point = None
    counts: Counts = field(default_factory=Counts)
    eps: float = None
    steps: list = field(default_factory=list)
    starts: list = field(default_factory=list)
