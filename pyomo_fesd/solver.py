"""``mpec_hybrid``: the solver plug-in, for both of Pyomo's solver interfaces."""

import datetime
import time
from dataclasses import replace

import casadi as ca
import numpy as np
from pyomo.common.collections import ComponentMap
from pyomo.common.config import (
    ConfigDict,
    ConfigValue,
    In,
    NonNegativeInt,
    PositiveFloat,
    PositiveInt,
    document_class_CONFIG,
    document_configdict,
)
from pyomo.common.gc_manager import PauseGC
from pyomo.common.timing import HierarchicalTimer
from pyomo.contrib.solver.common.base import Availability, LegacySolverWrapper, SolverBase
from pyomo.contrib.solver.common.config import SolverConfig
from pyomo.contrib.solver.common.factory import SolverFactory
from pyomo.contrib.solver.common.results import Results, SolutionStatus, TerminationCondition
from pyomo.contrib.solver.common.solution_loader import SolutionLoader
from pyomo.contrib.solver.common.util import (
    NoDualsError,
    NoOptimalSolutionError,
    NoReducedCostsError,
    NoSolutionError,
)
from pyomo.core import value
from pyomo.core.staleflag import StaleFlagManager

from pyomo_fesd import marks
from pyomo_fesd.errors import FesdError
from pyomo_fesd.mpcc.compile import Contradiction, compile_problem
from pyomo_fesd.mpcc.deadline import Deadline
from pyomo_fesd.mpcc.hybrid import HybridSolver
from pyomo_fesd.mpcc.lpec import Lpec
from pyomo_fesd.mpcc.multistart import executor_like, solve_many
from pyomo_fesd.mpcc.problem import read_problem
from pyomo_fesd.mpcc.relaxation import RELAXATIONS
from pyomo_fesd.mpcc.run import Outcome, Tolerances
from pyomo_fesd.mpcc.sides import sort_sides
from pyomo_fesd.mpcc.stationarity import certify as certify_point
from pyomo_fesd.mpcc.table import StartsTable, Table

#: What each outcome is in Pyomo's words.
CONDITIONS = {
    Outcome.CERTIFIED: (TerminationCondition.convergenceCriteriaSatisfied, SolutionStatus.optimal),
    Outcome.SOLVED: (TerminationCondition.convergenceCriteriaSatisfied, SolutionStatus.optimal),
    Outcome.FEASIBLE: (TerminationCondition.unknown, SolutionStatus.feasible),
    Outcome.INFEASIBLE: (TerminationCondition.locallyInfeasible, SolutionStatus.infeasible),
    Outcome.UNBOUNDED: (TerminationCondition.unbounded, SolutionStatus.unknown),
    Outcome.TIME_LIMIT: (TerminationCondition.maxTimeLimit, SolutionStatus.unknown),
    Outcome.ITERATION_LIMIT: (TerminationCondition.iterationLimit, SolutionStatus.unknown),
    Outcome.INTERRUPTED: (TerminationCondition.interrupted, SolutionStatus.unknown),
}
#: Violated pairs and rows that a report names.
NAMED = 5


