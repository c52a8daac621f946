"""The options of ``mpec_hybrid``, one row each: name, default, domain, meaning."""

from pyomo.common.config import (
    Bool,
    ConfigDict,
    ConfigValue,
    In,
    NonNegativeInt,
    Path,
    PositiveFloat,
    PositiveInt,
    document_configdict,
)
from pyomo.contrib.solver.common.config import SolverConfig

from pyomo_fesd.mpcc import NATURAL_UNITS, RELAXATIONS


def solver_name(given):
    """Domain of options that are names."""
    if not isinstance(given, str):
        raise ValueError(f"not a name: {given!r}")
    return given


def function(given):
    """Domain of options that are functions."""
    if not callable(given):
        raise ValueError(f"not callable: {given!r}")
    return given


def executor(given):
    """Domain of the option ``executor``: an object with the methods of ``concurrent.futures.Executor``."""
    if not callable(getattr(given, 'submit', None)):
        raise ValueError("not an executor: it has no method 'submit' like those of concurrent.futures")
    return given


OPTIONS = (
    ('eps_init', 1.0, PositiveFloat, "first relaxation parameter eps of Reg(eps) (eq. 15)"),
    ('eps_final', 1e-9, PositiveFloat, "smallest eps; the homotopy usually ends earlier, at a certified branch"),
    ('eps_factor', 0.1, PositiveFloat, "eps is multiplied by this after each relaxation (1/Q)"),
    (
        'relaxation',
        'auto',
        In(['auto', *RELAXATIONS]),
        "form of Reg(eps): 'elastic' (one slack, weight 1/eps), 'scholtes' (products <= eps), others of the same kind, or "
        "'auto': elastic, and after a failure or without a certified point paths that begin with scholtes",
    ),
    (
        'mode',
        'hybrid',
        In(['hybrid', 'relaxation']),
        "'hybrid': branches and certificates; 'relaxation': only the homotopy, down to eps_final, without any certificate",
    ),
    (
        'lpec',
        'auto',
        In(['auto', 'reduced', 'full']),
        "'reduced': binaries for bi-active pairs only; 'full': also an LPEC with a binary for every pair that searches for a "
        "better branch within the trust region after each certificate, with at most 100 nodes; 'auto': full for up to 50 pairs",
    ),
    (
        'warm_start',
        False,
        In([True, False, 'only']),
        "begin at the branch that the values in the model name; if its solution is certified, the run ends there, at the local "
        "solution next to the start, without a homotopy; of several starts this applies to the first one; with 'only' the run "
        "ends there in any case",
    ),
    (
        'simulate_first',
        'auto',
        In(['auto', True, False]),
        "simulate first (pyomo_fesd.simulate) and start from these values: 'auto' where there is no objective and no state is "
        "fixed later, elsewhere if the homotopy finds no feasible point, and after each relaxation, with its controls, where "
        "states jump; with True controls keep their values, and the run goes on as with warm_start; a simulation that fails is "
        "noted in the log, and the run begins with the model's values",
    ),
    (
        'nlp_solver',
        'ipopt',
        solver_name,
        "NLP solver: 'ipopt' (the one in casadi's wheel), 'uno' (also there), 'cyipopt' (the system's Ipopt), or an "
        "executable that reads NL files and that Pyomo knows, e.g. 'pounce', 'asl:ipopt'",
    ),
    ('relaxation_tol', 1e-4, PositiveFloat, "Ipopt's tol for relaxations, which only lead to a branch"),
    (
        'relaxation_iterations',
        500,
        PositiveInt,
        "Ipopt iterations allowed to one relaxation; one without multipliers to start from may use four times as many",
    ),
    ('gap_tol', 5e-5, PositiveFloat, "gap test: relative distance of incumbent and relaxed objective that ends a run"),
    ('feasibility_tol', 1e-6, PositiveFloat, "largest scaled violation and complementarity of a reported point"),
    ('biactive_tol', 1e-6, PositiveFloat, "sides below this are both zero at a branch solution (eq. 16)"),
    (
        'descent_tol',
        1e-6,
        PositiveFloat,
        "relative descent of an LPEC below this does not count (theory: free of units and of the objective's offset)",
    ),
    (
        'eta_tol',
        1e-3,
        PositiveFloat,
        "a branch imposes the constraint of a decided pair where its eta is above this (eq. 13); the eta of step equilibration "
        "is 1 where no mode switches",
    ),
    ('trust_radius', 1.0, PositiveFloat, "trust region Delta of the LPEC, relative for large variables (eq. 17)"),
    ('branch_tol', 1e-9, PositiveFloat, "Ipopt's tol for branch NLPs"),
    ('branch_iterations', 300, PositiveInt, "Ipopt iterations allowed to one branch NLP; a wrong branch uses all of them"),
    ('max_iterations', 20000, PositiveInt, "Ipopt iterations allowed in all; with several starts, to each"),
    ('starts', 1, PositiveInt, "number of points to solve from, the first being the model's values; the best solution is kept"),
    (
        'starts_vary',
        'variables',
        In(['variables', 'controls']),
        "what is random in further starts: 'variables' (all of them), or 'controls' (those held on control stages, with which the "
        "plant is simulated; all other variables have the simulated values)",
    ),
    ('seed', 0, NonNegativeInt, "of the random points: the same seed gives the same points"),
    (
        'executor',
        None,
        executor,
        "where the starts run: None for one by one in this process, or an executor of concurrent.futures or with its "
        "methods, e.g. ProcessPoolExecutor() or Dask's client.get_executor()",
    ),
    ('user_scaling', True, Bool, "apply Pyomo's scaling_factor suffixes"),
    (
        'natural_units',
        'auto',
        In(NATURAL_UNITS),
        "what shows the sizes of variables and rows that have no such factor; what is far from 1 is scaled: 'starts' (start "
        "values), 'coefficients' (of linear terms, and bounds), 'auto' (start values on a moving grid, coefficients of linear "
        "and of small MPCCs), 'user' (nothing is scaled, nor is a small or huge objective and its offset)",
    ),
    ('review', True, Bool, "check the solution on moving elements afterwards (``results.extra_info.warnings``)"),
    (
        'callback',
        None,
        function,
        "called with a Progress after every relaxation and the branches explored from it; if it returns something true, the run "
        "ends with the best point so far; not together with an executor",
    ),
    ('log_file', None, Path(), "file for the log that tee=True prints, whether or not tee is on"),
    ('json_file', None, Path(), "file for a record of the run, also of one that fails: attach it to a bug report"),
)
#: Options that are passed to other solvers unchanged.
PASSED_ON = (
    ('nlp_options', "options passed to Ipopt, e.g. {'max_iter': 3000}"),
    ('lpec_options', "options passed to HiGHS, e.g. {'threads': 2}"),
)


@document_configdict()
class MpecHybridConfig(SolverConfig):
    """Options of ``mpec_hybrid``."""

    def __init__(self, description=None, doc=None, implicit=False, implicit_domain=None, visibility=0):
        super().__init__(
            description=description, doc=doc, implicit=implicit, implicit_domain=implicit_domain, visibility=visibility
        )
        for name, default, domain, text in OPTIONS:
            setattr(self, name, self.declare(name, ConfigValue(default=default, domain=domain, description=text)))
        for name, text in PASSED_ON:
            setattr(self, name, self.declare(name, ConfigDict(implicit=True, description=text)))
