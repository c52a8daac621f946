"""
Gene network: conditions that do not matter, and two forms
==========================================================

Two genes regulate one another. A gene is expressed where the other protein is above
its first threshold and its own protein is below the second one. Each gene has three
modes. In the mode ``starved`` (too little of the other protein) the own threshold
does not matter, so this mode has one condition only, and the Heaviside form is a
third smaller than Stewart's. From (10, 3) gene 1 is starved first and saturated next;
in both modes protein 1 decays. At 8 it begins to slide, with gene 1 expressed for
36/40 = 90 % of the maximum. Protein 2 rises to 8 and slides there too, with gene 2
expressed for 12/40 = 30 %. The exact times follow from exponentials. ::

    dx1/dt = 40 s(x2 > 4) s(x1 < 8) - 4.5 x1
    dx2/dt = 40 s(x1 > 4) s(x2 < 8) - 1.5 x2

s is 1 where its condition holds and 0 elsewhere. All quantities are dimensionless.

Source: Acary, de Jong, Brogliato, Numerical simulation of piecewise-linear models of
gene regulatory networks using complementarity systems, Physica D 269 (2014).

**Why the answer is right.** The printed switching times differ from those of the
exponentials by less than 1e-9. In the slides the modes must hold the protein at its
threshold: 36/40 and 12/40, as printed. Stewart's and the Heaviside form are two
different models with the same answer, and a test compares all boundaries with scipy's
integration between events.
"""

from math import log

import pyomo.dae as dae
import pyomo.environ as pyo

import pyomo_fesd

START, END = {1: 10.0, 2: 3.0}, 0.6
DECAY, RATE = {1: 4.5, 2: 1.5}, 40.0
NEEDED, ENOUGH = 4.0, 8.0
OTHER = {1: 2, 2: 1}
PICTURE = 'gene_network.png'


def build():
    """Build both genes with three modes each."""
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
    """Exact times: gene 1 is fed, protein 1 falls to 8, protein 2 rises to 8."""

    def when(i, goal, rate):
        """Time of protein ``i`` from its start to ``goal`` at the given rate."""
        limit = rate / DECAY[i]
        return log((limit - START[i]) / (limit - goal)) / DECAY[i]

    return when(2, NEEDED, RATE), when(1, ENOUGH, 0), when(2, ENOUGH, RATE)


def solve(form='auto', nfe=16, ncp=3):
    """Transform and solve; returns the model and the solver's results."""
    m = build()
    pyo.TransformationFactory('fesd.dcs').apply_to(m, form=form)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=nfe, ncp=ncp)
    return m, pyo.SolverFactory('mpec_hybrid').solve(m)


def main():
    """Solve in both forms, print switches and sizes, draw proteins and modes."""
    for form in ('stewart', 'heaviside'):
        m, results = solve(form)
        size = pyomo_fesd.report(m)
        numbers = ', '.join(
            f'{size[name]} {name}' for name in ('variables', 'constraints', 'pairs')
        )
        print(f"{form}: {numbers}; {results.solver.nlp_iterations} iterations")
    for switch, exact in zip(pyomo_fesd.switches(m), exact_switches()):
        print(f"{switch}, {switch.time - exact:+.1e} off the exact time")
    last = pyomo_fesd.trajectory(m).iloc[-1]
    for i in m.gene:
        share = last[f'regulation[{i}]: expressed[{i}]']
        print(f"At the end gene {i} is expressed for {share:.6f} of what it could be.")
    pyomo_fesd.plot(m, m.t, ['x', 'regulation[1]', 'regulation[2]']).savefig(
        PICTURE, dpi=150
    )
    print(f'Picture: {PICTURE}')


if __name__ == '__main__':
    main()
