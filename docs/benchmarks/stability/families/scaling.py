"""Families of cases in which units of states, switching functions or time are extreme."""

from benchmarks.stability.cases import Case
from benchmarks.stability.families.one_switch import crossing, sliding
from benchmarks.stability.families.smooth_dynamics import oscillator
from benchmarks.stability.systems import System, one

#: Powers of ten.
SCALES = tuple(10.0**k for k in range(-6, 7, 2))


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
    """The same solutions on horizons of 1e-3 to 1e5; elements of the shortest are 5e-5 long."""
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
