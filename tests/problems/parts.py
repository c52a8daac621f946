"""The parts of the solver, put together as ``mpec_hybrid`` does, for tests that call one of them."""

from dataclasses import dataclass

from problems import carried
from pyomo.common.timing import HierarchicalTimer

from pyomo_fesd.mpcc.algorithm.branches import Branches
from pyomo_fesd.mpcc.algorithm.gap_test import GapTest
from pyomo_fesd.mpcc.algorithm.hybrid import GLOBAL_LPEC_SEARCH
from pyomo_fesd.mpcc.algorithm.state import Run, Setup, Tolerances
from pyomo_fesd.mpcc.algorithm.subsolves import Subsolves
from pyomo_fesd.mpcc.compile.compile import compile_mpcc
from pyomo_fesd.mpcc.compile.mpcc_functions import MpccFunctions
from pyomo_fesd.mpcc.compile.parameters import parameter_data
from pyomo_fesd.mpcc.compile.read_mpcc import read_mpcc
from pyomo_fesd.mpcc.nlp.deadline import Deadline
from pyomo_fesd.mpcc.subproblems.solver_cache import SolverCache
from pyomo_fesd.solvers.options import MpecHybridConfig


def compiled(model, parameters=()):
    """The compiled MPCC of a Pyomo model."""
    return compile_mpcc(read_mpcc(model), HierarchicalTimer(), parameters=parameter_data(parameters))


@dataclass
class Parts:
    """One run's parts; see their classes.  The model is kept, as variables only refer to it weakly."""

    model: object
    compiled: MpccFunctions
    setup: Setup
    run: Run
    subsolves: Subsolves
    gap: GapTest
    branches: Branches

    def point(self, **values):
        """w from the variables' names and values."""
        return [values[v.name] for v in self.compiled.variables]

    def kinds(self, kind):
        """The log entries of this kind."""
        return [entry for entry in self.run.steps if entry.kind == kind]


def parts(model, **options):
    """The parts for a Pyomo model and options of ``mpec_hybrid``."""
    config, c, run = MpecHybridConfig(), compiled(model), Run()
    config.set_value(options)
    cache = SolverCache(c)
    cache.prepare(config)
    setup = Setup(c, config, HierarchicalTimer(), Deadline(), cache, show=lambda entry: None, after=lambda run: None)
    subsolves = Subsolves(setup, Tolerances.of(config), run)
    gap = GapTest(config.gap_tol * 1e-2, config.gap_tol)
    return Parts(model, c, setup, run, subsolves, gap, Branches(subsolves, gap, GLOBAL_LPEC_SEARCH[config.lpec](c)))


def jump_inside_a_stage():
    """The parts for a state jump at t = 0.6, at the second of two inner boundaries of the first control stage, simulated."""
    p = parts(carried.simulated_with_jump(6))
    p.branches.explore_from(p.compiled.x0, False)
    return p
