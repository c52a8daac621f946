"""``refine``: the user says a tolerance, not a number of elements.

Rounds of solutions on grids that grow until the estimated error (``estimate``) is below the tolerance; the error and what the
solution looks like tell how many elements come next, and in which control stages (``placing``).

Takes: a model before ``fesd.finite_elements``.
Leaves: the model on its last grid, solved; after an error as it was.
Does not apply: to errors that no grid shows, such as a local minimum in place of the global one.
"""

import logging
import time
from math import ceil, nan

import numpy as np
from pyomo.core import TransformationFactory

from pyomo_fesd.accuracy.attempt import attempt
from pyomo_fesd.accuracy.checks import check, data_of
from pyomo_fesd.accuracy.judgement import Round, comparable, judge
from pyomo_fesd.accuracy.placing import most_numbers
from pyomo_fesd.accuracy.solution import read_solution
from pyomo_fesd.accuracy.solver import Solver
from pyomo_fesd.accuracy.table import ERRORS, Refinement, Table
from pyomo_fesd.elements.grid import share_elements
from pyomo_fesd.excursions import excursions
from pyomo_fesd.switching import switching_functions
from pyomo_fesd.timeindex import find_continuous_set

logger = logging.getLogger('pyomo_fesd')

#: Elements of the first round, if the user does not say: all together, and at least in each control stage.
FIRST, FIRST_EACH = 8, 2
#: How exactly equations are solved, as a part of the tolerance; within what Ipopt can do.
EXACT = 1e-3
#: Notes of rounds that cannot be compared with the one before, or with any.
OTHERWISE, OVERLOOKED = 'modes in another order than before', 'a switch is overlooked between two stage points'
NOT_REACHED = (
    "refine: the tolerance %.1e is not reached in %d rounds; the estimated error is %.1e. Take more rounds (max_rounds), "
    "more points (ncp), or more elements in the first round (nfe)."
)


def refine(
    model, tolerance=1e-6, wrt=None, nfe=None, ncp=3, scheme='LAGRANGE-RADAU', quantities=None, max_rounds=12, tee=False, **options
):
    """Discretise and solve ``model`` with as many elements as ``tolerance`` asks for.

    Without an objective each round is a simulation (``simulate``); with one, ``mpec_hybrid`` solves it, from the second round on
    from the trajectory of the round before.

    Parameters
    ----------
    model : Block
        after ``fesd.dcs``, before ``fesd.finite_elements``
    tolerance : float
        for the error of states at element boundaries, of switching times and of the objective, each relative to
        max(1, |value|); in the place of 1 the inverse of a state's ``scaling_factor`` if it has one, and the horizon for
        times if it is shorter
    wrt : ContinuousSet, optional
    nfe : int or list of int, optional
        elements of the first round, as in ``fesd.finite_elements``
    ncp, scheme :
        as in ``fesd.finite_elements``
    quantities : component or list of components, optional
        if given, the values of these count, and nothing else: at the times that the model has now if they are over time
    max_rounds : int
        at least 2, as an error is estimated by comparison
    tee : bool
        print the table as it grows
    options :
        other keywords of ``fesd.finite_elements``, and options of ``mpec_hybrid``

    Returns
    -------
    Refinement
        with ``reached``, ``error`` and ``table``; a warning says if the tolerance is not reached.  The model is discretised and
        solved on the last grid.

    Raises
    ------
    FesdError
        if no round has a solution; for a model that is discretised already, or that has freedom and no objective.  The model is
        as it was before.
    """
    wrt = find_continuous_set(model, wrt, 'refine')
    check(model, wrt, tolerance, max_rounds)
    quantities = data_of(quantities)
    elements = TransformationFactory('fesd.finite_elements').CONFIG
    keywords = {name: options.pop(name) for name in list(options) if name in elements} | {'ncp': ncp, 'scheme': scheme}
    stages = len(wrt) - 1
    numbers = share_elements(wrt, nfe if nfe is not None else stages * max(FIRST_EACH, ceil(FIRST / stages)))
    options = {'branch_tol': float(np.clip(EXACT * tolerance, 1e-12, 1e-9))} | options
    solver = Solver(model, wrt, keywords, options)
    table = Table({'objective': not solver.optimise, 'quantities': not quantities}, tee)
    return _Refining(model, wrt, tolerance, solver, quantities, table).run(numbers, max_rounds)


class _Refining:
    """The rounds of one call."""

    def __init__(self, model, wrt, tolerance, solver, quantities, table):
        self._model, self._wrt, self._tolerance = model, wrt, tolerance
        self._solver, self._quantities, self._table = solver, quantities, table
        self._most = most_numbers(wrt, solver.ncp)
        # rounds of which each can be compared with the one before; the last one that had a solution, and its error
        self._rounds, self._best, self._error = [], None, nan

    def run(self, numbers, max_rounds):
        """Rounds until the tolerance is reached, or nothing more can be done."""
        last = False
        while not last:
            with attempt(self._model, self._wrt) as now:
                started = time.perf_counter()
                failure = self._solver.solve(numbers, self._best)
                row, following = self._judge(numbers) if failure is None else self._fail(numbers, 'no solution: ' + failure.cause)
                self._table.add(row | {'seconds': time.perf_counter() - started})
                reached = failure is None and self._error <= self._tolerance
                last = reached or len(self._table) == max_rounds or following == numbers
                if last and failure is None:
                    now.keep()
            numbers = following
        if failure is not None:
            self._return_to_best(failure)
        if not reached:
            logger.warning(NOT_REACHED, self._tolerance, len(self._table), self._error)
        return Refinement(reached, self._error, self._table.frame, self._solver.results)

    def _fail(self, numbers, note):
        """A row of the table, and the next numbers of elements, after a round that tells nothing."""
        self._rounds = []
        row = {'nfe': numbers, 'elements': sum(numbers), 'note': note}
        return row, [min(2 * n, most) for n, most in zip(numbers, self._most)]

    def _judge(self, numbers):
        """The same for a round with a solution."""
        self._best, self._error = Round(numbers, read_solution(self._model, self._wrt, self._quantities)), nan
        if any(True for _ in excursions(self._model, self._wrt, switching_functions(self._model, self._wrt))):
            return self._fail(numbers, OVERLOOKED)
        lost = bool(self._rounds) and not comparable(self._rounds[-1], self._best)
        self._rounds = [self._best] if lost else [*self._rounds, self._best]
        found = judge(self._rounds, self._solver.order, self._tolerance, self._most)
        self._error = float(found.error.largest)
        row = {'nfe': numbers, 'elements': sum(numbers), 'order': found.order, 'pairs': self._best.solution.pairs}
        row |= {name: getattr(found.error, name) for name in ERRORS}
        return row | {'note': OTHERWISE if lost else ''}, found.following

    def _return_to_best(self, failure):
        """The last round had no solution: the last one that had one is solved again."""
        if self._best is None:
            raise failure
        with attempt(self._model, self._wrt) as now:
            again = self._solver.solve(self._best.numbers, self._best)
            if again is not None:
                raise again
            now.keep()
