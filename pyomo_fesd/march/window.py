"""The problem of one element with its complementarity, compiled once and solved for every element of its kind.

    max r   s.t.  collocation and algebraic equations of the element, its cross complementarity (theory, eq. 11), r <= r_most

The longest step up to ``r_most`` that one active set allows: it ends at the next switch.

Takes: ``Equations``.
Leaves: values in the user's model, nothing else.
"""

import pyomo.environ as pyo
from pyomo.contrib.solver.common.factory import SolverFactory
from pyomo.contrib.solver.common.results import TerminationCondition

from pyomo_fesd.march.scene import Scene, put_out

#: Options of the small problems: a point that is not certified is judged by the march; a relaxation that takes long leads nowhere.
OPTIONS = {'raise_exception_on_nonoptimal_result': False, 'relaxation_iterations': 100}


class Window:
    """One kind of problem, compiled.

    Parameters
    ----------
    pattern : Equations
        any problem of the kind
    options : dict
        of ``mpec_hybrid``
    """

    def __init__(self, pattern, options):
        self._scene = scene = Scene(pattern)
        self.model, self._length = scene.model, scene.length
        scene.add_pairs('pair', pattern.pairs)
        if self._length is not None:
            self._length.setlb(0)
            self.model.step = pyo.Objective(expr=self._length, sense=pyo.maximize)
        self._solver = SolverFactory('mpec_hybrid', **(OPTIONS | options))
        self._solver.set_instance(self.model, parameters=[self.model.known])

    def begin(self, values):
        """Start the next solve at ``values`` of the unknowns."""
        for v, number in zip(self.model.unknown.values(), values):
            v.set_value(number, skip_validation=True)

    def solve(self, equations, most=None, **options):
        """Solve for other ``equations`` of the kind, with a length multiplier up to ``most``; returns what is known of it."""
        self._scene.know(equations)
        if self._length is not None:
            self._length.setub(most)
            self._length.set_value(most)
        results = self._solver.solve(self.model, **options)
        if results.termination_condition is TerminationCondition.interrupted:
            raise KeyboardInterrupt
        return results.extra_info

    def force(self, equations, length):
        """Ask for a given length, to see what keeps an element from having it; returns what is known of that."""
        self._length.setlb(length)
        try:
            return self.solve(equations, length)
        finally:
            self._length.setlb(0)

    @property
    def length(self):
        """The length multiplier found."""
        return self._length.value

    @property
    def values(self):
        """What was found, in the order of the unknowns."""
        return [v.value for v in self.model.unknown.values()]

    def put_out(self, equations):
        """Write what was found into the user's model."""
        put_out(equations, self.values)
