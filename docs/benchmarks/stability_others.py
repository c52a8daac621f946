"""Cases that are no systems of modes alone: complementarity without time, memory, jumps, switches that accumulate.

They are taken from examples and from the problems of the tests.  A fixed grid has nothing to say of MPCCs, and neither has nosnoc;
smoothing takes the Fischer-Burmeister function there.  Memory and jumps cannot be stated by the others; nosnoc could by a state in
frozen time that is written by hand, which is another model.
"""

import math
from dataclasses import dataclass

import bouncing_ball
import numpy as np
import pyomo.environ as pyo
import thermostat
from problems import mpcc_collection, small_mpccs, two_tanks
from pyomo.mpec import Complementarity
from stability_cases import Case
from stability_methods import WIDTH, told

import pyomo_fesd
from pyomo_fesd.complementarity import read


@dataclass(frozen=True)
class Static(Case):
    """A small MPCC from a random start; ``answer`` is its best objective, None if it has no feasible point."""

    build: object = None
    answer: float = None

    @property
    def without_answer(self):
        return self.answer is None

    def methods(self):
        return ['mpec_hybrid', 'smoothing']

    def run(self, method, limit):
        m = self.build()
        draw = np.random.default_rng([self.seed, *map(ord, self.name)])
        for v in m.component_data_objects(pyo.Var, descend_into=True):
            if self.seed and not v.fixed:
                v.set_value(_inside(v, draw.normal(0.5, 1.0)), skip_validation=True)
        pairs = [read(c) for c in _conditions(m)]
        if method == 'smoothing':
            _smooth(m, pairs)
        solver = pyo.SolverFactory('mpec_hybrid')
        return told(lambda: solver.solve(m, time_limit=limit), lambda: [pyo.value(m.f), _gap(m, pairs)])

    def error(self, values):
        f, gap = values
        return max(abs(f - self.answer) / max(1.0, abs(self.answer)), gap)


def _inside(v, number):
    low, high = v.bounds
    return min(max(number, -math.inf if low is None else low), math.inf if high is None else high)


def _conditions(m):
    return [c for c in m.component_data_objects(Complementarity, active=True, descend_into=True)]


def _smooth(m, pairs):
    """G + H = sqrt(G^2 + H^2 + 2 w^2) for each pair."""
    for c in _conditions(m):
        c.parent_component().deactivate()
    m.smooth = pyo.ConstraintList()
    for G, H in pairs:
        m.smooth.add(G + H == pyo.sqrt(G**2 + H**2 + 2 * WIDTH**2))


def _gap(m, pairs):
    """How far the values are from complementary and feasible."""
    gaps = [max(-pyo.value(G), -pyo.value(H), min(pyo.value(G), pyo.value(H))) for G, H in pairs]
    rows = [c for c in m.component_data_objects(pyo.Constraint, active=True, descend_into=True) if not c.name.startswith('smooth')]
    for c in rows:
        body = pyo.value(c.body)
        gaps += [pyo.value(c.lower) - body] if c.has_lb() else []
        gaps += [body - pyo.value(c.upper)] if c.has_ub() else []
    return max([0.0, *gaps])


#: name in problems.md -> builder, best objective
STATIC = {
    'toy MPEC': (lambda: small_mpccs.toy()[0], 1.0),
    'M- not S-stationary': (lambda: small_mpccs.m_not_s_stationary()[0], -0.5),
    'scaling': (lambda: small_mpccs.badly_scaled()[0], 1.0),
    'ralph2, unbounded penalty': (lambda: small_mpccs.ralph2()[0], 0.0),
    'ralph1, no multipliers': (lambda: small_mpccs.ralph1()[0], 0.0),
    'scholtes4, no MPCC-LICQ': (lambda: small_mpccs.scholtes4()[0], 0.0),
    'infeasible': (mpcc_collection.infeasible, None),
    'infeasible by rows': (mpcc_collection.infeasible_by_rows, None),
}


