"""Many starts: the best of several runs from different points, solved one by one here or by an executor.

Takes: a compiled MPCC and the options ``starts``, ``seed`` and ``executor``.
Leaves: the ``Run`` of the best start, with the work of all and a record of each.

A start is a function of the seed and its number (``start_points``), and a run one of its start, so neither the executor nor the
order has an influence on the answer; only what a limit cuts off depends on speed.
"""

import pickle
import time
from concurrent.futures import TimeoutError as FuturesTimeout
from concurrent.futures import as_completed
from dataclasses import dataclass, replace
from functools import cached_property
from threading import Event, Lock
from uuid import uuid4

import numpy as np
from pyomo.common.config import ConfigDict, ConfigValue
from pyomo.common.timing import HierarchicalTimer
from pyomo.contrib.solver.common.config import SolverConfig

from pyomo_fesd.errors import FesdError
from pyomo_fesd.mpcc.deadline import Deadline
from pyomo_fesd.mpcc.hybrid import HybridSolver
from pyomo_fesd.mpcc.run import Counts, Outcome, Run
from pyomo_fesd.mpcc.start_points import start_point

#: Objectives within this of the best one, relative, are as good: then the first start counts.
TIE = 1e-8
#: Seconds beyond the time limit in which the executor may deliver what its workers have stopped.
LATE = 10.0
#: Problems that a worker process keeps, each with its NLPs.
KEPT = 2
#: What is said of a start of which nothing came in this time.
NO_ANSWER = 'failed: no answer in time'
#: Outcomes after which no other start is needed or wanted.
ENDS = (Outcome.SOLVED, Outcome.INTERRUPTED)

#: The problems of this process, by token, if it is a worker's.
_arrived = {}
#: Threads take turns: they share the NLPs, and each solve redirects ``sys.stderr`` of the whole process.
_turn = Lock()


@dataclass(frozen=True)
class Start:
    """What became of one start; ``pandas.DataFrame`` makes a table of a list of these.

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


def executor_like(given):
    """Domain of the option ``executor``; raises ValueError for what cannot ``submit``."""
    if not callable(getattr(given, 'submit', None)):
        raise ValueError("not an executor: it has no method 'submit' as those of concurrent.futures have")
    return given


def solve_many(compiled, config, timer, show, deadline):
    """Solve from ``config.starts`` points.

    Parameters
    ----------
    compiled : Compiled
    config : ConfigDict
        of ``mpec_hybrid``
    timer : HierarchicalTimer
        its phases are those of runs in this process
    show : callable Start -> None
        called after each start
    deadline : Deadline
        of all starts together

    Returns
    -------
    Run
        of the best start: certified before uncertified, then the lower objective (a start that finds the problem unbounded counts
        as certified, with the objective where it stopped), then the lower number; ``counts`` are those of all

    Raises
    ------
    FesdError
        if every start failed, or for a mistake in the options that a worker finds
    """
    job, x0 = _Job(compiled, _own(config), deadline, timer), compiled.x0
    points = (start_point(compiled, x0, config.seed, number) for number in range(config.starts))
    ended, interrupted = [], False
    solved = _here(job, points) if config.executor is None else _elsewhere(job, config.executor, points)
    try:
        for record, run in solved:
            ended.append((record, run))
            show(record)
            if run is not None and run.outcome in ENDS:
                break
    except KeyboardInterrupt:
        interrupted = True
    finally:
        solved.close()
        compiled.x0 = x0
    return _combined(compiled, sorted(ended, key=lambda one: one[0].start), config.starts, interrupted)


def _own(config):
    """The options that a run reads, without what belongs to a process: streams, timer, executor."""
    common = SolverConfig()
    return _options({name: option for name, option in config.value().items() if name not in common and name != 'executor'})


def _options(plain):
    """A ConfigDict from a dict: what a run reads options from."""
    options = ConfigDict()
    for name, option in plain.items():
        options.declare(name, ConfigDict(implicit=True)(option) if isinstance(option, dict) else ConfigValue(option))
    return options


# where the runs take place


def _here(job, points):
    """(Start, Run) of each start that begins before the time is up."""
    for number, x0 in enumerate(points):
        one = job.solve(number, x0)
        if one is None:
            return
        yield one


def _elsewhere(job, executor, points):
    """As ``_here``, in the order in which they end; those that failed have no Run.  Closing it cancels what has not begun."""
    numbers, waiting = {}, {}
    try:
        for number, x0 in enumerate(points):
            try:
                future = executor.submit(_work, job, number, x0)
                numbers[future] = waiting[future] = number
            except RuntimeError as error:  # of a broken pool, too
                yield _failed(number, error)
        left = job.deadline.left()
        for future in as_completed(numbers, None if left is None else left + LATE):
            one = _delivered(future, waiting.pop(future))
            if one is not None:
                yield one
    except FuturesTimeout:
        yield from ((Start(number, NO_ANSWER), None) for number in waiting.values())
    except KeyboardInterrupt:
        # also while many starts are still being handed over: what has ended by now counts
        ended = [(future, number) for future, number in waiting.items() if future.done() and not _lost(future)]
        yield from filter(None, (_delivered(future, number) for future, number in ended))
        raise
    finally:
        job.over.set()
        for future in numbers:
            future.cancel()


def _lost(future):
    """Whether nothing comes of a future that is done: cancelled, or interrupted itself."""
    return future.cancelled() or isinstance(future.exception(), KeyboardInterrupt)


def _delivered(future, number):
    """(Start, Run) of a future that is done; None if its start did not begin."""
    try:
        return future.result()
    except FesdError:
        raise
    except Exception as error:
        return _failed(number, error)


def _failed(number, error):
    return Start(number, f'failed: {type(error).__name__}: {error}'), None


def _work(job, number, x0):
    """What a worker does; anything but a mistake of the user's comes back as a failed start, whether or not it can be pickled."""
    with _turn:
        if job.over.is_set():
            return None
        try:
            return job.solve(number, x0)
        except FesdError:
            raise
        except Exception as error:
            return _failed(number, error)


