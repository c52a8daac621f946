"""``refine``: the user says a tolerance, not a number of elements.

Rounds of solutions on grids that grow until the estimated error (``estimate``) is below the tolerance; the error and what the
solution looks like tell how many elements come next, and in which control stages (``placing``).

Takes: a model before ``fesd.finite_elements``.
Leaves: the model on its last grid, solved; after an error as it was.
Does not apply: to errors that no grid shows, such as a local minimum in place of the global one.
"""

import logging
import time
from dataclasses import dataclass
from math import ceil, nan

import numpy as np
import pandas as pd
from pyomo.core import Block, Objective, TransformationFactory
from pyomo.opt import SolverFactory, TerminationCondition

from pyomo_fesd.accuracy.attempt import attempt
from pyomo_fesd.accuracy.judgement import Round, comparable, judge
from pyomo_fesd.accuracy.placing import most_numbers
from pyomo_fesd.accuracy.solution import read_solution
from pyomo_fesd.accuracy.start import start_from
from pyomo_fesd.elements.grid import share_elements
from pyomo_fesd.errors import FesdError
from pyomo_fesd.march.simulate import simulate
from pyomo_fesd.records import records
from pyomo_fesd.timeindex import TimeIndex, derivatives, discretised, find_continuous_set

logger = logging.getLogger('pyomo_fesd')

#: Elements of the first round, if the user does not say: all together, and at least in each control stage.
FIRST, FIRST_EACH = 8, 2
#: How exactly equations are solved, as a part of the tolerance; within what Ipopt can do.
EXACT = 1e-3
#: Columns of errors, and those of the table that may be left out.
COLUMNS = ('states', 'switches', 'objective', 'quantities')
OPTIONAL = ('objective', 'quantities')
NOT_REACHED = (
    "refine: the tolerance %.1e is not reached in %d rounds; the estimated error is %.1e. Take more rounds (max_rounds), more points "
    "(ncp), or more elements in the first round (nfe)."
)


@dataclass(frozen=True)
class Refinement:
    """What ``refine`` has done; prints as a table.

    Attributes
    ----------
    reached : bool
        whether the estimated error is below the tolerance
    error : float
        the estimate, nan if there is none
    table : pandas.DataFrame
        a row for each round: ``nfe`` (elements of each control stage), estimated errors of ``states``, ``switches`` and
        ``objective`` (or ``quantities``), the ``order`` that was observed, ``pairs``, ``seconds``, and a ``note``
    results : SolverResults or None
        of ``mpec_hybrid`` in the last round; None after a simulation
    """

    reached: bool
    error: float
    table: pd.DataFrame
    results: object

    def __repr__(self):
        return _lines(self.table)

    __str__ = __repr__


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
    _check(model, wrt, tolerance, max_rounds)
    elements = TransformationFactory('fesd.finite_elements').CONFIG
    keywords = {name: options.pop(name) for name in list(options) if name in elements} | {'ncp': ncp, 'scheme': scheme}
    stages = len(wrt) - 1
    numbers = share_elements(wrt, nfe if nfe is not None else stages * max(FIRST_EACH, ceil(FIRST / stages)))
    return _Refining(model, wrt, tolerance, keywords, options, _data(quantities), tee).run(numbers, max_rounds)


