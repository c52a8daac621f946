"""``mpec_hybrid``: the solver plug-in, for both of Pyomo's solver interfaces."""

import time
from dataclasses import replace

from pyomo.common.collections import ComponentMap
from pyomo.common.config import document_class_CONFIG
from pyomo.common.gc_manager import PauseGC
from pyomo.common.timing import HierarchicalTimer
from pyomo.contrib.solver.common.results import Results, SolutionStatus
from pyomo.core import Block
from pyomo.core.staleflag import StaleFlagManager

from pyomo_fesd.core import FesdError, __version__, check_keywords, interruptible, phase
from pyomo_fesd.diagnostics import diagnose
from pyomo_fesd.mpcc import (
    Certificate,
    Contradiction,
    HybridSolver,
    LogTable,
    Multistart,
    Outcome,
    OutOfTime,
    Run,
    RunRecord,
    Setup,
    StartsTable,
    fill_results,
    log_streams,
    reporter,
    start_value,
)
from pyomo_fesd.results import set_indicators
from pyomo_fesd.solvers.even_elements import even_elements
from pyomo_fesd.solvers.options import MpecHybridConfig
from pyomo_fesd.solvers.persistent_model import PersistentModel, persistent_model
from pyomo_fesd.solvers.plugin import CasadiSolver, LegacyPlugin, deadline, review, with_structure
from pyomo_fesd.solvers.simulated_start import SimulatedStart
from pyomo_fesd.solvers.small_states import warn_small_states
from pyomo_fesd.solvers.user_names import user_names

NAME = 'mpec_hybrid'
COMPILING = "it was up while the model was compiled"
#: Keywords of Pyomo's older solvers, and our options that mean the same.
FORMER = {'logfile': 'log_file', 'warmstart': 'warm_start'}


@document_class_CONFIG(methods=['solve'])
class MpecHybrid(CasadiSolver):
    """Solve a model with ``Complementarity`` to an exactly complementary, certified point (theory, eq. 14-17).

    Relaxations Reg(eps) run in Ipopt (the one in casadi's wheel), branch NLPs fix the active sets that they reveal, a reduced
    LPEC in HiGHS certifies B-stationarity or leads into a better branch.  The model is compiled once and left without traces of
    it.  ``set_instance`` keeps the compiled model for further solves with other values of parameters.

    Source: paper, section 3 and Algorithm 1.
    """

    name, CONFIG = NAME, MpecHybridConfig()

    def version(self) -> tuple:
        """Version of this package."""
        return tuple(int(part) for part in __version__.split('.')[:3])

    def __init__(self, **kwds):
        super().__init__(**kwds)
        self._persistent = None

    @property
    def instance(self) -> PersistentModel | None:
        """The model that ``set_instance`` has compiled."""
        return self._persistent

    @interruptible
    def set_instance(self, model: Block, parameters=(), **kwds) -> None:
        """Compile ``model`` for many solves: ``solve(model)`` then only reads the values that may change.

        These are the values of ``parameters``, start values, bounds of variables, and which variables are fixed (those that were
        fixed already and are not parameters must stay as they are).

        Parameters
        ----------
        model : Block
        parameters : list of components
            fixed variables and mutable Params, indexed or not, whose values will change
        kwds : options of ``mpec_hybrid``
            ``user_scaling`` and ``working_dir`` take effect here, others do not

        Raises
        ------
        FesdError
            for models that are not an MPCC, for a component that is not a parameter; later by ``solve``, naming any other change
        """
        self._persistent = None
        config = self._configure(kwds)
        self._persistent = persistent_model(model, config, config.timer or HierarchicalTimer(), parameters)

    @interruptible
    def solve(self, model: Block, **kwds) -> Results:
        """Solve ``model``.

        Returns
        -------
        Results
            Pyomo's, and in ``extra_info``: ``outcome`` (a sentence), ``stationarity`` ('B' or 'not certified'), ``reason``,
            ``violation``, ``complementarity`` (absolute and ``_scaled``), ``lower_objective`` (of a feasible point that is clearly
            lower than the certified one but not certified, or None), ``biactive_pairs``, ``nlps``, ``nlp_iterations``,
            ``lpecs``, ``binaries``, ``eps_last``, ``pairs``, ``missing_values``, ``violated`` (by name), ``steps``, ``starts``,
            ``warnings`` (post-solve diagnostics of a solution on moving elements)

        Raises
        ------
        FesdError
            for models that are not an MPCC (see docs, limits), and for changes that ``set_instance`` cannot follow, before anything
            is solved
        NoOptimalSolutionError
            if the point is not certified and ``raise_exception_on_nonoptimal_result`` is set
        """
        started = time.perf_counter()
        config = self._configure(kwds)
        results = self._begin(config)
        with RunRecord(config.json_file, results, config) as record, log_streams(config.tee, config.log_file) as streams:
            table = (StartsTable if config.starts > 1 else LogTable)(streams)
            until = deadline(config, started)
            pause = PauseGC()
            with pause, self._simulated_start(model, config, until, table) as start:
                try:
                    ready = self._ready(model, config, until)
                except Contradiction as error:
                    fill_results(results, model, Run(Outcome.INFEASIBLE), set_indicators, reason=str(error))
                except OutOfTime:
                    fill_results(results, model, Run(Outcome.TIME_LIMIT), set_indicators, reason=COMPILING)
                else:
                    # from here on a run may be long, and leave garbage
                    pause.close()
                    compiled = record.compiled = ready.compiled
                    table.begin(compiled)
                    shared = compiled, config, config.timer, ready.deadline, ready.cache
                    followed = table.row, reporter(config.callback, compiled, started)
                    starts = start.further(compiled), start.completion(compiled), start.draw(compiled)
                    setup = Setup(*shared, *followed, *starts, even_elements(model, compiled))
                    solver = (Multistart if config.starts > 1 else HybridSolver)(setup)
                    record.run = solver.run
                    fill_results(results, model, solver.solve(), set_indicators, compiled, names=user_names)
                with PauseGC():
                    _explain(results, model, record, start)
                    loaded = self._load(results)
                if not loaded:
                    start.restore()
                    StaleFlagManager.mark_all_as_stale()
            results.timing_info.wall_time = time.perf_counter() - started
            table.end(results)
        self._refuse_nonoptimal(results, f"{results.extra_info.outcome}. {results.extra_info.reason}")
        if loaded:
            wanted = config.review and results.solution_status in (SolutionStatus.optimal, SolutionStatus.feasible)
            with phase(config.timer, 'review'), PauseGC():
                found = review(lambda: self._review(model, record), lambda failure: [failure]) if wanted else []
            results.extra_info.warnings = found
        return results

    @staticmethod
    def _review(model, record):
        return [*diagnose(model), *warn_small_states(model, record.compiled)]

    def _ready(self, model, config, deadline):
        """The ``PersistentModel``: a new one, or that of ``set_instance`` with present values; its sides are sorted."""
        if self._persistent is not None and self._persistent.model is model:
            ready = self._persistent
            ready.deadline.at = deadline.at
            with phase(config.timer, 'refresh'):
                ready.refresh()
        else:
            with phase(config.timer, 'compile'):
                ready = PersistentModel(model, config, config.timer, deadline=deadline)
        with phase(config.timer, 'build'):
            ready.cache.prepare(config)
        return ready

    def _simulated_start(self, model, config, deadline, table):
        """The ``SimulatedStart`` of a model that is not compiled yet, with a line in the log."""
        start = SimulatedStart(model, config, deadline)
        if start.note:
            table.note(start.note)
        if start.found:
            # the branch of these values first
            config.warm_start = True
        return start

    def _configure(self, kwds):
        """Options of this call; those in ``solver_options`` (``options`` in the legacy interface) are ours as well."""
        config = self._options(kwds)
        extra = config.solver_options.value()
        unknown = [name for name in extra if name not in config]
        if unknown:
            raise FesdError(
                self.name,
                f"unknown option(s) {', '.join(unknown)}",
                "see the options page; Ipopt's own go in nlp_options={...}, HiGHS' in lpec_options={...}",
            )
        check_keywords(config, extra, self.name)
        config.set_value(extra)
        if config.threads is not None:
            config.lpec_options.set_value({'threads': config.threads} | config.lpec_options.value())
        return config


