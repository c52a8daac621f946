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
        self.model = m = pyo.ConcreteModel()
        m.unknown, m.known = pyo.Var(range(len(pattern.unknown))), pyo.Var(range(len(pattern.known)))
        own = {id(v): m.unknown[k] for k, v in enumerate(pattern.unknown)}
        own.update((id(v), m.known[k]) for k, v in enumerate(pattern.known))
        m.scaling_factor = pyo.Suffix(direction=pyo.Suffix.EXPORT)
        for v, bounds in zip(pattern.unknown, pattern.bounds):
            own[id(v)].bounds = bounds
            own[id(v)].set_value(v.value, skip_validation=True)
        for v, factor in pattern.factors.items():
            m.scaling_factor[own[id(v)]] = factor
        self._add_rows(pattern, own)
        self._add_pairs(pattern, own)
        self._length = None if pattern.length is None else own[id(pattern.length)]
        if self._length is not None:
            self._length.setlb(0)
            m.step = pyo.Objective(expr=self._length, sense=pyo.maximize)
        self._solver = SolverFactory('mpec_hybrid', **(OPTIONS | options))
        m.known.fix(0.0)
        self._solver.set_instance(m, parameters=[m.known])

    def _add_rows(self, pattern, own):
        self.model.row = pyo.ConstraintList()
        for row in pattern.rows:
            unknown = [v for v in variables_of([row]) if own[id(v)].parent_component() is self.model.unknown]
            # what holds between known values only is no condition on the others
            if unknown:
                added = self.model.row.add(replace_expressions(row, own))
                # the scale of a row is that of its variables, if the user has given all of them a factor
                factors = [pattern.factors.get(v) for v in unknown if v is not pattern.length]
                if factors and None not in factors:
                    self.model.scaling_factor[added] = min(factors)

    def _add_pairs(self, pattern, own):
        self.model.pair = Complementarity(range(len(pattern.pairs)))
        for i, pair in enumerate(pattern.pairs):
            G, H = (replace_expressions(side, own) for side in pair)
            self.model.pair.add(i, complements(G >= 0, H >= 0))

    def solve(self, equations, most=None, **options):
        """Solve for other ``equations`` of the kind, with a length multiplier up to ``most``; returns what is known of it."""
        for k, v in enumerate(equations.known):
            if v.value is None:
                raise FesdError(v, "simulate: it has no value", "give it one")
            self.model.known[k].set_value(v.value)
        if self._length is not None:
            self._length.setub(most)
            self._length.set_value(most)
        results = self._solver.solve(self.model, **options)
        if results.termination_condition is TerminationCondition.interrupted:
            raise KeyboardInterrupt
        return results.extra_info

    @property
    def length(self):
        """The length multiplier found."""
        return self._length.value

    def put_out(self, equations):
        """Write what was found into the user's model; a length is the caller's business."""
        for k, v in enumerate(equations.unknown):
            if v is not equations.length:
                v.set_value(self.model.unknown[k].value, skip_validation=True)
