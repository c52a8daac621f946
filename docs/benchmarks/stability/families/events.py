"""Families of systems with hysteresis, state jumps, and switching times that accumulate, from the examples and the tests.

Only pyomo_fesd can state them.  nosnoc could with a further state in frozen time, written by hand; that is another model.
"""

from dataclasses import dataclass

import bouncing_ball
import pyomo.environ as pyo
import thermostat
from benchmarks.common.exact import thermostat_temperature
from benchmarks.stability.cases import Case
from benchmarks.stability.methods import outcome_of
from problems import two_tanks

import pyomo_fesd


@dataclass(frozen=True)
class Hybrid(Case):
    """A model with hysteresis or state jumps; the answer None means that only a refusal is right."""

    build: object = None
    values: object = None
    answer: tuple = None
    hysteresis: str = None

    @property
    def without_answer(self):
        return self.answer is None

    def methods(self):
        return ['mpec_hybrid', 'simulate']

    def run(self, method, limit):
        m = self.build()

        def solve():
            if self.hysteresis:
                pyo.TransformationFactory('fesd.dcs').apply_to(m, hysteresis=[m.component(self.hysteresis)])
            pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=self.nfe, ncp=self.ncp)
            if method == 'simulate':
                pyomo_fesd.simulate(m, time_limit=limit)
                return None
            return pyo.SolverFactory('mpec_hybrid').solve(m, time_limit=limit)

        return outcome_of(solve, lambda: self.values(m))

    def error(self, values):
        return max(abs(f - a) / max(1.0, abs(a)) for f, a in zip(values, self.answer))


def thermostat_cases():
    """examples/thermostat.py on several horizons and grids."""
    seed = 0
    for horizon in (1.0, 1.5, 2.0, 2.8, 4.0):
        number = len(thermostat.switching_times(horizon))
        for more in (2, 3, 4, 6):
            build = lambda horizon=horizon: thermostat.build(horizon)  # noqa: E731
            name = f'{number} switches, {more * (number + 1)} elements'
            answer = (thermostat_temperature(horizon),)
            yield Hybrid(
                'hysteresis (thermostat)', name, seed, None, more * (number + 1), 3,
                build=build, values=lambda m: [m.y[m.t.last()].value], answer=answer, hysteresis='relay',
            )  # fmt: skip
            seed += 1


def ball_cases():
    """examples/bouncing_ball.py on several horizons and grids."""
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
    """Two tanks and one hose, whose switching times accumulate at t = 8."""
    seed = 0
    for end in (7.0, 7.9, 8.0, 8.5, 10.0):
        for nfe in (12, 30):
            answer = {7.0: two_tanks.LEVELS, 7.9: two_levels(7.9)}.get(end)
            build = lambda end=end: two_tanks.build(end)  # noqa: E731
            values = lambda m: [m.x[i, m.t.last()].value for i in (1, 2)]  # noqa: E731
            name = f'up to {end}, {nfe} elements'
            yield Hybrid('Zeno', name, seed, None, nfe, 2, build=build, values=values, answer=answer, hysteresis='hose')
            seed += 1


def two_levels(end):
    """Levels of the two tanks before t = 8; the hose fills the first one at the start."""
    x, t, filled = [1.0, 1.0], 0.0, 0
    while t < end:
        step = min(x[1 - filled] / 0.5, end - t)
        x[filled] += 0.25 * step
        x[1 - filled] -= 0.5 * step
        t, filled = t + step, 1 - filled
    return tuple(x)
