"""The cases of the stability study: families of systems with known answers (a table at the end of the file)."""

from dataclasses import replace
from math import ceil, cos, e, exp, floor, log, pi, sin, sqrt

import numpy as np
from stability_cases import GAUSS, RADAU, Ambiguous, Case, Sensitivity
from stability_reference import genes
from stability_systems import Part, System, one

STARTS = 50
#: Powers of ten.
SCALES = tuple(10.0**k for k in range(-6, 7, 2))


def starts(family, low, high, spread=1.0, number=STARTS):
    """``(seed, initial state, guess of all times)``: reproducible, uniform, and normal about the initial state."""
    for seed in range(number):
        draw = np.random.default_rng([seed, *map(ord, family)])
        x0 = draw.uniform(low, high)
        yield seed, float(x0), float(x0 + spread * draw.normal())


# one surface, straight pieces


def crossing(x0=-1.0, end=1.5, state=1.0, c=1.0, time=1.0, **keywords):
    """dx/dt = 2 below zero and 0.2 above; units of state, switching function and time."""
    rate = state / time
    reached = (x0 + 2 * end if -x0 / 2 > end else 0.2 * (end + x0 / 2)) if x0 < 0 else x0 + 0.2 * end
    parts = one(lambda x, f: c * x[0], lambda x, u, f: [0.2 * rate], lambda x, u, f: [2 * rate])
    return System((x0 * state,), end * time, parts, (reached * state,), (state,), **keywords)


def sliding(x0=-0.5, end=1.5, state=1.0, c=1.0, time=1.0, **keywords):
    """dx/dt = -sgn x, with the integral of x."""
    rate, t = state / time, min(abs(x0), end)
    area = (x0 - np.sign(x0) * t / 2) * t
    parts = one(lambda x, f: c * x[0], lambda x, u, f: [-rate, x[0] / time], lambda x, u, f: [rate, x[0] / time])
    answer = (np.sign(x0) * (abs(x0) - t) * state, area * state)
    guess = keywords.pop('guess', None)
    guess = guess and (*guess, 0.0)
    return System((x0 * state, 0.0), end * time, parts, tuple(map(float, answer)), (state, state), guess=guess, **keywords)


def signum(x0=-1.0, end=2.0, **keywords):
    """dx/dt = 2 - sgn x."""
    parts = one(lambda x, f: x[0], lambda x, u, f: [1.0], lambda x, u, f: [3.0])
    reached = end + x0 / 3 if x0 < 0 else x0 + end
    return System((x0,), end, parts, (reached,), **keywords)


def crossings():
    for seed, x0, guess in starts('crossing', -2.5, -0.05):
        yield Case('crossing', 'x0 and guess at random', seed, crossing(x0, guess=(guess,)))


def slides():
    for seed, x0, guess in starts('sliding', -1.4, 1.4):
        yield Case('entering a slide', 'x0 and guess at random', seed, sliding(x0, guess=(guess,)))


def not_unique():
    parts = one(lambda x, f: x[0], lambda x, u, f: [1.0], lambda x, u, f: [-1.0])
    for seed, _, guess in starts('unique', 0.0, 0.0, number=20):
        yield Ambiguous('non-uniqueness', 'dx/dt = sgn x from 0, guess at random', seed, System((0.0,), 1.0, parts, guess=(guess,)))


def simultaneous():
    """Two copies of 'crossing' that switch at once, or nearly so."""

    def part(i):
        def rates(v):
            return lambda x, u, f: [v if j == i else 0.0 for j in (0, 1)]

        return Part(lambda x, f: [x[i]], [((1,), rates(0.2)), ((-1,), rates(2.0))])

    for seed, (apart, nfe) in enumerate((d, n) for d in (0, 1e-12, 1e-9, 1e-7, 1e-5, 1e-4, 1e-3, 1e-2) for n in (5, 10, 20)):
        answer = (0.2, 0.2 * (1.5 + (-1 + apart) / 2))
        system = System((-1.0, -1.0 + apart), 1.5, [part(0), part(1)], answer)
        yield Case('simultaneous switches', f'{apart:.0e} apart, {nfe} elements', seed, system, nfe)


def sensitivity():
    for seed, x0, _ in starts('sensitivity', -2.9, -0.3):
        system = replace(signum(x0), answer=(1 / 3,))
        looks = lambda v: f'{v[0]:.1f} instead of 1/3'  # noqa: E731
        yield Sensitivity('sensitivity', 'dx(T)/dx0 of dx/dt = 2 - sgn x', seed, system, 10, looks=looks)