class _Job:
    """One MPCC to be solved from many points: NLPs are built once in each process, and what is pickled is pickled once.

    Parameters
    ----------
    compiled : Compiled
    options : ConfigDict
    deadline : Deadline
    timer : HierarchicalTimer
    """

    def __init__(self, compiled, options, deadline, timer):
        self._compiled, self._options, self.deadline, self._timer = compiled, options, deadline, timer
        # nothing begins any more; threads of this process see it, others are told by a cancelled future
        self.over = Event()
        self._built = {}

    def solve(self, number, x0):
        """(Start, Run) from ``x0``; None if the time is up before it begins."""
        if self.deadline.expired():
            return None
        began = time.perf_counter()
        self._compiled.x0 = x0
        run = HybridSolver(self._compiled, self._options, self._timer, lambda step: None, self.deadline, self._built).solve()
        run.steps = [replace(step, w=None) for step in run.steps]
        certified = run.point is not None and run.point.certificate.certified
        work = run.counts.nlps, run.counts.iterations, time.perf_counter() - began
        return Start(number, run.outcome.value, certified, self._objective(run), *work), run

    def _objective(self, run):
        if run.outcome is Outcome.UNBOUNDED:
            return run.steps[-1].f
        return None if run.point is None else self._compiled.objective(run.point.f)

    def __reduce__(self):
        # seconds left would not count those in a queue, and perf_counter means nothing to another computer
        left = self.deadline.left()
        return _arrive, (*self._parcel, None if left is None else time.time() + left)

    @cached_property
    def _parcel(self):
        """Token and pickled problem."""
        try:
            return uuid4().hex, pickle.dumps((self._compiled, self._options.value()))
        except Exception as error:
            raise FesdError(
                'executor',
                f"the problem and its options cannot be sent to another process: {error}",
                "leave out options that are functions or open files, or use executor=None",
            ) from error


def _arrive(token, parcel, end):
    """The job in a worker, where an earlier start of the same problem may have left it with its NLPs."""
    job = _arrived.get(token)
    if job is None:
        compiled, options = pickle.loads(parcel)
        job = _arrived.setdefault(token, _Job(compiled, _options(options), Deadline(), HierarchicalTimer()))
        for old in list(_arrived)[:-KEPT]:
            _arrived.pop(old, None)
    job.deadline.at = None if end is None else time.perf_counter() + end - time.time()
    return job


# what they come to


def _combined(c, ended, wanted, interrupted):
    """One ``Run`` from all."""
    runs = [one for one in ended if one[1] is not None]
    if ended and not runs and not interrupted:
        raise FesdError('starts', f"every start failed, the first with: {ended[0][0].outcome}", "see whether executor=None works")
    outcomes = {run.outcome for _, run in runs}
    best = _best(c, runs) if runs else Run()
    best.counts = _summed([run.counts for _, run in runs])
    best.starts = [record for record, _ in ended]
    if interrupted or Outcome.INTERRUPTED in outcomes:
        best.outcome = Outcome.INTERRUPTED
    elif best.outcome is not Outcome.SOLVED and (Outcome.TIME_LIMIT in outcomes or _answers(ended) < wanted):
        best.outcome = Outcome.TIME_LIMIT
    return best


def _answers(ended):
    """Number of starts that the time limit did not cut off."""
    return sum(record.outcome != NO_ANSWER for record, _ in ended)


def _best(c, runs):
    ranks = [_rank(c, record, run) for record, run in runs]
    first, least = min(ranks)
    enough = least + TIE * max(1.0, abs(least)) if np.isfinite(least) else least
    return next(run for (_, run), (kind, amount) in zip(runs, ranks) if kind == first and amount <= enough)


def _rank(c, record, run):
    """(kind, amount), the less the better: certified or unbounded by objective, feasible by objective, others by violation."""
    if record.objective is not None:
        kind = 0 if record.certified or run.outcome is Outcome.UNBOUNDED else 1
        return kind, c.sign * record.objective
    if run.w is None:
        return 2, np.inf
    at = c.evaluate(run.w)
    parts = (*c.violations(run.w, at), np.abs(np.minimum(at.G, at.H)))
    return 2, max(part.max(initial=0.0) for part in parts)


def _summed(counts):
    """``Counts`` of all runs."""
    total = {name: sum(getattr(count, name) for count in counts) for name in ('nlps', 'iterations', 'lpecs')}
    return Counts(**total, binaries=max((count.binaries for count in counts), default=0))
