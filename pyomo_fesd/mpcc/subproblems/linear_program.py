"""Linear programs with binaries in HiGHS: equilibrated before, and the answer checked afterwards.

    min cost' d   s.t.  low <= A d <= high,  lower <= d <= upper,   the last ``binaries`` variables in {0, 1}

Takes: a program whose columns have a known reach.
Leaves: a point, the rows' multipliers where there are no binaries, and HiGHS' bound; None where HiGHS' own answer does not hold.
"""

import threading
from dataclasses import dataclass

import highspy
import numpy as np

#: HiGHS' own 1e-7 is too coarse.  With such tolerances its presolve calls some LPECs infeasible although d = 0 is feasible, and
#: d = 0 optimal in others that have descent, so it stays off.  The dual simplex method may cycle at such tolerances, at the optimum
#: already, where the primal one ends.
PRIMAL_SIMPLEX = {'presolve': 'off', 'tolerance': 1e-9, 'simplex_strategy': 4}
ATTEMPTS = (
    {'presolve': 'off', 'tolerance': 1e-9},
    PRIMAL_SIMPLEX,
    {'presolve': 'off', 'tolerance': 1e-8, 'solver': 'ipm'},
    {'presolve': 'off', 'tolerance': 1e-7},
)
#: Iterations of the simplex method without binaries before the next attempt, for each row and column; the last has no limit.
ITERATIONS = 3
TOLERANCES = ('primal_feasibility_tolerance', 'dual_feasibility_tolerance', 'mip_feasibility_tolerance')
#: The programs are small, and other threads of HiGHS would not exist in a forked process, which would wait for them.
THREADS = {'threads': 1}
#: The equilibrated cost has entries up to 1; the defaults (1e-6 and 1e-4) would call d = 0 optimal beside a small descent.
GAPS = {'mip_abs_gap': 1e-9, 'mip_rel_gap': 1e-6}
#: d = 0 is a first solution; to search for one takes most of the time of a small program, and so do smaller programs with binaries
#: that HiGHS solves at the root for a better one.
STARTED = {f'mip_heuristic_run_{name}': False for name in ('feasibility_jump', 'rins', 'rens', 'root_reduced_cost')}
LIMITED = (highspy.HighsModelStatus.kSolutionLimit, highspy.HighsModelStatus.kIterationLimit, highspy.HighsModelStatus.kTimeLimit)
#: A point of HiGHS may miss equilibrated rows by this, and its value the bound by this.
RESIDUAL, GAP = 1e-6, 1e-6
#: Smaller entries, in rows whose columns reach 1, are noise; HiGHS drops them too.
NOISE = 1e-9


@dataclass(frozen=True)
class Program:
    """min cost' d, low <= A d <= high, lower <= d <= upper; ``reach`` is the size of each column."""

    cost: np.ndarray
    A: object
    low: np.ndarray
    high: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    reach: np.ndarray
    binaries: int = 0

    def equilibrated(self):
        """The same program in d / reach, with rows and cost scaled to a largest entry of 1; and the factors of rows and cost."""
        with np.errstate(over='ignore', invalid='ignore'):
            A, cost = self.A.tocsc(copy=True), self.cost * self.reach
        A.data *= np.repeat(self.reach, np.diff(A.indptr))
        A.data[np.abs(A.data) < NOISE] = 0.0
        A.eliminate_zeros()
        largest = np.zeros(A.shape[0])
        # a gradient may have overflown: HiGHS refuses what is no number
        with np.errstate(invalid='ignore'):
            np.maximum.at(largest, A.indices, np.abs(A.data))
        rows, size = 1.0 / np.where(largest > 0, largest, 1.0), np.abs(cost).max(initial=0.0)
        A.data *= rows[A.indices]
        factor = 1.0 / size if size > 0 else 1.0
        bounds = self.low * rows, self.high * rows, self.lower / self.reach, self.upper / self.reach
        with np.errstate(invalid='ignore'):
            return Program(cost * factor, A, *bounds, np.ones(len(cost)), self.binaries), rows, factor


@dataclass(frozen=True)
class Answer:
    """A point, and the rows' multipliers (positive at lower bounds; None with binaries)."""

    d: np.ndarray
    y: object


def solve(program, options, deadline, start=None, limits=None):
    """The ``Answer`` of HiGHS, or None without one that holds.

    Parameters
    ----------
    program : Program
    options : dict
        of the user
    deadline : Deadline
    start : array, optional
    limits : dict, optional
        HiGHS options of a single attempt; when one of them ends the search, the best point so far is taken
    """
    p, rows, factor = program.equilibrated()
    limits = limits or {}
    for attempt in _attempts(p):
        highs = highs_of(p, settings_of(attempt, p.binaries, deadline, limits | options))
        if start is not None:
            guess = highspy.HighsSolution()
            guess.col_value = list(start / program.reach)
            highs.setSolution(guess)
        run(highs)
        answer = _answer(highs, p, bool(limits))
        if answer is not None:
            y = None if answer.y is None else answer.y * rows / factor
            return Answer(answer.d * program.reach, y)
        if limits:
            return None
    return None


