"""Families of cases with one switching function and piecewise linear solutions."""

from dataclasses import replace

import numpy as np
from benchmarks.stability.cases import Ambiguous, Case, Sensitivity
from benchmarks.stability.families.random_starts import random_starts
from benchmarks.stability.systems import Part, System, one


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
    """Crossing a surface, from random initial states and values."""
    for seed, x0, guess in random_starts('crossing', -2.5, -0.05):
        yield Case('crossing', 'x0 and guess at random', seed, crossing(x0, guess=(guess,)))


def slides():
    """Entering a sliding mode, from random initial states and values."""
    for seed, x0, guess in random_starts('sliding', -1.4, 1.4):
        yield Case('entering a slide', 'x0 and guess at random', seed, sliding(x0, guess=(guess,)))


def not_unique():
    """dx/dt = sgn x from x = 0, which has three solutions."""
    parts = one(lambda x, f: x[0], lambda x, u, f: [1.0], lambda x, u, f: [-1.0])
    for seed, _, guess in random_starts('unique', 0.0, 0.0, number=20):
        yield Ambiguous('non-uniqueness', 'dx/dt = sgn x from 0, guess at random', seed, System((0.0,), 1.0, parts, guess=(guess,)))


def simultaneous():
    """Two copies of 'crossing' that switch at the same time, or nearly so."""

    def part(i):
        def rates(v):
            return lambda x, u, f: [v if j == i else 0.0 for j in (0, 1)]

        return Part(lambda x, f: [x[i]], [((1,), rates(0.2)), ((-1,), rates(2.0))])

    for seed, (apart, nfe) in enumerate((d, n) for d in (0, 1e-12, 1e-9, 1e-7, 1e-5, 1e-4, 1e-3, 1e-2) for n in (5, 10, 20)):
        answer = (0.2, 0.2 * (1.5 + (-1 + apart) / 2))
        system = System((-1.0, -1.0 + apart), 1.5, [part(0), part(1)], answer)
        yield Case('simultaneous switches', f'{apart:.0e} apart, {nfe} elements', seed, system, nfe)


def sensitivity():
    """Derivative of the end state with respect to the initial state, through a switch."""
    for seed, x0, _ in random_starts('sensitivity', -2.9, -0.3):
        system = replace(signum(x0), answer=(1 / 3,))
        looks = lambda v: f'{v[0]:.1f} instead of 1/3'  # noqa: E731
        yield Sensitivity('sensitivity', 'dx(T)/dx0 of dx/dt = 2 - sgn x', seed, system, 10, looks=looks)


def false_minima():
    """min int x^2 dt + (x(2) - 5/3)^2 over x0, which has one minimum."""
    best = -1.427572232082767
    parts = one(lambda x, f: x[0], lambda x, u, f: [1.0, x[0] ** 2], lambda x, u, f: [3.0, x[0] ** 2])
    answer = (2 + best / 3, None)
    for seed, x0, _ in random_starts('minima', -2.0, -0.8):
        final = lambda x, f: x[1] + (x[0] - 5 / 3) ** 2  # noqa: E731
        system = System((x0, 0.0), 2.0, parts, answer, final=final, free=(-2.5, -0.5))
        yield Case('false minima', '50 guesses of x0', seed, system, 10, looks=lambda v: 'a false minimum')


def free_start():
    """x0 from the end x(2) = 4/3; the integral of x determines x0."""
    parts = one(lambda x, f: x[0], lambda x, u, f: [1.0, x[0]], lambda x, u, f: [3.0, x[0]])
    for seed, x0, _ in random_starts('free', -2.9, -0.3):
        target = lambda x, f: [x[0] - 4 / 3]  # noqa: E731
        system = System((x0, 0.0), 2.0, parts, (4 / 3, 2 / 9), target=target, free=(-3.0, -0.1))
        yield Case('x0 free', 'from the end x(2) = 4/3', seed, system, 10)
