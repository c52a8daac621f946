"""A march through the elements of a moving grid, one after the other.

Every element is as long as its share of what is left of its control stage, or ends at the next switch, the end of a mode with
memory, or a jump.  Where these need more elements than there are, the march begins again with one in reserve for each of them.

Takes: a model on a moving grid whose states at the first time are fixed.
Leaves: values of everything over time.
Does not apply: to systems with freedom; inputs have to be given.
"""

import logging

from pyomo.common.collections import ComponentSet

from pyomo_fesd.elements.cross import grid_of
from pyomo_fesd.elements.jumps import read_jumps
from pyomo_fesd.elements.memory import read_modes
from pyomo_fesd.errors import FesdError
from pyomo_fesd.march.accumulation import accumulation
from pyomo_fesd.march.equations import Reader, own_labels, variables_of
from pyomo_fesd.march.events import Jumps, Memory
from pyomo_fesd.march.freedom import refuse_free_start, refuse_freedom
from pyomo_fesd.march.window import Window
from pyomo_fesd.records import records
from pyomo_fesd.timeindex import TimeIndex, derivatives
from pyomo_fesd.trajectory import physical_time

logger = logging.getLogger('pyomo_fesd')

#: Parts of an element's length, or of its share if that is longer: what is left of a stage after a switch may be as short as the
#: solver's tolerances.  A step shorter than this is none.
NO_STEP = 1e-9
#: A step that is shorter than its share by more than this has been cut short by an event.
CUT = 1e-7
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

    def __init__(self, model, wrt, inputs, options):
        self._model, self._wrt, self._options = model, wrt, options
        self._block, self._times = records(model).grids[wrt], TimeIndex(wrt)
        self._grid = grid_of(self._block)
        modes, jumps = read_modes(model, wrt), read_jumps(model, wrt)
        systems = dict.fromkeys(m.system for m in modes)
        self._memories = [Memory([m for m in modes if m.system == s], self._block.component('memory')) for s in systems]
        self._jumps = Jumps(jumps, self._block.component('jumps'))
        self._reader = Reader(model, self._block, self._times, self._given(inputs))
        self._equations, self._windows = {}, {}
        self._time, self._events = float(wrt.first()), {}

    def _given(self, inputs):
        """Inputs, controls that are held on each stage, and weights of modes with memory."""
        given = ComponentSet(v for u in inputs for v in u.values())
        for row in self._block.held.values():
            # the value at the end of its stage counts
            *others, last = sorted(variables_of([row.body]), key=self._times.time)
            given.update((*others, last))
            for control in others:
                control.set_value(last.value, skip_validation=True)
        given.update(v for memory in self._memories for e in self._grid.elements for v in memory.variables(e.right))
        return given

    def run(self):
        """March through all elements; where their number does not fit the switches of a stage, again with one for each of them."""
        self._begin()
        reserve, tried = dict.fromkeys(self._grid.stages, 0), set()
        while True:
            stage = self._through(reserve)
            if stage is None:
                return self._warn_short()
            reserve[stage] = self._expected(stage)
            if tuple(reserve.values()) in tried:
                raise self._used_up(stage)
            tried.add(tuple(reserve.values()))

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
        if equations.unknown:
            window = Window(equations, self._options)
            self._require(window.solve(equations))
            window.put_out(equations)

    def _through(self, reserve):
        """March once; returns the stage whose elements do not fit, None if all went well.

        Parameters
        ----------
        reserve : dict stage -> number of switches to be expected
        """
        self._time, self._events = float(self._wrt.first()), {stage: [] for stage in reserve}
        self._jumps.begin()
        for memory in self._memories:
            memory.begin(self._wrt.first())
        warm = False
        for stage, elements in self._grid.stages.items():
            rest = sum(e.length for e in elements)
            for number, element in enumerate(elements):
                left, expected = len(elements) - number, max(0, reserve[stage] - len(self._events[stage]))
                share = rest / max(1, left - expected)
                h, happened = self._advance(element, share, warm)
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
            memory.settle(self._grid, self._wrt.first())
        return None

    def _advance(self, element, share, warm):
        """One element of at most the length ``share``; returns its length and what happens at its end."""
        for memory in self._memories:
            memory.set_weights(element)
        h, last = self._step(element, share, warm), len(own_labels(element))
        while True:
            arrived = [(memory, memory.arrived(element)) for memory in self._memories]
            jumped = self._jumps.arrived(element)
            places = [p for found in (jumped, *(found for _, found in arrived)) for p in found if p is not None]
            if min(places, default=last) == last:
                break
            # a stage point is there already: the element ends where that point was
            h = self._step(element, h * self._grid.tau[min(places) - 1], True)
        if element is self._grid.elements[-1]:
            return h, []
        happened = self._jumps.end(element, jumped)
        for memory, found in arrived:
            if last in found or memory.ends_beyond(element.n, element.right):
                memory.end(element.n, element.right)
                happened.append(memory.name)
        return h, happened

    def _step(self, element, most, warm):
        """Solve one element with a length of at most ``most``; returns its length."""
        equations = self._problem(element)
        if equations.kind not in self._windows:
            refuse_freedom(equations)
            self._windows[equations.kind] = Window(equations, self._options), element.length
        window, nominal = self._windows[equations.kind]
        longest = max(most, element.length)
        for options in TRIES[not warm :]:
            answer = window.solve(equations, most / nominal, **options)
            h = window.length * nominal
            if answer.stationarity == 'B' and h > NO_STEP * longest:
                h = most if h > most - CUT * longest else h
                window.put_out(equations)
                self._block.r[element.n].set_value(h / element.length, skip_validation=True)
                return h
        self._require(answer)
        raise self._stuck(
            f"no step is possible from time {self._time:.6g}",
            "look for a bound that the solution reaches there, or for a state from which no mode leads on",
        )

    def _problem(self, element):
        if element.n not in self._equations:
            limits = [row for memory in self._memories for row in memory.limits(element)]
            self._equations[element.n] = self._reader.element(element, [*limits, *self._jumps.limits(element)])
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
                        "%.3g, so mpec_hybrid will not find this solution. Take more elements (nfe) or a larger length_bounds.",
                        a,
                        b,
                        least,
                    )

    def _require(self, answer):
        if answer.stationarity != 'B':
            raise self._stuck(
                f"no solution at time {self._time:.6g}: {answer.reason}",
                "check the equations there; more elements help where the solution is steep",
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
