"""Reference solutions without finite elements: event location and Filippov's sliding mode, for one switching function."""

import casadi as ca
import numpy as np
from scipy.integrate import solve_ivp

EXACT = {'method': 'Radau', 'rtol': 1e-11, 'atol': 1e-13}


class Filippov:
    """The vector field on both sides of c(x) = 0, and on it."""

    def __init__(self, system):
        (part,) = system.parts
        x = ca.SX.sym('x', len(system.x0))
        xs = [x[i] for i in range(x.shape[0])]
        shared = ca.vertcat(*system.smooth(xs, 0.0, ca)) if system.smooth else 0
        c = part.c(xs, ca)[0]
        self.c = ca.Function('c', [x], [c])
        self.f, self.J, self.rate = {}, {}, {}
        for (sign,), rates in part.modes:
            f = ca.vertcat(*rates(xs, 0.0, ca)) + shared
            self._add(sign, x, c, f)
        up, down = (ca.dot(ca.gradient(c, x), self.f[s](x)) for s in (1, -1))
        # the weight of the positive side that keeps c at zero
        nu = -down / (up - down)
        self.nu = ca.Function('nu', [x], [nu])
        self._add(0, x, c, nu * self.f[1](x) + (1 - nu) * self.f[-1](x))

    def _add(self, mode, x, c, f):
        self.f[mode] = ca.Function('f', [x], [f])
        self.J[mode] = ca.Function('J', [x], [ca.jacobian(f, x)])
        self.rate[mode] = ca.Function('rate', [x], [ca.dot(ca.gradient(c, x), f)])

    def end(self, x0, T):
        """State at time T, and the times at which the mode changes."""
        t, x, times = 0.0, np.array(x0, dtype=float), []
        mode = self._mode(x)
        while t < T:
            events = self._events(mode)
            run = solve_ivp(
                lambda _, x, f=self.f[mode]: np.array(f(x)).ravel(),
                (t, T),
                x,
                jac=lambda _, x, J=self.J[mode]: np.array(J(x)),
                events=events,
                **EXACT,
            )
            t, x = run.t[-1], run.y[:, -1]
            if run.status == 1:
                times.append(t)
                mode = self._mode_on_surface(x) if mode else (1 if float(self.nu(x)) > 0.5 else -1)
        return x, times

    def _events(self, mode):
        if mode:
            event = lambda _, x: float(self.c(x)) * mode  # noqa: E731
        else:
            event = lambda _, x: min(float(self.nu(x)), 1 - float(self.nu(x)))  # noqa: E731
        event.terminal, event.direction = True, -1
        return [event]

    def _mode(self, x):
        c = float(self.c(x))
        return int(np.sign(c)) if abs(c) > 1e-12 else self._mode_on_surface(x)

    def _mode_on_surface(self, x):
        up, down = float(self.rate[1](x)), float(self.rate[-1](x))
        return 1 if up > 0 else -1 if down < 0 else 0


def filippov(system):
    """End state of a system with one switching function."""
    return tuple(float(v) for v in Filippov(system).end(system.x0, system.end)[0])


def genes(start, end, decay=(4.5, 1.5), rate=40.0, needed=4.0, enough=8.0):
    """End state of the gene network (examples/gene_network.py), from event to event by exponentials."""
    x, t = list(start), 0.0
    while t < end - 1e-14:
        made = [_made(x, i, decay, rate, needed, enough) for i in (0, 1)]
        limit = [m / d for m, d in zip(made, decay)]
        step = min([end - t, *(time for i in (0, 1) for time in _times_to_levels(x[i], limit[i], decay[i], (needed, enough)))])
        x = [lim + (v - lim) * np.exp(-d * step) for lim, v, d in zip(limit, x, decay)]
        x = [_snapped(v, (needed, enough)) for v in x]
        t += step
    return tuple(float(v) for v in x)


def _snapped(x, levels):
    """x without the round-off in its distance to a level."""
    return next((level for level in levels if abs(x - level) < 1e-12), x)


def _times_to_levels(x, limit, decay, levels):
    """Yield the times at which x, which decays towards ``limit``, crosses a level."""
    for level in levels:
        if abs(x - level) > 1e-12 and (x - level) * (limit - level) < 0:
            yield np.log((limit - x) / (limit - level)) / decay


def _made(x, i, decay, rate, needed, enough):
    """Production rate of protein i right after this state."""
    other = x[1 - i]
    if other == needed:
        # on the threshold: above it afterwards if the other protein rises
        rises = _made_if(x, 1 - i, x[i] > needed, decay, rate, enough) > decay[1 - i] * other
        return _made_if(x, i, rises, decay, rate, enough)
    return _made_if(x, i, other > needed, decay, rate, enough)


def _made_if(x, i, fed, decay, rate, enough):
    if not fed or x[i] > enough:
        return 0.0
    return rate if x[i] < enough else decay[i] * enough
