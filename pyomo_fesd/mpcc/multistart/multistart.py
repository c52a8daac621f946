"""Many starts: the best of several runs from different points, one after the other here or by an executor.

Takes: the ``Setup`` of a run with the options ``starts``, ``seed`` and ``executor``.
Leaves: one ``Run``: that of the best start, with the work of all and a record of each.

A start is a function of the seed and its number (``start_points``, or ``draw`` of the Setup), and a run one of its start, so
neither the executor nor the order has an influence on the answer; only a limit makes it depend on speed.
"""

from concurrent.futures import TimeoutError as FuturesTimeout
from concurrent.futures import as_completed
from functools import partial

from pyomo_fesd.core import FesdError, interrupt_handled
from pyomo_fesd.mpcc.algorithm import Outcome, Run, Setup, Start, start_point
from pyomo_fesd.mpcc.multistart.best_start import NO_ANSWER, combine
from pyomo_fesd.mpcc.multistart.start_job import Job, failed, work

#: Seconds after the time limit in which the executor may deliver the runs that its workers have stopped.
LATE = 10.0
#: Outcomes after which no other start is needed.
FINAL = (Outcome.SOLVED, Outcome.INTERRUPTED, Outcome.STOPPED)


class Multistart:
    """Runs the algorithm from ``options.starts`` points; used as ``HybridSolver``.

    ``setup.show`` is called with the Start after each one; ``setup.after`` also with the number of the start, unless an executor
    runs it.

    Attributes
    ----------
    run : Run
        its ``starts`` grow as they end; the rest is that of the best start (certified before uncertified, then the lower objective,
        then the lower number; a start that finds the problem unbounded counts as certified, with the objective where it stopped),
        but the counts are those of all

    Raises
    ------
    FesdError
        for a callback together with an executor
    """

    def __init__(self, setup: Setup):
        options = setup.options
        if options.executor is not None and options.callback is not None:
            raise FesdError('callback', "an executor may run the starts in other processes", "use executor=None with a callback")
        self._setup, self._job, self.run = setup, Job(setup), Run()

    def solve(self) -> Run:
        """Run from all points.

        Raises
        ------
        FesdError
            if every start failed, or for a mistake in the options that a worker finds
        """
        c, options, x0 = self._setup.compiled, self._setup.options, self._setup.compiled.x0
        draw = self._setup.draw or partial(start_point, c, x0, options.seed)
        points = (draw(number) if number else x0 for number in range(options.starts))
        solved = _here(self._job, points) if options.executor is None else _elsewhere(self._job, options.executor, points)
        ended, interrupted = [], False
        try:
            for start, run in solved:
                ended.append((start, run))
                self.run.starts.append(start)
                self._setup.show(start)
                if run is not None and run.outcome in FINAL:
                    break
        except KeyboardInterrupt:
            interrupt_handled()
            interrupted = True
        finally:
            solved.close()
            c.x0 = x0
        combine(self.run, c, ended, options.starts, interrupted)
        return self.run


def _here(job, points):
    """(Start, Run) of each start that begins before the deadline."""
    for number, x0 in enumerate(points):
        one = job.solve(number, x0)
        if one is None:
            return
        yield one


def _elsewhere(job, executor, points):
    """As ``_here``, in the order in which they end; a failed start has no Run.  Closing the generator cancels all others."""
    numbers, waiting = {}, {}
    try:
        for number, x0 in enumerate(points):
            try:
                future = executor.submit(work, job, number, x0)
                numbers[future] = waiting[future] = number
            except RuntimeError as error:  # also of a broken pool
                yield failed(number, error)
        yield from filter(None, _in_order_of_completion(job, waiting))
    except KeyboardInterrupt:
        # also while starts are still being submitted: those that have ended count
        ended = [(future, number) for future, number in waiting.items() if future.done() and not _lost(future)]
        yield from filter(None, (_result(future, number) for future, number in ended))
        raise
    finally:
        job.stopped.set()
        for future in numbers:
            future.cancel()


def _in_order_of_completion(job, waiting):
    """Results of the futures in ``waiting``, which are removed from it; those that do not come in time are failed starts."""
    left = job.deadline.left()
    try:
        for future in as_completed(list(waiting), None if left is None else left + LATE):
            yield _result(future, waiting.pop(future))
    except FuturesTimeout:
        yield from ((Start(number, NO_ANSWER), None) for number in waiting.values())


def _lost(future):
    """Whether a future that is done has no result: cancelled, or interrupted itself."""
    return future.cancelled() or isinstance(future.exception(), KeyboardInterrupt)


def _result(future, number):
    """(Start, Run) of a future that is done; None if its start did not begin."""
    try:
        return future.result()
    except FesdError:
        raise
    except Exception as error:  # each kind of executor has its own for dead workers and lost messages
        return failed(number, error)
