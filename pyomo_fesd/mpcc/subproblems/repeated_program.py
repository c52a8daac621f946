"""A linear program that is solved again and again, with other upper bounds of its rows, each time from the last basis.

The first one, where it is large, begins with that of its equations (``equations_basis``).
Columns that stay 0 remain in it: without them HiGHS gives other multipliers of the same optimum, whose relative descent may be many
times larger.

Takes: a program without binaries.
Leaves: its optimum; or a point and multipliers as HiGHS gave them, of which nothing is promised.
"""

from dataclasses import replace
from itertools import cycle, islice

import highspy
import numpy as np

from pyomo_fesd.mpcc.subproblems.equations_basis import equations_basis
from pyomo_fesd.mpcc.subproblems.linear_program import ATTEMPTS, Answer, highs_of, holds, run, set_options, settings_of, solve

#: Iterations of the simplex method before the next attempt, for each row and column: without a basis, from the last one, and from
#: an optimum without scaling.
FIRST, AGAIN, RESCALED = 1.0, 0.1, 0.05
#: Rows from which on a program is large: its first run has a basis, while smaller ones are solved in a few milliseconds.
LARGE = 500
#: HiGHS' numbers of two ways to price: Devex begins at any basis as it is; HiGHS' choice, steepest edges, computes the length of
#: each edge first, which takes most of a run from the last basis.
DEVEX, CHOSEN = 1, -1
#: HiGHS' numbers of a program as it is, and of its own scaling.
UNSCALED, SCALED = 0, 2
#: Settings of the simplex method, each for as long as it ends: on degenerate programs, equilibrated already, any of them may not.
#: Large ones begin without HiGHS' own scaling.  (Of small ones the multipliers that it gives prove more: a ball that meets the
#: ground at the last time, 12 of 45 times, is certified by these only.)
WAYS = tuple(
    {
        'simplex_scale_strategy': scaling,
        'dual_simplex_cost_perturbation_multiplier': perturbation,
        'simplex_dual_edge_weight_strategy': pricing,
    }
    for scaling, perturbation, pricing in ((SCALED, 1.0, DEVEX), (UNSCALED, 1.0, DEVEX), (SCALED, 0.0, CHOSEN))
)
#: HiGHS' numbers of the simplex methods.
DUAL, PRIMAL = 1, 4
#: Ways to multipliers where the simplex method does not end.
OTHERWISE = {'solver': 'ipm', 'run_crossover': 'off'}, {'presolve': 'on'}


class RepeatedProgram:
    """One program in HiGHS.

    Parameters
    ----------
    program : Program
    options : dict
        of the user
    deadline : Deadline
    """

    def __init__(self, program, options, deadline):
        self._given, self._options, self._deadline = program, options, deadline
        self._p, self._rows, self._factor = program.equilibrated()
        self._needs_basis = len(program.high) >= LARGE
        self._high, self._limit, self._ways = self._p.high, FIRST, islice(cycle(WAYS), int(self._needs_basis), None)
        self._highs, self._basis = self._made(next(self._ways)), None

    def solve(self, high):
        """An ``Answer`` with the upper bounds ``high`` of the rows, of which nothing is promised; None where HiGHS has none."""
        answer = self._from_last_basis(high)
        return self._otherwise() if answer is None else answer

    def optimum(self, high):
        """The ``Answer`` that is optimal with the upper bounds ``high`` and holds, or None."""
        answer = self._from_last_basis(high)
        answer = None if answer is None else self._rescaled(answer)
        if answer is not None and holds(replace(self._p, high=self._high), answer.d / self._given.reach):
            return answer
        return solve(replace(self._given, high=high), self._options, self._deadline)

    def _from_last_basis(self, high):
        high = high * self._rows
        changed = np.flatnonzero(high != self._high)
        self._high = high
        self._change(self._highs, changed)
        if self._needs_basis:
            self._highs.setBasis(equations_basis(self._p, high))
            self._needs_basis = False
        if self._deadline.at is not None:
            # the limit is one of all runs together
            self._highs.setOptionValue('time_limit', self._highs.getRunTime() + self._deadline.left())
        self._limit_iterations(self._limit)
        if self._ends_well(self._highs) or self._ends_well_by_primal():
            self._limit, self._basis = AGAIN, self._highs.getBasis()
            return self._answer(self._highs)
        # the basis in which it ended leads nowhere
        self.restart(self._basis)
        set_options(self._highs, next(self._ways) | self._options)
        return None

    def _rescaled(self, answer):
        """The optimum with HiGHS' own scaling, some pivots from that of an ``answer`` without it; where it has none, the answer.

        What rows miss by the tolerances may be worth a descent that is none (a motor: 2e-3, with multipliers of 3e8).
        """
        given = self._highs.getOptionValue('simplex_scale_strategy')[1]
        if given != UNSCALED or 'simplex_scale_strategy' in self._options:
            return answer
        self._highs.setOptionValue('simplex_scale_strategy', SCALED)
        self._limit_iterations(RESCALED)
        again = self._answer(self._highs) if self._ends_well(self._highs) else None
        self._highs.setOptionValue('simplex_scale_strategy', given)
        self.restart(self._basis)
        return answer if again is None else again

    @property
    def basis(self):
        """That of the last optimum from the basis before; None before the first one."""
        return self._basis

    def restart(self, basis):
        """Begin with another basis."""
        if basis is None:
            self._highs.clearSolver()
        else:
            self._highs.setBasis(basis)

    def _otherwise(self):
        for settings in OTHERWISE:
            highs = self._made({'simplex_iteration_limit': int(FIRST * sum(self._p.A.shape))} | settings)
            self._change(highs, np.flatnonzero(self._high != self._p.high))
            self._ends_well(highs)
            answer = self._answer(highs)
            if answer is not None:
                return answer
        return None

    def _limit_iterations(self, limit):
        self._highs.setOptionValue('simplex_iteration_limit', int(limit * sum(self._p.A.shape)))

    def _made(self, settings):
        return highs_of(self._p, settings_of(ATTEMPTS[0], 0, self._deadline, settings | self._options))

    def _change(self, highs, rows):
        for i in rows:
            highs.changeRowBounds(int(i), self._p.low[i], self._high[i])

    @staticmethod
    def _ends_well(highs):
        run(highs)
        return highs.getModelStatus() == highspy.HighsModelStatus.kOptimal

    def _ends_well_by_primal(self):
        """Whether the primal method has an optimum, from the basis with which the dual one just misses the tolerances."""
        if self._highs.getModelStatus() != highspy.HighsModelStatus.kUnknown:
            return False
        set_options(self._highs, {'simplex_strategy': PRIMAL} | self._options)
        ends_well = self._ends_well(self._highs)
        set_options(self._highs, {'simplex_strategy': DUAL} | self._options)
        return ends_well

    def _answer(self, highs):
        solution = highs.getSolution()
        if not (solution.value_valid and solution.dual_valid):
            return None
        d, y = np.array(solution.col_value) * self._given.reach, np.array(solution.row_dual) * self._rows / self._factor
        return Answer(d, y) if np.isfinite(d).all() and np.isfinite(y).all() else None