def false_minima():
    """min int x^2 dt + (x(2) - 5/3)^2 over x0."""
    best = -1.427572232082767
    parts = one(lambda x, f: x[0], lambda x, u, f: [1.0, x[0] ** 2], lambda x, u, f: [3.0, x[0] ** 2])
    answer = (2 + best / 3, None)
    for seed, x0, _ in starts('minima', -2.0, -0.8):
        final = lambda x, f: x[1] + (x[0] - 5 / 3) ** 2  # noqa: E731
        system = System((x0, 0.0), 2.0, parts, answer, final=final, free=(-2.5, -0.5))
        yield Case('false minima', '50 guesses of x0', seed, system, 10, looks=lambda v: 'a false minimum')


def free_start():
    """x0 from the end x(2) = 4/3; the integral of x tells which x0 was found."""
    parts = one(lambda x, f: x[0], lambda x, u, f: [1.0, x[0]], lambda x, u, f: [3.0, x[0]])
    for seed, x0, _ in starts('free', -2.9, -0.3):
        target = lambda x, f: [x[0] - 4 / 3]  # noqa: E731
        system = System((x0, 0.0), 2.0, parts, (4 / 3, 2 / 9), target=target, free=(-3.0, -0.1))
        yield Case('x0 free', 'from the end x(2) = 4/3', seed, system, 10)


# where a switch lies


def stage_boundary():
    """The switch on a boundary of control stages, and near it."""
    offsets = (0.0, *(s * d for d in (1e-12, 1e-9, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2) for s in (-1, 1)))
    kinds = {'crossing': lambda d: crossing(-1 + 2 * d, stages=[0.5, 1.0]), 'slide': lambda d: sliding(-0.5 + d, stages=[0.5, 1.0])}
    for seed, (kind, d) in enumerate((k, d) for k in kinds for d in offsets):
        yield Case('switch on a stage boundary', f'{kind}, {d:.0e} before it', seed, kinds[kind](d), 12)


def at_the_start():
    """A switch at t = 0, and right after it."""
    offsets = (0.0, *(s * d for d in (1e-12, 1e-9, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3) for s in (-1, 1)))
    kinds = {'crossing': crossing, 'slide': sliding}
    for seed, (kind, d) in enumerate((k, d) for k in kinds for d in offsets):
        yield Case('switch at t0', f'{kind}, x0 = {d:.0e}', seed, kinds[kind](d), 12)


def close_pair():
    """A pulse of area 1 between two switches that are nearer to one another than an element is long."""

    def pulse(width):
        up, none = (lambda v: lambda x, u, f: [1.0, v])(1 / width), (lambda x, u, f: [1.0, 0.0])
        modes = [((1, -1), up), ((-1, -1), none), ((1, 1), none)]
        part = Part(lambda x, f: [x[0] - 1 + width / 2, x[0] - 1 - width / 2], modes)
        return System((0.0, 0.0), 2.0, [part], (2.0, 1.0))

    cases = ((r, n) for r in (2.0, 1.0, 0.5, 0.3, 0.2, 0.1, 0.05, 0.02, 0.01, 0.001) for n in (5, 20))
    for seed, (ratio, nfe) in enumerate(cases):
        yield Case(
            'two switches in one element', f'{ratio:g} of an element apart, {nfe} elements', seed, pulse(ratio * 2 / nfe), nfe
        )


def many_switches():
    """dy/dt = sgn sin(pi s): a switch at every full second, in one control stage."""
    parts = one(lambda x, f: f.sin(pi * x[0]), lambda x, u, f: [1.0, 1.0, x[1]], lambda x, u, f: [1.0, -1.0, x[1]])
    cases = ((n, r) for n in (1, 2, 4, 8, 16) for r in (1.5, 2, 3))
    for seed, (number, ratio) in enumerate(cases):
        end = number + 0.75
        y = 0.75 if number % 2 == 0 else 0.25
        area = (number / 2) + (0.75**2 / 2 if number % 2 == 0 else 0.75 - 0.75**2 / 2)
        system = System((0.25, 0.0, 0.0), end - 0.25, parts, ())
        y, area = _saw(0.25, end)
        nfe = ceil(ratio * (number + 1))
        yield Case('many switches', f'{number} switches, {nfe} elements', seed, replace(system, answer=(end, y, area)), nfe, 3)


