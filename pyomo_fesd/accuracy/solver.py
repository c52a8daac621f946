"""How the model of one round is solved: simulated without an objective, by ``mpec_hybrid`` with one."""

from pyomo.core import TransformationFactory
from pyomo.opt import SolverFactory, TerminationCondition

from pyomo_fesd.accuracy.checks import objectives, refuse_freedom
from pyomo_fesd.accuracy.start import start_from
from pyomo_fesd.errors import FesdError
from pyomo_fesd.march.simulate import simulate
from pyomo_fesd.records import records


class Solver:
    """Discretises and solves.

    Parameters
    ----------
    model : Block
    wrt : ContinuousSet
    keywords : dict
        of ``fesd.finite_elements``, without ``nfe``
    options : dict
        of ``mpec_hybrid``
    """

    def __init__(self, model, wrt, keywords, options):
        self._model, self._wrt, self._keywords, self._options = model, wrt, keywords, options
        self.optimise = any(True for _ in objectives(model))
        self.results = None

    @property
    def ncp(self):
        """Collocation points in each element."""
        return self._keywords['ncp']

    @property
    def order(self):
        """Of the scheme."""
        return 2 * self.ncp - (1 if self._keywords['scheme'] == 'LAGRANGE-RADAU' else 0)

    def solve(self, numbers, before):
        """Solve on a grid with these numbers of elements; returns the error that says why there is no solution, or None.

        Parameters
        ----------
        numbers : list of int
        before : Round or None
            where to begin
        """
        TransformationFactory('fesd.finite_elements').apply_to(self._model, wrt=self._wrt, nfe=numbers, **self._keywords)
        return self._optimised(numbers, before) if self.optimise else self._simulated()

    def _simulated(self):
        held = records(self._model).grids[self._wrt].held
        if len(held):
            refuse_freedom(held[1].body.args[0])
        try:
            simulate(self._model, self._wrt, **self._options)
        except FesdError as error:
            if error.component != self._wrt.name:
                raise
            # of a march that cannot go on: more elements may help
            return error
        return None

    def _optimised(self, numbers, before):
        if before is not None:
            start_from(self._model, self._wrt, before.solution)
        options = {'warm_start': before is not None} | self._options
        self.results = SolverFactory('mpec_hybrid').solve(self._model, **options)
        if self.results.solver.termination_condition == TerminationCondition.userInterrupt:
            raise KeyboardInterrupt
        if str(self.results.solver.stationarity) == 'B':
            return None
        cause = f"refine: no certified solution with nfe={numbers}: {self.results.solver.reason}"
        return FesdError(self._wrt, cause, "give another start, or more elements in the first round (nfe)")