@document_configdict()
class MpecHybridConfig(SolverConfig):
    """Options of ``mpec_hybrid``."""

    def __init__(self, description=None, doc=None, implicit=False, implicit_domain=None, visibility=0):
        super().__init__(
            description=description, doc=doc, implicit=implicit, implicit_domain=implicit_domain, visibility=visibility
        )
        for name, default, domain, text in (
            ('eps_init', 1.0, PositiveFloat, "first relaxation parameter eps of Reg(eps) (eq. 15)"),
            ('eps_final', 1e-9, PositiveFloat, "smallest eps; the homotopy usually ends earlier, at a certified branch"),
            ('eps_factor', 0.1, PositiveFloat, "eps is multiplied by this after each relaxation (1/Q)"),
            (
                'relaxation',
                'auto',
                In(['auto', *RELAXATIONS]),
                "form of Reg(eps): 'elastic' (one slack, weight 1/eps), 'scholtes' (products <= eps), others of the same kind, or "
                "'auto': elastic without an objective, scholtes with one, the other after a failure",
            ),
            (
                'nlp_solver',
                'ipopt',
                str,
                "NLP solver: 'ipopt' (the one in casadi's wheel), 'uno' (also there), 'cyipopt' (the system's Ipopt), or an "
                "executable that reads NL files and that Pyomo knows, e.g. 'pounce', 'asl:ipopt'",
            ),
            ('relaxation_tol', 1e-4, PositiveFloat, "Ipopt's tol for relaxations, which only lead to a branch"),
            ('relaxation_iterations', 500, PositiveInt, "Ipopt iterations allowed to one relaxation"),
            ('gap_tol', 5e-5, PositiveFloat, "gap test: relative distance of incumbent and relaxed objective that ends a run"),
            ('feasibility_tol', 1e-6, PositiveFloat, "largest scaled violation and complementarity of a reported point"),
            ('biactive_tol', 1e-6, PositiveFloat, "sides below this are both zero at a branch solution (eq. 16)"),
            ('descent_tol', 1e-6, PositiveFloat, "LPEC value, relative to max(1, |f|), that counts as no descent"),
            ('eta_tol', 1e-3, PositiveFloat, "indicator of step equilibration above which nothing has switched (eq. 13)"),
            ('trust_radius', 1.0, PositiveFloat, "trust region Delta of the LPEC, relative for large variables (eq. 17)"),
            ('branch_tol', 1e-9, PositiveFloat, "Ipopt's tol for branch NLPs"),
            ('branch_iterations', 300, PositiveInt, "Ipopt iterations allowed to one branch NLP; a wrong branch burns them all"),
            ('max_iterations', 20000, PositiveInt, "Ipopt iterations allowed in all; with several starts, to each"),
            ('starts', 1, PositiveInt, "solve from so many points, the first being the model's values, and keep the best"),
            ('seed', 0, NonNegativeInt, "of the random points: the same seed gives the same points"),
            (
                'executor',
                None,
                executor_like,
                "where the starts run: None for one by one in this process, or an executor of concurrent.futures or with its "
                "methods, e.g. ProcessPoolExecutor() or Dask's client.get_executor()",
            ),
        ):
            setattr(self, name, self.declare(name, ConfigValue(default=default, domain=domain, description=text)))
        self.user_scaling = self.declare(
            'user_scaling', ConfigValue(default=True, domain=bool, description="honour Pyomo's scaling_factor suffixes")
        )
        self.nlp_options = self.declare(
            'nlp_options', ConfigDict(implicit=True, description="options passed to Ipopt, e.g. {'max_iter': 3000}")
        )
        self.lpec_options = self.declare(
            'lpec_options', ConfigDict(implicit=True, description="options passed to HiGHS, e.g. {'threads': 2}")
        )


class _Loader(SolutionLoader):
    """Values of the point found and the multipliers of its branch NLP.

    Loading also sets the indicator variables of the disjuncts that ``fesd.dcs`` transformed.
    """

    def __init__(self, model, compiled, run):
        self._pyomo_model, self._c, self._w = model, compiled, None if run.w is None else compiled.values(run.w)
        self._nlp = None if run.point is None else run.point.nlp

    def get_number_of_solutions(self):
        """1, or 0 if no point was reached."""
        return int(self._w is not None)

    def get_vars(self, vars_to_load=None):
        """Values by variable."""
        if self._w is None:
            raise NoSolutionError()
        return _select(ComponentMap, self._c.variables, self._w, vars_to_load)

    def get_duals(self, cons_to_load=None):
        """Multipliers of the constraints in the branch NLP, in Pyomo's sign; the pairs are fixed there."""
        if self._nlp is None:
            raise NoDualsError()
        c = self._c
        lam = -c.sign * self._nlp.lam_g[: len(c.constraints)] * c.scale.g / c.scale.f
        return _select(dict, c.constraints, lam, cons_to_load)

    def get_reduced_costs(self, vars_to_load=None):
        """Multipliers of the bounds in the branch NLP, in Pyomo's sign."""
        if self._nlp is None:
            raise NoReducedCostsError()
        c = self._c
        lam = -c.sign * self._nlp.lam_x * c.scale.x / c.scale.f
        return _select(ComponentMap, c.variables, lam, vars_to_load)

    def load_vars(self, vars_to_load=None):
        super().load_vars(vars_to_load)
        for disjunct, weight in marks.marked(self._pyomo_model, marks.INDICATOR):
            # Pyomo's own link: near 0 or 1 it sets the Boolean, between it leaves it unset
            disjunct.binary_indicator_var.set_value(value(weight, exception=False), skip_validation=True)