def _saw(start, end):
    """y and its integral for dy/dt = sgn sin(pi s)."""
    s, y, area = start, 0.0, 0.0
    while s < end - 1e-12:
        step = min(floor(s + 1e-12) + 1, end) - s
        slope = 1.0 if floor(s + 1e-12) % 2 == 0 else -1.0
        area += y * step + slope * step**2 / 2
        y += slope * step
        s += step
    return y, area


def grazing():
    """A ball that touches the surface q = 1/2 - d from below at the top of its way; above it, it falls four times as fast."""
    for seed, (d, nfe) in enumerate((d, n) for d in _DEPTHS for n in (10, 40)):
        c = lambda x, f, d=d: x[0] - 0.5 + d  # noqa: E731
        parts = one(c, lambda x, u, f: [x[1], -4.0], lambda x, u, f: [x[1], -1.0])
        v, q, left = 1.0, 0.0, 2.0
        if d > 0:
            v = -sqrt(2 * d)
            q, left = 0.5 - d, 2.0 - (1 - sqrt(2 * d)) - sqrt(2 * d) / 2
        answer = (q + v * left - left**2 / 2, v - left)
        yield Case('grazing contact', f'd = {d:.0e}, {nfe} elements', seed, System((0.0, 1.0), 2.0, parts, answer), nfe)


_DEPTHS = (-1e-2, -1e-4, -1e-6, 0.0, 1e-10, 1e-8, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 5e-2, 1e-1)


# sliding


def start_in_slide():
    """From the surface: staying on it, and leaving it smoothly at log 2 (docs/benchmarks/exits.py)."""
    T, leaves = 2.0, log(2)
    push = lambda x, f: f.exp(x[1]) - 1  # noqa: E731
    leave = one(lambda x, f: x[0], lambda x, u, f: [push(x, f) - 1, 1.0], lambda x, u, f: [push(x, f) + 1, 1.0])
    stay = one(lambda x, f: x[0], lambda x, u, f: [f.sin(3 * x[1]) - 1.5, 1.0], lambda x, u, f: [f.sin(3 * x[1]) + 1.5, 1.0])
    x_end = exp(T) - 2 * T - 2 + 2 * leaves
    seed = 0
    for nfe in (5, 6, 7, 8, 10, 12, 14, 17, 20, 25, 30, 40):
        yield Case('start in a slide', f'leaves it, {nfe} elements', seed, System((0.0, 0.0), T, leave, (x_end, T)), nfe, 3)
        yield Case('start in a slide', f'stays, {nfe} elements', seed + 1, System((0.0, 0.0), T, stay, (0.0, T)), nfe, 3)
        seed += 2


def chattering():
    """A relay that would chatter: dx1 = x2, dx2 = -a sgn(x1 + x2), which slides down to the origin."""
    for seed, x0, guess in starts('chattering', 0.2, 1.5, number=STARTS):
        parts = one(lambda x, f: x[0] + x[1], lambda x, u, f: [x[1], -3.0], lambda x, u, f: [x[1], 3.0])
        # x1 = x0 - 1.5 t^2, x2 = -3 t meet x1 + x2 = 0
        t = (-3 + sqrt(9 + 6 * x0)) / 3
        x = 3 * t * exp(-(3.0 - t))
        yield Case('chattering control', 'relay', seed, System((x0, 0.0), 3.0, parts, (x, -x), guess=(guess, 0.0)), 20, 3)


def chattering_optimum():
    """dx = sgn y, dy = u: the control that chatters between two modes is a slide whose multiplier is free to choose."""
    parts = one(lambda x, f: x[1], lambda x, u, f: [1.0, u, x[0] ** 2], lambda x, u, f: [-1.0, u, x[0] ** 2])
    for seed, u, _ in starts('optimum', -1.0, 1.0, number=10):
        system = System((1.0, 0.0, 0.0), 2.0, parts, (None, None, 1 / 3), stages=[0.5, 1.0, 1.5], u=(-5, 5, u))
        system = replace(system, final=lambda x, f: x[2], scale=(1.0,))
        yield Case('chattering control', 'as an optimum, guess of u at random', seed, system, 12, looks=lambda v: 'a worse minimum')


