"""Families of cases in which the position of a switch in time is difficult."""

from dataclasses import replace
from math import ceil, floor, pi, sqrt

from benchmarks.stability.cases import Case
from benchmarks.stability.families.one_switch import crossing, sliding
from benchmarks.stability.systems import Part, System, one


def stage_boundary():
    """A switch on a boundary of control stages, and near it."""
    offsets = (0.0, *(s * d for d in (1e-12, 1e-9, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2) for s in (-1, 1)))
    kinds = {'crossing': lambda d: crossing(-1 + 2 * d, stages=[0.5, 1.0]), 'slide': lambda d: sliding(-0.5 + d, stages=[0.5, 1.0])}
    for seed, (kind, d) in enumerate((k, d) for k in kinds for d in offsets):
        yield Case('switch on a stage boundary', f'{kind}, {d:.0e} before it', seed, kinds[kind](d), 12)


def at_the_start():
    """A switch at t = 0, and shortly after."""
    offsets = (0.0, *(s * d for d in (1e-12, 1e-9, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3) for s in (-1, 1)))
    kinds = {'crossing': crossing, 'slide': sliding}
    for seed, (kind, d) in enumerate((k, d) for k in kinds for d in offsets):
        yield Case('switch at t0', f'{kind}, x0 = {d:.0e}', seed, kinds[kind](d), 12)


def close_pair():
    """A pulse of area 1 between two switches whose distance is less than an element."""

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
    """A ball that touches the surface q = 1/2 - d from below at its highest point; above, gravity is four times as strong."""
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
