"""Elements of one class: with a known active set by Newton's method, otherwise as an MPCC; compiled when first needed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pyomo_fesd.core import phase
from pyomo_fesd.simulation.active_set_step import ActiveSetStepper
from pyomo_fesd.simulation.element_equations import ElementEquations
from pyomo_fesd.simulation.element_model import known_values, write_values
from pyomo_fesd.simulation.element_mpcc import ElementMpcc
from pyomo_fesd.simulation.element_residuals import ElementResiduals

#: The MPCC and Newton's method have found the same element if their lengths differ by less than this part of it.
SAME = 1e-5
#: A solution is followed from the first part of an element's length, each length at most so many times the one before, until only a
#: growth below the last number is possible.
FIRST, GROWTH, LEAST_GROWTH = 1e-6, 10.0, 1.05


@dataclass(frozen=True)
class ElementEnd:
    """Active set and values at the end of an element.

    Attributes
    ----------
    active : dict name of a condition -> whether its H (else its G) is zero in the element; None if unknown
    event : (name, bool) or None
        the condition whose H (else its G) is zero from there on
    values : array or None
        of all functions of ``element_class`` there
    element_class : ElementClass
    activity : bytes
        for each condition whether its G (else its H) is positive in the element, as in eq. (12)
    is_first : bool
        whether it is the first time, the end of no element
    """

    active: dict[str, bool] | None = None
    event: tuple[str, bool] | None = None
    values: np.ndarray | None = None
    element_class: ElementClass | None = None
    activity: bytes | None = None
    is_first: bool = False


@dataclass(frozen=True)
class LeftBoundary:
    """Values that the variables of an element have at its left boundary.

    Attributes
    ----------
    unknown, known : list
    """

    unknown: list
    known: list


class ElementClass:
    """The class of elements with the equations of ``pattern`` and the ``nominal`` length, or the first time.

    ``unit`` is what the length multiplier is usually near.
    """

    def __init__(
        self, pattern: ElementEquations, nominal: float | None, tau: tuple[float, ...], options: dict, timer, deadline, unit=1.0
    ):
        self._pattern, self.nominal, self._tau, self._unit = pattern, nominal, tau, unit
        self._options, self._timer, self._deadline, self._values = options, timer, deadline, None

    @cached_property
    def mpcc(self) -> ElementMpcc:
        """The element with complementarity."""
        with phase(self._timer, 'compile'):
            return ElementMpcc(self._pattern, self._options, self._deadline, self._unit)

    @cached_property
    def _residuals(self):
        with phase(self._timer, 'compile'):
            return ElementResiduals(self._pattern, self._tau, self._options.get('user_scaling', True))

    @cached_property
    def _stepper(self):
        return ActiveSetStepper(self._residuals, self._tau) if self._residuals.complete else None

    def begin_pass(self) -> None:
        """Begin a pass: values of the last element are no start for the first one."""
        self._values = None

    def mark(self) -> list | None:
        """Return the values of the last element."""
        return self._values

    def return_to(self, mark: list | None) -> None:
        """Return to a mark, None to the begin of a pass."""
        self._values = mark

    def find_initial_values(self, equations: ElementEquations) -> bool:
        """Find and write the values of the first time by Newton's method; returns whether it succeeded."""
        if self._stepper is None:
            return False
        self._residuals.set_known(known_values(equations))
        before = [v.value for v in equations.unknown]
        start = self._residuals.point(before)
        step = self._stepper.step(start, self._stepper.guess(start), None, self._stepper.unknown_values)
        if step is not None:
            write_values(equations, self._residuals.values(step.w, before))
        return step is not None

    def newton_step(
        self, equations: ElementEquations, before: ElementEnd, most: float, at_left: Callable[[], LeftBoundary]
    ) -> tuple[float, ElementEnd] | None:
        """Solve an element of at most the length ``most`` that goes on with the active set of ``before``.

        Conditions that ``before`` does not have, such as those that a model states after the first time only, are guessed from the
        values at the left boundary.  Returns (length, ElementEnd), or None if the active set is unknown or does not hold;
        ``at_left`` is called for the first element of the class.
        """
        if before.active is None or self._stepper is None:
            return None
        goes_on = before.active.keys() >= set(self._stepper.names)
        values = self._values if goes_on and self._values is not None else at_left().unknown
        active, left, event = self._at_begin(equations, before, values, at_left)
        with phase(self._timer, 'newton'):
            return self._newton(equations, active, left, most, values, event)

    def followed(self, equations: ElementEquations, before: ElementEnd, most: float, at_left: LeftBoundary) -> float:
        """Return the length, at most ``most``, up to which Newton's method follows a solution from the left boundary.

        It is 0 where the active set is unknown.  Short elements are solved from the values there, longer ones from shorter ones.
        """
        if before.active is None or self._stepper is None:
            return 0.0
        active, left, event = self._at_begin(equations, before, at_left.unknown, lambda: at_left)
        self._residuals.set_known(known_values(equations))
        w, length, reached, growth = self._residuals.point(at_left.unknown), FIRST * most, 0.0, GROWTH
        while reached < most and growth > LEAST_GROWTH:
            step = self._stepper.step(w, active, length / self.nominal, left, event)
            if step is not None:
                w, reached = step.w, length
            elif reached == 0:
                break
            else:
                growth **= 0.5
            length = min(growth * reached, most)
        return reached

    def _at_begin(self, equations, before, values, at_left):
        """The active set at the beginning of an element, the values of all functions on the left, and the event there."""
        names = self._stepper.names
        goes_on = before.active.keys() >= set(names)
        guess = {} if goes_on else self._guess(equations, values)
        active = np.array([before.active.get(name, guess.get(name)) for name in names], dtype=bool)
        event = None if before.event is None or before.event[0] not in names else 2 * names.index(before.event[0]) + before.event[1]
        return active, self._functions_on_left(before, goes_on, at_left), event

    def _functions_on_left(self, before, goes_on, at_left):
        """Values of all functions at the left boundary; nan where they are unknown."""
        if before.element_class is self and before.values is not None:
            return before.values
        if not (before.is_first and goes_on):
            return self._stepper.unknown_values
        left = at_left()
        self._residuals.set_known(left.known)
        return self._stepper.values_on_left(self._residuals.point(left.unknown))

    def _guess(self, equations, values):
        """For each condition whether its H (else its G) is the smaller side at some values."""
        self._residuals.set_known(known_values(equations))
        return dict(zip(self._stepper.names, self._stepper.active_set(self._residuals.point(values)).tolist()))

    def _newton(self, equations, active, left, most, values, event=None):
        self._residuals.set_known(known_values(equations))
        step = self._stepper.step(self._residuals.point(values), active, most / self.nominal, left, event)
        if step is None:
            return None
        self._values = self._residuals.values(step.w, values)
        write_values(equations, self._values)
        names = self._stepper.names
        is_condition = step.event is not None and step.event < 2 * len(names)
        event = (names[step.event // 2], step.event % 2) if is_condition else None
        end = ElementEnd(dict(zip(names, step.active.tolist())), event, step.end, self, step.activity)
        return float(step.length) * self.nominal, end

    def mpcc_step(self, equations: ElementEquations, most: float, options: dict, least: float = 0.0):
        """Solve the MPCC with a length from ``least`` to ``most``; returns the ``extra_info`` of its results, and the length."""
        self.mpcc.set_start([v.value for v in equations.unknown] if self._values is None else self._values)
        with phase(self._timer, 'mpcc'):
            answer = self.mpcc.solve(equations, most / self.nominal, least / self.nominal, **options)
        return answer, self.mpcc.length * self.nominal

    def accept_mpcc(self, equations: ElementEquations, most: float, h: float) -> tuple[float, ElementEnd]:
        """Write the solution of the MPCC, improved by Newton's method if that finds the same; returns (length, ElementEnd)."""
        self._values, active = self.mpcc.values, None
        if self._stepper is not None:
            self._residuals.set_known(known_values(equations))
            active = self._stepper.active_set(self._residuals.point(self._values))
            with phase(self._timer, 'newton'):
                found = self._newton(equations, active, self._stepper.unknown_values, most, self._values)
            if found is not None and abs(found[0] - h) <= SAME * most:
                return found
            self._values = self.mpcc.values
        self.mpcc.write(equations)
        return h, ElementEnd() if active is None else ElementEnd(dict(zip(self._stepper.names, active.tolist())))
