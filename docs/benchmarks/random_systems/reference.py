"""Event-located solutions of random switching systems, by scipy and Filippov's rule, without finite elements.

Every part is in a mode or on one of its levels.  Where several parts are on their levels, all combinations (below, on, above) are
tried; a combination is a solution if every part below moves down, every part above moves up, and the weights of those on a level
keep them there with values in (0, 1).  Not exactly one combination: the system has several solutions from here, or none.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np
from benchmarks.random_systems.systems import RandomSystem
from scipy.integrate import solve_ivp

EXACT = {'method': 'DOP853', 'rtol': 1e-11, 'atol': 1e-12}
#: Distance to a level that counts as on it, and a rate or a weight that is too near to a tie.
ON, TIE = 1e-9, 1e-4
BELOW, LEVEL, ABOVE = -1, 0, 1
MOST_EVENTS = 30


class IllPosed(Exception):
    """The system has no robust solution: a tie, a grazing contact, or too many events."""


@dataclass(frozen=True)
class Solution:
    """End of the solution, and how it got there.

    Attributes
    ----------
    x : array (n)
    times : tuple
        of all events
    path : tuple
        what happened at them
    size : array (n)
        largest size of each state on the way
    unique : bool
        whether the rule left one way only
    slides : bool
    """

    x: np.ndarray
    times: tuple
    path: tuple
    size: np.ndarray
    unique: bool
    slides: bool


@dataclass(frozen=True)
class At:
    """Position of a part: mode k, or on level k (between modes k and k + 1)."""

    k: int
    on: bool = False


class EventLocated:
    """Solves one system from event to event."""

    def __init__(self, system: RandomSystem):
        self._s = system

    def solve(self) -> Solution:
        """Return the solution at the end.

        Raises
        ------
        IllPosed
        """
        s, t, x = self._s, 0.0, np.array(self._s.x0, dtype=float)
        at, unique = self._first(t, x)
        times, path, size, slides = [], [], np.abs(x), any(a.on for a in at)
        while t < s.end:
            run = solve_ivp(self._field(at), (t, s.end), x, events=self._events(at), max_step=s.end / 60, **EXACT)
            t, x, size = run.t[-1], run.y[:, -1], np.maximum(size, np.abs(run.y).max(axis=1))
            if not run.success or len(times) > MOST_EVENTS:
                raise IllPosed('too many events')
            if run.status == 1:
                (n,) = [n for n, found in enumerate(run.t_events) if len(found)]
                x, at, said, one = self._after(n, t, x, at)
                times.append(t)
                path.append(said)
                unique, slides = unique and one, slides or any(a.on for a in at)
        return Solution(x, tuple(times), tuple(path), size, unique, slides)

    # rates

    def _field(self, at):
        return lambda t, x: self._rates(t, x, at)[0]

    def _rates(self, t, x, at):
        """Return dx/dt and the weights of the upper modes of the parts on a level."""
        s = self._s
        f = s.A @ x + s.b
        if s.frequency:
            f = f + s.amplitude * np.sin(s.frequency * t)
        on = [(part, a) for part, a in zip(s.parts, at) if a.on]
        for part, a in zip(s.parts, at):
            f = f + np.array(part.rate(a.k, x))
        if not on:
            return f, []
        normals = np.array([part.gradient(x) for part, _ in on])
        steps = np.array([np.subtract(part.rate(a.k + 1, x), part.rate(a.k, x)) for part, a in on]).T
        M = normals @ steps
        if abs(np.linalg.det(M)) < 1e-8:
            raise IllPosed('no unique sliding mode')
        nu = np.linalg.solve(M, -normals @ f)
        return f + steps @ nu, list(nu)

    # events

    def _events(self, at):
        """Return the event functions, each positive until it happens."""
        found = []
        for j, (part, a) in enumerate(zip(self._s.parts, at)):
            if part.hysteresis:
                level = part.levels[1] if a.k == 0 else part.levels[0]
                sign = -1 if a.k == 0 else 1
                found.append(lambda t, x, p=part, level=level, sign=sign: sign * (p.c(x) - level))
            elif a.on:
                number = sum(b.on for b in at[:j])
                found.append(lambda t, x, n=number: self._rates(t, x, at)[1][n])
                found.append(lambda t, x, n=number: 1 - self._rates(t, x, at)[1][n])
            else:
                # the first and the last mode have one level; the other function never happens
                found.append(lambda t, x, p=part, a=a: p.c(x) - p.levels[a.k - 1] if a.k > 0 else 1.0)
                found.append(lambda t, x, p=part, a=a: p.levels[a.k] - p.c(x) if a.k < len(p.levels) else 1.0)
        if self._s.impact:
            found.append(lambda t, x: x[self._s.impact.position])
        for event in found:
            event.terminal, event.direction = True, -1
        return found

    def _after(self, n, t, x, at):
        """Return the state, the positions, a word and whether they are unique after event number n."""
        names = [(j, side) for j, part in enumerate(self._s.parts) for side in ((None,) if part.hysteresis else (BELOW, ABOVE))]
        if n == len(names):
            return self._jump(t, x, at)
        j, side = names[n]
        part, a = self._s.parts[j], at[j]
        at = list(at)
        if part.hysteresis:
            at[j] = At(1 - a.k)
            return (x, *self._settle(t, x, at, f'part {j} to mode {1 - a.k}'))
        if a.on:
            at[j] = At(a.k if side == BELOW else a.k + 1)
            return x, at, f'part {j} leaves level {a.k}', True
        at[j] = At(a.k - 1 if side == BELOW else a.k, on=True)
        return (x, *self._settle(t, x, at, f'part {j} at level {at[j].k}'))

    def _jump(self, t, x, at):
        impact = self._s.impact
        if x[impact.velocity] > -TIE:
            raise IllPosed('a grazing impact')
        x = x.copy()
        x[impact.position], x[impact.velocity] = 0.0, -impact.e * x[impact.velocity]
        # the parts go on from where they are after the jump
        positions = [a if p.hysteresis else self._position(p, x) for p, a in zip(self._s.parts, at)]
        self._check_regions(x, positions)
        return (x, *self._settle(t, x, positions, 'impact'))

    # positions

    def _check_regions(self, x, at):
        for p, a in zip(self._s.parts, at):
            if p.hysteresis and (p.c(x) > p.levels[1] if a.k == 0 else p.c(x) < p.levels[0]):
                raise IllPosed('outside the region of its mode')

    def _first(self, t, x):
        at = [At(p.first) if p.hysteresis else self._position(p, x) for p in self._s.parts]
        self._check_regions(x, at)
        found, _, unique = self._settle(t, x, at, '')
        return found, unique

    def _position(self, part, x):
        c = part.c(x)
        for k, level in enumerate(part.levels):
            if abs(c - level) < ON:
                return At(k, on=True)
        return At(int(np.searchsorted(part.levels, c)))

    def _settle(self, t, x, at, said):
        """Return the positions after all parts on a level have gone below, above or stayed; the word; whether there is one way."""
        on = [j for j, a in enumerate(at) if a.on]
        found = []
        for sides in product((BELOW, LEVEL, ABOVE), repeat=len(on)):
            tried = list(at)
            for j, side in zip(on, sides):
                tried[j] = At(at[j].k, on=True) if side == LEVEL else At(at[j].k + (side == ABOVE))
            if self._holds(t, x, tried, dict(zip(on, sides))):
                found.append(tried)
        if not found:
            raise IllPosed('no way on')
        return found[0], said, len(found) == 1

    def _holds(self, t, x, at, sides):
        """Whether the parts on a level go to these sides."""
        rates, weights = self._rates(t, x, at)
        weights = iter(weights)
        for j, side in sides.items():
            if side == LEVEL:
                nu = next(weights)
                if min(abs(nu), abs(1 - nu)) < TIE:
                    raise IllPosed('a slide that is just left')
                if not 0 < nu < 1:
                    return False
            else:
                speed = self._s.parts[j].gradient(x) @ rates
                if abs(speed) < TIE:
                    raise IllPosed('a tangent')
                if speed * side < 0:
                    return False
        return True


def solution(system: RandomSystem) -> Solution:
    """Return the solution of a system.

    Raises
    ------
    IllPosed
        if its events are not robust
    """
    return EventLocated(system).solve()
