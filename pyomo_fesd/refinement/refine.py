"""``refine``: choose the number of elements by a tolerance.

Rounds of solutions on growing grids, until the estimated error (``error_estimate``) is below the tolerance; error and solution
determine how many elements come next, and in which control stages (``element_density``).

Takes: a model before ``fesd.finite_elements``.
Leaves: the model on its last grid, solved; after an error as it was.
Does not apply: to errors that no grid shows, such as a local minimum instead of the global one.
"""

import logging
import time
from collections.abc import Sequence
from math import ceil, inf, isnan, nan
from operator import ge

import numpy as np
from pyomo.core import Block
from pyomo.dae import ContinuousSet

from pyomo_fesd.core import find_continuous_set, interruptible
from pyomo_fesd.diagnostics import diagnose, missed_crossings
from pyomo_fesd.refinement.assessment import Round, assess, comparable
from pyomo_fesd.refinement.checks import check, read_nfe, read_options, read_quantities
from pyomo_fesd.refinement.dense_output import read_solution
from pyomo_fesd.refinement.grading import graded
from pyomo_fesd.refinement.kept_values import read_values, write_values
from pyomo_fesd.refinement.mesh import first_mesh
from pyomo_fesd.refinement.refinement_result import ERRORS, Refinement, RoundTable
from pyomo_fesd.refinement.round_solver import RoundSolver
from pyomo_fesd.refinement.trial_round import trial_round
from pyomo_fesd.results import switching_functions

logger = logging.getLogger('pyomo_fesd')

#: Elements of the first round by default: in total, and at least in each control stage.
FIRST, FIRST_EACH = 8, 2
#: Rounds that new fixed points leave: with three, the order of the error is observed.
COMPARED = 3
#: Tolerance of the equations, as a part of that of the solution, and its limits by what Ipopt can do.
EXACT, EXACT_LIMITS = 1e-3, (1e-12, 1e-9)
#: Notes of rounds that cannot be compared with the one before, or with any.
OTHER_ORDER, OVERLOOKED = 'modes in another order than before', 'a switch is overlooked between two collocation points'
POINTS = 'new fixed points: %s'
NOT_REACHED = (
    "refine: the tolerance %.1e is not reached in %d rounds; the estimated error is %.1e. Take more rounds (max_rounds), "
    "more points (ncp), or more elements in the first round (nfe)."
)
TIME_IS_UP = (
    "refine: the tolerance %.1e is not reached in the %d rounds that the time limit allowed; the estimated error is %.1e. "
    "Give more time (time_limit)."
)


@interruptible
def refine(
    model: Block,
    tolerance: float = 1e-6,
    wrt: ContinuousSet | None = None,
    nfe: int | Sequence[int] | None = None,
    ncp: int = 3,
    scheme: str = 'LAGRANGE-RADAU',
    quantities=None,
    max_rounds: int = 12,
    tee: bool = False,
    **options,
) -> Refinement:
    """Discretise and solve ``model`` with as many elements as ``tolerance`` needs.

    Without an objective each round is a simulation (``simulate``); with one, ``mpec_hybrid`` solves it, from the second round on
    from the trajectory of the round before.

    Parameters
    ----------
    model : Block
        after ``fesd.dcs``, before ``fesd.finite_elements``
    tolerance : float
        for the error of states at element boundaries, of switching times and of the objective, each relative to
        max(1, |value|); instead of 1 the inverse of a state's ``scaling_factor`` if it has one, and the horizon for
        times if it is shorter
    wrt : ContinuousSet, optional
    nfe : int or list of int, optional
        elements of the first round, as in ``fesd.finite_elements``
    ncp, scheme :
        as in ``fesd.finite_elements``
    quantities : component or list of components, optional
        if given, only the values of these count: at the present points of the model if they are over time
    max_rounds : int
        at least 2, as an error is estimated by comparison
    tee : bool
        print the table as it grows
    options :
        other keywords of ``fesd.finite_elements``, and options of ``mpec_hybrid``; ``time_limit`` is that of all rounds together

    Returns
    -------
    Refinement
        with ``reached``, ``error`` and ``table``; a warning says if the tolerance is not reached.  The model is discretised and
        solved on the last grid.

    Raises
    ------
    FesdError
        if no round has a solution; for a model that is discretised already, or that has degrees of freedom and no objective.
        The model is as it was before.
    """
    wrt = find_continuous_set(model, wrt, 'refine')
    check(model, wrt, tolerance, max_rounds, tee)
    quantities = read_quantities(quantities)
    keywords, options = read_options(options | {'ncp': ncp, 'scheme': scheme})
    stages = len(wrt) - 1
    number = stages * max(FIRST_EACH, ceil(FIRST / stages)) if nfe is None else read_nfe(nfe)
    mesh = first_mesh(wrt, number, keywords.pop('fixed_points', ()))
    options = {'branch_tol': float(np.clip(EXACT * tolerance, *EXACT_LIMITS))} | options
    solver = RoundSolver(model, wrt, keywords, options)
    table = RoundTable({'objective': not solver.optimise, 'quantities': not quantities}, tee)
    return _Rounds(model, wrt, tolerance, solver, quantities, table, max_rounds).run(mesh)