def statics(starts=50):
    for name, (build, answer) in STATIC.items():
        for seed in range(starts if answer is not None else 3):
            family = 'MPCC without time' if answer is not None else 'infeasible MPCC'
            yield Static(family, name, seed, None, build=build, answer=answer, looks=lambda v: 'a spurious stationary point')


@dataclass(frozen=True)
class Hybrid(Case):
    """A model with memory or jumps, by ``simulate`` and by ``mpec_hybrid``; the answer None asks for a refusal."""

    build: object = None
    values: object = None
    answer: tuple = None
    memory: str = None

    @property
    def without_answer(self):
        return self.answer is None

    def methods(self):
        return ['mpec_hybrid', 'simulate']

    def run(self, method, limit):
        m = self.build()

        def solve():
            if self.memory:
                pyo.TransformationFactory('fesd.dcs').apply_to(m, memory=[m.component(self.memory)])
            pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=self.nfe, ncp=self.ncp)
            if method == 'simulate':
                pyomo_fesd.simulate(m, time_limit=limit)
                return None
            return pyo.SolverFactory('mpec_hybrid').solve(m, time_limit=limit)

        return told(solve, lambda: self.values(m))

    def error(self, values):
        return max(abs(f - a) / max(1.0, abs(a)) for f, a in zip(values, self.answer))


def temperature(horizon):
    """Of the thermostat at the end."""
    changes = [0.0, *thermostat.switching_times(horizon)]
    y, heats = thermostat.START, True
    for begin, end in zip(changes, [*changes[1:], horizon]):
        limit = 50.0 if heats else 0.0
        y, heats = limit + (y - limit) * math.exp(-(end - begin) / 5), not heats
    return y


def thermostat_cases():
    seed = 0
    for horizon in (1.0, 1.5, 2.0, 2.8, 4.0):
        number = len(thermostat.switching_times(horizon))
        for more in (2, 3, 4, 6):
            build = lambda horizon=horizon: thermostat.build(horizon)  # noqa: E731
            name = f'{number} switches, {more * (number + 1)} elements'
            yield Hybrid(
                'hysteresis (thermostat)', name, seed, None, more * (number + 1), 3,
                build=build, values=lambda m: [m.y[m.t.last()].value], answer=(temperature(horizon),), memory='relay',
            )  # fmt: skip
            seed += 1


def ball_cases():
    seed = 0
    for e in (1.0, 0.8):
        for horizon in (0.5, 1.0, 2.0, 3.0):
            number = len(bouncing_ball.impacts(e, horizon))
            for more in (2, 3, 4):
                build = lambda e=e, horizon=horizon: bouncing_ball.build(e, horizon)  # noqa: E731
                yield Hybrid(
                    'state jump (bouncing ball)', f'e = {e}, {number} impacts, {more * (number + 1)} elements', seed, None,
                    more * (number + 1), 2, build=build, answer=bouncing_ball.end(e, horizon),
                    values=lambda m: [m.q[m.t.last()].value, m.v[m.t.last()].value],
                )  # fmt: skip
                seed += 1


def zeno_cases():
    seed = 0
    for end in (7.0, 7.9, 8.0, 8.5, 10.0):
        for nfe in (12, 30):
            answer = {7.0: two_tanks.LEVELS, 7.9: two_levels(7.9)}.get(end)
            build = lambda end=end: two_tanks.build(end)  # noqa: E731
            values = lambda m: [m.x[i, m.t.last()].value for i in (1, 2)]  # noqa: E731
            name = f'up to {end}, {nfe} elements'
            yield Hybrid('Zeno', name, seed, None, nfe, 2, build=build, values=values, answer=answer, memory='hose')
            seed += 1


def two_levels(end):
    """Levels of the two tanks before t = 8, with the hose in the first to begin with."""
    x, t, filled = [1.0, 1.0], 0.0, 0
    while t < end:
        step = min(x[1 - filled] / 0.5, end - t)
        x[filled] += 0.25 * step
        x[1 - filled] -= 0.5 * step
        t, filled = t + step, 1 - filled
    return tuple(x)


def others():
    """All of them."""
    for family in (statics, thermostat_cases, ball_cases, zeno_cases):
        yield from family()
