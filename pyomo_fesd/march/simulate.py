"""``simulate``: march through the elements of a moving grid, one after the other.

Every element is as long as its share of what is left of its control stage, or ends at the next switch, the end of a mode with
memory, or a jump.  So the march knows nothing of the future, and needs no homotopy over the whole horizon.

Takes: a model on a moving grid whose states at the first time are fixed.
Leaves: values of everything over time: the solution of a system without freedom (lengths are not equalised), or a start for
``mpec_hybrid`` with ``warm_start=True``.
Does not apply: to systems whose equations are not the same in all elements.
"""

from contextlib import contextmanager

from pyomo.common.collections import ComponentSet
from pyomo.common.modeling import unique_component_name
from pyomo.core import Block, Constraint, Var
from pyomo.core.expr.visitor import identify_variables
from pyomo.mpec import Complementarity

from pyomo_fesd import marks
from pyomo_fesd.complementarity import read
from pyomo_fesd.elements.cross import grid_of
from pyomo_fesd.elements.jumps import read_jumps
from pyomo_fesd.elements.memory import read_modes
from pyomo_fesd.errors import FesdError
from pyomo_fesd.indicators import set_indicators
from pyomo_fesd.march.events import Jumps, Memory
from pyomo_fesd.march.window import TRIES, Window, small_model, solver, variables_of
from pyomo_fesd.records import records
from pyomo_fesd.review import review
from pyomo_fesd.timeindex import TimeIndex, derivatives, find_continuous_set
from pyomo_fesd.trajectory import trajectory

#: A step shorter than this part of its share is none; one that is longer than the rest has not been cut short.
NO_STEP = 1e-9
#: So many intervals between switches, each shorter than the last, are a sign that the switches accumulate.
SHRINKING = 4


def simulate(model, wrt=None, inputs=(), **options):
    """Simulate a system without freedom on its moving grid, element by element.

    Parameters
    ----------
    model : Block
        after ``fesd.finite_elements``; its states are fixed at the first time
    wrt : ContinuousSet, optional
    inputs : list of Var
        variables over time that are given: they keep their present values (controls of an optimal control problem, whose guess
        is simulated)
    options : options of ``mpec_hybrid`` for the small problem of each element

    Returns
    -------
    pandas.DataFrame, the ``trajectory``; the model has the values

    Raises
    ------
    FesdError
        where the march cannot go on: more switches than elements (with the time at which they accumulate, if they do), a state
        that is not fixed at the first time, equations that differ from element to element
    """
    wrt = find_continuous_set(model, wrt, 'simulate')
    if wrt not in records(model).grids:
        raise FesdError(wrt, "simulate: its elements are not movable", "apply fesd.finite_elements first")
    march = March(model, wrt, inputs, options)
    with march.given():
        march.run()
    set_indicators(model)
    review(model)
    return trajectory(model, wrt)


