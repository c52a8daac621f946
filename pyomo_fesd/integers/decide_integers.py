"""``decide_integers``: solve a model with switches for the values of its integer variables, and keep the best.

With the integers y fixed, the model is an MPCC that ``mpec_hybrid`` solves and certifies,

    f(y) = the objective of a certified point for y,          y* = argmin f(y) over the values tried

The certificate of each row is local, so f(y) is an upper bound of the best objective for y, and so is f(y*) for the whole problem.
No value is left out by a bound: with switches a relaxed solution is a local one, and bounds nothing.

Takes: a model that is ready for ``mpec_hybrid`` except for its integer variables.
Does not apply: to integer variables without bounds.
"""

import time
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from math import prod

import pandas as pd
from pyomo.contrib.solver.common.factory import SolverFactory
from pyomo.contrib.solver.common.results import SolutionStatus
from pyomo.core import Block, Objective, Var, maximize

from pyomo_fesd.core import FesdError, check_keywords
from pyomo_fesd.solvers import MpecHybridConfig

COLUMNS = ('outcome', 'certified', 'objective', 'seconds', 'reason')
SOLUTIONS = (SolutionStatus.optimal, SolutionStatus.feasible)
SEARCHES = ('all', 'neighbours')


@dataclass(frozen=True)
class IntegerDecision:
    """Result of ``decide_integers``.

    Attributes
    ----------
    table : pandas.DataFrame
        a row for each choice in the order of its solve: the integer variables by name, ``outcome``, ``certified`` (B-stationary for
        this choice), ``objective``, ``seconds``, ``reason``
    best : int
        its row with the best objective among the certified ones; if none is certified, among all solutions
    complete : bool
        whether every choice within the bounds has a row, certified or reported infeasible (no point was found, which is no proof)
    """

    table: pd.DataFrame
    best: int
    complete: bool


def decide_integers(model: Block, search: str = 'all', most: int = 256, **options) -> IntegerDecision:
    """Decide the integer variables of a model with switches; the model gets the values of the best choice found.

    Parameters
    ----------
    model : Block
        transformed; its integer variables that are not fixed have bounds
    search : str
        'all': every choice within the bounds.  'neighbours': from the present values of the integers (rounded) to the best choice
        that differs in one integer by 1, as long as that is better; the result is then best among its neighbours
    most : int
        largest number of choices
    options : options of ``mpec_hybrid``

    Returns
    -------
    IntegerDecision
        whose certificates are local, one for each choice: see the page on integers

    Raises
    ------
    FesdError
        for a model without such variables or with one without bounds, for more than ``most`` choices, if no choice has a solution;
        the model is then as before
    """
    check_keywords(MpecHybridConfig(), options, 'decide_integers')
    if search not in SEARCHES:
        raise FesdError('decide_integers', f"search={search!r}", f"give one of {', '.join(map(repr, SEARCHES))}")
    integers = _integers(model)
    number = prod(v.ub - v.lb + 1 for v in integers)
    if search == 'all' and number > most:
        raise FesdError(model, f"its integers have {number} choices, more than most={most}", "raise most, or search='neighbours'")
    trials = _Trials(model, integers, options)
    try:
        choices = trials.all() if search == 'all' else trials.neighbours(most)
        for choice in choices:
            trials.solve(choice)
        trials.keep_best()
    except BaseException:
        trials.restore()
        raise
    finally:
        trials.unfix()
    table = trials.table()
    judged = table['certified'] | (table['outcome'] == SolutionStatus.infeasible.name)
    return IntegerDecision(table, trials.best, bool(len(table) == number and judged.all()))


def _integers(model):
    found = [v for v in model.component_data_objects(Var, active=True, descend_into=Block) if not v.fixed and not v.is_continuous()]
    if not found:
        raise FesdError(model, "decide_integers: it has no integer variable that is not fixed", "solve it with mpec_hybrid")
    for v in found:
        if v.lb is None or v.ub is None:
            raise FesdError(v, "decide_integers: an integer variable without bounds", "give it bounds")
    return found


