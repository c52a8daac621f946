"""The parts of the solver, put together as ``mpec_hybrid`` does, for tests that call one of them."""

from dataclasses import dataclass

from pyomo.common.timing import HierarchicalTimer

from pyomo_fesd.mpcc.branches import Branches
from pyomo_fesd.mpcc.built import Built
from pyomo_fesd.mpcc.compile import compile_problem
from pyomo_fesd.mpcc.compiled import Compiled
from pyomo_fesd.mpcc.config import MpecHybridConfig
from pyomo_fesd.mpcc.deadline import Deadline
from pyomo_fesd.mpcc.gap import GapTest
from pyomo_fesd.mpcc.hybrid import FAR_SIGHTED
from pyomo_fesd.mpcc.parameters import parameter_data
from pyomo_fesd.mpcc.problem import read_problem
from pyomo_fesd.mpcc.run import Run, Tolerances
from pyomo_fesd.mpcc.steps import Steps


def compiled(model, parameters=()):
    """The compiled MPCC of a Pyomo model."""
    return compile_problem(read_problem(model), HierarchicalTimer(), parameters=parameter_data(parameters))


@dataclass
class Parts:
    """One run's parts; see their classes."""

    compiled: Compiled
    run: Run
    steps: Steps
    gap: GapTest
    branches: Branches

    def point(self, **values):
        """w from the variables' names and values."""
        return [values[v.name] for v in self.compiled.variables]

    def kinds(self, kind):
        """The steps of this kind."""
        return [step for step in self.run.steps if step.kind == kind]


def parts(model, **options):
    """The parts for a Pyomo model and options of ``mpec_hybrid``."""
    config, c, run = MpecHybridConfig(), compiled(model), Run()
    config.set_value(options)
    built = Built(c)
    built.prepare(config)
    tolerances = Tolerances.of(config)
    steps = Steps(c, config, tolerances, run, HierarchicalTimer(), lambda step: None, Deadline(), built)
    gap = GapTest(config.gap_tol * 1e-2, config.gap_tol)
    return Parts(c, run, steps, gap, Branches(c, steps, tolerances, gap, FAR_SIGHTED[config.lpec](c)))
