"""The equations of a flowsheet at one time, as functions of casadi: each mode has rows of its own."""

import io
import itertools
import tempfile
from pathlib import Path

import casadi
import numpy as np
import pyomo.environ as pyo
from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.core.expr.visitor import identify_variables
from pyomo.dae import DerivativeVar
from pyomo.gdp import Disjunction
from pyomo.repn.plugins.nl_writer import NLWriter


class Equations:
    """A differential-algebraic system F(w) = 0 at one time, w of states, their derivatives and algebraic variables.

    Parameters
    ----------
    m : ConcreteModel, discretised, with Disjunctions over ``time`` that are not transformed
    time : ContinuousSet
    label : float
        the time whose equations are taken; fixed variables have their values of this time
    start : dict or None
        values of the first time by the names of data; without it the model's own

    Attributes
    ----------
    modes : list of tuple of int
        combinations of disjuncts, one number for each Disjunction
    names : list of str
        of the variables in w, at ``label``
    states, rates : arrays of int
        positions in w; the derivative of state k is rate k
    first : array, values of the states at the first time
    guess : array, values of w in the model
    """

    def __init__(self, m, time, label, start=None):
        families = ComponentMap((family[label], family) for family in _families(m, time) if label in family)
        of_time, split = _discretisation(m, time), _Split(time)
        data = [c for c in m.component_data_objects(pyo.Constraint, active=True) if split(c)[0] == label]
        common = [c.body - c.upper for c in data if c.equality and c.parent_component() not in of_time]
        rows = self._numbered(common, [[_rows(d) for d in found.disjuncts] for found in _disjunctions(m, time, label)])
        pairs = [(x, rate) for x, rate in _derivatives(m, time, label) if x in families and not _is_input(families[x])]
        given = [x for x, _ in pairs if x.fixed]
        for x in given:
            x.unfix()
        used = ComponentSet(v for row in rows for v in identify_variables(row, include_fixed=False))
        constant = [v for v in used if v not in families]
        for v in constant:
            v.fix()
        pairs = [(x, rate) for x, rate in pairs if rate in used and not rate.fixed]
        self._function, order = _casadi(rows, pairs)
        self._jacobian = self._function.factory('J', ['w'], ['jac:g:w'])
        for v in given:
            v.fix()
        for v in constant:
            v.unfix()
        position = {id(v): n for n, v in enumerate(order)}
        self.names = [v.name for v in order]
        self.states = np.array([position[id(x)] for x, _ in pairs], int)
        self.rates = np.array([position[id(rate)] for _, rate in pairs], int)
        self.guess = np.array([1.0 if v.value is None else v.value for v in order])
        at_first = [families[x][time.first()] for x, _ in pairs]
        self.first = np.array([x.value if start is None else start[x.name] for x in at_first], float)

    def _numbered(self, rows, choices):
        """All rows, after the spans of each disjunct, numbers of its equations and of its guards, are noted."""
        self._common, self._spans, rows = len(rows), [], list(rows)
        for disjuncts in choices:
            self._spans.append([])
            for equations, guards in disjuncts:
                ends = [len(rows), len(rows) + len(equations), len(rows) + len(equations) + len(guards)]
                rows += [*equations, *guards]
                self._spans[-1].append((range(*ends[:2]), range(*ends[1:])))
        self.modes = list(itertools.product(*(range(len(s)) for s in self._spans)))
        return rows

    def _of_mode(self, mode, part):
        return list(itertools.chain.from_iterable(self._spans[n][k][part] for n, k in enumerate(mode)))

    def residual(self, w, mode):
        """F(w) of a mode."""
        return self._all(w)[[*range(self._common), *self._of_mode(mode, 0)]]

    def jacobian(self, w, mode):
        """Its derivative, sparse."""
        return self._jacobian(w).sparse().tocsr()[[*range(self._common), *self._of_mode(mode, 0)]]

    def guards(self, w, mode):
        """Functions that are not negative where the mode holds."""
        return self._all(w)[self._of_mode(mode, 1)]

    def _all(self, w):
        return np.asarray(self._function(w)).ravel()


def _is_input(family):
    """Whether a state is fixed at all times."""
    return all(v.fixed for v in family.values())


