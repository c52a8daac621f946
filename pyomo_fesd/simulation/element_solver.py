"""Solve one element after the other, each up to the next switch, the end of a mode with hysteresis, or a state jump."""

from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import chain
from math import log2

from pyomo.common.collections import ComponentMap
from pyomo.core import Block, Var, value
from pyomo.core.base.var import VarData

from pyomo_fesd.core import Element, TimeIndex, derivatives, moving_grids, own_data, phase
from pyomo_fesd.simulation.determinacy import refuse_undetermined, refuse_undetermined_start
from pyomo_fesd.simulation.element_class import ElementClass, ElementEnd, LeftBoundary
from pyomo_fesd.simulation.equation_reader import EquationReader
from pyomo_fesd.simulation.events import JumpEvents, read_hysteresis
from pyomo_fesd.simulation.impacts import ImpactEvents
from pyomo_fesd.simulation.inputs import given_variables, prescribed_states
from pyomo_fesd.simulation.largest_residuals import largest_residuals
from pyomo_fesd.simulation.progress import Progress
from pyomo_fesd.simulation.sizes import Sizes
from pyomo_fesd.simulation.step_sizes import SimulatedElement

#: Parts of an element's usual length, or of the length aimed at if that is longer.  A step shorter than the first is none: the
#: rest of a control stage after a switch may be as short as the solver's tolerances.  A step that misses its aim by more than the
#: second has been cut short by an event.
NO_STEP, CUT = 1e-9, 1e-7
#: A given state jumps if it changes by more than the first part of its value, and so many times faster than to the element's end.
JUMP, STEEP = 1e-6, 2.0
#: Options of the MPCC, tried in this order: a warm start from the last element; searches farther away; other starts.
TRIES = (
    {'warm_start': True, 'lpec': 'reduced'},
    {'lpec': 'full', 'relaxation': 'elastic'},
    {'lpec': 'full'},
    {'lpec': 'full', 'starts': 6},
)
#: How many of these are tried where the elements are only a start, and nothing else: from where the last element ended most steps
#: are found, and searches, up to some seconds a step, mostly find bodies on another side of a surface.
QUICK = 1
#: Where a solution can be followed for less than the first part of a step, and no step is found, other searches and starts do not
#: help.  A switch that ends it is found in a step at most so many times as long as it was followed.
ENDS, FOLLOWED = 1e-3, (2.0, 10.0)
#: A step of length zero is a local solution of its own where a switch lies on the left boundary.  Then lengths of at least these
#: parts of the aim are asked for; a step is longer by the last part, else the bound holds it.
LEAST, BEYOND, LONGER = (1e-2, 1e-4), {'lpec': 'full', 'relaxation': 'elastic'}, 1e-3
#: Round-off in how far a drift turns a surface.
TURNED = 1e-6


