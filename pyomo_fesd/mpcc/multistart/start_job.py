"""Runs on one MPCC from many points, in this process or in a worker process.

Takes: the ``Setup`` of all starts.
Leaves: a ``Start`` and a ``Run`` for each point.

NLPs are built once in each process, and the problem is pickled once.
"""

import pickle
import time
from dataclasses import replace
from functools import cached_property, partial
from threading import Event, Lock
from uuid import uuid4

from pyomo.common.config import ConfigDict, ConfigValue
from pyomo.common.timing import HierarchicalTimer
from pyomo.contrib.solver.common.config import SolverConfig

from pyomo_fesd.core import FesdError
from pyomo_fesd.mpcc.algorithm import HybridSolver, Outcome, Setup, Start
from pyomo_fesd.mpcc.nlp import Deadline
from pyomo_fesd.mpcc.reporting import reporter
from pyomo_fesd.mpcc.subproblems import SolverCache

#: Problems that a worker process keeps, each with its NLPs.
KEPT = 2
#: Options that belong to this process or to all starts together; like Pyomo's options of every solver, a run does not read them.
NOT_SENT = ('starts', 'executor', 'callback', 'log_file', 'json_file')

#: The problems of a worker process, by token.
_received = {}
#: Threads run one after the other: they share the NLPs.
_turn = Lock()


def work(job, number, x0):
    """Run one start in a worker; any error except a FesdError comes back as a failed start, as it may not be picklable."""
    with _turn:
        if job.stopped.is_set():
            return None
        try:
            return job.solve(number, x0)
        except FesdError:
            raise
        except Exception as error:  # a start that fails, for whatever reason, must not lose the others
            return failed(number, error)


def failed(number, error):
    """(Start, None) of a start that ended in an error."""
    return Start(number, f'failed: {type(error).__name__}: {error}'), None


class Job:
    """The starts of one MPCC.

    Parameters
    ----------
    setup : Setup
        ``after`` is called with the number of the start, too; it stays in this process
    options : dict, optional
        those that a run reads; default: from ``setup``

    Attributes
    ----------
    stopped : Event
        no start begins any more; threads of this process see it, in other processes a cancelled future has the same effect
    """

    def __init__(self, setup, options=None):
        self._plain = options or _plain_options(setup.options)
        self._setup, self.deadline = setup, setup.deadline
        # random points do not name a branch, so only the model's values are a warm start
        self._options, self._cold = _config(self._plain), _config(self._plain | {'warm_start': False})
        self.stopped = Event()

    def solve(self, number, x0):
        """(Start, Run) from ``x0``; None after the deadline."""
        if self.deadline.expired():
            return None
        began, compiled = time.perf_counter(), self._setup.compiled
        compiled.x0 = x0
        options, after = self._cold if number else self._options, partial(self._setup.after, start=number)
        setup = replace(self._setup, options=options, show=lambda entry: None, after=after)
        # a further start is one for the model's own values
        run = HybridSolver(replace(setup, further_start=None) if number else setup).solve()
        run.steps = [replace(step, w=None) for step in run.steps]
        certified = run.point is not None and run.point.certificate.certified
        spent = run.counts.nlps, run.counts.iterations, time.perf_counter() - began
        return Start(number, run.outcome.value, certified, self._objective(run), *spent), run

    def _objective(self, run):
        if run.outcome is Outcome.UNBOUNDED:
            return run.steps[-1].f
        return None if run.point is None else self._setup.compiled.objective(run.point.f)

    def __reduce__(self):
        # an absolute time, as seconds left would not count those in a queue, and perf_counter differs between computers
        left = self.deadline.left()
        return _receive, (*self._parcel, None if left is None else time.time() + left)

    @cached_property
    def _parcel(self):
        """Token and pickled problem."""
        try:
            return uuid4().hex, pickle.dumps((self._setup.compiled, self._plain))
        except (pickle.PicklingError, AttributeError, TypeError) as error:  # raised for functions and open files
            raise FesdError(
                'executor',
                f"the problem and its options cannot be sent to another process: {error}",
                "leave out options that are functions or open files, or use executor=None",
            ) from error


def _plain_options(config):
    """The options that a run reads, as a dict."""
    common = (*SolverConfig(), *NOT_SENT)
    return {name: option for name, option in config.value().items() if name not in common}


def _config(plain):
    """A ConfigDict from such a dict."""
    options = ConfigDict()
    for name, option in plain.items():
        options.declare(name, ConfigDict(implicit=True)(option) if isinstance(option, dict) else ConfigValue(option))
    return options


def _receive(token, parcel, end):
    """The job in a worker; an earlier start of the same problem may have left it there with its NLPs."""
    job = _received.get(token) or _received.setdefault(token, _unpacked(parcel))
    for old in list(_received)[:-KEPT]:
        _received.pop(old, None)
    job.deadline.at = None if end is None else time.perf_counter() + end - time.time()
    return job


def _unpacked(parcel):
    compiled, options = pickle.loads(parcel)
    config, cache = _config(options), SolverCache(compiled)
    cache.prepare(config)
    silent = reporter(None, compiled, 0.0)
    return Job(Setup(compiled, config, HierarchicalTimer(), Deadline(), cache, lambda start: None, silent), options)
