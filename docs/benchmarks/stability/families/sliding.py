"""Families of cases with sliding modes."""

from dataclasses import replace
from math import exp, log, sin, sqrt

from benchmarks.stability.cases import GAUSS, RADAU, Case
from benchmarks.stability.families.random_starts import random_starts
from benchmarks.stability.systems import System, one


def start_in_slide():
    """Starts on the surface: staying on it, and leaving it smoothly at log 2 (docs/benchmarks/sliding_exit)."""
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
    """A relay that chatters when simulated step by step: dx1 = x2, dx2 = -a sgn(x1 + x2), which slides to the origin."""
    for seed, x0, guess in random_starts('chattering', 0.2, 1.5):
        parts = one(lambda x, f: x[0] + x[1], lambda x, u, f: [x[1], -3.0], lambda x, u, f: [x[1], 3.0])
        # x1 = x0 - 1.5 t^2, x2 = -3 t meet x1 + x2 = 0
        t = (-3 + sqrt(9 + 6 * x0)) / 3
        x = 3 * t * exp(-(3.0 - t))
        yield Case('chattering control', 'relay', seed, System((x0, 0.0), 3.0, parts, (x, -x), guess=(guess, 0.0)), 20, 3)


def chattering_optimum():
    """dx = sgn y, dy = u: the optimal control chatters between two modes; its limit is a slide with a free multiplier."""
    parts = one(lambda x, f: x[1], lambda x, u, f: [1.0, u, x[0] ** 2], lambda x, u, f: [-1.0, u, x[0] ** 2])
    for seed, u, _ in random_starts('optimum', -1.0, 1.0, number=10):
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
