"""A march through the elements of a moving grid, one after the other.

Every element is as long as its share of what is left of its control stage, or ends at the next switch, the end of a mode with
memory, or a jump.  Where these need more elements than there are, the march begins again with one in reserve for each of them.

Takes: a model on a moving grid whose states at the first time are fixed.
Leaves: values of everything over time.
Does not apply: to systems with freedom; inputs have to be given.
"""

import logging
from dataclasses import replace

from pyomo.common.collections import ComponentSet

from pyomo_fesd.elements.cross import grid_of
from pyomo_fesd.elements.jumps import read_jumps
from pyomo_fesd.elements.memory import read_modes
from pyomo_fesd.errors import FesdError
from pyomo_fesd.march.accumulation import accumulation
from pyomo_fesd.march.equations import Reader, own_labels, variables_of
from pyomo_fesd.march.events import Jumps, Memory
from pyomo_fesd.march.freedom import refuse_free_start, refuse_freedom
from pyomo_fesd.march.kind import Kind, State, active_at_first, find_first
from pyomo_fesd.march.prescribed import prescribed_states
from pyomo_fesd.march.residuals import largest_residuals
from pyomo_fesd.march.shares import Even, Passed, equal_lengths, wanted
from pyomo_fesd.march.window import Window
from pyomo_fesd.mpcc.phase import phase
from pyomo_fesd.records import records
from pyomo_fesd.timeindex import TimeIndex, derivatives
from pyomo_fesd.trajectory import physical_time

logger = logging.getLogger('pyomo_fesd')

#: Parts of an element's length, or of its share if that is longer: what is left of a stage after a switch may be as short as the
#: solver's tolerances.  A step shorter than this is none.
NO_STEP = 1e-9
#: A step that is shorter than its share by more than this has been cut short by an event.
CUT = 1e-7
#: Lengths between two switches are equal if they differ by less than this part; what is left after so many marches may be larger.
EQUAL, NEARLY, PASSES = 1e-10, 1e-7, 6
#: How an element is tried, one after the other: from where the last one ended; from afar; with other starts.  A step of no
#: length is a local solution of its own where a switch lies on the left boundary, so the later ones look farther.
TRIES = (
    {'warm_start': True, 'lpec': 'reduced'},
    {'lpec': 'full', 'relaxation': 'elastic'},
    {'lpec': 'full'},
    {'lpec': 'full', 'starts': 6},
)


