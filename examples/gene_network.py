"""Two genes that regulate one another: modes in which one condition does not matter, and the two forms that write them.

    dx1/dt = 40 s(x2 > 4) s(x1 < 8) - 4.5 x1        dx2/dt = 40 s(x1 > 4) s(x2 < 8) - 1.5 x2

s is 1 where its condition holds and 0 elsewhere: a gene is expressed where the other protein is above its first threshold AND
its own is below the second.  So each gene has three modes.  Of ``starved``, the other protein is missing, nothing is said of its
own threshold: it does not matter there.

From (6, 3) protein 2 comes up just before protein 1 has decayed too far; then both rise to their own second threshold and slide
along it, gene 1 expressed for 36/40 = 90 % of what it could be and gene 2 for 12/40 = 30 %.

Source: Acary, de Jong, Brogliato, Numerical simulation of piecewise-linear models of gene regulatory networks using
complementarity systems, Physica D 269 (2014), section 5.  Time and concentrations have no unit there.
"""

from math import exp, log

import pyomo.dae as dae
import pyomo.environ as pyo

import pyomo_fesd

START, END = {1: 6.0, 2: 3.0}, 1.0
DECAY, RATE = {1: 4.5, 2: 1.5}, 40.0
NEEDED, ENOUGH = 4.0, 8.0
OTHER = {1: 2, 2: 1}
PICTURE = 'gene_network.png'


def build():
    """Both genes with three modes over time."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, END))
    m.gene = pyo.Set(initialize=[1, 2])
    m.x = pyo.Var(m.gene, m.t, initialize=lambda m, i, t: START[i])
    m.dx = dae.DerivativeVar(m.x, wrt=m.t)
    m.made = pyo.Var(m.gene, m.t, initialize=0)
    for i in m.gene:
        m.x[i, 0].fix(START[i])

    @m.Constraint(m.gene, m.t)
    def balance(m, i, t):
        return m.dx[i, t] == m.made[i, t] - DECAY[i] * m.x[i, t]

    @m.Disjunct(m.gene, m.t)
    def starved(d, i, t):
        d.region = pyo.Constraint(expr=m.x[OTHER[i], t] <= NEEDED)
        d.rate = pyo.Constraint(expr=m.made[i, t] == 0)

    @m.Disjunct(m.gene, m.t)
    def expressed(d, i, t):
        d.region = pyo.Constraint(expr=m.x[OTHER[i], t] >= NEEDED)
        d.below = pyo.Constraint(expr=m.x[i, t] <= ENOUGH)
        d.rate = pyo.Constraint(expr=m.made[i, t] == RATE)

    @m.Disjunct(m.gene, m.t)
    def saturated(d, i, t):
        d.region = pyo.Constraint(expr=m.x[OTHER[i], t] >= NEEDED)
        d.above = pyo.Constraint(expr=m.x[i, t] >= ENOUGH)
        d.rate = pyo.Constraint(expr=m.made[i, t] == 0)

    @m.Disjunction(m.gene, m.t)
    def regulation(m, i, t):
        return [m.starved[i, t], m.expressed[i, t], m.saturated[i, t]]

    return m


def exact_switches():
    """Exact times: gene 1 is no longer starved, gene 1 saturates, gene 2 saturates."""

    def when(i, start, goal):
        """Time in which protein ``i`` rises from ``start`` to ``goal`` while its gene is expressed."""
        limit = RATE / DECAY[i]
        return log((limit - start) / (limit - goal)) / DECAY[i]

    fed = when(2, START[2], NEEDED)
    full = fed + when(1, START[1] * exp(-DECAY[1] * fed), ENOUGH)
    return fed, full, when(2, START[2], ENOUGH)


def solve(form='auto', nfe=20, ncp=3):
    """Transform and solve; returns the model and the solver's results."""
    m = build()
    pyo.TransformationFactory('fesd.dcs').apply_to(m, form=form)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=nfe, ncp=ncp)
    return m, pyo.SolverFactory('mpec_hybrid').solve(m)


def main():
    """Solve in both forms, print switches and sizes, draw the proteins and the modes."""
    for form in ('stewart', 'heaviside'):
        m, results = solve(form)
        size = pyomo_fesd.report(m)
        numbers = ', '.join(f'{size[name]} {name}' for name in ('variables', 'constraints', 'pairs'))
        print(f"{form}: {numbers}; {results.solver.nlp_iterations} iterations")
    for switch, exact in zip(pyomo_fesd.switches(m), exact_switches()):
        print(f"{switch}, {switch.time - exact:+.1e} off the exact time")
    last = pyomo_fesd.trajectory(m).iloc[-1]
    for i in m.gene:
        print(f"At the end gene {i} is expressed for {last[f'regulation[{i}]: expressed']:.6f} of what it could be.")
    pyomo_fesd.plot(m, m.t, ['x', 'regulation[1]', 'regulation[2]']).savefig(PICTURE, dpi=150)
    print(f'Picture: {PICTURE}')


if __name__ == '__main__':
    main()
