"""Elements of one kind, solved as smooth collocation where the active set is known, by a window where it is not.

What is compiled is compiled when it is first needed.

Takes: ``Equations`` of the kind, the ``State`` in which the element before ended.
Leaves: values in the user's model.
Does not apply: to elements of another kind.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from pyomo.core import value

from pyomo_fesd.march.functions import Functions
from pyomo_fesd.march.scene import known_values, put_out
from pyomo_fesd.march.smooth import Smooth
from pyomo_fesd.march.window import Window
from pyomo_fesd.mpcc.phase import phase

#: A window and Newton's method have found the same element if their lengths differ by less than this part of it.
SAME = 1e-5
#: A side below this part of the other is zero at the first time.
STRICT = 1e-5


@dataclass(frozen=True)
class State:
    """Where an element ended.

    Attributes
    ----------
    active : dict name of a condition -> whether its H (else its G) is zero in the element; None if that is not known
    event : (name, bool) or None
        the condition whose H (else its G) is zero from there on
    left : array
        values there of all functions of ``kind``, or None
    kind : Kind
    theta : bytes
        for each condition whether its G (else its H) is positive in the element, as in eq. (12)
    """

    active: dict = None
    event: tuple = None
    left: np.ndarray = None
    kind: object = None
    theta: bytes = None


class Kind:
    """One kind of element.

    Parameters
    ----------
    pattern : Equations
        of any element of the kind
    element : Element
        that element
    grid : Grid
    options : dict
        of ``mpec_hybrid``
    timer : HierarchicalTimer
    """

    def __init__(self, pattern, element, grid, options, timer):
        self._pattern, self.nominal, self._grid = pattern, element.length, grid
        self._options, self._timer, self._values = options, timer, None

    @cached_property
    def window(self):
        """With complementarity."""
        with phase(self._timer, 'compile'):
            return Window(self._pattern, self._options)

    @cached_property
    def _functions(self):
        with phase(self._timer, 'compile'):
            return Functions(self._pattern, self._timer, self._options.get('user_scaling', True))

    @cached_property
    def _smooth(self):
        return Smooth(self._functions, self._grid.tau) if self._functions.complete else None

    def smooth_step(self, equations, state, most, start):
        """An element of at most the length ``most`` with the active set of ``state``; (length, State) or None."""
        if state.active is None or self._smooth is None:
            return None
        names = self._smooth.names
        if not state.active.keys() >= set(names):
            return None
        active = np.array([state.active[name] for name in names], dtype=bool)
        event = None if state.event is None or state.event[0] not in names else 2 * names.index(state.event[0]) + state.event[1]
        values = self._values if self._values is not None else start()
        with phase(self._timer, 'smooth'):
            return self._smooth_step(equations, active, self._left(state), most, values, event)

    def _left(self, state):
        return state.left if state.kind is self and state.left is not None else self._smooth.nothing

    def _smooth_step(self, equations, active, left, most, values, event=None):
        self._functions.know(known_values(equations))
        step = self._smooth.step(self._functions.point(values), active, most / self.nominal, left, event)
        if step is None:
            return None
        self._values = self._functions.values(step.w, values)
        put_out(equations, self._values)
        active = dict(zip(self._smooth.names, step.active.tolist()))
        condition = step.event is not None and step.event < 2 * len(active)
        event = (self._smooth.names[step.event // 2], step.event % 2) if condition else None
        return float(step.length) * self.nominal, State(active, event, step.end, self, step.theta)

    def window_step(self, equations, most, options):
        """Solve the window; returns what is known of it, and the length."""
        if self._values is not None:
            self.window.begin(self._values)
        with phase(self._timer, 'window'):
            answer = self.window.solve(equations, most / self.nominal, **options)
        return answer, self.window.length * self.nominal

    def take_window(self, equations, most, h):
        """Put out what the window has found, exactly where Newton's method finds the same; (length, State)."""
        self._values = self.window.values
        if self._smooth is not None:
            self._functions.know(known_values(equations))
            active = self._smooth.read(self._functions.point(self._values))
            with phase(self._timer, 'smooth'):
                found = self._smooth_step(equations, active, self._smooth.nothing, most, self._values)
            if found is not None and abs(found[0] - h) <= SAME * most:
                return found
            self._values = self.window.values
        self.window.put_out(equations)
        if self._smooth is None:
            return h, State()
        return h, State(dict(zip(self._smooth.names, active.tolist())))


def find_first(equations, sides, options, timer):
    """Find the values of the first time by Newton's method; False if their active set is not clear.

    Parameters
    ----------
    equations : Equations
    sides : dict name -> Pair
        the conditions there
    """
    with phase(timer, 'compile'):
        functions = Functions(equations, timer, options.get('user_scaling', True))
    if not functions.complete:
        return False
    functions.know(known_values(equations))
    smooth, before = Smooth(functions, (1.0,)), [v.value for v in equations.unknown]
    start = functions.point(before)
    step = smooth.step(start, smooth.guess(start), None, smooth.nothing)
    if step is not None:
        put_out(equations, functions.values(step.w, before))
    return step is not None and active_at_first(sides) is not None


def active_at_first(sides):
    """The active set of the first time; None where a condition has two sides that are zero.

    Parameters
    ----------
    sides : dict name -> Pair
    """
    found = {}
    for name, pair in sides.items():
        G, H = map(abs, map(value, pair))
        if min(G, H) > STRICT * max(G, H) or max(G, H) < STRICT:
            return None
        found[name] = G > H
    return found