def _select(kind, components, numbers, wanted):
    """``kind`` from components to numbers, for all or the wanted ones."""
    found = kind(zip(components, map(float, numbers)))
    return found if wanted is None else kind((c, found[c]) for c in wanted)


@document_class_CONFIG(methods=['solve'])
class MpecHybrid(SolverBase):
    """Solve a model with ``Complementarity`` to an exactly complementary, certified point (theory, eq. 14-17).

    Relaxations Reg(eps) run in Ipopt (the one in casadi's wheel), branch NLPs fix the active sets that they reveal, a reduced
    LPEC in HiGHS certifies B-stationarity or leads into a better branch.  The model is compiled once; nothing of this stays
    on it.

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

    def solve(self, model, **kwds):
        """Solve ``model``.

        Returns
        -------
        Results
            Pyomo's, and in ``extra_info``: ``outcome`` (a sentence), ``stationarity`` ('B' or 'not certified'), ``reason``,
            ``violation``, ``complementarity`` (absolute and ``_scaled``), ``biactive_pairs``, ``nlps``, ``nlp_iterations``,
            ``lpecs``, ``binaries``, ``eps_last``, ``pairs``, ``missing_values``, ``violated`` (by name), ``steps``, ``starts``

        Raises
        ------
        FesdError
            for models that are no MPCC (see docs, limits), before anything is solved
        NoOptimalSolutionError
            if the point is not certified and ``raise_exception_on_nonoptimal_result`` is set
        """
        started = time.perf_counter()
        results = Results()
        results.timing_info.start_timestamp = datetime.datetime.now(datetime.timezone.utc)
        results.solver_name, results.solver_version = self.name, self.version()
        config = self._configure(kwds)
        timer = config.timer = config.timer or HierarchicalTimer()
        StaleFlagManager.mark_all_as_stale()
        problem = read_problem(model)
        timer.start('compile')
        try:
            with PauseGC():
                compiled = compile_problem(problem, timer, config.working_dir, user_scaling=config.user_scaling)
        except Contradiction as error:
            _fill_contradiction(results, model, str(error))
            results.solver_config = config
            return self._deliver(results, config)
        timer.stop('compile')
        deadline = Deadline(None if config.time_limit is None else started + config.time_limit)
        if config.starts > 1:
            table = StartsTable(config.tee, compiled)
            run = solve_many(compiled, config, timer, table.row, deadline)
        else:
            table = Table(config.tee, compiled)
            run = HybridSolver(compiled, config, timer, table.row, deadline).solve()
        _fill(results, model, compiled, run)
        results.solver_config = config
        results.timing_info.timer = timer
        results.timing_info.wall_time = time.perf_counter() - started
        table.end(results)
        return self._deliver(results, config)

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
    def _deliver(results, config):
        optimal = results.solution_status is SolutionStatus.optimal
        if config.raise_exception_on_nonoptimal_result and not optimal:
            raise NoOptimalSolutionError(f"mpec_hybrid: {results.extra_info.outcome}. {results.extra_info.reason}")
        if config.load_solutions and results.solution_loader.get_number_of_solutions():
            results.solution_loader.load_solution()
        return results


def _fill(results, model, c, run):
    """Pyomo's results from a ``Run``."""
    condition, status = CONDITIONS[run.outcome]
    if status is SolutionStatus.unknown:
        # stopped by a limit: what the best point is decides
        status = _status_of(run)
    results.termination_condition, results.solution_status = condition, status
    results.solution_loader = _Loader(model, c, run)
    if run.point is not None and c.has_objective:
        results.incumbent_objective = c.objective(run.point.f)
    info = results.extra_info
    info.outcome = run.outcome.value
    certificate = None if run.point is None else run.point.certificate
    info.stationarity = 'B' if certificate is not None and certificate.certified else 'not certified'
    info.reason = '' if certificate is None else certificate.grade.value
    for name in ('violation', 'complementarity', 'violation_scaled', 'complementarity_scaled'):
        setattr(info, name, None if certificate is None else getattr(certificate, name))
    info.biactive_pairs = None if certificate is None else certificate.biactive
    info.pairs, info.missing_values, info.eps_last = len(c.conditions), c.missing, run.eps
    info.nlps, info.nlp_iterations = run.counts.nlps, run.counts.iterations
    info.lpecs, info.binaries = run.counts.lpecs, run.counts.binaries
    info.violated = _violated(c, run.w) if run.outcome is Outcome.INFEASIBLE and run.w is not None else []
    if info.violated:
        info.reason = 'largest violations: ' + ', '.join(f'{name} ({amount:.1e})' for name, amount in info.violated)
    info.steps, info.starts = run.steps, run.starts


