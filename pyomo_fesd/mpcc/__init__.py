"""MPCC -> certified solution (theory, eq. 14-17): min f(x) s.t. constraints and 0 <= G(x) perp H(x) >= 0.  Knows no time.

Read in this order: ``compile`` (a Pyomo model as casadi functions), ``nlp`` (NLP solvers behind one contract), ``subproblems``
(relaxation, branch, LPEC, certificate), ``algorithm`` (the hybrid active-set algorithm), ``reporting`` (results, log, callback,
record), ``multistart``.  The plug-ins of ``pyomo_fesd.solvers`` put them together:

    compiled = compile_mpcc(read_mpcc(model), timer)     MpccFunctions
    cache = SolverCache(compiled);  cache.prepare(options)
    run = HybridSolver(Setup(compiled, options, timer, deadline, cache, show, after)).solve()
    fill_results(results, model, run, loaded, compiled)
"""

from pyomo_fesd.mpcc.algorithm import HybridSolver, Outcome, Run, Setup, Tolerances, is_exact
from pyomo_fesd.mpcc.compile import (
    NATURAL_UNITS,
    Contradiction,
    Snapshot,
    beside,
    certain_constants,
    compile_mpcc,
    parameter_data,
    plain_nlp,
    read_mpcc,
    row_factors,
    side_factors,
    start_value,
    variable_factors,
    without_small,
)
from pyomo_fesd.mpcc.multistart import Multistart
from pyomo_fesd.mpcc.nlp import Deadline, OutOfTime, PlainIpopt
from pyomo_fesd.mpcc.reporting import Loader, LogTable, RunRecord, StartsTable, fill_results, log_streams, reporter
from pyomo_fesd.mpcc.subproblems import (
    FREE,
    RELAXATIONS,
    Certificate,
    Lpec,
    SolverCache,
    active_sets,
    certify_point,
    settle,
    sort_sides,
    without_constant,
)