class _Split:
    """The time in the index of data, or of a block around them, and a key of the rest; faster than Pyomo's flattening."""

    def __init__(self, time):
        self._time, self._places = time, {}

    def __call__(self, data):
        label, key = None, []
        while data is not None:
            component = data.parent_component()
            index = data.index() if component.is_indexed() else ()
            index = index if isinstance(index, tuple) else (index,)
            place = self._place(component)
            if place is not None:
                label, index = index[place], (*index[:place], *index[place + 1 :])
            key.append((id(component), index))
            data = data.parent_block()
        return label, tuple(key)

    def _place(self, component):
        if id(component) not in self._places:
            self._places[id(component)] = _place_of(component, self._time) if component.is_indexed() else None
        return self._places[id(component)]


def _place_of(component, time):
    """The position of the time in the index of a component; None without."""
    position = 0
    for subset in component.index_set().subsets(expand_all_set_operators=False):
        if subset is time:
            return position
        position += subset.dimen or 1
    return None


def _families(m, time):
    """Variables over time as dicts by label."""
    split, found = _Split(time), {}
    for v in m.component_data_objects(pyo.Var):
        label, key = split(v)
        if label is not None:
            found.setdefault(key, {})[label] = v
    return found.values()


def _time_derivatives(m, time):
    for derivative in m.component_objects(pyo.Var):  # pyomo.dae makes Vars of them
        if isinstance(derivative, DerivativeVar) and any(s is time for s in derivative.get_continuousset_list()):
            yield derivative


def _discretisation(m, time):
    """The Constraints that pyomo.dae has written for the time."""
    found = ComponentSet()
    for derivative in _time_derivatives(m, time):
        block, state = derivative.parent_block(), derivative.get_state_var().local_name
        names = (f'{derivative.local_name}_disc_eq', f'{state}_{time.local_name}_cont_eq')
        found.update(c for c in map(block.component, names) if c is not None)
    return found


def _at_label(component, time, label):
    """(index, data) of an indexed component at a time."""
    place = _place_of(component, time)
    for index, data in component.items():
        if (index[place] if isinstance(index, tuple) else index) == label:
            yield index, data


def _derivatives(m, time, label):
    """Pairs of data (state, derivative) at a time."""
    for derivative in _time_derivatives(m, time):
        state = derivative.get_state_var()
        yield from ((state[index], data) for index, data in _at_label(derivative, time, label))


def _disjunctions(m, time, label):
    for disjunction in m.component_objects(Disjunction, active=True):
        if disjunction.is_indexed() and any(s is time for s in disjunction.index_set().subsets(expand_all_set_operators=False)):
            yield from (data for _, data in _at_label(disjunction, time, label) if data.active)


def _rows(disjunct):
    """The equations of a disjunct as expressions that are zero, and its inequalities as expressions that are not negative."""
    equations, guards = [], []
    for c in disjunct.component_data_objects(pyo.Constraint, active=True):
        if c.equality:
            equations.append(c.body - c.upper)
            continue
        guards += [] if c.upper is None else [c.upper - c.body]
        guards += [] if c.lower is None else [c.body - c.lower]
    return equations, guards


def _casadi(rows, pairs):
    """A function of casadi, through the NL file, and its variables in their order."""
    scratch = pyo.ConcreteModel()
    scratch.none = pyo.Objective(expr=0.0)
    scratch.rows = pyo.ConstraintList()
    # a product keeps the writer from moving constants into bounds only for linear rows, so they are taken back below
    data = [scratch.rows.add(row == 0) for row in rows]
    for x, rate in pairs:  # so that states which no equation names are written
        scratch.rows.add(x + rate == 0)
    text = io.StringIO()
    info = NLWriter().write(scratch, text, linear_presolve=False)
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / 'rows.nl').write_text(text.getvalue())
        nl = casadi.NlpBuilder()
        nl.import_nl(str(Path(folder) / 'rows.nl'))
    number = {id(c): n for n, c in enumerate(info.constraints)}
    w, g = casadi.vertcat(*nl.x), casadi.vertcat(*nl.g) - casadi.DM(nl.g_lb)
    chosen = g[[number[id(c)] for c in data]]
    return casadi.Function('g', [w], [chosen], ['w'], ['g']).expand(), list(info.variables)