class March:
    """One march over one moving grid."""

    def __init__(self, model, wrt, inputs, options):
        self._model, self._wrt, self._options = model, wrt, options
        self._block = records(model).grids[wrt]
        self._grid, self._times = grid_of(self._block), TimeIndex(wrt)
        self._pattern = self._grid.elements[min(1, len(self._grid.elements) - 1)]
        self._states = ComponentSet(d.get_state_var() for d in derivatives(model, wrt))
        modes = read_modes(model, wrt)
        self._memories = [Memory([m for m in modes if m.system == s]) for s in dict.fromkeys(m.system for m in modes)]
        self._jumps = Jumps(read_jumps(model, wrt), self._block.component('jumps'))
        self._given = ComponentSet(v for u in inputs for v in u.values())
        self._given.update(v for memory in self._memories for v in memory.variables())
        self._given.update(self._jumps.variables())
        self._time, self._events = float(wrt.first()), {}

    def run(self):
        """March through all elements; where those of a stage do not suffice, again with one in reserve for every switch in it."""
        self._begin()
        window, reserve = self._window(), dict.fromkeys(self._grid.stages, 0)
        while True:
            stage = self._through(window, reserve)
            if stage is None:
                return
            seen = len(self._events[stage])
            if seen <= reserve[stage] or self._accumulate():
                raise self._used_up(stage)
            reserve[stage] = seen

    def _through(self, window, reserve):
        """March once; returns the stage whose elements were used up before its end, None if all went well.

        Parameters
        ----------
        reserve : dict stage -> number of switches to be expected
        """
        self._time, self._events = float(self._wrt.first()), {stage: [] for stage in reserve}
        for memory in self._memories:
            memory.begin(self._wrt.first())
        cut, kept = True, None
        for stage, elements in self._grid.stages.items():
            rest = sum(e.length for e in elements)
            for number, element in enumerate(elements):
                left, expected = len(elements) - number, max(0, reserve[stage] - len(self._events[stage]))
                share = rest / max(1, left - expected)
                h = self._advance(window, element, share, not cut)
                cut = h < share * (1 - NO_STEP)
                rest, self._time = rest - h, self._time + h
                if self._end(element, cut):
                    self._events[stage].append(self._time)
                if element is self._pattern:
                    kept = window.values()
                if (rest <= NO_STEP * share) != (left == 1):
                    return stage
        window.put_back(kept)
        for memory in self._memories:
            memory.settle(self._block.memory, self._grid, self._wrt.first())
        return None

    def _labels(self, element):
        return tuple(dict.fromkeys((element.left, *element.points, element.right)))

    def _begin(self):
        """The algebraic variables and the modes at the first time."""
        first = self._wrt.first()
        for memory in self._memories:
            memory.begin(first)
            memory.set_weights([first])
        rows = [c.expr for c in self._equations([first])]
        conditions = self._model.component_data_objects(Complementarity, active=True, descend_into=Block)
        pairs = [read(c) for c in conditions if self._times.time(c) == first]
        everything = variables_of([*rows, *(side for pair in pairs for side in pair)])
        unknown = ComponentSet(v for v in everything if self._times.time(v) == first and not v.fixed and v not in self._given)
        free = next((v for v in unknown if v.parent_component() in self._states), None)
        if free is not None:
            raise FesdError(free, "this state is not fixed at the first time", "fix its initial value before simulate")
        model = small_model(self._home('first'), rows, pairs, unknown)
        for v in everything:
            if v not in unknown:
                v.fix()
        if unknown:
            self._require(solver(self._options).solve(model))

    def _equations(self, labels, counts=None):
        """Active equations at ``labels``, and what the package adds there; user inequalities do not determine a simulation."""
        memory = self._block.component('memory')
        for c in self._model.component_data_objects(Constraint, active=True, descend_into=Block):
            label = self._times.time(c)
            if label in labels and (c.equality or marks.is_generated(c)) and c.parent_block() is not memory:
                yield c

    def _signs(self, labels):
        """Signs of sides and values at left limits, which stand in lists: those of variables at ``labels`` only."""
        for name in ('nonnegative', 'left_limit'):
            rows = self._block.component(name)
            for c in rows.values() if rows is not None else ():
                found = {self._times.time(v) for v in identify_variables(c.body, include_fixed=True)}
                if found <= set(labels) and found & set(labels[1:]):
                    yield c

    def _window(self):
        labels, n = self._labels(self._pattern), self._pattern.n
        rows = [c.expr for c in self._equations(labels[1:])] + [c.expr for c in self._signs(labels)]
        for label in labels[1:]:
            rows += [row for memory in self._memories for row in memory.rows(label)] + self._jumps.rows(label)
        copies, more = self._jumps.copies(n - 1)
        rows += more
        pairs = [read(c) for index, c in self._block.cross.items() if index[1] == n]
        return Window(
            self._home('pattern'), self._block.r[n], labels, rows, pairs, copies.values(), self._given, self._times, self._options
        )

    def _home(self, name):
        self._scratch.add_component(name, Block())
        return self._scratch.component(name)

    def _advance(self, window, element, share, warm):
        """One element of at most the length ``share``; returns its length."""
        labels = self._labels(element)
        for memory in self._memories:
            memory.set_weights(labels[1:])
        if element.n == 1:
            self._jumps.stay(self._pattern.n - 1, element.left, self._times)
        else:
            self._jumps.put(self._pattern.n - 1, element.n - 1)
        for options in TRIES[not warm :]:
            r, results = window.solve(labels, share / self._pattern.length, options)
            h = r * self._pattern.length
            if results.solver.stationarity == 'B' and h > NO_STEP * share:
                self._jumps.take(self._pattern.n - 1, element.n - 1)
                self._block.r[element.n].set_value(h / element.length, skip_validation=True)
                return h
        self._require(results)
        raise FesdError(
            self._wrt,
            f"simulate: no step is possible from time {self._time:.6g}",
            "look for a bound that the solution reaches there, or for a state from which no mode leads on",
        )

    def _require(self, results):
        if results.solver.stationarity != 'B':
            raise FesdError(
                self._wrt,
                f"simulate: no solution at time {self._time:.6g}: {results.solver.reason}",
                "check the equations there; more elements help where the solution is steep",
            )

    def _end(self, element, limited):
        """Let modes end and states jump at the right boundary of ``element``; returns whether anything happens there."""
        ended = [memory.end(element.right) for memory in self._memories]
        jumped = self._jumps.end(element.n, element.right, limited)
        return limited or jumped or any(ended)

    def _accumulate(self):
        """The time at which the switches accumulate, None if their intervals do not shrink."""
        events = [t for stage in self._events.values() for t in stage]
        gaps = [b - a for a, b in zip(events, events[1:])][-SHRINKING:]
        ratios = [b / a for a, b in zip(gaps, gaps[1:])]
        if len(gaps) < SHRINKING or max(ratios) > 0.95:
            return None
        return events[-1] + gaps[-1] * ratios[-1] / (1 - ratios[-1])

    def _used_up(self, stage):
        """More switches than elements."""
        events, limit = [t for times in self._events.values() for t in times], self._accumulate()
        if limit is not None:
            return FesdError(
                self._wrt,
                "simulate: the switches accumulate (Zeno): the last ones are at times "
                f"{', '.join(f'{t:.6g}' for t in events[-SHRINKING:])}, their limit is about {limit:.6g}",
                "no number of elements reaches beyond: end before, or model what happens there (a rest, a slide)",
            )
        return FesdError(
            self._wrt,
            f"simulate: the elements of control stage {stage} are used up at time {self._time:.6g}, after {len(events)} switches",
            "take more elements (nfe)",
        )

    @contextmanager
    def given(self):
        """Fix and release as the march needs it; afterwards everything is as free as it was."""
        variables = [(v, v.fixed) for v in self._model.component_data_objects(ctype=Var, descend_into=Block)]
        r = self._block.r[self._pattern.n]
        # a simulation goes where the equations lead: bounds of states are for those who choose inputs
        states = [v for v, _ in variables if v.parent_component() in self._states]
        bounds, held = [(v, v.lower, v.upper) for v in (r, *states)], r.fixed
        for v in states:
            v.bounds = (None, None)
        r.unfix()
        r.setlb(0)
        self._scratch = Block()
        self._model.add_component(unique_component_name(self._model, marks.GENERATED + 'march'), self._scratch)
        try:
            yield
        finally:
            self._model.del_component(self._scratch)
            for v, fixed in variables:
                v.fixed = fixed
            for v, lower, upper in bounds:
                v.bounds = (lower, upper)
            r.fixed = held
