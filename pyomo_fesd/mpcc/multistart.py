"""Many starts: the best of several runs from different points, solved one by one here or by an executor.

Takes: a compiled MPCC and the options ``starts``, ``seed`` and ``executor``.
Leaves: one ``Run``: that of the best start, with the work of all and a record of each.

A start is a function of the seed and its number (``start_points``), and a run one of its start, so neither the executor nor the
order has an influence on the answer; only what a limit cuts off depends on speed.
"""

from concurrent.futures import TimeoutError as FuturesTimeout
from concurrent.futures import as_completed

from pyomo_fesd.errors import FesdError
from pyomo_fesd.mpcc.best_start import NO_ANSWER, combine
from pyomo_fesd.mpcc.run import Outcome, Run, Start
from pyomo_fesd.mpcc.start_job import Job, failed, plain_options, work
from pyomo_fesd.mpcc.start_points import start_point

#: Seconds beyond the time limit in which the executor may deliver what its workers have stopped.
LATE = 10.0
#: Outcomes after which no other start is needed or wanted.
ENDS = (Outcome.SOLVED, Outcome.INTERRUPTED, Outcome.STOPPED)


class Multistart:
    """Runs the algorithm from ``options.starts`` points; used as ``HybridSolver``.

    Parameters
    ----------
    compiled : Compiled
    options : ConfigDict
        of ``mpec_hybrid``
    timer : HierarchicalTimer
        its phases are those of runs in this process
    show : callable Start -> None
        called after each start
    deadline : Deadline
        of all starts together
    after : callable Run, int -> None
        called after every outer iteration with the number of the start, unless an executor has it
    built : Built
        prepared for these options; shared by all starts in this process

    Attributes
    ----------
    run : Run
        its ``starts`` are there as soon as they have ended; the rest is that of the best start (certified before uncertified, then
        the lower objective, then the lower number; a start that finds the problem unbounded counts as certified, with the objective
        where it stopped), but the counts are those of all

    Raises
    ------
    FesdError
        for a callback together with an executor
    """

    def __init__(self, compiled, options, timer, show, deadline, after, built):
        if options.executor is not None and options.callback is not None:
            raise FesdError('callback', "an executor may run the starts in other processes", "use executor=None with a callback")
        self._c, self._options, self._show = compiled, options, show
        self._job = Job(compiled, plain_options(options), timer, deadline, after, built)
        self.run = Run()

    def solve(self):
        """Run from all points; returns the ``Run``.

        Raises
        ------
        FesdError
            if every start failed, or for a mistake in the options that a worker finds
        """
        c, options, x0 = self._c, self._options, self._c.x0
        points = (start_point(c, x0, options.seed, number) for number in range(options.starts))
        solved = _here(self._job, points) if options.executor is None else _elsewhere(self._job, options.executor, points)
        ended, interrupted = [], False
        try:
            for record, run in solved:
                ended.append((record, run))
                self.run.starts.append(record)
                self._show(record)
                if run is not None and run.outcome in ENDS:
                    break
        except KeyboardInterrupt:
            interrupted = True
        finally:
            solved.close()
            c.x0 = x0
        combine(self.run, c, ended, options.starts, interrupted)
        return self.run


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
                future = executor.submit(work, job, number, x0)
                numbers[future] = waiting[future] = number
            except RuntimeError as error:  # of a broken pool, too
                yield failed(number, error)
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
    except Exception as error:  # each kind of executor has its own for workers that died and messages that were lost
        return failed(number, error)
