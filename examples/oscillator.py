"""
Oscillator: the standard test of the order
==========================================

A linear oscillator reverses its sense of rotation at the unit circle, a curved
switching surface. From x(0) = (1/e, 0) the radius grows like exp(t), so the
trajectory crosses the circle at exactly t = 1, and the end state is known. With
switch detection the error falls with the full order of the collocation scheme; the
benchmarks show it. ::

    dx/dt = A1 x  inside |x| = 1,        A1 = [[1, 2 pi], [-2 pi, 1]]
    dx/dt = A2 x  outside,               A2 = [[1, -2 pi], [2 pi, 1]]

Source: Nurkanovic et al. (2024), FESD; problem 'oscillator' of NOSNOC.

**Why the answer is right.** The exact crossing is at t = 1 and the end state is known,
as both fields are linear and the radius grows like exp(t). With 20 elements of three
points the printed errors are 2e-5 and 4e-4; the tests fit the order to three grids and
find that of the scheme (5 for three Radau points), which a switch inside an element
would destroy.
"""

from math import e, pi

import pyomo.dae as dae
import pyomo.environ as pyo
from pyomo.gdp import Disjunction

import pyomo_fesd

X0 = (1 / e, 0.0)
HORIZON = pi / 2
SWITCH = 1.0
X_END = (-1.5974603774506984, -0.7614936206060108)
A_INSIDE = ((1, 2 * pi), (-2 * pi, 1))
A_OUTSIDE = ((1, -2 * pi), (2 * pi, 1))


def build():
    """Build the oscillator with its two modes."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, HORIZON))
    m.i = pyo.RangeSet(2)
    m.x = pyo.Var(m.t, m.i, initialize=lambda m, t, i: X0[i - 1])
    m.dx = dae.DerivativeVar(m.x)
    for i in m.i:
        m.x[0, i].fix(X0[i - 1])

    def mode(d, t, A):
        @d.Constraint(m.i)
        def ode(d, i):
            return m.dx[t, i] == sum(A[i - 1][j - 1] * m.x[t, j] for j in m.i)

    @m.Disjunct(m.t)
    def inside(d, t):
        d.region = pyo.Constraint(expr=m.x[t, 1] ** 2 + m.x[t, 2] ** 2 <= 1)
        mode(d, t, A_INSIDE)

    @m.Disjunct(m.t)
    def outside(d, t):
        d.region = pyo.Constraint(expr=m.x[t, 1] ** 2 + m.x[t, 2] ** 2 >= 1)
        mode(d, t, A_OUTSIDE)

    m.circle = Disjunction(m.t, rule=lambda m, t: [m.inside[t], m.outside[t]])
    return m


def solve(nfe, ncp, scheme):
    """Transform and solve; returns the model and the solver's results."""
    m = build()
    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(
        m, nfe=nfe, ncp=ncp, scheme=scheme
    )
    return m, pyo.SolverFactory('mpec_hybrid').solve(m)


def error(m):
    """Largest error of the end state."""
    return max(abs(m.x[m.t.last(), i].value - X_END[i - 1]) for i in m.i)


def main():
    """Solve with 20 elements, print the errors, draw both states."""
    m, _ = solve(20, 3, 'LAGRANGE-RADAU')
    (switch,) = pyomo_fesd.switches(m)
    print(
        f"The circle is crossed at t = {switch.time:.8f}, {switch.time - SWITCH:+.1e} "
        "off the exact time 1."
    )
    print(f"The end state is right to {error(m):.1e}.")
    pyomo_fesd.plot(m, m.t, ['x', 'circle']).savefig('oscillator.png', dpi=150)
    print("Picture: oscillator.png")


if __name__ == '__main__':
    main()