class ElementSolver:
    """Solves the elements of one moving grid in their order; errors say the ``progress``.

    Parameters as of ``simulate``; ``lengths`` by the number of an element, where they are usually not near the nominal one;
    ``quick`` where a failure costs less than a long search.

    Attributes
    ----------
    given : ComponentSet
        variables with known values
    """

    def __init__(self, model, times: TimeIndex, inputs, options, timer, progress: Progress, lengths=None, quick=False):
        self._model, self._first, self._options, self._timer = model, times.wrt.first(), options, timer
        self._times, self._progress, self._lengths, self._quick = times, progress, lengths or {}, quick
        self._moving = moving_grids(model)[times.wrt]
        self._grid, self._hysteresis = self._moving.grid, read_hysteresis(self._moving)
        self._jumps = JumpEvents(self._moving.state_jumps)
        has_contacts = self._moving.state_jumps is not None and self._moving.state_jumps.impacts is not None
        self._turned = defaultdict(list)
        for (_, n, _), c in ((self._moving.state_jumps.impacts.turned if has_contacts else None) or {}).items():
            self._turned[n].append(c)
        # gaps and forces of contacts are 0 to round-off over long times, which is no size
        self._sizes = Sizes(self._times) if has_contacts else None
        self._impacts = ImpactEvents(self._moving.state_jumps, self._times, self._solve_impact)
        self.given = given_variables(model, self._times, inputs, self._moving.held)
        self.given.update(v for some in self._hysteresis for e in self._grid.elements for v in some.variables(e.right))
        self._reader = EquationReader(model, self._moving, self._times, self.given)
        self._equations, self._classes, self._end = {}, {}, ElementEnd()

    def are_alike(self, elements: Iterable[Element]) -> bool:
        """Return whether ``elements`` have the same equations."""
        return len({self._read(element).element_class for element in elements}) == 1

    def find_initial_values(self) -> None:
        """Find the values of the first time: algebraic variables, modes, and states that equations there determine."""
        for modes in self._hysteresis:
            modes.begin(self._first)
            modes.set_weights(self._grid.elements[0])
        self._learn_sizes()
        equations = self._reader.first(self._first)
        states = (v for d in derivatives(self._model, self._times.wrt) for v in d.get_state_var().values())
        refuse_undetermined_start(equations, [v for v in states if self._times.time(v) == self._first and not v.fixed])
        if equations.unknown:
            initial = ElementClass(self._sized(equations), None, (1.0,), self._options, self._timer, self._progress.deadline)
            if not initial.find_initial_values(equations) or self._reader.active_set(self._first) is None:
                self._solve_first_mpcc(initial.mpcc, equations)

    def _solve_first_mpcc(self, mpcc, equations):
        with phase(self._timer, 'mpcc'):
            answer = mpcc.solve(equations)
        self._progress.check_time()
        if answer.stationarity != 'B':
            residuals = largest_residuals(self._model, self._times, equations, mpcc.values)
            raise self._progress.error(
                f"no solution at time {self._progress.time:.6g}: {residuals or answer.reason or answer.outcome}",
                "check the equations there, and the initial values",
            )
        mpcc.write(equations)

    def begin_pass(self) -> None:
        """Begin a pass at the first time."""
        self._jumps.begin()
        self._impacts.begin()
        for element_class in self._classes.values():
            element_class.begin_pass()
        for modes in self._hysteresis:
            modes.begin(self._first)
        self._end = ElementEnd(self._reader.active_set(self._first), is_first=True)

    def begin_stage(self) -> None:
        """Begin a control stage: values of functions may jump with the controls."""
        self._end = replace(self._end, values=None)

    def mark(self) -> tuple:
        """Return what the next element depends on besides the values in the model."""
        return self._end, [source.mark() for source in self._sources()], {c: c.mark() for c in self._classes.values()}

    def return_to(self, mark: tuple) -> None:
        """Return to a mark of this pass; the next element is the one of then."""
        self._end, of_sources, of_classes = mark
        for source, was in zip(self._sources(), of_sources):
            source.return_to(was)
        for element_class in self._classes.values():
            element_class.return_to(of_classes.get(element_class))

    def end_pass(self) -> None:
        """Set the multipliers of the hysteresis conditions, and the variables of requirements."""
        for modes in self._hysteresis:
            modes.set_multipliers(self._grid, self._first)
        self._reader.requirements.fulfil()

    def written(self) -> Iterator[VarData]:
        """Yield the variables that a pass writes, some of them repeatedly."""
        for equations in self._equations.values():
            yield from equations.unknown
        yield from own_data(self._moving.block, Var, Block)
        yield from self._reader.requirements.variables
        for modes in self._hysteresis:
            for element in self._grid.elements:
                yield from modes.variables(element.right)

    def solve(self, element, aim: float, warm: bool) -> SimulatedElement:
        """Solve the next element, up to the length ``aim`` or the first event; ``warm`` as in ``TRIES``."""
        for modes in self._hysteresis:
            modes.set_weights(element)
        (h, end), last = self._step(element, aim, warm), len(element.own_labels)
        while (position := min(self._arrivals(element), default=last)) < last:
            # a function is zero at a collocation point already: the element ends there
            h, end = self._step(element, h * self._grid.tau[position - 1], True)
        self._check_turns(element)
        self._end = end
        events = [] if element is self._grid.elements[-1] else self._pass_boundary(element)
        return SimulatedElement(h, end.activity, events)

    def _check_turns(self, element):
        """Refuse a solution in which a drift has brought a body to another side of a surface (eq. 22)."""
        for c in self._turned[element.n]:
            if not c.lower * (1 + TURNED) <= value(c.body) <= c.upper * (1 + TURNED):
                raise self._progress.error(
                    f"from time {self._progress.time:.6g} on the contact '{c.index()[0]}' is found on another side of its surface",
                    "take more elements, or let the positions begin with values near the first ones (initialize=)",
                )

    def _arrivals(self, element):
        return [position for source in self._sources() for position in source.find_arrivals(element)]

    def _sources(self):
        return (*self._hysteresis, self._jumps, self._impacts)

    def _pass_boundary(self, element):
        # jumps first: conditions of modes are evaluated right of the boundary
        sources = (self._jumps, self._impacts, *self._hysteresis)
        events = [name for source in sources for name in source.pass_boundary(element)]
        if events:
            self._end = replace(self._end, values=None)
        return events

    def _solve_impact(self, b, closed):
        """Solve the laws of impact at boundary b."""
        equations = self._reader.boundary(b, closed)
        impact = self._class(equations, None, (1.0,))
        answer = impact.mpcc.solve(equations)
        self._progress.check_time()
        if answer.stationarity != 'B':
            raise self._progress.error(
                f"the impact at time {self._progress.time:.6g} has no solution: {answer.reason or answer.outcome}",
                "check the directions of the contact forces, and the masses",
            )
        impact.mpcc.write(equations)

    def _step(self, element, most, warm):
        """Solve one element with a length of at most ``most``; returns its length and its ``ElementEnd``."""
        self._progress.check_time()
        equations = self._read(element)
        element_class, longest = self._class_of(equations, element), max(most, self._usual_length(element))
        found = element_class.newton_step(equations, self._end, most, lambda: self._left_boundary(equations, element))
        if found is None:
            search = self._quick_step if self._quick else self._mpcc_step
            found = search(element_class, equations, most, TRIES[not warm :], NO_STEP * longest, element)
        h, end = found
        h = most if h > most - CUT * longest else h
        self._moving.r[element.n].set_value(h / element.length, skip_validation=True)
        return h, end

    def _read(self, element):
        if element.n not in self._equations:
            with phase(self._timer, 'read'):
                functions = {}
                for source in self._sources():
                    functions |= source.event_functions(element)
                equations = self._reader.element(element, functions)
                # the rows of a mode that is off show no size
                weights = ComponentMap(chain.from_iterable(modes.equal_weights(element) for modes in self._hysteresis))
                self._equations[element.n] = replace(equations, typical=weights)
        return self._equations[element.n]

    def _class_of(self, equations, element):
        if equations.element_class not in self._classes:
            refuse_undetermined(equations)
        # scaling by a power of 2 is exact
        unit = 2.0 ** round(log2(self._usual_length(element) / element.length))
        return self._class(equations, element.length, self._grid.tau, unit)

    def _usual_length(self, element):
        return self._lengths.get(element.n, element.length)

    def _class(self, equations, nominal, tau, unit=1.0):
        key = equations.element_class
        if key not in self._classes:
            equations = self._sized(equations)
            self._classes[key] = ElementClass(equations, nominal, tau, self._options, self._timer, self._progress.deadline, unit)
        return self._classes[key]

    def _learn_sizes(self):
        if self._sizes is not None:
            element = self._grid.elements[0]
            equations = self._read(element)
            self._sizes.learn(equations, self._left_boundary(equations, element).unknown)

    def _sized(self, equations):
        """The equations with factors by the sizes of their variables; without contacts as they are."""
        if self._sizes is None:
            return equations
        self._sizes.learn(equations, [v.value for v in equations.unknown])
        return replace(equations, size_factor=self._sizes.factor)

    def _left_boundary(self, equations, element):
        def values(variables):
            return [self._value_at(v, element.left) if self._times.time(v) is not None else v.value for v in variables]

        return LeftBoundary(values(equations.unknown), values(equations.known))

    def _value_at(self, v, label):
        """Value of the counterpart of a variable at another time, or its own without one."""
        try:
            found = self._times.at(v, label).value
        except KeyError:
            found = None
        return v.value if found is None else found

    def _quick_step(self, element_class, equations, most, tries, no_step, element):
        """As ``_mpcc_step``, by the first tries only."""
        for options in tries[:QUICK]:
            answer, h = self._longest(element_class, equations, most, options)
            if answer.stationarity == 'B' and h > no_step:
                return element_class.accept_mpcc(equations, most, h)
        raise self._progress.error(f"no step was found from time {self._progress.time:.6g} at once", "simulate the model alone")

    def _mpcc_step(self, element_class, equations, most, tries, no_step, element):
        """A step longer than ``no_step`` where the next active set is unknown, or does not hold."""
        is_stuck = False
        for options in tries:
            answer, h = self._longest(element_class, equations, most, options)
            if answer.stationarity == 'B':
                if h <= no_step and not is_stuck:
                    is_stuck, h = True, self._length_beyond(element_class, equations, most)
                if h > no_step:
                    return element_class.accept_mpcc(equations, most, h)
                continue
            reached = element_class.followed(equations, self._end, most, self._left_boundary(equations, element))
            if 0 < reached < ENDS * most:
                return self._beyond(element_class, equations, most, reached, answer, no_step)
        raise self._no_step(element_class, equations, most, answer, element)

    def _beyond(self, element_class, equations, most, reached, answer, no_step):
        """A step to a switch a little beyond the length up to which the solution is followed; without one this ends there."""
        ends = self._solution_ends(element_class, equations, most, reached, answer)
        for factor in FOLLOWED:
            found, h = self._longest(element_class, equations, factor * reached, BEYOND)
            if found.stationarity == 'B' and h > no_step:
                return element_class.accept_mpcc(equations, factor * reached, h)
        raise ends

    def _length_beyond(self, element_class, equations, most):
        """The length of a step that is not zero; 0 if none is found."""
        for part in LEAST:
            answer, h = self._longest(element_class, equations, most, BEYOND, part * most)
            if answer.stationarity == 'B' and h > part * most * (1 + LONGER):
                return h
        return 0.0

    def _longest(self, element_class, equations, most, options, least=0.0):
        found = element_class.mpcc_step(equations, most, options, least)
        self._progress.check_time()
        return found

    def _solution_ends(self, element_class, equations, most, reached, answer):
        residuals = largest_residuals(self._model, self._times, equations, element_class.mpcc.values)
        return self._progress.error(
            f"no step of length {most:.6g} was found from time {self._progress.time:.6g}: {answer.outcome}; steps from there are "
            f"solved up to a length of {reached:.3g}, and longer ones are not{f'; {residuals}' if residuals else ''}",
            "check the equations and the values there: the solution ends or bursts within that length, as from initial values that "
            "are far from any balance; where it is only steep, elements of that length help",
        )

    def _no_step(self, element_class, equations, most, answer, element):
        mpcc, now = element_class.mpcc, f"{self._progress.time:.6g}"
        mpcc.solve(equations, most / element_class.nominal, most / element_class.nominal)
        residuals = largest_residuals(self._model, self._times, equations, mpcc.values)
        forced = f"; where one is forced, {residuals}" if residuals else ''
        jump = self._jump_of_given_state(element)
        if jump:
            return self._progress.error(
                f"no step was found from time {now}: {jump}{forced}",
                "a state cannot jump: let its values be continuous, also from the first time on, as those of "
                "pyomo_fesd.signal(..., kind='linear')",
            )
        if answer.stationarity == 'B':
            return self._progress.error(
                f"no step is possible from time {now}{forced}",
                "look for a bound that the solution reaches there, or for a state from which no mode leads on",
            )
        return self._progress.error(
            f"no step was found from time {now}: {answer.outcome}{forced}",
            "check the equations there; more elements help where the solution is steep",
        )

    def _jump_of_given_state(self, element):
        """A sentence on a state that is given and has another value right of the boundary than on it; empty without one."""
        for by_time in prescribed_states(self._model, self._times):
            left, right = by_time.get(element.left), by_time.get(element.points[0])
            far = by_time.get(element.right)
            if None in (left, right, far) or None in (left.value, right.value, far.value):
                continue
            # a given ramp changes in proportion to time, a jump at once
            change, least = abs(right.value - left.value), JUMP * max(abs(left.value), abs(right.value))
            if change > max(least, STEEP * self._grid.tau[0] * abs(far.value - left.value)):
                return f"the state '{right.name}' is given, and jumps there from {left.value:.6g} to {right.value:.6g}"
        return ''
