"""Runs in a child process, so that one that hangs or crashes costs a row and not the study."""

import multiprocessing
import time
import warnings

from stability_cases import judge


class Worker:
    """A child that knows all cases and runs them by number; it is replaced when it does not answer in time."""

    def __init__(self, cases, limit):
        self.cases, self.limit = cases, limit
        self.child = None

    def run(self, number, method):
        """``(class, error, what it looks like, what it said, seconds)``."""
        if self.child is None:
            self._begin()
        started = time.perf_counter()
        self.pipe.send((number, method))
        if self.pipe.poll(self.limit):
            try:
                return *self.pipe.recv(), time.perf_counter() - started
            except EOFError:
                verdict = 'the process died'
        else:
            verdict = f'no answer within {self.limit} s'
        self.end()
        return 'refused', float('nan'), '', verdict, time.perf_counter() - started

    def _begin(self):
        fork = multiprocessing.get_context('fork')
        self.pipe, theirs = fork.Pipe()
        self.child = fork.Process(target=_serve, args=(theirs, self.cases, self.limit), daemon=True)
        self.child.start()
        theirs.close()

    def end(self):
        """Stop the child."""
        if self.child is not None:
            self.child.kill()
            self.child.join()
            self.child = None


def _serve(pipe, cases, limit):
    warnings.simplefilter('ignore')
    while True:
        number, method = pipe.recv()
        case = cases[number]
        # a little less than the child's own limit: a method that stops by itself says more
        outcome = case.run(method, 0.8 * limit)
        pipe.send(('-', float('nan'), '', 'cannot be stated') if outcome is None else (*judge(case, outcome), outcome.said))