def _fill_contradiction(results, model, message):
    """Pyomo's results where fixed values alone violate a constraint: nothing was solved."""
    results.termination_condition, results.solution_status = CONDITIONS[Outcome.INFEASIBLE]
    results.solution_loader = _Nothing(model)
    info = results.extra_info
    info.outcome, info.stationarity, info.reason = Outcome.INFEASIBLE.value, 'not certified', message
    info.violated, info.steps, info.starts = [], [], []
    for name in ('violation', 'complementarity', 'violation_scaled', 'complementarity_scaled', 'biactive_pairs', 'eps_last'):
        setattr(info, name, None)
    info.nlps = info.nlp_iterations = info.lpecs = info.binaries = 0


class _Nothing(SolutionLoader):
    """No point at all."""

    def __init__(self, model):
        self._pyomo_model = model

    def get_number_of_solutions(self):
        """0."""
        return 0

    def get_vars(self, vars_to_load=None):
        """There are none."""
        raise NoSolutionError()


def _status_of(run):
    if run.w is None:
        return SolutionStatus.noSolution
    return SolutionStatus.unknown if run.point is None else SolutionStatus.feasible


def _violated(c, w):
    """The most violated rows and pairs at ``w``, by name."""
    at = c.evaluate(w)
    rows, _ = c.violations(w, at)
    named = [(con.name, float(v)) for con, v in zip(c.constraints, rows)]
    named += [(cond.name, float(v)) for cond, v in zip(c.conditions, np.abs(np.minimum(at.G, at.H)))]
    named = sorted(named, key=lambda item: -item[1])[:NAMED]
    return [(name, amount) for name, amount in named if amount > 0]


class LegacyMpecHybrid(LegacySolverWrapper, MpecHybrid):
    """``pyomo.environ.SolverFactory('mpec_hybrid')``: every option is also a keyword of ``solve``, and none outlives its call."""

    def solve(self, model, **kwds):
        """Solve ``model``; see ``MpecHybrid.solve``.  What it reports beyond Pyomo's own is in ``results.solver``."""
        kept = self.config.value()
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
    tolerances = Tolerances(
        config.feasibility_tol, config.biactive_tol, config.descent_tol, config.eta_tol, config.trust_radius
    )
    certificate = certify_point(compiled, lpec, compiled.x0, tolerances)
    if certificate.lpec is None:
        return certificate
    return replace(certificate, direction=ComponentMap(zip(compiled.variables, map(float, certificate.lpec.d))))
