"""``casadi_ipopt``: the Ipopt in casadi's wheel as an NLP solver for Pyomo and IDAES.

    min f(x)   s.t.   g_l <= g(x) <= g_u,   x_l <= x <= x_u

Takes: a model or a block of one, also the temporary blocks of Pyomo and IDAES; options in Ipopt's own names.
Leaves: values, multipliers in import suffixes; nothing else on the model.
Does not apply: to complementarities, modes and integers, which it refuses; to external functions.
If-then-else is casadi's: a kink, at which Ipopt may stall.
"""

import io
import logging
import time
from contextlib import contextmanager, nullcontext
from dataclasses import replace

import casadi as ca
from pyomo.common.config import ConfigDict, ConfigValue, document_class_CONFIG, document_configdict
from pyomo.common.gc_manager import PauseGC
from pyomo.common.tee import TeeStream, capture_output
from pyomo.contrib.solver.common.config import SolverConfig
from pyomo.contrib.solver.common.results import Results, SolutionStatus, TerminationCondition
from pyomo.core import Block

from pyomo_fesd.core import REDIRECTION, FesdError, interruptible, phase
from pyomo_fesd.mpcc import Contradiction, Loader, OutOfTime, PlainIpopt, compile_mpcc, is_exact, plain_nlp, read_mpcc
from pyomo_fesd.results import set_indicators
from pyomo_fesd.solvers.plugin import CasadiSolver, LegacyPlugin, deadline, with_structure
from pyomo_fesd.solvers.singular_start import with_perturbation
from pyomo_fesd.solvers.stand_in import ExecutableKeywords, LegacyExecutableKeywords, Replacement
from pyomo_fesd.solvers.unready_models import refuse_integers, refuse_unready
from pyomo_fesd.solvers.user_names import user_names

logger = logging.getLogger('pyomo_fesd')

NAME = 'casadi_ipopt'
#: Linear solvers in the wheel.
LINEAR_SOLVERS = ('mumps', 'spral')
#: Options of Ipopt's executable, not of Ipopt.
OF_EXECUTABLE = ('halt_on_ampl_error', 'option_file_name', 'wantsol', 'outlev')

_SOLVED = TerminationCondition.convergenceCriteriaSatisfied, SolutionStatus.optimal
_LATE = TerminationCondition.maxTimeLimit, SolutionStatus.unknown
#: Ipopt's status as Pyomo's condition and status; all others are errors.
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
    'Fixed values contradict': (TerminationCondition.provenInfeasible, SolutionStatus.noSolution),
}
TOO_LATE = 'Maximum_WallTime_Exceeded', 'Maximum WallTime Exceeded'
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
class CasadiIpopt(CasadiSolver):
    """Solve an NLP, or a square system, with the Ipopt in casadi's wheel: no executable, exact sparse derivatives.

    ``scaling_factor`` suffixes apply with ``nlp_scaling_method='user-scaling'``, as with Ipopt's executable, and with the NL
    writer's option ``scale_model``.
    """

    name, CONFIG = NAME, CasadiIpoptConfig()

    def version(self) -> tuple:
        """Version of casadi, which contains Ipopt."""
        return tuple(int(part) for part in ca.__version__.split('.')[:3])

    @interruptible
    def solve(self, model: Block, **kwds) -> Results:
        """Solve ``model``.

        Returns
        -------
        Results
            Pyomo's, and in ``extra_info``: ``return_status`` (Ipopt's word), ``iteration_count``, ``solver_message``

        Raises
        ------
        FesdError
            for a model that is not an NLP, for functions that cannot be evaluated and for options that Ipopt refuses
        NoOptimalSolutionError
            if Ipopt found no solution and ``raise_exception_on_nonoptimal_result`` is set
        """
        with _turn(kwds):
            return self._solve(model, kwds)

    def _solve(self, model, kwds):
        started = time.perf_counter()
        config = self._options(kwds)
        results = self._begin(config)
        options = _ipopts_own(config.solver_options.value())
        scaled = config.writer_config.scale_model or options.get('nlp_scaling_method') == 'user-scaling'
        try:
            with phase(config.timer, 'compile'), PauseGC():
                until = deadline(config, started)
                problem = _read_nlp(model)
                compiled = compile_mpcc(
                    problem, config.timer, config.working_dir, user_scaling=scaled, check=until.check, conditions=True
                )
                refuse_integers(compiled.variables, NAME)
        except (Contradiction, OutOfTime) as error:
            late = isinstance(error, OutOfTime)
            _conclude(results, *(TOO_LATE if late else ('Fixed values contradict', str(error))))
            results.solution_loader = Loader(model, None, None, None)
        else:
            with phase(config.timer, 'ipopt'):
                answer, results.solver_log = with_perturbation(
                    lambda more: _run(compiled, options | more, config.tee, until), compiled, options
                )
            answer = _as_exact_as_can_be(compiled, answer)
            _conclude(results, answer.status, answer.status.replace('_', ' '), answer.iterations)
            results.solution_loader = Loader(model, compiled, answer.w, answer, set_indicators)
            if results.solution_status is not SolutionStatus.optimal:
                results.extra_info.solver_message = with_structure(results.extra_info.solver_message, model)
            elif compiled.has_objective:
                results.incumbent_objective = compiled.objective(answer.f)
        results.timing_info.wall_time = time.perf_counter() - started
        self._load(results)
        self._refuse_nonoptimal(results, results.extra_info.solver_message)
        return results


