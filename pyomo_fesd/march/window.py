"""One element of a moving grid as a problem of its own, compiled once and solved for every element.

    max r   s.t.  collocation and algebraic equations of the element, its cross complementarity (theory, eq. 11), r <= r_most

The longest step up to ``r_most`` that one active set allows: it ends at the next switch.  All elements have the same equations,
so one of them serves as the pattern: the values of another element are put into its variables, and the answers taken out.

Takes: a model on a moving grid; what is fixed, what has no time and what lies at the left boundary are parameters.
Leaves: values.
"""

import pyomo.environ as pyo
from pyomo.common.collections import ComponentSet
from pyomo.core import ConstraintList, Objective, maximize
from pyomo.core.expr.visitor import identify_variables
from pyomo.mpec import Complementarity, complements

from pyomo_fesd.values import mutable_parameters

#: Options of the small problems: a point that is not certified is judged by the march.
OPTIONS = {'raise_exception_on_nonoptimal_result': False}
#: How an element is tried, one after the other: from where the last one ended; from afar; with other starts.  A step of no
#: length is a local solution of its own where a switch lies on the left boundary, so the later ones look farther.
TRIES = ({'warm_start': True, 'lpec': 'reduced'}, {'lpec': 'full'}, {'lpec': 'full', 'starts': 6})


def solver(options):
    """A solver of the small problems."""
    return pyo.SolverFactory('mpec_hybrid', **OPTIONS, **options)


def variables_of(expressions):
    """All variables of ``expressions``, fixed ones too, each once."""
    found = ComponentSet()
    for e in expressions:
        if hasattr(e, 'is_expression_type'):
            found.update(identify_variables(e, include_fixed=True))
    return found


def small_model(model, rows, pairs, unknown):
    """Put ``rows`` and ``pairs`` on a Block; rows without an unknown are left out."""
    model.row = ConstraintList()
    for row in rows:
        if any(v in unknown for v in identify_variables(row, include_fixed=True)):
            model.row.add(row)
    model.pair = Complementarity(range(len(pairs)))
    for i, (G, H) in enumerate(pairs):
        model.pair.add(i, complements(G >= 0, H >= 0))
    return model


class Window:
    """The pattern element, compiled.

    Parameters
    ----------
    home : Block
        empty, on the model itself
    r : VarData
        length multiplier of the pattern element
    labels : tuple
        labels of the pattern: its left boundary, then its own
    rows : list of relational expressions
    pairs : list of Pair
    more : iterable of VarData
        unknowns that have no label
    given : ComponentSet of VarData
        variables at the pattern's labels that the march knows: inputs, weights of modes with memory
    times : TimeIndex
    """

    def __init__(self, home, r, labels, rows, pairs, more, given, times, options):
        self._r, self._times, self._labels = r, times, labels
        expressions = [*rows, *(side for pair in pairs for side in pair)]
        everything = variables_of(expressions)
        self.unknown = ComponentSet(
            v for v in everything if v is r or (times.time(v) in labels[1:] and not v.fixed and v not in given)
        )
        self.unknown.update(more)
        fixed = [v for v in everything if v not in self.unknown]
        params = ComponentSet(p for e in expressions if hasattr(e, 'args') for p in mutable_parameters(e))
        self.parameters = [*fixed, *params]
        self.model = small_model(home, rows, pairs, self.unknown)
        self.model.step = Objective(expr=r, sense=maximize)
        self._solver, self._options = solver(options), options
        self._homes = {}
        for v in fixed:
            v.fix()
        self._solver.set_instance(self.model, parameters=self.parameters)

    def solve(self, labels, r_most, options):
        """Put in the values at ``labels`` of another element, solve with ``options``, take out; returns (r, results)."""
        places = dict(zip(self._labels, labels))
        for data in self.parameters:
            source = self._counterpart(data, places)
            if source is not None and source is not data:
                data.set_value(source.value, **({'skip_validation': True} if data.is_variable_type() else {}))
        self._r.setub(r_most)
        self._r.set_value(r_most, skip_validation=True)
        results = self._solver.solve(self.model, **options)
        for v in self.unknown:
            target = self._counterpart(v, places)
            if target is not None and target is not v:
                target.set_value(v.value, skip_validation=True)
        return self._r.value, results

    def values(self):
        """The present values of the pattern."""
        return [(v, v.value) for v in (*self.unknown, *self.parameters)]

    def put_back(self, values):
        """Values of the pattern's own element, after others have used its variables."""
        for v, now in values:
            if v.is_variable_type():
                v.set_value(now, skip_validation=True)
            else:
                v.set_value(now)

    def _counterpart(self, data, places):
        label = self._times.time(data)
        return None if label is None else self._times.at(data, places[label])
