"""The random systems of the study: kinds, and the draw of each system from its kind and seed."""

from dataclasses import replace

import numpy as np
from benchmarks.random_systems.reference import IllPosed, solution
from benchmarks.random_systems.systems import Impact, Part, RandomSystem

#: Change of b that must not change what happens, and how much it may change the end.
NUDGE, ROBUST = 1e-5, 1e-2
#: Units of time and of the states.
UNITS = (1e-9, 1e-6, 1e-3, 1.0, 1e3, 1e6, 1e9)


def smooth(rng, n):
    """A damped linear system with a start: A, b, x0."""
    A = rng.uniform(-1, 1, (n, n))
    A -= np.eye(n) * (max(np.linalg.eigvals(A).real.max(), 0.0) + 0.2)
    return A, rng.uniform(-1, 1, n), rng.uniform(-1.5, 1.5, n)


def chain(rng, n, levels=1, attracts=0.0, repels=0.0, curved=False):
    """A part with a number of levels; ``attracts`` and ``repels`` add rates towards and away from them."""
    weights = rng.uniform(-1, 1, n)
    weights /= np.linalg.norm(weights)
    middle = rng.uniform(-0.7, 0.7)
    at = tuple(np.sort(middle + np.arange(levels) * rng.uniform(0.4, 0.9)))
    rates = rng.uniform(-1.5, 1.5, (levels + 1, n))
    push = np.linspace(1, -1, levels + 1)[:, None] * weights
    rates += (attracts - repels) * push * 2.5
    gains = rng.uniform(-0.3, 0.3, (levels + 1, n, n)) * (rng.random() < 0.5)
    return Part(weights, rng.uniform(-0.3, 0.3) if curved else 0.0, at, rates, gains)


def relay(rng, n):
    """A part with hysteresis that drives its switching function from one threshold to the other."""
    part = chain(rng, n, 1)
    rates = part.rates * 0.3 + np.array([[1.0], [-1.0]]) * part.weights * rng.uniform(1.0, 3.0)
    width = rng.uniform(0.2, 0.6)
    return Part(
        part.weights, 0.0, (part.levels[0] - width, part.levels[0] + width), rates, part.gains * 0.3, first=int(rng.integers(2))
    )


def plain(rng, *parts, n=None, forced=0.3, **more):
    """A system with these parts."""
    n = n or int(rng.integers(2, 4))
    A, b, x0 = smooth(rng, n)
    system = RandomSystem('', 0, A, b, x0, rng.uniform(1.0, 3.0), [make(rng, n) for make in parts], **more)
    if rng.random() < forced:
        system = replace(system, amplitude=rng.uniform(-1, 1, n), frequency=rng.uniform(1, 4))
    return system


def one_switch(rng):
    return plain(rng, lambda r, n: chain(r, n, curved=True))


def several_levels(rng):
    return plain(rng, lambda r, n: chain(r, n, int(r.integers(2, 4))))


def sliding(rng):
    return plain(rng, lambda r, n: chain(r, n, int(r.integers(1, 3)), attracts=r.uniform(0.3, 1.0)))


def two_disjunctions(rng):
    return plain(rng, chain, lambda r, n: chain(r, n, attracts=r.uniform(0, 0.8)))


def three_disjunctions(rng):
    return plain(rng, *[lambda r, n: chain(r, n, attracts=r.uniform(0, 0.5))] * 3, n=3)


def hysteresis(rng):
    return plain(rng, relay)


def hysteresis_and_levels(rng):
    return plain(rng, relay, lambda r, n: chain(r, n, int(r.integers(1, 3))))


def impacts(rng):
    """A ball that a spring or gravity pulls down."""
    parts = [] if rng.random() < 0.5 else [lambda r, n: chain(r, n, attracts=r.uniform(0, 0.3))]
    system = plain(rng, *parts, n=2, forced=0.0, impact=Impact(0, 1, rng.uniform(0.6, 1.0)))
    for part in system.parts:
        part.rates[:, 0], part.gains[:, 0] = 0.0, 0.0
    A = np.array([[0.0, 1.0], [-rng.uniform(0, 2), -rng.uniform(0, 0.3)]])
    return replace(system, A=A, b=np.array([0.0, -rng.uniform(2.5, 6)]), x0=np.array([rng.uniform(0.3, 1.5), rng.uniform(-1, 1)]))


def on_the_surface(rng):
    """A start on a level."""
    system = plain(rng, lambda r, n: chain(r, n, attracts=r.uniform(-0.3, 0.8)))
    return _start_on_level(system)


def repelling(rng):
    """A start on a level that both modes lead away from: several solutions."""
    return _start_on_level(plain(rng, lambda r, n: chain(r, n, repels=r.uniform(0.8, 1.5))))


def _start_on_level(system):
    part = system.parts[0]
    return replace(system, x0=system.x0 + part.weights * (part.levels[0] - part.c(system.x0)))


def switch_on_a_node(rng):
    """A horizon of which the first event is at an inner boundary of the nominal grid."""
    system = (one_switch, sliding, hysteresis)[rng.integers(3)](rng)
    found = solution(system)
    if not found.times:
        raise IllPosed('no event')
    end = found.times[0] * system.nfe / int(rng.integers(1, system.nfe))
    if end > 4.0:
        raise IllPosed('too long')
    return replace(system, end=end)


def units(rng):
    """Systems of other kinds in units from 1e-9 to 1e9."""
    system = (one_switch, sliding, hysteresis)[rng.integers(3)](rng)
    return replace(system, time_unit=float(rng.choice(UNITS)), state_unit=float(rng.choice(UNITS)))


KINDS = {
    'one switch': one_switch,
    'several levels': several_levels,
    'sliding': sliding,
    'two Disjunctions': two_disjunctions,
    'three Disjunctions': three_disjunctions,
    'hysteresis': hysteresis,
    'hysteresis and levels': hysteresis_and_levels,
    'impacts': impacts,
    'start on the surface': on_the_surface,
    'repelling': repelling,
    'switch on a node': switch_on_a_node,
    'units': units,
}


def draw(kind, seed):
    """Return the system of a kind and a seed, and its solution: the first draw that is robust and switches."""
    rng = np.random.default_rng([list(KINDS).index(kind), seed])
    while True:
        try:
            system = KINDS[kind](rng)
            found = solution(system)
            if _is_wanted(kind, system, found):
                # three elements for each event, so that events have room
                nfe = system.nfe if kind == 'switch on a node' else max(10, 3 * (len(found.times) + 1))
                return replace(system, kind=kind, seed=seed, nfe=nfe), found
        except IllPosed:
            continue


def _is_wanted(kind, system, found):
    if not found.unique:
        return kind == 'repelling'
    if kind == 'repelling' or not (found.times or found.slides) or len(found.times) > 7:
        return False
    gaps = np.diff([0.0, *found.times, system.end]) if found.times else [1.0]
    if kind == 'switch on a node':
        gaps = gaps[:-1]
    if min(gaps) < 1e-3 * system.end:
        return False
    nudged = solution(replace(system, b=system.b + NUDGE))
    return nudged.path == found.path and np.all(np.abs(nudged.x - found.x) <= ROBUST * np.maximum(found.size, 1e-2))
