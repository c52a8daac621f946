"""``mpec_hybrid``: the solver plug-in, for both of Pyomo's solver interfaces."""

import datetime
import time
from dataclasses import replace

import casadi as ca
from pyomo.common.collections import ComponentMap
from pyomo.common.config import document_class_CONFIG
from pyomo.common.gc_manager import PauseGC
from pyomo.common.timing import HierarchicalTimer
from pyomo.contrib.solver.common.base import Availability, LegacySolverWrapper, SolverBase
from pyomo.contrib.solver.common.factory import SolverFactory
from pyomo.contrib.solver.common.results import Results, SolutionStatus
from pyomo.contrib.solver.common.util import NoOptimalSolutionError
from pyomo.core.staleflag import StaleFlagManager

from pyomo_fesd.errors import FesdError
from pyomo_fesd.mpcc.compile import compile_problem
from pyomo_fesd.mpcc.config import MpecHybridConfig
from pyomo_fesd.mpcc.hybrid import HybridSolver
from pyomo_fesd.mpcc.instance import Instance, kept_instance
from pyomo_fesd.mpcc.lpec import Lpec
from pyomo_fesd.mpcc.multistart import Multistart
from pyomo_fesd.mpcc.phase import phase
from pyomo_fesd.mpcc.problem import read_problem
from pyomo_fesd.mpcc.progress import reporter
from pyomo_fesd.mpcc.record import Record
from pyomo_fesd.mpcc.results import fill
from pyomo_fesd.mpcc.run import Outcome, Run, Tolerances
from pyomo_fesd.mpcc.sides import sort_sides
from pyomo_fesd.mpcc.source import Contradiction
from pyomo_fesd.mpcc.stationarity import certify as certify_point
from pyomo_fesd.mpcc.table import StartsTable, Table, log_streams
from pyomo_fesd.review import review
from pyomo_fesd.structure import structure


@document_class_CONFIG(methods=['solve'])
class MpecHybrid(SolverBase):
    """Solve a model with ``Complementarity`` to an exactly complementary, certified point (theory, eq. 14-17).

    Relaxations Reg(eps) run in Ipopt (the one in casadi's wheel), branch NLPs fix the active sets that they reveal, a reduced
    LPEC in HiGHS certifies B-stationarity or leads into a better branch.  The model is compiled once; nothing of this stays
    on it.  ``set_instance`` keeps what was compiled for further solves with other values of parameters.

    Source: paper, section 3 and Algorithm 1.
    """

    CONFIG = MpecHybridConfig()

    def available(self):
        """Whether casadi's wheel brings Ipopt."""
        return Availability.FullLicense if ca.has_nlpsol('ipopt') else Availability.NotFound

    def version(self):
        """Version of this package."""
        from pyomo_fesd import __version__

        return tuple(int(part) for part in __version__.split('.')[:3])

    def __init__(self, **kwds):
        super().__init__(**kwds)
        self._instance = None

    def set_instance(self, model, parameters=(), **kwds):
        """Compile ``model`` for many solves: ``solve(model)`` then only reads what has changed.

        These are the values of ``parameters``, start values, bounds of variables, and which variables are fixed (those that were
        fixed already and are no parameters must stay as they are).

        Parameters
        ----------
        model : Block
        parameters : list of components
            fixed variables and mutable Params, indexed or not, whose values will change
        kwds : options of ``mpec_hybrid``
            ``user_scaling`` and ``working_dir`` have their effect here, others none

        Raises
        ------
        FesdError
            for models that are no MPCC, and for what is no parameter; later by ``solve``, naming what has changed besides
        """
        self._instance = None
        config = self._configure(kwds)
        self._instance = kept_instance(model, config, config.timer or HierarchicalTimer(), parameters)

    def solve(self, model, **kwds):
        """Solve ``model``.

        Returns
        -------
        Results
            Pyomo's, and in ``extra_info``: ``outcome`` (a sentence), ``stationarity`` ('B' or 'not certified'), ``reason``,
            ``violation``, ``complementarity`` (absolute and ``_scaled``), ``biactive_pairs``, ``nlps``, ``nlp_iterations``,
            ``lpecs``, ``binaries``, ``eps_last``, ``pairs``, ``missing_values``, ``violated`` (by name), ``steps``, ``starts``,
            ``warnings`` (what ``review`` says of a solution on moving elements)

        Raises
        ------
        FesdError
            for models that are no MPCC (see docs, limits), and for changes that ``set_instance`` cannot follow, before anything
            is solved
        NoOptimalSolutionError
            if the point is not certified and ``raise_exception_on_nonoptimal_result`` is set
        """
        started = time.perf_counter()
        results = Results()
        results.timing_info.start_timestamp = datetime.datetime.now(datetime.timezone.utc)
        results.solver_name, results.solver_version = self.name, self.version()
        config = self._configure(kwds)
        config.timer = results.timing_info.timer = config.timer or HierarchicalTimer()
        results.solver_config = config
        with Record(config.json_file, results, config) as record, log_streams(config.tee, config.log_file) as streams:
            StaleFlagManager.mark_all_as_stale()
            several = config.starts > 1
            table = (StartsTable if several else Table)(streams)
            try:
                instance = self._ready(model, config)
            except Contradiction as error:
                fill(results, model, Run(Outcome.INFEASIBLE), reason=str(error))
            else:
                compiled = record.compiled = instance.compiled
                table.begin(compiled)
                instance.deadline.at = None if config.time_limit is None else started + config.time_limit
                after = reporter(config.callback, compiled, started)
                algorithm = Multistart if several else HybridSolver
                solver = algorithm(compiled, config, config.timer, table.row, instance.deadline, after, instance.built)
                record.run = solver.run
                fill(results, model, solver.solve(), compiled)
                _explain(results, model)
            results.timing_info.wall_time = time.perf_counter() - started
            table.end(results)
        return self._deliver(results, config, model)

    def _ready(self, model, config):
        """The model compiled, now, or by ``set_instance`` and up to date, and its sides sorted."""
        if self._instance is not None and self._instance.model is model:
            instance = self._instance
            with phase(config.timer, 'refresh'):
                instance.refresh()
        else:
            with phase(config.timer, 'compile'), PauseGC():
                instance = Instance(model, config, config.timer)
        with phase(config.timer, 'build'):
            instance.built.prepare(config)
        return instance

    def _configure(self, kwds):
        """Options of this call; those in ``solver_options`` (``options`` in the legacy interface) are ours as well."""
        config = self.config(value=kwds, preserve_implicit=True)
        extra = config.solver_options.value()
        unknown = [name for name in extra if name not in config]
        if unknown:
            raise FesdError(
                self.name,
                f"unknown option(s) {', '.join(unknown)}",
                "see the options page; Ipopt's own go in nlp_options={...}, HiGHS' in lpec_options={...}",
            )
        config.set_value(extra)
        if config.threads is not None:
            config.lpec_options.set_value({'threads': config.threads} | config.lpec_options.value())
        return config

    @staticmethod
    def _deliver(results, config, model):
        optimal = results.solution_status is SolutionStatus.optimal
        if config.raise_exception_on_nonoptimal_result and not optimal:
            raise NoOptimalSolutionError(f"mpec_hybrid: {results.extra_info.outcome}. {results.extra_info.reason}")
        if config.load_solutions and results.solution_loader.get_number_of_solutions():
            results.solution_loader.load_solution()
            feasible = results.solution_status in (SolutionStatus.optimal, SolutionStatus.feasible)
            results.extra_info.warnings = review(model) if feasible else []
        return results


