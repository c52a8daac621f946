"""The attempts of one step of a ``Controller``, as long as there is time, and the best of them.

Takes: the controller, a deadline, and for each attempt the options of a solve and where its solutions come from.
Leaves: a ``ControlStep``, and the values of the best point, or of the plan, in the model.
Does not apply: to corrections of a prepared plan, which solve nothing.
"""

import time

from pyomo.contrib.solver.common.results import SolutionStatus

from pyomo_fesd.control.control_step import DEADLINE, FULL, PLAN, ControlStep

#: Seconds left without which no further attempt begins.
LEAST = 1e-3


class StepSearch:
    """The attempts of one step of a ``Controller``, which solves, and keeps and loads the values of its model.

    Attributes
    ----------
    best : Results or None
        of the best feasible point
    """

    def __init__(self, controller, deadline):
        self._controller, self._deadline = controller, deadline
        self._plan, self._results, self._late = controller.values(), [], False
        self.best, self._values, self._origin = None, self._plan, PLAN

    def run(self, attempts, all_of_them):
        """Make attempts until one is certified, or all; the model has the values of the best one, or those of the plan."""
        for options, origin in attempts:
            left = self._deadline.left()
            if left is not None and left < LEAST:
                self._late = True
                break
            results = self._controller.solve(options, left)
            self._results.append(results)
            if self._improves(results):
                self.best, self._values, self._origin = results, self._controller.values(), _origin(results, origin)
            if results.solution_status is SolutionStatus.optimal and not all_of_them:
                return
            self._controller.load(self._values)
        self._controller.load(self._values)

    def _improves(self, results):
        """Whether this is the first feasible point, or better than the one before: certified before uncertified."""
        if results.solution_status not in (SolutionStatus.optimal, SolutionStatus.feasible):
            return False
        return self.best is None or self._rank(results) < self._rank(self.best)

    def _rank(self, results):
        sense = self._controller.sense
        return results.solution_status is not SolutionStatus.optimal, sense * results.incumbent_objective

    def answer(self, began, controls, refused) -> ControlStep:
        """The best point as a ``ControlStep``; ``refused`` says why a prepared plan was not corrected."""
        certified = self.best is not None and self.best.solution_status is SolutionStatus.optimal
        origin = DEADLINE if self.best is not None and not certified and self._deadline.expired() else self._origin
        objective = None if self.best is None else self.best.incumbent_objective
        seconds = time.perf_counter() - began
        reason = '; '.join(filter(None, (self._reason(), refused and f"not corrected: {refused}")))
        return ControlStep(controls, origin, certified, reason, objective, seconds, self._results)

    def _reason(self):
        if self.best is not None:
            return self.best.extra_info.reason
        found = [f"{r.extra_info.outcome}: {r.extra_info.reason}" for r in self._results[-1:]]
        late = ["no time was left"] if self._late else []
        return "the plan before goes on; " + '; '.join([*found, *late])


def _origin(results, origin):
    """Where a feasible point comes from; relaxations belong to the full run."""
    return FULL if any(step.kind in ('relaxation', 'restoration') for step in results.extra_info.steps) else origin