class _Trials:
    """Solves with fixed integers; each begins from the values that the model had, so that no row depends on another."""

    def __init__(self, model, integers, options):
        self._model, self._integers = model, integers
        variables = model.component_data_objects(Var, descend_into=True)
        self._before = [(v, v.value, v.stale) for v in variables]
        self._rows, self._solution, self.best = {}, [], None
        sense = next((o.sense for o in model.component_data_objects(Objective, active=True)), 1)
        self._sign = -1 if sense == maximize else 1
        self._solver = SolverFactory('mpec_hybrid', raise_exception_on_nonoptimal_result=False, **options)
        for v in integers:
            v.fix(self._nearest(v))
        try:
            self._solver.set_instance(model, parameters=integers)
        except BaseException:
            self.restore()
            self.unfix()
            raise

    @staticmethod
    def _nearest(v):
        """The present value, rounded and within the bounds."""
        return int(min(max(round(v.lb if v.value is None else v.value), v.lb), v.ub))

    def all(self) -> Iterator[tuple]:
        """Yield every choice."""
        return product(*(range(int(v.lb), int(v.ub) + 1) for v in self._integers))

    def neighbours(self, most: int) -> Iterator[tuple]:
        """Yield the first choice, and those beside the best one until it stays the best; at most ``most`` of them."""
        yield tuple(v.value for v in self._integers)
        centre = None
        while self.best != centre:
            centre = self.best
            for choice in self._beside(list(self._rows)[centre]):
                if choice not in self._rows and len(self._rows) < most:
                    yield choice

    def _beside(self, choice):
        for k, v in enumerate(self._integers):
            for number in (choice[k] - 1, choice[k] + 1):
                if v.lb <= number <= v.ub:
                    yield (*choice[:k], number, *choice[k + 1 :])

    def solve(self, choice: tuple) -> None:
        """Solve for a choice, and remember its values if it is the best so far."""
        begun = time.perf_counter()
        self.restore()
        for v, number in zip(self._integers, choice):
            v.fix(number)
        results = self._solver.solve(self._model)
        status = results.solution_status
        self._rows[choice] = dict(zip((v.name for v in self._integers), choice)) | {
            'outcome': status.name,
            'certified': status is SolutionStatus.optimal,
            'objective': results.incumbent_objective if status in SOLUTIONS else None,
            'seconds': time.perf_counter() - begun,
            'reason': results.extra_info.reason,
        }
        number = len(self._rows) - 1
        if status in SOLUTIONS and (self.best is None or self._rank(number) < self._rank(self.best)):
            self.best = number
            self._solution = [(v, v.value, v.stale) for v, _, _ in self._before]

    def _rank(self, number):
        """Certified ones first, then by objective."""
        row = list(self._rows.values())[number]
        return not row['certified'], self._sign * row['objective']

    def keep_best(self) -> None:
        """Give the model the values of the best choice."""
        if self.best is None:
            reasons = sorted({row['reason'] or row['outcome'] for row in self._rows.values()})
            cause = f"decide_integers: no solution for any of {len(self._rows)} choices: {'; '.join(reasons[:3])}"
            raise FesdError(self._model, cause, "check the constraints that hold for every choice")
        self._set(self._solution)

    def restore(self) -> None:
        """Give the model the values that it had."""
        self._set(self._before)

    @staticmethod
    def _set(values):
        # the first value after a solve makes all others stale, so the flags come last
        for v, number, _ in values:
            v.set_value(number, skip_validation=True)
        for v, _, stale in values:
            v.stale = stale

    def unfix(self) -> None:
        """Let the integers be variables again."""
        for v in self._integers:
            v.unfix()

    def table(self) -> pd.DataFrame:
        """The rows in the order of their solves."""
        return pd.DataFrame(list(self._rows.values()))
