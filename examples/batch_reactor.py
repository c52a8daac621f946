"""
Batch reactor: four states jump at once
=======================================

A -> B reacts with first-order kinetics while solvent evaporates at a constant rate.
As soon as A has fallen to a tenth of a charge, the contents except for a heel go to
the product tank, where P counts B, and a fresh charge comes in. Between two resets A
is an exponential, so the exact times are known: the first batch takes
log(A(0)/A_end)/k and every later one log(A+/A_end)/k with A+ = heel A_end + charge.
::

    dA/dt = -k A,   dB/dt = k A,   dV/dt = -w

    A+ = heel A + charge,              B+ = heel B,
    V+ = heel V + volume of a charge,  P+ = P + (1 - heel) B

Units: mol, L, h.

**Why the answer is right.** A is an exponential between two resets, so the times have a
closed form: the printed errors are below 3e-8 h, that of collocation on an exponential.
The product needs no integration at all, as the resets themselves count it: it is exact
to round-off.
"""

from math import log

import pyomo.dae as dae
import pyomo.environ as pyo

import pyomo_fesd

RATE, EVAPORATION = 0.8, 1.5  # k in 1/h, w in L/h
CHARGE, VOLUME = 40.0, 20.0  # A and volume of a charge
A_END = CHARGE / 10
HEEL = 0.05
HORIZON = 10
A_RESET = HEEL * A_END + CHARGE
PICTURE = 'batch_reactor.png'


def resets(horizon=HORIZON):
    """Exact times at which the reactor is emptied before the horizon."""
    first, later = log(CHARGE / A_END) / RATE, log(A_RESET / A_END) / RATE
    return [first + n * later for n in range(1 + int((horizon - first) / later))]


def contents_at_resets(horizon=HORIZON):
    """Exact B, V and P just before each reset, and P after the last one."""
    B, V, P, before, found = 0.0, VOLUME, 0.0, 0.0, []
    for n, time in enumerate(resets(horizon)):
        B, V = (
            B + (CHARGE if n == 0 else A_RESET) - A_END,
            V - EVAPORATION * (time - before),
        )
        found.append((B, V, P))
        B, V, P, before = HEEL * B, HEEL * V + VOLUME, P + (1 - HEEL) * B, time
    return found, P


def build(horizon=HORIZON):
    """Build kinetics, evaporation and the law of reset."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, horizon))
    start = {'A': CHARGE, 'B': 0.0, 'V': VOLUME, 'P': 0.0}
    for name, now in start.items():
        m.add_component(name, pyo.Var(m.t, initialize=now))
        m.add_component(f'd{name}', dae.DerivativeVar(m.component(name)))
        m.component(name)[0].fix(now)
    m.reaction = pyo.Constraint(m.t, rule=lambda m, t: m.dA[t] == -RATE * m.A[t])
    m.product = pyo.Constraint(m.t, rule=lambda m, t: m.dB[t] == RATE * m.A[t])
    m.evaporation = pyo.Constraint(m.t, rule=lambda m, t: m.dV[t] == -EVAPORATION)
    m.tank = pyo.Constraint(m.t, rule=lambda m, t: m.dP[t] == 0)

    def after(m, t):
        return [
            (m.A[t], HEEL * m.A[t] + CHARGE),
            (m.B[t], HEEL * m.B[t]),
            (m.V[t], HEEL * m.V[t] + VOLUME),
            (m.P[t], m.P[t] + (1 - HEEL) * m.B[t]),
        ]

    m.charging = pyomo_fesd.state_jump(
        m.t, guard=lambda m, t: m.A[t] - A_END, reset=after
    )
    return m


def main():
    """Simulate, solve all elements at once, compare with the exact times, draw."""
    m = build()
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=16, ncp=4)
    pyomo_fesd.simulate(m)
    results = pyo.SolverFactory('mpec_hybrid').solve(m, warm_start=True)
    print(f'mpec_hybrid: {results.solver.reason}; {results.solver.nlps} NLPs.')
    for switch, exact in zip(pyomo_fesd.switches(m), resets()):
        print(
            f'The reactor is emptied after {switch.time:.8f} h, '
            f'{switch.time - exact:+.1e} h off.'
        )
    print(
        f'Product: {m.P[HORIZON].value:.6f} mol, '
        f'{m.P[HORIZON].value - contents_at_resets()[1]:+.1e} mol off.'
    )
    units = {
        'A': 'A (mol)',
        'B': 'B (mol)',
        'V': 'volume V (L)',
        'P': 'product P (mol)',
    }
    pyomo_fesd.plot(m, m.t, ['A', 'B', 'V', 'P'], units=units).savefig(PICTURE, dpi=150)
    print(f'Contents of reactor and product tank over time: {PICTURE}')


if __name__ == '__main__':
    main()