class Silent(highspy.Highs):
    """HiGHS without output: 1.16 writes its licence, once in a process, as soon as it is given callbacks."""

    def enableCallbacks(self):
        """Begin without output; the constructor calls this."""
        self.setOptionValue('output_flag', False)
        super().enableCallbacks()


def highs_of(p, settings):
    """HiGHS with an equilibrated program and these settings."""
    highs = Silent()
    set_options(highs, settings)
    highs.passModel(_highs_model(p))
    return highs


def set_options(highs, settings):
    """Give HiGHS these options."""
    for name, option in settings.items():
        highs.setOptionValue(name, option)


def refusal(options: dict) -> str | None:
    """Return HiGHS' answer if it refuses one of these options, else None."""
    highs = Silent()
    try:
        refused = [name for name, option in options.items() if highs.setOptionValue(name, option) != highspy.HighsStatus.kOk]
    except TypeError as error:
        return str(error).splitlines()[0]
    return "unknown option or value" if refused else None


def infeasible(program) -> bool:
    """Whether HiGHS shows that a program has no point."""
    highs = Silent()
    highs.setOptionValue('threads', THREADS['threads'])
    highs.passModel(_highs_model(program.equilibrated()[0]))
    run(highs)
    return highs.getModelStatus() == highspy.HighsModelStatus.kInfeasible


def run(highs):
    """Run HiGHS, also where the last run in this thread, perhaps of another tool, had another number of threads.

    HiGHS refuses such a run with the same error as a start from which its simplex method cannot go on; the second run has none.
    """
    if highs.run() == highspy.HighsStatus.kError:
        # HiGHS keeps its scheduler for each thread.  A new thread has none; the one of this thread may come from before a fork,
        # with locks that nobody opens any more
        another = threading.Thread(target=highs.run)
        another.start()
        another.join()


def _answer(highs, p, limited):
    """HiGHS' answer to the equilibrated program; None where it did not end or does not hold."""
    status, solution = highs.getModelStatus(), highs.getSolution()
    stopped = limited and status in LIMITED and solution.value_valid
    if not (status == highspy.HighsModelStatus.kOptimal or stopped):
        return None
    d = np.array(solution.col_value)
    optimal = p.binaries and not stopped
    if not holds(p, d) or (optimal and not _bounded(highs, p.cost @ d)):
        return None
    y = np.array(solution.row_dual) if not p.binaries and solution.dual_valid else None
    return Answer(np.clip(d, p.lower, p.upper), y)


def holds(p, d):
    """Whether a point satisfies rows and bounds."""
    activity = p.A @ d
    misses = (p.low - activity, activity - p.high, p.lower - d, d - p.upper)
    return np.isfinite(d).all() and max(miss.max(initial=0.0) for miss in misses) <= RESIDUAL


def _bounded(highs, value):
    """Whether HiGHS has proved that nothing is much better than ``value``."""
    return highs.getInfo().mip_dual_bound >= value - GAP * max(1.0, abs(value))


def _attempts(p):
    """Tolerances and HiGHS options of each attempt."""
    if p.binaries:
        return [attempt for attempt in ATTEMPTS if attempt is not PRIMAL_SIMPLEX]
    limit = {'simplex_iteration_limit': ITERATIONS * sum(p.A.shape)}
    return [limit | attempt for attempt in ATTEMPTS[:-1]] + list(ATTEMPTS[-1:])


def settings_of(attempt, binaries, deadline, given):
    """HiGHS options of one attempt; those that are ``given`` override ours, except for the deadline."""
    settings = THREADS | {name: value for name, value in attempt.items() if name != 'tolerance'}
    if binaries:
        settings.pop('solver', None)
        settings |= GAPS | STARTED
    settings |= dict.fromkeys(TOLERANCES, attempt['tolerance']) | given
    if deadline.at is not None:
        settings['time_limit'] = min(settings.get('time_limit', np.inf), deadline.left())
    return settings


def _highs_model(p):
    """The program for HiGHS."""
    lp = highspy.HighsLp()
    lp.num_col_, lp.num_row_ = p.A.shape[1], p.A.shape[0]
    lp.col_cost_, lp.col_lower_, lp.col_upper_ = p.cost, p.lower, p.upper
    lp.row_lower_, lp.row_upper_ = p.low, p.high
    lp.a_matrix_.format_ = highspy.MatrixFormat.kColwise
    lp.a_matrix_.start_, lp.a_matrix_.index_, lp.a_matrix_.value_ = p.A.indptr, p.A.indices, p.A.data
    if p.binaries:
        kinds = [highspy.HighsVarType.kContinuous] * (p.A.shape[1] - p.binaries)
        lp.integrality_ = kinds + [highspy.HighsVarType.kInteger] * p.binaries
    return lp
