"""``casadi_ipopt``: the Ipopt in casadi's wheel as an NLP solver for Pyomo and IDAES.

    min f(x)   s.t.   g_l <= g(x) <= g_u,   x_l <= x <= x_u

Takes: a model or a block of one, also the temporary blocks of Pyomo and IDAES; options in Ipopt's own names.
Leaves: values, multipliers in import suffixes; nothing else on the model.
Does not apply: to complementarities, modes and integers, which it refuses; external functions and if-then-else.
"""

import datetime
import io
import logging
import time
from contextlib import contextmanager

import casadi as ca
from pyomo.common.config import ConfigDict, ConfigValue, document_class_CONFIG, document_configdict
from pyomo.common.gc_manager import PauseGC
from pyomo.common.tee import TeeStream, capture_output
from pyomo.common.timing import HierarchicalTimer
from pyomo.contrib.solver.common.base import Availability, LegacySolverWrapper, SolverBase
from pyomo.contrib.solver.common.config import SolverConfig
from pyomo.contrib.solver.common.factory import SolverFactory
from pyomo.contrib.solver.common.results import Results, SolutionStatus, TerminationCondition
from pyomo.contrib.solver.common.util import NoOptimalSolutionError
from pyomo.core.staleflag import StaleFlagManager

from pyomo_fesd.errors import FesdError
from pyomo_fesd.mpcc.compile import compile_problem
from pyomo_fesd.mpcc.deadline import Deadline
from pyomo_fesd.mpcc.nlp_casadi import PlainIpopt
from pyomo_fesd.mpcc.phase import phase
from pyomo_fesd.mpcc.problem import read_problem
from pyomo_fesd.mpcc.results import Loader
from pyomo_fesd.mpcc.source import Contradiction
from pyomo_fesd.structure import structure

logger = logging.getLogger('pyomo_fesd')

NAME = 'casadi_ipopt'
#: Linear solvers in the wheel.
LINEAR_SOLVERS = ('mumps', 'spral')
#: Options of Ipopt's executable, not of Ipopt.
OF_EXECUTABLE = ('halt_on_ampl_error', 'option_file_name', 'wantsol', 'outlev')

_SOLVED = TerminationCondition.convergenceCriteriaSatisfied, SolutionStatus.optimal
_LATE = TerminationCondition.maxTimeLimit, SolutionStatus.unknown
#: Ipopt's words in Pyomo's; all others are errors.
STATUS = {
    'Solve_Succeeded': _SOLVED,
    'Solved_To_Acceptable_Level': _SOLVED,
    'Feasible_Point_Found': _SOLVED,
    'Infeasible_Problem_Detected': (TerminationCondition.locallyInfeasible, SolutionStatus.infeasible),
    'Diverging_Iterates': (TerminationCondition.unbounded, SolutionStatus.unknown),
    'Maximum_Iterations_Exceeded': (TerminationCondition.iterationLimit, SolutionStatus.unknown),
    'Maximum_CpuTime_Exceeded': _LATE,
    'Maximum_WallTime_Exceeded': _LATE,
    'Search_Direction_Becomes_Too_Small': (TerminationCondition.minStepLength, SolutionStatus.unknown),
    'User_Requested_Stop': (TerminationCondition.interrupted, SolutionStatus.unknown),
}
FAILED = TerminationCondition.error, SolutionStatus.unknown


@document_configdict()
class CasadiIpoptConfig(SolverConfig):
    """Options of ``casadi_ipopt``; Ipopt's own are in ``solver_options`` (``options`` in the legacy interface)."""

    def __init__(self, description=None, doc=None, implicit=False, implicit_domain=None, visibility=0):
        super().__init__(
            description=description, doc=doc, implicit=implicit, implicit_domain=implicit_domain, visibility=visibility
        )
        # IDAES sets further ones of Pyomo's NL writer, which only change how a model is written
        writer = ConfigDict(implicit=True, description="Options of the NL writer: scale_model, others have no effect")
        writer.declare('scale_model', ConfigValue(default=False, domain=bool, description="Apply scaling_factor suffixes"))
        self.writer_config = self.declare('writer_config', writer)