class _Refining:
    """The rounds of one call."""

    def __init__(self, model, wrt, tolerance, keywords, options, quantities, tee):
        self._model, self._wrt, self._tolerance = model, wrt, tolerance
        self._keywords, self._quantities, self._tee = keywords, quantities, tee
        self._optimise = any(True for _ in _objectives(model))
        self._options = {'branch_tol': float(np.clip(EXACT * tolerance, 1e-12, 1e-9))} | options
        self._scheme = 2 * keywords['ncp'] - (1 if keywords['scheme'] == 'LAGRANGE-RADAU' else 0)
        self._most = most_numbers(wrt, keywords['ncp'])
        # rounds that can be compared, each with the one before; the last one that had a solution
        self._rounds, self._best, self._rows = [], None, []
        self._results = None

    def run(self, numbers, max_rounds):
        """Rounds until the tolerance is reached, or nothing more can be done."""
        last = False
        while not last:
            with attempt(self._model, self._wrt) as now:
                started = time.perf_counter()
                failure = self._solve(numbers)
                error, following = self._judge(numbers, failure)
                self._rows[-1]['seconds'] = time.perf_counter() - started
                self._say()
                reached = error <= self._tolerance
                last = reached or len(self._rows) == max_rounds or following == numbers
                if last and failure is None:
                    now.keep()
            numbers = following
        if failure is not None:
            self._return_to_best(failure)
        if not reached:
            logger.warning(NOT_REACHED, self._tolerance, len(self._rows), error)
        return Refinement(reached, error, self._table(), self._results)

    def _solve(self, numbers):
        """One round; returns the error that says why there is no solution, or None."""
        TransformationFactory('fesd.finite_elements').apply_to(self._model, wrt=self._wrt, nfe=numbers, **self._keywords)
        return self._optimised(numbers) if self._optimise else self._simulated()

    def _simulated(self):
        held = records(self._model).grids[self._wrt].held
        if len(held):
            _refuse_freedom(next(iter(held.values())).body.args[0])
        try:
            simulate(self._model, self._wrt, **self._options)
        except FesdError as error:
            if error.component != self._wrt.name:
                raise
            # of a march that cannot go on: more elements may help
            return error
        return None

    def _optimised(self, numbers):
        if self._best is not None:
            start_from(self._model, self._wrt, self._best.solution)
        options = {'warm_start': True} if self._best is not None else {}
        self._results = SolverFactory('mpec_hybrid').solve(self._model, load_solutions=True, **(options | self._options))
        if self._results.solver.termination_condition == TerminationCondition.userInterrupt:
            raise KeyboardInterrupt
        if str(self._results.solver.stationarity) == 'B':
            return None
        cause = f"refine: no certified solution with nfe={numbers}: {self._results.solver.reason}"
        return FesdError(self._wrt, cause, "give another start, or more elements in the first round (nfe)")

    def _judge(self, numbers, failure):
        """A row of the table; the estimated error, nan if there is none, and the next numbers of elements."""
        row = {'nfe': list(numbers), 'elements': sum(numbers)}
        self._rows.append(row)
        if failure is not None:
            self._rounds = []
            row['note'] = 'no solution: ' + failure.cause
            return nan, [min(2 * n, most) for n, most in zip(numbers, self._most)]
        now = Round(list(numbers), read_solution(self._model, self._wrt, self._quantities))
        row['note'] = ''
        if self._rounds and not comparable(self._rounds[-1], now):
            self._rounds = []
            row['note'] = 'active sets in another order than before'
        self._rounds.append(now)
        self._best = now
        found = judge(self._rounds, self._scheme, self._tolerance, self._most)
        row |= {c: getattr(found.error, c) for c in COLUMNS} | {'order': found.order, 'pairs': now.solution.pairs}
        return found.error.largest, found.following

    def _return_to_best(self, failure):
        """The last round had no solution: the one before it that had one is solved again."""
        if self._best is None:
            raise failure
        with attempt(self._model, self._wrt) as now:
            failure = self._solve(self._best.numbers)
            if failure is not None:
                raise failure
            now.keep()

    def _table(self):
        columns = ['nfe', 'elements', *COLUMNS, 'order', 'pairs', 'seconds', 'note']
        table = pd.DataFrame(self._rows, columns=columns, index=pd.RangeIndex(1, 1 + len(self._rows), name='round'))
        return table.drop(columns=[c for c in OPTIONAL if table[c].isna().all()])

    def _say(self):
        if self._tee:
            print(_lines(self._table().tail(1)).splitlines()[-1] if len(self._rows) > 1 else _lines(self._table()), flush=True)


def _lines(table):
    return table.to_string(float_format='{:.1e}'.format, na_rep='-')


def _objectives(model):
    return model.component_data_objects(Objective, active=True, descend_into=Block)


def _data(quantities):
    """``(component, index)`` of everything that is named; data may be replaced when a round is taken back."""
    named = quantities if isinstance(quantities, (list, tuple)) else [] if quantities is None else [quantities]
    found = []
    for q in named:
        datas = q.values() if q.is_indexed() else [q]
        found += [(d.parent_component(), d.index()) for d in datas]
    return found


def _check(model, wrt, tolerance, max_rounds):
    if not tolerance > 0:
        raise FesdError('tolerance', f"refine: it is {tolerance}", "give a positive number, e.g. 1e-6")
    if max_rounds < 2:
        raise FesdError('max_rounds', f"refine: it is {max_rounds}", "an error is estimated by comparison: give 2 at least")
    if discretised(wrt):
        raise FesdError(wrt, "refine: it is discretised already", "leave fesd.finite_elements to refine")
    if not any(True for _ in _objectives(model)):
        times, states = TimeIndex(wrt), [d.get_state_var() for d in derivatives(model, wrt)]
        for v in (v for x in states for v in x.values()):
            if v.fixed and times.time(v) != wrt.first():
                _refuse_freedom(v, "fixed after the first time")


def _refuse_freedom(v, what="free"):
    raise FesdError(
        v,
        f"refine: it is {what}, and there is no objective",
        "fix inputs, at the end of each stage if they are in piecewise_constant; where something is left to solve for, give an "
        "objective (0 is one)",
    )
