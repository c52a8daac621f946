"""
Signum: the smallest system with a switch
=========================================

One state crosses one boundary. Ten elements give the switching time and the end state
to machine precision: both pieces of the solution are straight lines, so collocation
is exact on every element that holds only one of them, and the element boundary lies
on the switch. On a fixed grid the error would be of the order of an element's length,
whatever the order of the collocation. ::

    dx/dt = 2 - sgn(x),   x(0) = -2,   0 <= t <= 2

    below (x <= 0):  dx/dt = 3        above (x >= 0):  dx/dt = 1

The exact solution reaches zero at t_s = 2/3 and ends at x(2) = 2 - t_s = 4/3. The
multiplier nu of the mode below is 1 before the switch and 0 after it, so that dx/dt =
3 nu + (1 - nu) = 1 + 2 nu. All quantities are dimensionless.

Source: paper, eq. (21) and Fig. 2.

**Why the answer is right.** dx/dt is at least 1, so x crosses zero exactly once, and
collocation represents both straight lines exactly. The printed errors against 2/3 and
4/3 are round-off; tests ask for 1e-9 with five schemes.
"""

import pyomo.dae as dae
import pyomo.environ as pyo

import pyomo_fesd

END = 2
ELEMENTS = 10
SWITCH, FINAL = 2 / 3, 4 / 3  # exact switching time and x(2)
PICTURE = 'signum.png'


def build():
    """Build the two modes; no variable is free, so there is no objective."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, END))
    m.x = pyo.Var(m.t, initialize=-2)
    m.dx = dae.DerivativeVar(m.x)
    m.x[0].fix(-2)

    @m.Disjunct(m.t)
    def below(d, t):
        d.region = pyo.Constraint(expr=m.x[t] <= 0)
        d.ode = pyo.Constraint(expr=m.dx[t] == 3)

    @m.Disjunct(m.t)
    def above(d, t):
        d.region = pyo.Constraint(expr=m.x[t] >= 0)
        d.ode = pyo.Constraint(expr=m.dx[t] == 1)

    @m.Disjunction(m.t)
    def sgn(m, t):
        return [m.below[t], m.above[t]]

    return m


def solve(m):
    """Transform with a Gauss scheme of order 4 and solve; returns the results."""
    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(
        m, wrt=m.t, nfe=ELEMENTS, ncp=2, scheme='LAGRANGE-LEGENDRE'
    )
    return pyo.SolverFactory('mpec_hybrid').solve(m)


def draw(m):
    """Draw x and nu with element boundaries and the switch (paper, Fig. 2)."""
    figure = pyomo_fesd.plot(
        m,
        m.t,
        ['x', 'sgn: below'],
        units={'x': 'state x', 'sgn: below': 'multiplier ν (mode below)'},
    )
    figure.savefig(PICTURE, dpi=150)


def main():
    """Solve, print the answer with its errors, draw."""
    m = build()
    results = solve(m)
    (switch,) = pyomo_fesd.switches(m, m.t)
    elements = pyomo_fesd.element_lengths(m, m.t)
    before = int((elements['end'] <= switch.time).sum())
    first, last = elements['length'].iloc[[0, -1]]
    work = f'{results.solver.nlps} NLPs with {results.solver.nlp_iterations} iterations'
    print(f'mpec_hybrid: {results.solver.reason}; {work}.')
    print(
        f'x goes from {switch.before} to {switch.after} zero '
        f'at t = {switch.time:.12f}, {switch.time - SWITCH:+.1e} off 2/3.'
    )
    print(f'x(2) = {m.x[END].value:.12f}, {m.x[END].value - FINAL:+.1e} off 4/3.')
    print(
        f'There are {before} elements of length {first:.6f} before the switch '
        f'and {ELEMENTS - before} of length {last:.6f} after it.'
    )
    draw(m)
    print(f'x and nu over time: {PICTURE}')


if __name__ == '__main__':
    main()
