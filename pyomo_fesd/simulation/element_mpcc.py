"""One element with its complementarity conditions as an MPCC, compiled once for all elements of its class.

    max r   s.t.  collocation and algebraic equations of the element, its cross complementarity (theory, eq. 11), r <= r_max

The longest step up to ``r_max`` that one active set allows: it ends at the next switch.
"""

from collections.abc import Sequence

import pyomo.environ as pyo
from pyomo.contrib.solver.common.factory import SolverFactory
from pyomo.contrib.solver.common.results import TerminationCondition

from pyomo_fesd.mpcc import Deadline
from pyomo_fesd.simulation.element_equations import ElementEquations
from pyomo_fesd.simulation.element_model import ElementModel, write_values

#: Options of the small problems: the simulation judges uncertified points itself; a relaxation that takes long does not succeed.
OPTIONS = {'raise_exception_on_nonoptimal_result': False, 'relaxation_iterations': 100, 'natural_units': 'starts'}


class ElementMpcc:
    """The MPCC of the element class of ``pattern``; ``options`` are those of ``mpec_hybrid``, ``deadline`` is that of all.

    ``unit`` is what the length multiplier is usually near.
    """

    def __init__(self, pattern: ElementEquations, options: dict, deadline: Deadline | None = None, unit: float = 1.0):
        self._deadline = deadline or Deadline()
        self._copy = copy = ElementModel(pattern)
        self.model, self._length = copy.model, copy.length
        copy.add_pairs('cross', pattern.cross_pairs)
        if self._length is not None:
            self.model.step = pyo.Objective(expr=self._length if unit == 1 else self._length / unit, sense=pyo.maximize)
            if unit != 1:
                self.model.scaling_factor[self._length] = 1 / unit
        self._solver = SolverFactory('mpec_hybrid', **(OPTIONS | options))
        self._solver.set_instance(self.model, parameters=[self.model.known])

    def set_start(self, values: Sequence[float]) -> None:
        """Start the next solve at ``values`` of the unknowns."""
        for v, number in zip(self.model.unknown.values(), values):
            v.set_value(number, skip_validation=True)

    def solve(self, equations: ElementEquations, most: float | None = None, least: float = 0.0, **options):
        """Solve for other ``equations`` of the class; returns the ``extra_info``.

        The length multiplier is between ``least`` and ``most``; where both are equal, the answer shows which equations prevent it.
        """
        self._copy.set_known(equations)
        if self._length is not None:
            self._length.setlb(least)
            self._length.setub(most)
            self._length.set_value(most)
        results = self._solver.solve(self.model, time_limit=self._deadline.left(), **options)
        if results.termination_condition is TerminationCondition.interrupted:
            raise KeyboardInterrupt
        return results.extra_info

    @property
    def length(self) -> float:
        """The length multiplier found."""
        return self._length.value

    @property
    def values(self) -> list[float]:
        """The values found, in the order of the unknowns."""
        return [v.value for v in self.model.unknown.values()]

    def write(self, equations: ElementEquations) -> None:
        """Write the values found into the user's model."""
        write_values(equations, self.values)
