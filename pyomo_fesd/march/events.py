"""What happens between two elements of a march: a mode with memory ends, a state jumps.

Both are decided by the values at the end of an element.  Inside an element the weights of the modes and the values after a jump
are given; conditions and guards are kept >= 0, so the element ends where one of them would become negative.
"""

from pyomo.core import value

from pyomo_fesd.elements.jumps import jumping_states
from pyomo_fesd.errors import FesdError

#: A condition or guard below this has ended.
ENDED = 1e-7


class Memory:
    """The modes with memory of one Disjunction.

    Parameters
    ----------
    modes : list of elements.memory.Mode
    """

    def __init__(self, modes):
        self._modes, self._active = modes, None

    def begin(self, label):
        """The mode at the first time: the one that is fixed there, or the only one whose conditions hold."""
        given = [m for m in self._modes if m.weights[label].is_fixed() and value(m.weights[label]) > 0.5]
        possible = given or [m for m in self._modes if _room(m, label) >= 0]
        if len(possible) != 1:
            raise FesdError(
                self._modes[0].system,
                f"{len(possible)} modes are possible at the first time",
                "fix the indicator of the mode that comes first, e.g. m.heating[0].indicator_var.fix(True)",
            )
        self._active = possible[0]

    def variables(self):
        """The weights that are variables of their own."""
        return [w for m in self._modes for w in m.weights.values() if w.is_variable_type()]

    def rows(self, label):
        """The conditions at one time, each for its mode only: nu c + (1 - nu) >= 0."""
        return [m.weights[label] * c + (1 - m.weights[label]) >= 0 for m in self._modes for c in m.conditions[label]]

    def set_weights(self, labels):
        """Give nu its values at the labels of an element."""
        for mode in self._modes:
            for weight in (mode.weights[t] for t in labels if t in mode.weights):
                if weight.is_variable_type():
                    weight.set_value(float(mode is self._active), skip_validation=True)

    def end(self, label):
        """Change the mode if a condition of the active one has ended at ``label``; returns whether it has."""
        if _room(self._active, label) > ENDED:
            return False
        others = [m for m in self._modes if m is not self._active and _room(m, label) >= -ENDED]
        if not others:
            raise FesdError(self._active.name, "no other mode is possible where this one ends", "let the regions overlap")
        self._active = max(others, key=lambda m: _room(m, label))
        return True

    def settle(self, home, grid, first):
        """What the law of switching between elements says at the values of the march: p, n and d at every boundary."""
        labels = [first, *(e.right for e in grid.elements)]
        for mode in self._modes:
            weights = [value(mode.weight(e)) for e in grid.elements]
            for b, label in enumerate(labels):
                now = [value(c) for c in mode.conditions[label]]
                left = 0 < b < len(grid.elements) and weights[b - 1] > weights[b]
                for k, c in enumerate(now, start=1):
                    c = 0.0 if abs(c) <= ENDED else c
                    home.p[mode.name, b, k].set_value(max(c, 0.0), skip_validation=True)
                    home.n[mode.name, b, k].set_value(max(-c, 0.0), skip_validation=True)
                    if (mode.name, b, k) in home.d:
                        home.d[mode.name, b, k].set_value(float(left and c <= ENDED), skip_validation=True)


def _room(mode, label):
    return min((value(c) for c in mode.conditions[label]), default=float('inf'))


class Jumps:
    """The laws of reset of a model.

    Parameters
    ----------
    jumps : list of elements.jumps.Jump
    home : Block or None
        what ``fesd.finite_elements`` made of them
    """

    def __init__(self, jumps, home):
        self._jumps, self._home = jumps, home

    def rows(self, label):
        """The guards at one time."""
        return [j.guards[label] >= 0 for j in self._jumps]

    def variables(self):
        """The values after the boundaries."""
        return list(self._home.after.values()) if self._home is not None else []

    def stay(self, boundary, label, times):
        """No jump: the values after ``boundary`` are the states at ``label``."""
        for j, x in enumerate(jumping_states(self._jumps, next(iter(self._jumps[0].resets))) if self._jumps else (), start=1):
            self._home.after[boundary, j].set_value(times.at(x, label).value, skip_validation=True)

    def end(self, boundary, label, limited):
        """Jump at an inner boundary if the element was cut short and a guard is zero; returns whether it did."""
        if self._home is None or boundary not in self._home.boundary:
            return False
        happened = False
        for jump in self._jumps:
            now = limited and value(jump.guards[label]) <= ENDED
            self._home.e[jump.name, boundary].set_value(float(now), skip_validation=True)
            happened = happened or now
        for j in range(1, 1 + len(jumping_states(self._jumps, label))):
            self._home.after[boundary, j].set_value(value(self._home.reset[boundary, j].expr.args[1]), skip_validation=True)
        return happened

    def copies(self, boundary):
        """The copies of multipliers after a boundary, by place, and their rows."""
        home = self._home
        if home is None:
            return {}, []
        rows = [c.expr for (b, _), c in home.copied.items() if b == boundary]
        return {k: v for (b, k), v in home.copy.items() if b == boundary}, rows

    def take(self, pattern, boundary):
        """Bring the copies of the pattern's boundary to another one."""
        others = self.copies(boundary)[0]
        for place, v in self.copies(pattern)[0].items():
            if place in others:
                others[place].set_value(v.value, skip_validation=True)

    def put(self, pattern, boundary):
        """Copy the values after ``boundary`` to the boundary of the pattern."""
        for (b, j), after in self._home.after.items() if self._home is not None else ():
            if b == boundary:
                self._home.after[pattern, j].set_value(after.value, skip_validation=True)
