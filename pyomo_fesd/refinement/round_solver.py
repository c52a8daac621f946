"""Discretise and solve one round: by simulation without an objective, by ``mpec_hybrid`` with one."""

from pyomo.core import Block, TransformationFactory, Var
from pyomo.dae import ContinuousSet
from pyomo.gdp import Disjunct
from pyomo.opt import SolverFactory, TerminationCondition

from pyomo_fesd.core import FesdError, kept_values, moving_grids, withheld_messages
from pyomo_fesd.mpcc import Deadline
from pyomo_fesd.refinement.checks import degree_of_freedom, objectives
from pyomo_fesd.refinement.dense_output import RoundSolution
from pyomo_fesd.refinement.interpolated_start import start_from
from pyomo_fesd.refinement.mesh import Mesh
from pyomo_fesd.simulation import TooFewElements, simulate

#: Ipopt iterations of a round that a finer one follows: on a grid that is too coarse, searches for a feasible point do not end.
IMPATIENT = 5000


class RoundSolver:
    """Discretises with the ``keywords`` of ``fesd.finite_elements`` and solves with the ``options`` of ``mpec_hybrid``.

    Attributes
    ----------
    ncp, order : int
        collocation points in each element; order of the scheme
    optimise : bool
        whether there is an objective
    deadline : Deadline
        of all rounds
    patient : bool
        whether a round may use all iterations that the options allow: no finer one follows
    results : SolverResults or None
        of the last optimisation
    """

    def __init__(self, model: Block, wrt: ContinuousSet, keywords: dict, options: dict):
        self._model, self._wrt, self._keywords, self._options = model, wrt, keywords, dict(options)
        self.deadline = Deadline.after(self._options.pop('time_limit', None))
        self.ncp = keywords['ncp']
        self.order = 2 * self.ncp - (keywords['scheme'] == 'LAGRANGE-RADAU')
        self.optimise = any(True for _ in objectives(model))
        self.results, self.patient = None, False

    def solve(self, mesh: Mesh, before: RoundSolution | None) -> FesdError | None:
        """Solve on a mesh, starting from ``before``; returns the error if there is no solution, else None."""
        self.discretise(mesh)
        return self._optimise(mesh.numbers, before) if self.optimise else self._simulate()

    def discretise(self, mesh: Mesh) -> None:
        """Put a mesh on the model."""
        grid = {'nfe': mesh.numbers, 'fixed_points': mesh.points}
        TransformationFactory('fesd.finite_elements').apply_to(self._model, wrt=self._wrt, **grid, **self._keywords)

    def _simulate(self):
        held = moving_grids(self._model)[self._wrt].held
        if len(held):
            raise degree_of_freedom(held[1].body.args[0])
        try:
            simulate(self._model, self._wrt, time_limit=self.deadline.left(), **self._options)
        except FesdError as error:
            if error.component != self._wrt.name:
                raise
            # the simulation cannot go on: more elements may help
            return error
        return None

    def _hopeless(self):
        """The error of a simulation with the present values for which the elements are too few; None if it has another end.

        An optimisation with more switches than elements burns its iterations, while a finer round costs little more.
        """
        variables = list(self._model.component_data_objects(Var, descend_into=(Block, Disjunct)))
        try:
            with kept_values(variables), withheld_messages('pyomo_fesd'):
                simulate(self._model, self._wrt, time_limit=self.deadline.left())
        except TooFewElements as error:
            return error
        except FesdError:
            # nothing is known of a model that cannot be simulated
            return None
        return None

    def _optimise(self, numbers, before):
        hopeless = None if self.patient or before is not None else self._hopeless()
        if hopeless is not None:
            return hopeless
        if before is not None:
            start_from(self._model, self._wrt, before)
        options = {'warm_start': before is not None, 'timelimit': self.deadline.left()}
        if not self.patient:
            options['max_iterations'] = IMPATIENT
        options |= self._options
        self.results = SolverFactory('mpec_hybrid').solve(self._model, **options)
        if self.results.solver.termination_condition == TerminationCondition.userInterrupt:
            raise KeyboardInterrupt
        if str(self.results.solver.stationarity) == 'B':
            return None
        cause = f"refine: no certified solution with nfe={numbers}: {self.results.solver.reason}"
        return FesdError(self._wrt, cause, "give another start, or more elements in the first round (nfe)")
