"""The records of a run of the hybrid algorithm: its setup, tolerances, log, starts, counts, points, and outcome."""

from dataclasses import dataclass, field
from enum import Enum
from typing import Callable, Optional

import numpy as np


class Outcome(Enum):
    """How a run ended; the value is the sentence for the user."""

    CERTIFIED = "B-stationary point found and certified"
    SOLVED = "exactly complementary solution found; there is no objective to minimise"
    RELAXED = "relaxation solved down to the last eps; nothing is certified"
    FEASIBLE = "feasible, exactly complementary point found, not certified"
    NO_BRANCH = "the branch of the start values has no feasible point; no other was looked for (warm_start='only')"
    INFEASIBLE = "no feasible point found: the problem is locally infeasible"
    UNBOUNDED = "the objective falls without bound along feasible points"
    TIME_LIMIT = "time limit reached"
    ITERATION_LIMIT = "iteration limit reached"
    INTERRUPTED = "interrupted"
    STOPPED = "stopped by the callback"


class Stop(Exception):
    """A limit was reached; ``outcome`` names it."""

    def __init__(self, outcome):
        self.outcome = outcome


@dataclass(frozen=True)
class Setup:
    """Everything that a run is given.

    Attributes
    ----------
    compiled : MpccFunctions
    options : ConfigDict
        of ``mpec_hybrid``
    timer : HierarchicalTimer
    deadline : Deadline
    cache : SolverCache
        prepared for these options; shared with other runs on the same compiled MPCC and deadline
    show : callable
        called with the LogEntry of each NLP and LPEC, or with the Start of each of several starts
    after : callable
        called with the Run after every outer iteration; may raise Stop
    further_start : callable or None
        returns another start (array), or None, and a note for the log; called once where the homotopy finds no feasible point
    complete : callable or None
        takes a point (array) and the seconds that it may take; returns a point with the same values of the free variables, at which
        all other variables solve equations and pairs, whether that was possible for all of them, and a note for the log
    draw : callable or None
        takes the number of a start, from 1; returns a random point (array), instead of ``start_point``
    even : callable or None
        takes a point (array); returns one close to the same solution in a branch in which variables with guide bounds are nearly
        equal, or None
    """

    compiled: object
    options: object
    timer: object
    deadline: object
    cache: object
    show: Callable
    after: Callable
    further_start: Optional[Callable] = None
    complete: Optional[Callable] = None
    draw: Optional[Callable] = None
    even: Optional[Callable] = None


@dataclass(frozen=True)
class Tolerances:
    """Tolerances of the algorithm; see the options of ``mpec_hybrid`` for their meaning."""

    feasibility: float
    biactive: float
    descent: float
    eta: float
    radius: float

    @classmethod
    def of(cls, options) -> 'Tolerances':
        """Those among the options of ``mpec_hybrid``."""
        return cls(options.feasibility_tol, options.biactive_tol, options.descent_tol, options.eta_tol, options.trust_radius)


@dataclass(frozen=True)
class LogEntry:
    """One line of the log: an NLP or LPEC and its result; ``w`` is the point (order of ``MpccFunctions.variables``)."""

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
    """The result of one of several starts; ``pandas.DataFrame`` makes a table of a list of these.

    Attributes
    ----------
    start : int
        0 is the model's own values
    outcome : str
        a sentence; 'failed: ...' for a run that ended in an error
    certified : bool
    objective : float or None
        in the model's own sense; None without a feasible point
    nlps, iterations : int
    seconds : float
    """

    start: int
    outcome: str
    certified: bool = False
    objective: Optional[float] = None
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
    """An exactly complementary point: the NlpResult of its branch with Certificate and the decisions in force.

    ``f`` is its objective, and what that owes to rows that hold to the tolerances only.  ``reach`` is the radius of the trust
    region within which it was found, None without one.
    """

    nlp: object
    f: float
    certificate: object
    equal: object = None
    reach: Optional[float] = None

    @property
    def w(self) -> np.ndarray:
        """Values of the variables."""
        return self.nlp.w

    def less(self, part: float) -> float:
        """Return the objective less a part of it, relative above 1."""
        return self.f - part * max(1.0, abs(self.f))


@dataclass
class Run:
    """The results of a run.

    Attributes
    ----------
    outcome : Outcome
    w : array or None
        the point to load: the incumbent, or the least infeasible one
    complementary : array or None
        without an incumbent, the best point of a relaxation at which rows and pairs hold
    point : Point or None
        the incumbent
    lowest : Point or None
        the point of the least objective, which a certified incumbent may have replaced
    counts : Counts
    eps : float
        the last relaxation parameter
    steps : list of LogEntry
    starts : list of Start
        if there were several; counts are those of all, everything else is the best one's
    refused : str
        why the start values are no solution, where there is no objective
    """

    outcome: Optional[Outcome] = None
    w: Optional[np.ndarray] = None
    complementary: Optional[np.ndarray] = None
    point: Optional[Point] = None
    lowest: Optional[Point] = None
    counts: Counts = field(default_factory=Counts)
    eps: Optional[float] = None
    steps: list = field(default_factory=list)
    starts: list = field(default_factory=list)
    refused: str = ''
