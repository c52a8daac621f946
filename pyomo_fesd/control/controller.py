"""``Controller``: one step of model predictive control after the other, each with an answer by its deadline.

A step shifts the plan of the step before, loads what was measured, and tries, as long as there is time,

1. the branch of the shifted plan: one NLP and its certificate;
2. the branch of a simulation from the measured state with the shifted controls, which has the modes that the plant will have;
3. the full run: the homotopy.

With ``levels`` the objective found is compared with those of some simulations (``held_controls``), and a better one is a start.
After ``prepare``, which solves the plan for the predicted state before the measurement is there, a step first corrects this plan
to first order (``prepared_plan``), and solves only where the branch would change.
The first certified solution is the answer; without one the best feasible point; without any the shifted plan itself.

Takes: a model on a moving grid, compiled once.
Leaves: the new plan as the values of the model.
Does not apply: to controls that are not held on control stages.
"""

import time
from collections.abc import Iterable, Sequence
from typing import Any

from pyomo.contrib.mpc import ScalarData
from pyomo.contrib.solver.common.factory import SolverFactory
from pyomo.core import Block, Objective, Var
from pyomo.dae import ContinuousSet
from pyomo.gdp import Disjunct

from pyomo_fesd.control.control_step import BRANCH, CORRECTED, FULL, SIMULATED, ControlStep
from pyomo_fesd.control.held_controls import HeldControls
from pyomo_fesd.control.moving_interface import MovingModelInterface
from pyomo_fesd.control.prepared_plan import PreparedPlan
from pyomo_fesd.control.states import first_states
from pyomo_fesd.control.step_search import StepSearch
from pyomo_fesd.core import FesdError, interruptible, is_indexed_by
from pyomo_fesd.mpcc import Deadline, parameter_data

#: Options of the attempts of a step, and where their certified solutions come from unless a homotopy was needed; without a plan
#: the first attempt is left out.
ATTEMPTS = ({'warm_start': 'only'}, BRANCH), ({'simulate_first': True}, SIMULATED)
#: One more attempt of a thorough step.
HOMOTOPY = ({'simulate_first': False}, FULL)


