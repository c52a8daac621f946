"""Seconds of CPU by phase: of the timers of the package, and inside casadi's NLP solvers."""

import time
from contextlib import contextmanager

import casadi as ca
from pyomo.common.timing import HierarchicalTimer


class CpuTimer(HierarchicalTimer):
    """A timer of Pyomo that also counts CPU time.

    Attributes
    ----------
    cpu : dict
        seconds by path: a tuple of the names of a phase and of those around it, outermost first
    """

    def __init__(self):
        super().__init__()
        self.cpu, self._started = {}, []

    def start(self, identifier):
        """Begin a phase."""
        super().start(identifier)
        self._started.append(time.process_time())

    def stop(self, identifier):
        """End a phase."""
        path = tuple(self.stack)
        super().stop(identifier)
        self.cpu[path] = self.cpu.get(path, 0.0) + time.process_time() - self._started.pop()


class NlpClock:
    """Seconds of CPU inside casadi's ``nlpsol``: making solvers, evaluating functions, and everything (of all solves)."""

    def __init__(self):
        self.reset()

    def reset(self):
        """Forget everything until now."""
        self.making = self.evaluating = self.solving = 0.0

    @contextmanager
    def running(self):
        """Within the body, count every solver that is made by ``casadi.nlpsol``."""
        original = ca.nlpsol
        ca.nlpsol = lambda *given: self._made(original, *given)
        try:
            yield self
        finally:
            ca.nlpsol = original

    def _made(self, nlpsol, name, plugin, problem, options):
        started = time.process_time()
        solver = nlpsol(name, plugin, problem, options | {'record_time': True})
        self.making += time.process_time() - started
        return _TimedSolver(solver, self)


class Clock:
    """Counts the CPU seconds between marks; restarts a timer and the clock of the NLP solvers with itself."""

    def __init__(self, timer, nlp):
        self._timer, self._nlp = timer, nlp
        self.restart()

    def restart(self):
        """Forget everything until now."""
        self._timer.cpu.clear()
        self._nlp.reset()
        self.seconds, self._last = {}, time.process_time()

    def __call__(self, part):
        """Count the seconds since the last mark to ``part``."""
        now = time.process_time()
        self.seconds[part] = self.seconds.get(part, 0.0) + now - self._last
        self._last = now


class _TimedSolver:
    """A solver of casadi whose calls are timed."""

    def __init__(self, solver, clock):
        self._solver, self._clock = solver, clock

    def __call__(self, **given):
        started = time.process_time()
        try:
            return self._solver(**given)
        finally:
            self._clock.solving += time.process_time() - started
            times = self._solver.stats()
            self._clock.evaluating += sum(t for name, t in times.items() if name.startswith('t_proc_nlp_'))

    def __getattr__(self, name):
        return getattr(self._solver, name)
