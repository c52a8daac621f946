"""Code that both plug-ins share: the beginning of a solve, its end, and Pyomo's older solver interface."""

import datetime
import logging
import math

import casadi as ca
from pyomo.common.timing import HierarchicalTimer
from pyomo.contrib.solver.common.base import Availability, LegacySolverWrapper, SolverBase
from pyomo.contrib.solver.common.results import Results, SolutionStatus
from pyomo.contrib.solver.common.util import NoOptimalSolutionError
from pyomo.core.staleflag import StaleFlagManager

from pyomo_fesd.analysis import structure
from pyomo_fesd.core import check_keywords, interruptible
from pyomo_fesd.mpcc import Deadline

logger = logging.getLogger('pyomo_fesd')

#: Keywords of Pyomo's wrapper for the older interface: those that are options of ours, under another name, and no options.
WRAPPED = (
    'tee',
    'load_solutions',
    'symbolic_solver_labels',
    'raise_exception_on_nonoptimal_result',
    'solver_options',
    'writer_config',
)
RENAMED = {'timelimit': 'time_limit', 'options': 'solver_options'}
#: Bounds of the objective that are not known: callers of the older interface calculate with them.
NO_BOUNDS = {'lower_bound': -math.inf, 'upper_bound': math.inf}
NO_OPTIONS = ('logfile', 'solnfile', 'report_timing', 'solver_io', 'suffixes', 'keepfiles')


class CasadiSolver(SolverBase):
    """A solver that needs the Ipopt in casadi's wheel."""

    def __init__(self, **kwds):
        check_keywords(self.CONFIG, {name: kwds[name] for name in kwds if name != 'name'}, kwds.get('name', self.name))
        super().__init__(**kwds)

    def _options(self, kwds):
        """The options of one call."""
        check_keywords(self.config, kwds, self.name)
        return self.config(value=kwds, preserve_implicit=True)

    def available(self) -> Availability:
        """Whether casadi's wheel contains Ipopt."""
        return Availability.FullLicense if ca.has_nlpsol('ipopt') else Availability.NotFound

    def _begin(self, config):
        """Empty results of a solve with ``config``, which gets a timer."""
        results = Results()
        results.solver_name, results.solver_version, results.solver_config = self.name, self.version(), config
        results.timing_info.start_timestamp = datetime.datetime.now(datetime.timezone.utc)
        config.timer = results.timing_info.timer = config.timer or HierarchicalTimer()
        return results

    def _load(self, results):
        """Load the solution if the options say so; returns whether it was loaded.  Other values of the model become stale."""
        StaleFlagManager.mark_all_as_stale()
        found = results.solution_loader.get_number_of_solutions()
        loads = bool(results.solver_config.load_solutions and found and not _raises(results))
        if loads:
            self._load_from(results.solution_loader)
        return loads

    @staticmethod
    def _load_from(loader):
        loader.load_solution()

    def _refuse_nonoptimal(self, results, message):
        """Raise if the options say so."""
        if _raises(results):
            raise NoOptimalSolutionError(f"{self.name}: {message}")


def _raises(results):
    """Whether the options ask for an exception instead of these results."""
    optimal = results.solution_status is SolutionStatus.optimal
    return results.solver_config.raise_exception_on_nonoptimal_result and not optimal


def deadline(config, started: float) -> Deadline:
    """The deadline that the option ``time_limit`` sets, counted from ``time.perf_counter()`` at the start."""
    return Deadline(None if config.time_limit is None else started + config.time_limit)


def with_structure(message: str, model) -> str:
    """``message`` and, if the model has not one equation for every unknown, the problem that ``structure`` finds."""
    problem = review(lambda: structure(model).problem, lambda failure: None)
    return '; '.join(part for part in (message, problem) if part)


def review(look, instead):
    """What ``look`` finds in a result; where it fails, what ``instead`` makes of a sentence on that: no review costs a result."""
    try:
        return look()
    except Exception as error:  # whatever it is, the solve has ended well
        failure = f"a review of the result failed with {type(error).__name__}: {error}"
        logger.warning("%s", failure)
        return instead(failure)


class LegacyPlugin(LegacySolverWrapper):
    """``pyomo.environ.SolverFactory`` interface: no option of one call outlives it; ``extra_info`` goes to ``results.solver``."""

    @interruptible
    def solve(self, model, **kwds):
        """Solve ``model`` as in the new interface."""
        kept = self.config.value()
        try:
            return super().solve(model, **self._own_keywords(kwds))
        finally:
            self.config.solver_options.reset()
            self.config.set_value(kept)

    def _own_keywords(self, kwds):
        """Keywords for Pyomo's wrapper, which knows only its own: our options are set, unknown ones refused."""
        own = {name: kwds.pop(name) for name in list(kwds) if name in self.config and name not in (*WRAPPED, *NO_OPTIONS)}
        given = {RENAMED.get(name, name): value for name, value in kwds.items() if name not in NO_OPTIONS}
        # for Pyomo's wrapper None means that a keyword is not given
        meant = {name: value for name, value in given.items() if value is not None or name not in self.config}
        check_keywords(self.config, own | meant, self.name)
        self.config.set_value(own)
        return kwds

    @staticmethod
    def _load_from(loader):
        # Pyomo's wrapper loads the multipliers, which takes a walk through all blocks
        loader.load_vars()

    def _map_results(self, model, results):
        legacy, solution = super()._map_results(model, results)
        for name, entry in results.extra_info.items():
            setattr(legacy.solver, name, entry)
        for name, unknown in NO_BOUNDS.items():
            if getattr(legacy.problem, name) is None:
                setattr(legacy.problem, name, unknown)
        return legacy, solution