class Controller:
    """Model predictive control of a hybrid system: the model is compiled once, and each step solves it again.

    Parameters
    ----------
    model : Block
        the control problem after ``fesd.finite_elements``: an objective, states fixed at the first time, control stages of equal
        length and number of elements
    controls : list of Var
        over time, held on each control stage (``piecewise_constant``)
    parameters : list of components
        fixed variables and mutable Params whose values may change besides the states and modes at the first time: references,
        prices, disturbances; bounds of variables may change as well
    wrt : ContinuousSet, optional
    rise : float, optional
        where the objective of a new plan is above that of the plan before by more than this part, the homotopy is tried as well,
        and the better one kept: the shifted branch may hold a local solution that a disturbance has made poor
    levels : int, optional
        at each step the model is simulated with the controls held over the horizon at so many levels between their bounds; where
        the best of them has a better objective than the new plan, its branch is solved too, and the better plan kept
    options : options of ``mpec_hybrid`` for every solve

    Attributes
    ----------
    interface : MovingModelInterface
        of the model

    Raises
    ------
    FesdError
        as ``set_instance`` and ``MovingModelInterface``, and for controls that are not variables over time; with ``levels``, for
        fewer than two and for controls without two bounds
    """

    def __init__(
        self,
        model: Block,
        controls: Sequence[Var],
        parameters: Iterable = (),
        wrt: ContinuousSet | None = None,
        rise: float | None = None,
        levels: int | None = None,
        **options,
    ):
        self.interface = MovingModelInterface(model, wrt)
        self._model, self._controls = model, _checked(controls, self.interface.time)
        self._options = {'review': False} | options
        self._solver, self._has_plan = SolverFactory('mpec_hybrid'), False
        self._rise, self._objective = rise, None
        self._held = None if levels is None else HeldControls(model, self._controls, self.interface.time, levels)
        self._variables = list(model.component_data_objects(Var, descend_into=(Block, Disjunct)))
        given = [*first_states(model, self.interface.time), *self.interface.mode_multipliers, *parameters]
        self._parameters, self._is_moved, self._prepared, self._unprepared = parameter_data(given), False, None, ''
        self._solver.set_instance(model, parameters=given, **options)

    @interruptible
    def step(
        self, measured: Any = None, modes: Iterable = (), time_limit: float | None = None, thorough: bool = False
    ) -> ControlStep:
        """Shift the plan, load the measurement, solve; after ``prepare``, correct the plan, which is shifted already.

        Parameters
        ----------
        measured : ScalarData or dict, optional
            values at the first time, as ``load_data`` takes them, e.g. ``{m.x: 0.3}``
        modes : list of Disjunct or str, optional
            modes with hysteresis at the first time, as ``load_modes`` takes them
        time_limit : float, optional
            seconds for the whole step
        thorough : bool
            make all attempts, and the homotopy, though one is certified before, and keep the best: a certified plan is a local
            solution, and the shifted one may have become a poor one

        Raises
        ------
        FesdError
            for data that the model does not have, and for changes of the model that are not listed in ``parameters``
        """
        began, deadline, before = time.perf_counter(), Deadline.after(time_limit), self.values()
        try:
            self._measure(measured, modes)
            corrected, refused = (None, '') if thorough else self._corrected(began)
            search = None if corrected else self._searched(deadline, thorough)
        except BaseException:  # Ctrl-C, too, leaves the plan of before
            self.load(before)
            raise
        self._is_moved, self._prepared, self._unprepared = False, None, ''
        answer = corrected or search.answer(began, self.present_controls(), refused)
        self._has_plan, self._objective = self._has_plan or answer.objective is not None, answer.objective
        return answer

    def prepare(self, time_limit: float | None = None) -> ControlStep:
        """Shift the plan and solve it for the state that it predicts, so that the next ``step`` only has to correct it.

        To be called while the present control is applied, before the measurement is there.  The next step changes the prepared
        plan to first order in everything that differs from the prediction: states and ``parameters``.

        Returns
        -------
        ControlStep
            for the predicted state; not to be applied

        Raises
        ------
        FesdError
            as ``step``
        """
        self._prepared, self._unprepared = None, ''
        answer = self.step(time_limit=time_limit)
        self._is_moved = True
        try:
            if answer.certified:
                kept = self._parameters, self._controls, self.interface.mode_multipliers
                self._prepared = PreparedPlan(self._solver.instance, *kept)
            else:
                self._unprepared = answer.reason
        except FesdError as error:
            self._unprepared = str(error).splitlines()[0]
        return answer

    def _measure(self, measured, modes):
        """Move the plan on, unless this is done, and load the measurement."""
        if self._has_plan and not self._is_moved:
            self.interface.shift_values_by_time()
        if measured is not None:
            self.interface.load_data(measured, time_points=[self.interface.time.first()])
        self.interface.load_modes(modes)

    def _corrected(self, began):
        """The answer that corrects the prepared plan; or None and why there is none."""
        if self._prepared is None:
            return None, self._unprepared
        try:
            objective, residual = self._prepared.correct()
        except FesdError as error:
            return None, str(error).splitlines()[0]
        reason = f"to first order from a certified plan for the predicted state, residual {residual:.1e}"
        seconds = time.perf_counter() - began
        return ControlStep(self.present_controls(), CORRECTED, False, reason, objective, seconds), ''

    def _searched(self, deadline, thorough):
        """The ``StepSearch`` of one step."""
        search = StepSearch(self, deadline)
        search.run(ATTEMPTS if self._has_plan else ATTEMPTS[1:], thorough)
        if self._held is not None and not deadline.expired():
            self._search_from_held(search, deadline)
        if thorough or self._has_risen(search.best):
            search.run([HOMOTOPY], True)
        return search

    def _search_from_held(self, search, deadline):
        """Solve the branch of the best simulation with held controls, where it is better than what was found."""
        start = self.values()
        objective, level = self._held.best(self._objective_component(), deadline)
        self.load(start)
        found = None if search.best is None else search.best.incumbent_objective
        if level is not None and (found is None or self.sense * (objective - found) < 0):
            self._held.hold(level)
            search.run(ATTEMPTS[1:], True)

    def present_controls(self) -> ScalarData:
        """Return the controls of the first control stage that the model has now, within their bounds."""
        last = self.interface.moving.grid.elements[0].points[-1]
        return ScalarData({u: _within_bounds(u[last]) for u in self._controls}, time_set=self.interface.time)

    def _has_risen(self, best):
        """Whether the objective is above that of the step before by more than ``rise``; one that is maximised is below it."""
        if best is None or self._rise is None or self._objective is None:
            return False
        return self.sense * (best.incumbent_objective - self._objective) > self._rise * abs(self._objective)

    # called by the search

    @property
    def sense(self) -> int:
        """1 where the objective is minimised, -1 where it is maximised."""
        return int(self._objective_component().sense)

    def _objective_component(self):
        return next(self._model.component_data_objects(Objective, active=True))

    def solve(self, options: dict, time_limit: float | None):
        """Solve from the present values; returns Pyomo's results."""
        limits = {} if time_limit is None else {'time_limit': time_limit}
        settings = {'raise_exception_on_nonoptimal_result': False} | self._options | options | limits
        return self._solver.solve(self._model, **settings)

    def values(self) -> list:
        """Return the values of all variables."""
        return [v.value for v in self._variables]

    def load(self, values: list) -> None:
        """Give all variables their values of before."""
        for v, number in zip(self._variables, values):
            v.set_value(number, skip_validation=True)


def _checked(controls, wrt):
    for u in controls:
        if getattr(u, 'ctype', None) is not Var or not is_indexed_by(u, wrt):
            raise FesdError(getattr(u, 'name', repr(u)), f"Controller: not a Var over '{wrt.name}'", "give e.g. controls=[m.u]")
    return list(controls)


def _within_bounds(v):
    low, high = v.bounds
    number = v.value
    return min(number if low is None else max(number, low), float('inf') if high is None else high)