class March:
    """One march over one moving grid."""

    def __init__(self, model, wrt, inputs, options, timer):
        self._model, self._wrt, self._options, self._timer = model, wrt, options, timer
        self._block, self._times = records(model).grids[wrt], TimeIndex(wrt)
        self._grid = grid_of(self._block)
        modes, jumps = read_modes(model, wrt), read_jumps(model, wrt)
        systems = dict.fromkeys(m.system for m in modes)
        self._memories = [Memory([m for m in modes if m.system == s], self._block.component('memory')) for s in systems]
        self._jumps = Jumps(jumps, self._block.component('jumps'))
        self._reader = Reader(model, self._block, self._grid, self._times, self._given(inputs))
        self._equations, self._kinds, self._state, self._passed = {}, {}, State(), {}
        self._time, self._events = float(wrt.first()), {}

    def _given(self, inputs):
        """Inputs, controls that are held on each stage, and weights of modes with memory."""
        given = ComponentSet(v for u in inputs for v in u.values())
        given.update(prescribed_states(self._model, self._wrt))
        for row in self._block.held.values():
            # the value at the end of its stage counts
            *others, last = sorted(variables_of([row.body]), key=self._times.time)
            given.update((*others, last))
            for control in others:
                control.set_value(last.value, skip_validation=True)
        given.update(v for memory in self._memories for e in self._grid.elements for v in memory.variables(e.right))
        return given

    def run(self):
        """March through all elements, and again with equal lengths between the switches that were found."""
        with phase(self._timer, 'begin'):
            self._begin()
        shares = self._enough_elements()
        if wanted(self._block) and not self._equalise():
            self._through(shares)
        self._warn_short()

    def _enough_elements(self):
        """Where their number does not fit the switches of a stage, march again with one for each of them; returns the shares."""
        reserve, tried = dict.fromkeys(self._grid.stages, 0), set()
        while True:
            shares = Even(dict(reserve))
            stage = self._through(shares)
            if stage is None:
                return shares
            reserve[stage] = self._expected(stage)
            if tuple(reserve.values()) in tried:
                raise self._used_up(stage)
            tried.add(tuple(reserve.values()))

    def _equalise(self):
        """March with equal lengths between switches until they fit; returns whether they do."""
        equal, differs = equal_lengths(self._block, self._grid, self._passed)
        for _ in range(PASSES):
            if differs <= EQUAL:
                return True
            try:
                if self._through(equal) is not None:
                    return False
            except FesdError:
                return False
            before, (equal, differs) = equal, equal_lengths(self._block, self._grid, self._passed)
            if equal.last != before.last:
                return False
        return differs <= NEARLY

    def _expected(self, stage):
        """The switches to expect in a stage whose elements did not fit; all of them are for switches if these accumulate there."""
        elements, limit = self._grid.stages[stage], accumulation(self._events[stage])
        short = limit is not None and limit[1] <= elements[-1].right
        return len(elements) - 1 if short else len(self._events[stage])

    def _begin(self):
        """The algebraic variables, and states that they imply, and the modes at the first time."""
        first = self._wrt.first()
        for memory in self._memories:
            memory.begin(first)
            memory.set_weights(self._grid.elements[0])
        equations = self._reader.first(first)
        states = [d.get_state_var() for d in derivatives(self._model, self._wrt)]
        refuse_free_start(equations, [v for x in states for v in x.values() if self._times.time(v) == first and not v.fixed])
        if equations.unknown and not find_first(equations, self._reader.sides(first), self._options, self._timer):
            with phase(self._timer, 'compile'):
                window = Window(equations, self._options)
            with phase(self._timer, 'window'):
                self._require(window.solve(equations), equations, window)
            window.put_out(equations)

    def _through(self, shares):
        """March once; returns the stage whose elements do not fit, None if all went well.

        Parameters
        ----------
        shares : Even or Equal
            how long the elements are to be
        """
        first = self._wrt.first()
        self._time, self._events = float(first), {stage: [] for stage in self._grid.stages}
        self._jumps.begin()
        for memory in self._memories:
            memory.begin(first)
        warm, self._state = False, State(active_at_first(self._reader.sides(first)))
        for stage, elements in self._grid.stages.items():
            rest = sum(e.length for e in elements)
            self._state = replace(self._state, left=None)
            for left, element in zip(range(len(elements), 0, -1), elements):
                share = shares.most(element, rest, left, len(self._events[stage]))
                h, happened = self._advance(element, share, warm)
                self._passed[element.n] = Passed(self._state.theta, bool(happened))
                least = CUT * max(share, element.length)
                cut = h < share - least
                # after a switch another active set holds
                warm = bool(happened) or not cut
                rest, self._time = rest - h, self._time + h
                if cut or happened:
                    self._events[stage].append((self._time, ', '.join(happened) or 'switch'))
                if (rest <= least) != (left == 1):
                    return stage
        for memory in self._memories:
            memory.settle(self._grid, first)
        return None

    def _advance(self, element, share, warm):
        """One element of at most the length ``share``; returns its length and what happens at its end."""
        for memory in self._memories:
            memory.set_weights(element)
        (h, state), last = self._step(element, share, warm), len(own_labels(element))
        while True:
            arrived = [(memory, memory.arrived(element)) for memory in self._memories]
            jumped = self._jumps.arrived(element)
            places = [p for found in (jumped, *(found for _, found in arrived)) for p in found if p is not None]
            if min(places, default=last) == last:
                break
            # a stage point is there already: the element ends where that point was
            h, state = self._step(element, h * self._grid.tau[min(places) - 1], True)
        self._state = state
        if element is self._grid.elements[-1]:
            return h, []
        happened = self._jumps.end(element, jumped)
        for memory, found in arrived:
            if last in found or memory.ends_beyond(element.n, element.right):
                memory.end(element.n, element.right)
                happened.append(memory.name)
        if happened:
            self._state = replace(state, left=None)
        return h, happened

    def _step(self, element, most, warm):
        """Solve one element with a length of at most ``most``; returns its length and the state at its end."""
        equations = self._problem(element)
        if equations.kind not in self._kinds:
            refuse_freedom(equations)
            self._kinds[equations.kind] = Kind(equations, element, self._grid, self._options, self._timer)
        kind = self._kinds[equations.kind]
        found = kind.smooth_step(equations, self._state, most, lambda: self._values_before(equations, element))
        longest = max(most, element.length)
        h, state = self._by_window(kind, equations, most, warm, NO_STEP * longest) if found is None else found
        h = most if h > most - CUT * longest else h
        self._block.r[element.n].set_value(h / element.length, skip_validation=True)
        return h, state

    def _values_before(self, equations, element):
        """Values of the unknowns of an element as they are on its left."""
        return [_value_at(self._times, v, element.left) if self._times.time(v) is not None else v.value for v in equations.unknown]

    def _by_window(self, kind, equations, most, warm, least):
        """Where the next active set is not known, or does not hold: a step longer than ``least``."""
        for options in TRIES[not warm :]:
            answer, h = kind.window_step(equations, most, options)
            if answer.stationarity == 'B' and h > least:
                return kind.take_window(equations, most, h)
        kind.window.force(equations, most / kind.nominal)
        missed = largest_residuals(self._model, self._times, equations, kind.window.values)
        forced = f"; where one is forced, {missed}" if missed else ''
        if answer.stationarity == 'B':
            raise self._stuck(
                f"no step is possible from time {self._time:.6g}{forced}",
                "look for a bound that the solution reaches there, or for a state from which no mode leads on",
            )
        raise self._stuck(
            f"no step was found from time {self._time:.6g}: {answer.outcome}{forced}",
            "check the equations there; more elements help where the solution is steep",
        )

    def _problem(self, element):
        if element.n not in self._equations:
            with phase(self._timer, 'read'):
                limits = {name: rows for law in (*self._memories, self._jumps) for name, rows in law.limits(element).items()}
                self._equations[element.n] = self._reader.element(element, limits)
        return self._equations[element.n]

    def _warn_short(self):
        """Where less time lies between two switches than an element must have, the full problem has no solution like this one."""
        for stage, elements in self._grid.stages.items():
            begin = physical_time(self._model, self._wrt)[elements[0].left]
            ends = [*(time for time, _ in self._events[stage]), begin + sum(e.length * self._block.r[e.n].value for e in elements)]
            least = min(e.length * (self._block.r[e.n].lb or 0.0) for e in elements)
            for a, b in zip([begin, *ends], ends):
                if 0 < b - a < least * (1 - CUT):
                    logger.warning(
                        "simulate: from time %.6g to %.6g there is less time between two switches than the least element length "
                        "%.3g, so mpec_hybrid will not find this solution. Take more elements (nfe).",
                        a,
                        b,
                        least,
                    )

    def _require(self, answer, equations, window):
        if answer.stationarity != 'B':
            missed = largest_residuals(self._model, self._times, equations, window.values)
            raise self._stuck(
                f"no solution at time {self._time:.6g}: {missed or answer.reason or answer.outcome}",
                "check the equations there, and the initial values",
            )

    def _stuck(self, cause, fix):
        """The error of a march that cannot go on; a limit of shrinking intervals explains most."""
        events = [event for stage in self._events.values() for event in stage]
        limit = accumulation(events)
        if limit is not None:
            times = ', '.join(f'{t:.9g}' for t in limit[0])
            cause = f"the switches accumulate (Zeno): the last ones are at times {times}, their limit is about {limit[1]:.6g}"
            fix = "no number of elements reaches beyond: end before, or model what happens there (a rest, a slide)"
        return FesdError(self._wrt, f"simulate: {cause}", fix)

    def _used_up(self, stage):
        """More switches than elements."""
        number = sum(map(len, self._events.values()))
        return self._stuck(
            f"the elements of control stage {stage} are used up at time {self._time:.6g}, after {number} switches",
            "take more elements (nfe)",
        )


def _value_at(times, v, label):
    """Value of the counterpart of a variable at another time, or its own where there is none."""
    try:
        found = times.at(v, label).value
    except KeyError:
        found = None
    return v.value if found is None else found
