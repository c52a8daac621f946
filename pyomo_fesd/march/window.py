"""The problem of one element as a model of its own, compiled once and solved for every element of its kind.

    max r   s.t.  collocation and algebraic equations of the element, its cross complementarity (theory, eq. 11), r <= r_most

The longest step up to ``r_most`` that one active set allows: it ends at the next switch.

Takes: ``Equations``.
Leaves: values in the user's model, nothing else.
"""

import pyomo.environ as pyo
from pyomo.contrib.solver.common.factory import SolverFactory
from pyomo.contrib.solver.common.results import TerminationCondition
from pyomo.core.expr.visitor import replace_expressions
from pyomo.mpec import Complementarity, complements

from pyomo_fesd.errors import FesdError
from pyomo_fesd.march.equations import variables_of
from pyomo_fesd.march.freedom import refuse_freedom

#: Options of the small problems: a point that is not certified is judged by the march.
OPTIONS = {'raise_exception_on_nonoptimal_result': False}


class Window:
    """One kind of problem, compiled.

    Parameters
    ----------
    pattern : Equations
        any problem of the kind
    options : dict
        of ``mpec_hybrid``
    steps : bool
        whether its first unknown is a length, to be as large as possible

    Raises
    ------
    FesdError
        for a variable that nothing determines
    """

    def __init__(self, pattern, options, steps=True):
        if steps:
            refuse_freedom(pattern)
        self.model = m = pyo.ConcreteModel()
        m.unknown, m.known = pyo.Var(range(len(pattern.unknown))), pyo.Var(range(len(pattern.known)))
        own = {id(v): m.unknown[k] for k, v in enumerate(pattern.unknown)}
        own.update((id(v), m.known[k]) for k, v in enumerate(pattern.known))
        for k, bounds in enumerate(pattern.bounds):
            m.unknown[k].bounds = bounds
        m.row = pyo.ConstraintList()
        for row in pattern.rows:
            # what holds between known values only is no condition on the others
            if any(own[id(v)].parent_component() is m.unknown for v in variables_of([row])):
                m.row.add(replace_expressions(row, own))
        m.pair = Complementarity(range(len(pattern.pairs)))
        for i, pair in enumerate(pattern.pairs):
            G, H = (replace_expressions(side, own) for side in pair)
            m.pair.add(i, complements(G >= 0, H >= 0))
        self._steps = steps
        if steps:
            m.unknown[0].setlb(0)
            m.step = pyo.Objective(expr=m.unknown[0], sense=pyo.maximize)
        for k, v in enumerate(pattern.unknown):
            m.unknown[k].set_value(v.value, skip_validation=True)
        self._solver = SolverFactory('mpec_hybrid', **(OPTIONS | options))
        m.known.fix(0.0)
        self._solver.set_instance(m, parameters=[m.known])

    def solve(self, equations, most=None, **options):
        """Solve for other ``equations`` of the kind, with a length multiplier up to ``most``; returns what is known of the answer."""
        for k, v in enumerate(equations.known):
            if v.value is None:
                raise FesdError(v, "simulate: this input has no value", "give it one")
            self.model.known[k].set_value(v.value)
        if self._steps:
            self.model.unknown[0].setub(most)
            self.model.unknown[0].set_value(most)
        results = self._solver.solve(self.model, **options)
        if results.termination_condition is TerminationCondition.interrupted:
            raise KeyboardInterrupt
        return results.extra_info

    @property
    def length(self):
        """The length multiplier found."""
        return self.model.unknown[0].value

    def put_out(self, equations):
        """Write what was found into the user's model; a length is the caller's business."""
        for k, v in enumerate(equations.unknown):
            if k or not self._steps:
                v.set_value(self.model.unknown[k].value, skip_validation=True)