def _read_nlp(model):
    """The model as an ``Mpcc`` without pairs."""
    refuse_unready(model, NAME)
    problem = read_mpcc(model)
    if problem.sources:
        name = user_names(model)(problem.sources[0])
        raise FesdError(name, f"an active Complementarity, which {NAME} does not handle", "use mpec_hybrid, or deactivate it")
    return problem


def _ipopts_own(options):
    """The user's options without those that this Ipopt does not know; some of them are defaults of IDAES."""
    for name in OF_EXECUTABLE:
        if name in options:
            logger.debug("%s: option %s belongs to Ipopt's executable and is left out", NAME, name)
    options = {name: value for name, value in options.items() if name not in OF_EXECUTABLE}
    requested = options.get('linear_solver', 'mumps')
    if requested not in LINEAR_SOLVERS and 'hsllib' not in options:
        logger.debug("%s: linear solver %s is not in casadi's wheel; mumps is used instead", NAME, requested)
        options['linear_solver'] = 'mumps'
    return options


def _run(compiled, options, streams, deadline):
    """Ipopt's NlpResult, and its output."""
    if options.get('nlp_scaling_method') == 'user-scaling':
        # the compiled problem is scaled already
        options = options | {'nlp_scaling_method': 'none'}
    budget = {'print_level': 5 if streams else 0, 'sb': 'no' if streams else 'yes'}
    if deadline.at is not None:
        budget['max_wall_time'] = max(deadline.left(), 1e-3)
    log, c = io.StringIO(), compiled
    with _captured(log, streams, budget | options):
        nlp = plain_nlp(c)
        ipopt = PlainIpopt('ipopt', nlp.x, nlp.p, nlp.f, nlp.g, budget, derivatives=nlp.derivatives, options=options)
        answer = ipopt.solve(c.x0, c.parameters, c.lbx, c.ubx, c.lbg, c.ubg)
    return answer, log.getvalue()


def _as_exact_as_can_be(compiled, answer):
    """The answer; solved where Ipopt's next step is too small because the rows, and nothing else, hold up to their round-off."""
    too_small = answer.status == 'Search_Direction_Becomes_Too_Small'
    if too_small and not compiled.has_objective and is_exact(compiled, answer.w):
        return replace(answer, status='Solved_To_Acceptable_Level')
    return answer


def _turn(kwds):
    """A turn among the threads for solves with ``tee``: the streams that it means are not those of another solve."""
    return REDIRECTION if kwds.get('tee') else nullcontext()


@contextmanager
def _captured(log, streams, options):
    """Send Ipopt's output to ``log`` and ``streams``, unless it is silent."""
    if options['print_level'] == 0:
        yield
        return
    with REDIRECTION, TeeStream(log, *streams) as tee, capture_output(tee.STDOUT, capture_fd=True):
        yield


def _conclude(results, status, message, iterations=0):
    results.termination_condition, results.solution_status = STATUS.get(status, FAILED)
    info = results.extra_info
    info.return_status, info.solver_message, info.iteration_count = status, message, iterations


class LegacyCasadiIpopt(LegacyPlugin, CasadiIpopt):
    """``pyomo.environ.SolverFactory('casadi_ipopt')``; Ipopt's word is in ``results.solver.message``; see ``CasadiIpopt``."""

    def solve(self, model, **kwds):
        """Solve ``model`` as in the new interface."""
        with _turn(kwds):
            return super().solve(model, **kwds)

    def _map_results(self, model, results):
        legacy, solution = super()._map_results(model, results)
        legacy.solver.message = results.extra_info.solver_message
        return legacy, solution


class StandInIpopt(ExecutableKeywords, CasadiIpopt):
    """``casadi_ipopt`` with the keywords of a solver that runs an executable."""


class LegacyStandInIpopt(LegacyExecutableKeywords, LegacyCasadiIpopt):
    """The same in Pyomo's older interface."""


def stand_in() -> Replacement:
    """Let the names ``ipopt`` and ``ipopt_v2`` mean the Ipopt in casadi's wheel, from now on or within a ``with`` block.

    Scripts and initialisers that name them, through ``SolverFactory`` of both interfaces, IDAES' ``get_solver`` or
    ``InitializerBase`` objects and their sub-models, then need no executable.  Importing the package never does this.

    Returns
    -------
    Replacement
        a context manager, which undoes the replacement when it is left; a call of its own lasts until ``undo()``

    Examples
    --------
    >>> with pyomo_fesd.casadi_ipopt.stand_in():
    ...     m.fs.unit.initialize()
    """
    return Replacement(LegacyStandInIpopt, StandInIpopt)