def curved():
    """Slides on x = -y^2 and on x = sin s, with Radau and with Gauss."""
    bowl = one(lambda x, f: x[0] + x[1] ** 2, lambda x, u, f: [-1.0, 1.0], lambda x, u, f: [1.0, 1.0])
    wave = one(lambda x, f: x[0] - f.sin(x[1]), lambda x, u, f: [-2.0, 1.0], lambda x, u, f: [4.0, 1.0])
    kinds = {
        'parabola': System((-0.5, 0.0), 0.45, bowl, (-(0.45**2), 0.45), (0.1, 1.0)),
        'sine': System((-1.0, 0.0), 2.0, wave, (sin(2.0), 2.0)),
    }
    cases = ((k, s, n, p) for k in kinds for s in (RADAU, GAUSS) for n in (5, 10, 20) for p in (2, 3))
    for seed, (kind, scheme, nfe, ncp) in enumerate(cases):
        name = f"{kind}, {scheme.split('-')[1].capitalize()} {ncp}, {nfe} elements"
        yield Case('slide on a curved surface', name, seed, kinds[kind], nfe, ncp, scheme)


# sizes


def scaling():
    """Units of states and switching functions from 1e-6 to 1e6."""
    seed = 0
    for kind, make in (('crossing', crossing), ('slide', sliding)):
        for s in SCALES:
            yield Case('bad scaling', f'{kind}, states in units of {s:.0e}', seed, make(state=s))
            yield Case('bad scaling', f'{kind}, switching function times {s:.0e}', seed + 1, make(c=s))
            seed += 2
    for s in SCALES:
        yield Case('bad scaling', f'tank, switching function times {s:.0e}', seed, tank(c=s), 25, 3)
        yield Case('bad scaling', f'tank, holdups in units of {1 / s:.0e} mol', seed + 1, tank(unit=s), 25, 3)
        seed += 2


def tank(c=1.0, unit=1.0, **keywords):
    """The gas-liquid tank; holdups times ``unit``, switching function times ``c``."""
    R, T, V, rho, k = 0.082057, 300.0, 10.0, 50.0, 0.1

    def pressure(x):
        return x[0] / unit * R * T / (V - x[1] / unit / rho)

    liquid = lambda x, u, f: [0.1 * unit, (2.5 - k * (pressure(x) - 1)) * unit]  # noqa: E731
    gas = lambda x, u, f: [(0.1 - k * (pressure(x) - 1)) * unit, 2.5 * unit]  # noqa: E731
    parts = one(lambda x, f: c * (x[1] / unit / rho - 5.0), liquid, gas)
    answer = (5.496072704665 * unit, 250.0 * unit)
    return System((6.83 * unit, 260.0 * unit), 20.0, parts, answer, (5.5 * unit, 250.0 * unit), **keywords)


def horizons():
    """The same courses in 1e-3 to 1e5 units of time; the element of the shortest is 50 microunits long."""
    seed = 0
    for k in range(-3, 6):
        for kind, make in (('crossing', crossing), ('slide', sliding), ('oscillator', oscillator)):
            nfe, ncp = (40, 3) if make is oscillator else (20, 2)
            yield Case('horizon 1e-3 to 1e5', f'{kind}, T = {10.0**k:.0e}', seed, make(time=10.0**k / make().end), nfe, ncp)
            seed += 1
            if make is not oscillator:
                name = f'{kind}, states as large as T = {10.0**k:.0e}'
                factor = 10.0**k / make().end
                yield Case('horizon 1e-3 to 1e5', name, seed, make(time=factor, state=factor), nfe, ncp)
                seed += 1


# smooth dynamics


def oscillator(time=1.0):
    """It turns round at the unit circle."""
    inside = lambda x, u, f: [(x[0] + 2 * pi * x[1]) / time, (-2 * pi * x[0] + x[1]) / time]  # noqa: E731
    outside = lambda x, u, f: [(x[0] - 2 * pi * x[1]) / time, (2 * pi * x[0] + x[1]) / time]  # noqa: E731
    parts = one(lambda x, f: x[0] ** 2 + x[1] ** 2 - 1, outside, inside)
    return System((1 / e, 0.0), pi / 2 * time, parts, (-1.5974603774506984, -0.7614936206060108))


def oscillators():
    cases = ((s, p, n) for s, p in ((RADAU, 3), (RADAU, 4), (GAUSS, 2), (GAUSS, 3)) for n in range(24, 80, 8))
    for seed, (scheme, ncp, nfe) in enumerate(cases):
        name = f"{scheme.split('-')[1].capitalize()} {ncp}, {nfe} elements"
        yield Case('oscillator', name, seed, oscillator(), nfe, ncp, scheme)


