"""
Bouncing ball: a state jump
===========================

Where the height q falls to zero the velocity v is reversed: v(t+) = -e v(t-). The
impact times have a closed form. With e = 1 all arcs are equal: the ball hits the
ground at t_1 = sqrt(2 q(0)/g) = 0.404 s and then every 2 t_1. With e < 1 the arcs
shrink by the factor e: n impacts take t_1 (1 + 2 e + ... + 2 e^(n-1)), and infinitely
many take t_1 (1 + e)/(1 - e). ::

    dq/dt = v,   dv/dt = -g,   q(0) = 0.8 m,   v(0) = 0

Units: m, s.

**Why the answer is right.** Between two impacts the height is a parabola, which two
collocation points represent exactly. So the printed times, and height and velocity at
the end, differ from the closed form by round-off, 1e-14.
"""

from itertools import count, takewhile
from math import sqrt

import pyomo.dae as dae
import pyomo.environ as pyo

import pyomo_fesd

HEIGHT, GRAVITY, HORIZON = 0.8, 9.81, 3
FIRST = sqrt(2 * HEIGHT / GRAVITY)
PICTURE = 'bouncing_ball.png'


def impacts(e=1.0, horizon=HORIZON):
    """Exact times of the impacts before the horizon."""
    times = (FIRST * (1 + 2 * sum(e**k for k in range(1, n))) for n in count(1))
    return list(takewhile(lambda t: t < horizon, times))


def end(e=1.0, horizon=HORIZON):
    """Exact height and velocity at the horizon."""
    times = impacts(e, horizon)
    since, v = horizon - times[-1], e ** len(times) * GRAVITY * FIRST
    return v * since - GRAVITY * since**2 / 2, v - GRAVITY * since


def build(e=1.0, horizon=HORIZON):
    """Build the free fall and the law of impact."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, horizon))
    m.q, m.v = pyo.Var(m.t, initialize=HEIGHT), pyo.Var(m.t, initialize=0)
    m.dq, m.dv = dae.DerivativeVar(m.q), dae.DerivativeVar(m.v)
    m.q[0].fix(HEIGHT)
    m.v[0].fix(0)
    m.kinematics = pyo.Constraint(m.t, rule=lambda m, t: m.dq[t] == m.v[t])
    m.fall = pyo.Constraint(m.t, rule=lambda m, t: m.dv[t] == -GRAVITY)
    m.impact = pyomo_fesd.state_jump(
        m.t, guard=lambda m, t: m.q[t], reset=lambda m, t: [(m.v[t], -e * m.v[t])]
    )
    return m


def main():
    """Simulate, solve all elements at once, compare with the exact times, draw."""
    m = build()
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=24, ncp=2)
    pyomo_fesd.simulate(m)
    results = pyo.SolverFactory('mpec_hybrid').solve(m, warm_start=True)
    print(f'mpec_hybrid: {results.solver.reason}; {results.solver.nlps} NLPs.')
    for switch, exact in zip(pyomo_fesd.switches(m), impacts()):
        print(f'{switch}, {switch.time - exact:+.1e} s off')
    q, v = end()
    print(
        f'q(3 s) = {m.q[HORIZON].value:.10f} m, {m.q[HORIZON].value - q:+.1e} m off; v '
        f'is {m.v[HORIZON].value - v:+.1e} m/s off.'
    )
    pyomo_fesd.plot(
        m, m.t, ['q', 'v'], units={'q': 'height q (m)', 'v': 'velocity v (m/s)'}
    ).savefig(PICTURE, dpi=150)
    print(f'Height and velocity over time: {PICTURE}')


if __name__ == '__main__':
    main()
