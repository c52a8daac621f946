"""
Optimal control along a wall: projected dynamics
================================================

A point is steered with least effort around an ellipse that it cannot enter. The field
drives the point onto the ellipse, the ellipse carries it, and the control only has to
hold it a little to one side. There are two ways around; the initial values choose. ::

    dx/dt = f(x) + u + grad c(x) lam,   f = (-0.2 (x1 + 1)^2, -0.4 (x2 + 3))
    0 <= lam  perp  c(x) = x1^2/4 + x2^2/16 - 1 >= 0,   |u| <= 1
    from (1, 5) to (0, -4) in 10 time units,   min int 10 |u|^2 dt

**Why the answer is right.** The answer around the right is certified, and independent
shooting with ten control stages finds the same effort (see the page on
complementarity). The answer around the left, with 24 times the effort, satisfies all
equations, but it has no certificate: switches of it coincide, and not every order of
them could be tested. The program says so.
"""

from math import atan2, cos, pi, sin

import numpy as np
import pandas as pd
import pyomo.dae as dae
import pyomo.environ as pyo
from matplotlib.figure import Figure

import pyomo_fesd

START, GOAL, HORIZON = (1.0, 5.0), (0.0, -4.0), 10.0
HALF_AXES = (2.0, 4.0)
PICTURE = 'projected_ellipse.png'


def build(stages=20, side='right'):
    """Build the problem; the initial guess is on one side of the ellipse."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=np.linspace(0, HORIZON, stages + 1).tolist())
    m.i = pyo.RangeSet(2)
    m.x = pyo.Var(m.t, m.i, initialize=lambda m, t, i: way(t / HORIZON, side)[i - 1])
    m.u = pyo.Var(m.t, m.i, initialize=0)
    m.dx = dae.DerivativeVar(m.x, wrt=m.t)
    for i in m.i:
        m.x[0, i].fix(START[i - 1])
        m.x[HORIZON, i].fix(GOAL[i - 1])

    @m.Block(m.t)
    def ellipse(b, t):
        m = b.model()
        x = [m.x[t, 1], m.x[t, 2]]
        field = (-0.2 * (x[0] + 1) ** 2, -0.4 * (x[1] + 3))
        push = pyomo_fesd.projection(
            b, (x[0] / HALF_AXES[0]) ** 2 + (x[1] / HALF_AXES[1]) ** 2 >= 1, x
        )
        b.ode = pyo.Constraint(
            m.i,
            rule=lambda b, i: m.dx[t, i] == field[i - 1] + m.u[t, i] + push[m.x[t, i]],
        )

    m.limit = pyo.Constraint(
        m.t, rule=lambda m, t: m.u[t, 1] ** 2 + m.u[t, 2] ** 2 <= 1
    )
    m.effort = dae.Integral(
        m.t, rule=lambda m, t: 10 * (m.u[t, 1] ** 2 + m.u[t, 2] ** 2)
    )
    m.cost = pyo.Objective(expr=m.effort)
    return m


def way(share, side):
    """Initial guess: an arc from start to goal a little outside the ellipse."""
    first = atan2(START[1] / HALF_AXES[1], START[0] / HALF_AXES[0])
    last = -pi / 2 if side == 'right' else 3 * pi / 2
    angle = first + share * (last - first)
    return 1.1 * HALF_AXES[0] * cos(angle), 1.1 * HALF_AXES[1] * sin(angle)


def solve(m, elements=40):
    """Discretise with three Radau points and solve; returns the solver's results."""
    pyo.TransformationFactory('fesd.finite_elements').apply_to(
        m, nfe=elements, ncp=3, piecewise_constant=[m.u]
    )
    return pyo.SolverFactory('mpec_hybrid').solve(m)


def draw(ways):
    """Draw both ways; control and contact force of the better one."""
    figure = Figure(figsize=(10, 5.5), layout='constrained')
    plane, control, force = (
        figure.add_subplot(*place) for place in ((1, 2, 1), (2, 2, 2), (2, 2, 4))
    )
    angle = np.linspace(0, 2 * pi, 200)
    plane.fill(HALF_AXES[0] * np.cos(angle), HALF_AXES[1] * np.sin(angle), color='0.9')
    for side, m in ways.items():
        frame = pyomo_fesd.trajectory(m)
        plane.plot(
            frame['x[1]'], frame['x[2]'], label=f'{side}: {pyo.value(m.effort):.3f}'
        )
    plane.plot(*zip(START, GOAL), 'k.')
    plane.set(xlabel='$x_1$', ylabel='$x_2$', aspect='equal')
    plane.legend(title='effort', fontsize='small')
    frame = pyomo_fesd.trajectory(ways['right'])
    for i in (1, 2):
        control.plot(frame[f'u[{i}]'], drawstyle='steps-pre', label=f'$u_{i}$')
    control.legend(fontsize='small')
    force.plot(frame['ellipse.lam'], label='$\\lambda$')
    force.legend(fontsize='small')
    force.set_xlabel('time')
    for axis in (control, force):
        for switch in pyomo_fesd.switches(ways['right']):
            axis.axvline(switch.time, color='0.4', linestyle='--', linewidth=0.8)
    figure.savefig(PICTURE, dpi=150)


def main():
    """Solve from a guess on each side, print and draw both answers."""
    ways, table = {}, {}
    for side in ('right', 'left'):
        ways[side] = m = build(side=side)
        results = solve(m)
        table[side] = {
            'effort': pyo.value(m.effort),
            'reason': results.solver.reason,
            'NLPs': results.solver.nlps,
        }
        print(f'Round the {side}:')
        print(pyomo_fesd.switches(m))
    print(pd.DataFrame(table).T.to_string())
    draw(ways)
    print(f'Both ways, the control and the force of the ellipse: {PICTURE}')


if __name__ == '__main__':
    main()
