"""Families of cases with nonlinear or stiff modes."""

from dataclasses import replace
from math import cos, e, pi

import numpy as np
from benchmarks.stability.cases import GAUSS, RADAU, Case
from benchmarks.stability.reference import genes
from benchmarks.stability.systems import Part, System, one


def oscillator(time=1.0):
    """The oscillator, which changes its direction of rotation on the unit circle."""
    inside = lambda x, u, f: [(x[0] + 2 * pi * x[1]) / time, (-2 * pi * x[0] + x[1]) / time]  # noqa: E731
    outside = lambda x, u, f: [(x[0] - 2 * pi * x[1]) / time, (2 * pi * x[0] + x[1]) / time]  # noqa: E731
    parts = one(lambda x, f: x[0] ** 2 + x[1] ** 2 - 1, outside, inside)
    return System((1 / e, 0.0), pi / 2 * time, parts, (-1.5974603774506984, -0.7614936206060108))


def oscillators():
    """The oscillator with four schemes on several grids."""
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
    """Prothero and Robinson's mode with growing stiffness."""
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


#: (mu, T) -> states at T by ``reference.filippov``.
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
    """Van der Pol's oscillator with growing stiffness."""
    seed = 0
    for mu in (1.0, 10.0, 100.0, 300.0, 1000.0):
        for end in (0.3, 0.6):
            x, v = VAN_DER_POL[mu, end]
            # on the slow manifold v is small, hence its own scale
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
    for seed in range(50):
        x0 = tuple(np.random.default_rng([seed, 7]).uniform(0.5, 12.0, 2).tolist())
        system = System(x0, 0.6, [part(0), part(1)], genes(x0, 0.6), smooth=smooth)
        yield Case('gene network', 'from 50 initial states', seed, system, 16, 3)