class _Rounds:
    """The rounds of one call."""

    def __init__(self, model, wrt, tolerance, solver, quantities, table, max_rounds):
        self._model, self._wrt, self._tolerance = model, wrt, tolerance
        self._solver, self._quantities, self._table, self._max_rounds = solver, quantities, table, max_rounds
        # rounds of which each can be compared with the one before; the last one with a solution, and its error
        self._rounds, self._best, self._error = [], None, nan

    def run(self, mesh):
        """Solve rounds until the tolerance is reached, or no round can improve."""
        last = False
        while not last:
            with trial_round(self._model, self._wrt) as trial:
                started = time.perf_counter()
                most = mesh.most(self._solver.ncp)
                self._solver.patient = len(self._table) + 1 == self._max_rounds or all(map(ge, mesh.numbers, most))
                failure = self._solve(mesh)
                row, following = self._assess(mesh) if failure is None else self._fail(mesh, 'no solution: ' + failure.cause)
                seconds = time.perf_counter() - started
                self._table.add(row | {'seconds': seconds})
                reached = failure is None and self._error <= self._tolerance
                # the next round hardly takes less than this one
                out_of_time = self._solver.deadline.within(seconds)
                last = reached or len(self._table) == self._max_rounds or following == mesh or out_of_time
                if last and failure is None:
                    trial.keep()
            mesh = following
        if failure is not None:
            self._return_to_best(failure)
        if not reached:
            logger.warning(TIME_IS_UP if out_of_time else NOT_REACHED, self._tolerance, len(self._table), self._error)
        return Refinement(reached, self._error, self._best.mesh.points, self._table.frame, self._solver.results)

    def _solve(self, mesh):
        return self._solver.solve(mesh, None if self._best is None else self._best.solution)

    def _fail(self, mesh, note):
        """A row of the table, and the next mesh, after a round without a comparable solution."""
        self._rounds = []
        row = {'nfe': mesh.numbers, 'elements': sum(mesh.numbers), 'note': note}
        return row, mesh.with_numbers([min(2 * n, most) for n, most in zip(mesh.numbers, mesh.most(self._solver.ncp))])

    def _assess(self, mesh):
        """The same for a round with a solution."""
        solution = read_solution(self._model, self._wrt, self._quantities)
        new = [] if self._best is None else [t for t in mesh.points if t not in self._best.mesh.points]
        self._best, self._error = Round(mesh, solution, read_values(self._model), self._solver.results), nan
        if any(True for _ in missed_crossings(self._model, self._wrt, switching_functions(self._model, self._wrt))):
            return self._fail(mesh, OVERLOOKED)
        lost = bool(self._rounds) and not comparable(self._rounds[-1], self._best)
        self._rounds = [self._best] if lost else [*self._rounds, self._best]
        found = assess(self._rounds, self._solver.order, self._tolerance)
        self._error = float(found.error.largest)
        row = {'nfe': mesh.numbers, 'elements': sum(mesh.numbers), 'order': found.order, 'pairs': self._best.solution.pairs}
        row |= {name: getattr(found.error, name) for name in ERRORS}
        row['note'] = OTHER_ORDER if lost else POINTS % ', '.join(f'{t:g}' for t in new) if new else ''
        return row, self._graded(mesh, solution, found.order) or mesh.with_numbers(found.following)

    def _graded(self, mesh, solution, observed):
        """The next mesh if it gets fixed points, and enough rounds are left; else None."""
        if len(self._table) + 1 + COMPARED > self._max_rounds:
            return None
        # two rounds alone overestimate the error
        estimate = 0.0 if isnan(observed) or self._error == inf else self._error
        following = graded(mesh, solution, self._solver.order, self._tolerance, estimate)
        if following is not None:
            # solutions on meshes with other points are not compared
            self._rounds = []
        return following

    def _return_to_best(self, failure):
        """Return to the last round with a solution, as the last round has none."""
        if self._best is None:
            raise failure
        with trial_round(self._model, self._wrt) as trial:
            self._solver.discretise(self._best.mesh)
            write_values(self._model, self._best.values)
            diagnose(self._model)
            trial.keep()
        self._solver.results = self._best.results