@document_class_CONFIG(methods=['solve'])
class CasadiIpopt(SolverBase):
    """Solve an NLP, or a square system, with the Ipopt in casadi's wheel: no executable, exact sparse derivatives.

    ``scaling_factor`` suffixes count with ``nlp_scaling_method='user-scaling'``, as with Ipopt's executable, and with the NL
    writer's option ``scale_model``.
    """

    CONFIG = CasadiIpoptConfig()

    def available(self):
        """Whether casadi's wheel brings Ipopt."""
        return Availability.FullLicense if ca.has_nlpsol('ipopt') else Availability.NotFound

    def version(self):
        """Version of casadi, which brings Ipopt."""
        return tuple(int(part) for part in ca.__version__.split('.')[:3])

    def solve(self, model, **kwds):
        """Solve ``model``.

        Returns
        -------
        Results
            Pyomo's, and in ``extra_info``: ``return_status`` (Ipopt's word), ``iteration_count``, ``solver_message``

        Raises
        ------
        FesdError
            for what is no NLP, for functions that cannot be evaluated and for options that Ipopt refuses
        NoOptimalSolutionError
            if Ipopt found no solution and ``raise_exception_on_nonoptimal_result`` is set
        """
        started = time.perf_counter()
        config = self.config(value=kwds, preserve_implicit=True)
        results = Results()
        results.solver_name, results.solver_version, results.solver_config = NAME, self.version(), config
        results.timing_info.start_timestamp = datetime.datetime.now(datetime.timezone.utc)
        timer = config.timer = results.timing_info.timer = config.timer or HierarchicalTimer()
        deadline = Deadline(None if config.time_limit is None else started + config.time_limit)
        StaleFlagManager.mark_all_as_stale()
        options = _ipopts_own(config.solver_options.value())
        scaled = config.writer_config.scale_model or options.get('nlp_scaling_method') == 'user-scaling'
        try:
            with phase(timer, 'compile'), PauseGC():
                compiled = compile_problem(_read(model), timer, config.working_dir, user_scaling=scaled)
        except Contradiction as error:
            _conclude(results, 'Fixed values contradict', str(error))
            results.termination_condition = TerminationCondition.provenInfeasible
            results.solution_status = SolutionStatus.noSolution
            results.solution_loader = Loader(model, None, None, None)
        else:
            with phase(timer, 'ipopt'):
                answer, results.solver_log = _run(compiled, options, config.tee, deadline)
            _conclude(results, answer.status, answer.status.replace('_', ' '), answer.iterations)
            results.solution_loader = Loader(model, compiled, answer.w, answer)
            if results.solution_status is not SolutionStatus.optimal:
                info = results.extra_info
                info.solver_message = '; '.join(part for part in (info.solver_message, structure(model).problem) if part)
            elif compiled.has_objective:
                results.incumbent_objective = compiled.objective(answer.f)
        results.timing_info.wall_time = time.perf_counter() - started
        return _deliver(results, config)


def _read(model):
    """The model as an ``Mpcc`` without pairs."""
    problem = read_problem(model, NAME)
    if problem.sources:
        raise FesdError(
            problem.sources[0], f"an active Complementarity, which {NAME} does not handle", "use mpec_hybrid, or deactivate it"
        )
    return problem


def _ipopts_own(options):
    """Those of the user's options that this Ipopt knows; what IDAES asks for by default must not stop it."""
    for name in OF_EXECUTABLE:
        if name in options:
            logger.debug("%s: option %s belongs to Ipopt's executable and is left out", NAME, name)
    options = {name: value for name, value in options.items() if name not in OF_EXECUTABLE}
    wanted = options.get('linear_solver', 'mumps')
    if wanted not in LINEAR_SOLVERS and 'hsllib' not in options:
        logger.debug("%s: linear solver %s is not in casadi's wheel; mumps takes its place", NAME, wanted)
        options['linear_solver'] = 'mumps'
    return options


def _run(compiled, options, streams, deadline):
    """Ipopt's answer, and what it printed."""
    if options.get('nlp_scaling_method') == 'user-scaling':
        # the compiled problem is scaled already
        options = options | {'nlp_scaling_method': 'none'}
    budget = {'print_level': 5 if streams else 0, 'sb': 'no' if streams else 'yes'}
    if deadline.at is not None:
        budget['max_wall_time'] = max(deadline.left(), 1e-3)
    log, c = io.StringIO(), compiled
    with _captured(log, streams, budget | options):
        ipopt = PlainIpopt('ipopt', c.x, c.p, c.f, c.g, budget, options=options)
        answer = ipopt.solve(c.x0, c.parameters, c.lbx, c.ubx, c.lbg, c.ubg)
    return answer, log.getvalue()


@contextmanager
def _captured(log, streams, options):
    """Let ``log`` and ``streams`` have what Ipopt prints; nothing where it is silent."""
    if options['print_level'] == 0:
        yield
        return
    with TeeStream(log, *streams) as tee, capture_output(tee.STDOUT, capture_fd=True):
        yield


def _conclude(results, status, message, iterations=0):
    results.termination_condition, results.solution_status = STATUS.get(status, FAILED)
    info = results.extra_info
    info.return_status, info.solver_message, info.iteration_count = status, message, iterations


def _deliver(results, config):
    if config.raise_exception_on_nonoptimal_result and results.solution_status is not SolutionStatus.optimal:
        raise NoOptimalSolutionError(f"{NAME}: {results.extra_info.solver_message}")
    if config.load_solutions and results.solution_status is not SolutionStatus.noSolution:
        results.solution_loader.load_solution()
    return results


class LegacyCasadiIpopt(LegacySolverWrapper, CasadiIpopt):
    """``pyomo.environ.SolverFactory('casadi_ipopt')``: no option of one call outlives it."""

    def solve(self, model, **kwds):
        """Solve ``model``; see ``CasadiIpopt.solve``.  Ipopt's word is in ``results.solver.message``."""
        kept = self.config.value()
        try:
            return super().solve(model, **kwds)
        finally:
            self.config.solver_options.reset()
            self.config.set_value(kept)

    def _map_results(self, model, results):
        legacy, solution = super()._map_results(model, results)
        legacy.solver.message = results.extra_info.solver_message
        for name, entry in results.extra_info.items():
            setattr(legacy.solver, name, entry)
        return legacy, solution


SolverFactory.register(NAME, doc="The Ipopt in casadi's wheel: an NLP solver without an executable")(CasadiIpopt, LegacyCasadiIpopt)