def stiff(stiffness, offset=0.0):
    """Prothero and Robinson: dx/dt = -k (x - cos s) - sin s below cos(1/2), 1 above; s from -3/2."""
    level = cos(0.5)
    slow = lambda x, u, f: [-stiffness * (x[0] - f.cos(x[1])) - f.sin(x[1]), 1.0]  # noqa: E731
    parts = one(lambda x, f: x[0] - level, lambda x, u, f: [1.0, 1.0], slow)
    return System((cos(1.5) + offset, -1.5), 1.5, parts, (level + 0.5, 0.0))


def stiff_modes():
    for name, scheme in (('Radau', RADAU), ('Gauss', GAUSS)):
        seed = 0
        for stiffness in (1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6):
            for nfe in (5, 20):
                for ncp in (2, 3):
                    what = f'stiffness {stiffness:.0e}, {nfe} elements of {ncp}'
                    yield Case(f'stiff mode, {name}', what, seed, stiff(stiffness), nfe, ncp, scheme)
                    seed += 1


def van_der_pol(mu, end):
    """Van der Pol's oscillator with dry friction in its own slow time: dx = mu v, dv = mu (mu (1 - x^2) v - x - sgn(v)/5)."""

    def rates(sign):
        return lambda x, u, f: [mu * x[1], mu * (mu * (1 - x[0] ** 2) * x[1] - x[0] - 0.2 * sign)]

    return System((2.0, 1.0), end, one(lambda x, f: x[1], rates(1), rates(-1)))


#: (mu, T) -> states at T by ``stability_reference.filippov``.
VAN_DER_POL = {
    (1.0, 0.3): (2.116817418, -0.05224627004),
    (1.0, 0.6): (2.044327759, -0.3774758523),
    (10.0, 0.3): (1.844654206, -0.06827079706),
    (10.0, 0.6): (1.615060238, -0.08737644544),
    (100.0, 0.3): (1.808877144, -0.007080997423),
    (100.0, 0.6): (1.567247561, -0.009387868581),
    (300.0, 0.3): (1.80625157, -0.002366429993),
    (300.0, 0.6): (1.563749083, -0.003145193314),
    (1000.0, 0.3): (1.805331517, -0.0007105681095),
    (1000.0, 0.6): (1.562524201, -0.0009452237594),
}


def van_der_pols():
    seed = 0
    for mu in (1.0, 10.0, 100.0, 300.0, 1000.0):
        for end in (0.3, 0.6):
            x, v = VAN_DER_POL[mu, end]
            # off the slow motion v is large; there it is not
            system = replace(van_der_pol(mu, end), answer=(x, v), scale=(1.0, abs(v)))
            for nfe in (20, 80):
                yield Case('Van der Pol with dry friction', f'mu = {mu:g}, T = {end}, {nfe} elements', seed, system, nfe, 3)
                seed += 1


def gene_network():
    """Two genes (examples/gene_network.py) from 50 initial states."""

    def part(i):
        made = lambda v: lambda x, u, f: [v if j == i else 0.0 for j in (0, 1)]  # noqa: E731
        modes = [((1, -1), made(40.0)), ((1, 1), made(0.0)), ((-1, -1), made(0.0)), ((-1, 1), made(0.0))]
        return Part(lambda x, f: [x[1 - i] - 4.0, x[i] - 8.0], modes)

    smooth = lambda x, u, f: [-4.5 * x[0], -1.5 * x[1]]  # noqa: E731
    for seed in range(STARTS):
        x0 = tuple(np.random.default_rng([seed, 7]).uniform(0.5, 12.0, 2).tolist())
        system = System(x0, 0.6, [part(0), part(1)], genes(x0, 0.6), smooth=smooth)
        yield Case('gene network', 'from 50 initial states', seed, system, 16, 3)


FAMILIES = (
    crossings, slides, not_unique, simultaneous, sensitivity, false_minima, free_start, stage_boundary, at_the_start, close_pair,
    many_switches, grazing, start_in_slide, chattering, chattering_optimum, curved, scaling, horizons, oscillators, stiff_modes,
    van_der_pols, gene_network,
)  # fmt: skip


def cases():
    """All of them."""
    for family in FAMILIES:
        yield from family()