def _explain(results, model):
    """Where nothing feasible was found: whether there is an equation for every unknown."""
    if results.solution_status is SolutionStatus.infeasible:
        info = results.extra_info
        info.reason = '; '.join(part for part in (info.reason, structure(model).problem) if part)


class LegacyMpecHybrid(LegacySolverWrapper, MpecHybrid):
    """``pyomo.environ.SolverFactory('mpec_hybrid')``: every option is also a keyword of ``solve``, and none outlives its call."""

    def solve(self, model, **kwds):
        """Solve ``model``; see ``MpecHybrid.solve``.  What it reports beyond Pyomo's own is in ``results.solver``."""
        kept = self.config.value()
        if kwds.get('logfile') is not None:
            # Pyomo's wrapper refuses its old name of our option
            kwds['log_file'] = kwds.pop('logfile')
        ours = {name: kwds.pop(name) for name in list(kwds) if name in self.config and name not in _LEGACY_KEYWORDS}
        try:
            self.config.set_value(ours)
            return super().solve(model, **kwds)
        finally:
            self.config.solver_options.reset()
            self.config.set_value(kept)

    def _map_results(self, model, results):
        legacy, solution = super()._map_results(model, results)
        if results.solution_status is SolutionStatus.optimal:
            legacy.solver.message = results.extra_info.outcome
        for name, entry in results.extra_info.items():
            setattr(legacy.solver, name, entry)
        return legacy, solution


_LEGACY_KEYWORDS = (
    'tee',
    'load_solutions',
    'symbolic_solver_labels',
    'raise_exception_on_nonoptimal_result',
    'solver_options',
)

SolverFactory.register('mpec_hybrid', doc="Certified MPCC solutions: Reg(eps) in Ipopt and a reduced LPEC in HiGHS")(
    MpecHybrid, LegacyMpecHybrid
)


def certify(model, **options):
    """Judge the model's present values: are they feasible, complementary and B-stationary?

    Parameters
    ----------
    options : options of ``mpec_hybrid`` (tolerances)

    Returns
    -------
    Certificate
        with ``certified``, ``grade`` (a sentence), the residuals, ``value`` of the LPEC and its ``direction`` by variable
    """
    config = MpecHybrid.CONFIG(value=options)
    compiled = compile_problem(read_problem(model), HierarchicalTimer())
    lpec = Lpec(compiled, sort_sides(compiled), config.lpec_options.value())
    tolerances = Tolerances.of(config)
    certificate = certify_point(compiled, lpec, compiled.x0, tolerances)
    if certificate.lpec is None:
        return certificate
    return replace(certificate, direction=ComponentMap(zip(compiled.variables, map(float, certificate.lpec.d))))
