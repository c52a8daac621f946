"""One MPCC to be solved from many points, here or in a worker process.

Takes: a compiled MPCC with what is built for it, and the options.
Leaves: a ``Start`` and a ``Run`` for each point.

NLPs are built once in each process, and what is pickled is pickled once.
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

from pyomo_fesd.errors import FesdError
from pyomo_fesd.mpcc.built import Built
from pyomo_fesd.mpcc.deadline import Deadline
from pyomo_fesd.mpcc.hybrid import HybridSolver
from pyomo_fesd.mpcc.progress import reporter
from pyomo_fesd.mpcc.run import Outcome, Start

#: Problems that a worker process keeps, each with its NLPs.
KEPT = 2
#: Options that belong to this process or to all starts together; with those that Pyomo gives to every solver, no run reads them.
NOT_SENT = ('starts', 'executor', 'callback', 'log_file', 'json_file')

#: The problems of this process, by token, if it is a worker's.
_arrived = {}
#: Threads take turns: they share the NLPs, and each solve redirects ``sys.stderr`` of the whole process.
_turn = Lock()


def work(job, number, x0):
    """What a worker does; anything but a mistake of the user's comes back as a failed start, whether or not it can be pickled."""
    with _turn:
        if job.over.is_set():
            return None
        try:
            return job.solve(number, x0)
        except FesdError:
            raise
        except Exception as error:  # one lost start, whatever it was, must not lose the others
            return failed(number, error)


def failed(number, error):
    """(Start, None) of a start that was lost."""
    return Start(number, f'failed: {type(error).__name__}: {error}'), None


def plain_options(config):
    """What a run reads of the options, as a dict."""
    common = (*SolverConfig(), *NOT_SENT)
    return {name: option for name, option in config.value().items() if name not in common}


class Job:
    """What all starts of one MPCC share.

    Parameters
    ----------
    compiled : Compiled
    options : dict
        of ``plain_options``
    timer : HierarchicalTimer
    deadline : Deadline
    after : callable Run, int -> None
        called after every outer iteration with the number of the start; stays in this process
    built : Built
        prepared for these options

    Attributes
    ----------
    over : Event
        nothing begins any more; threads of this process see it, others are told by a cancelled future
    """

    def __init__(self, compiled, options, timer, deadline, after, built):
        self._compiled, self._plain, self.deadline = compiled, options, deadline
        self._timer, self._after, self._built = timer, after, built
        # random points name no branch, so only the model's values are a warm start
        self._options, self._cold = _config(options), _config(options | {'warm_start': False})
        self.over = Event()

    def solve(self, number, x0):
        """(Start, Run) from ``x0``; None if the time is up before it begins."""
        if self.deadline.expired():
            return None
        began = time.perf_counter()
        self._compiled.x0 = x0
        options, after = self._cold if number else self._options, partial(self._after, start=number)
        run = HybridSolver(self._compiled, options, self._timer, lambda step: None, self.deadline, after, self._built).solve()
        run.steps = [replace(step, w=None) for step in run.steps]
        certified = run.point is not None and run.point.certificate.certified
        spent = run.counts.nlps, run.counts.iterations, time.perf_counter() - began
        return Start(number, run.outcome.value, certified, self._objective(run), *spent), run

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
            return uuid4().hex, pickle.dumps((self._compiled, self._plain))
        except (pickle.PicklingError, AttributeError, TypeError) as error:  # what pickle says of functions and open files
            raise FesdError(
                'executor',
                f"the problem and its options cannot be sent to another process: {error}",
                "leave out options that are functions or open files, or use executor=None",
            ) from error


def _config(plain):
    """A ConfigDict from a dict: what a run reads options from."""
    options = ConfigDict()
    for name, option in plain.items():
        options.declare(name, ConfigDict(implicit=True)(option) if isinstance(option, dict) else ConfigValue(option))
    return options


def _arrive(token, parcel, end):
    """The job in a worker, where an earlier start of the same problem may have left it with its NLPs."""
    job = _arrived.get(token) or _arrived.setdefault(token, _unpacked(parcel))
    for old in list(_arrived)[:-KEPT]:
        _arrived.pop(old, None)
    job.deadline.at = None if end is None else time.perf_counter() + end - time.time()
    return job


def _unpacked(parcel):
    compiled, options = pickle.loads(parcel)
    built = Built(compiled)
    built.prepare(_config(options))
    return Job(compiled, options, HierarchicalTimer(), Deadline(), reporter(None, compiled, 0.0), built)