class LegacyMpecHybrid(LegacyPlugin, MpecHybrid):
    """``pyomo.environ.SolverFactory('mpec_hybrid')``: every option is also a keyword of ``solve``; see ``MpecHybrid``."""

    def _own_keywords(self, kwds):
        # Pyomo's wrapper refuses the former names of our options
        for former, name in FORMER.items():
            given = kwds.pop(former, None)
            if given is not None:
                kwds[name] = given
        return super()._own_keywords(kwds)

    def _map_results(self, model, results):
        legacy, solution = super()._map_results(model, results)
        info, optimal = results.extra_info, results.solution_status is SolutionStatus.optimal
        legacy.solver.message = info.outcome if optimal or not info.reason else f"{info.outcome}; {info.reason}"
        return legacy, solution


def _explain(results, model, record, start):
    """Add to the reason of a failure what the structure of the model and the simulated start show."""
    info = results.extra_info
    if results.solution_status is SolutionStatus.infeasible and record.run is not None:
        info.reason = with_structure(info.reason, model)
    if results.solution_status is not SolutionStatus.optimal:
        refused = '' if record.run is None else record.run.refused
        info.reason = '; '.join(filter(None, (info.reason, start.reason(refused))))


@interruptible
def certify(model: Block, **options) -> Certificate:
    """Judge the model's present values: are they feasible, complementary and B-stationary?

    Parameters
    ----------
    options : options of ``mpec_hybrid`` (tolerances)

    Raises
    ------
    FesdError
        for a model that is not an MPCC, or has variables without a value

    Returns
    -------
    Certificate
        with ``certified``, ``grade`` (a sentence), the residuals, ``value`` of the LPEC and its ``direction`` by variable
    """
    ready, certificate = certified_model(model, options, 'certify')
    if certificate.lpec is None:
        return certificate
    return replace(certificate, direction=ComponentMap(zip(ready.compiled.variables, map(float, certificate.lpec.d))))


def certified_model(model: Block, options: dict, caller: str, parameters=()) -> tuple[PersistentModel, Certificate]:
    """Compile ``model`` and judge its present values; returns the ``PersistentModel``, prepared, and the ``Certificate``.

    Raises
    ------
    FesdError
        as ``certify``, and for a component of ``parameters`` that is not a parameter
    """
    check_keywords(MpecHybrid.CONFIG, options, caller)
    config = MpecHybrid.CONFIG(value=options)
    timer = HierarchicalTimer()
    ready = PersistentModel(model, config, timer, parameters)
    ready.cache.prepare(config)
    compiled = ready.compiled
    if compiled.missing:
        first = next(v for v in compiled.variables if start_value(v.value) is None)
        others = f" (nor have {compiled.missing - 1} others)" * (compiled.missing > 1)
        raise FesdError(first, f"has no value that could be judged{others}", "solve the model first, or set its values")
    setup = Setup(compiled, config, timer, ready.deadline, ready.cache, _ignore, _ignore)
    return ready, HybridSolver(setup).certify()


def _ignore(_):
    """No log."""
