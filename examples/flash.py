"""
Flash: phases that appear and disappear
=======================================

A benzene/toluene mixture is heated until it boils and until it is dry. One mixed
complementarity on the vapour fraction v describes all three cases: while everything
is liquid (v = 0) the vapour in equilibrium with it would not add up, sum y < sum x;
in between both sum up to 1 (Rachford and Rice); a vapour without liquid (v = 1) would
need sum x < 1. The model lists no modes and needs neither bubble nor dew point. Since
the latent heat is counted at the bubble point T_b of the feed, both exact times
follow from the bubble and the dew point. ::

    dH/dt = Q
    H = (1 - v) cpL (T - T0) + v (latent + cpL (T_b - T0) + cpV (T - T_b))
    0 <= v <= 1  perp  sum_i (x_i - y_i)
    y_i = K_i x_i,   x_i (1 + v (K_i - 1)) = z_i,   K_i = p_i(T)/P

H is the enthalpy of 1 kmol.

**Why the answer is right.** The times of the bubble and the dew point are computed from
the mixture alone, without the model, and both printed errors are below 1e-11 s. The
same vessel as a Disjunction of three modes (``build_modes``) needs twice as many pairs.
Tests start from any vapour fraction and find the same times to 1e-8 s.
"""

import pandas as pd
import pyomo.dae as dae
import pyomo.environ as pyo
from matplotlib.figure import Figure
from pyomo.gdp import Disjunction
from pyomo.mpec import complements
from scipy.optimize import brentq

import pyomo_fesd

FEED = {'benzene': 0.5, 'toluene': 0.5}  # kmol
ANTOINE = {
    'benzene': (6.90565, 1211.033, 220.79),
    'toluene': (6.95464, 1344.8, 219.482),
}  # mmHg, degC
PRESSURE = 760.0  # mmHg
T0 = 340.0  # K
CP_LIQUID, CP_VAPOUR = 150.0, 100.0  # kJ/(kmol K)
LATENT = 32000.0  # kJ/kmol
DUTY = 100.0  # kW
HORIZON = 400.0  # s
PICTURE = 'flash.png'


def equilibrium_ratio(i, T):
    """K value of Raoult's law with Antoine's vapour pressure."""
    A, B, C = ANTOINE[i]
    return 10 ** (A - B / (C + T - 273.15)) / PRESSURE


def bubble_point():
    """Temperature at which the first vapour appears (K)."""
    return brentq(
        lambda T: sum(z * equilibrium_ratio(i, T) for i, z in FEED.items()) - 1,
        300,
        400,
        xtol=1e-12,
    )


def dew_point():
    """Temperature at which the last liquid disappears (K)."""
    return brentq(
        lambda T: sum(z / equilibrium_ratio(i, T) for i, z in FEED.items()) - 1,
        300,
        400,
        xtol=1e-12,
    )


T_B = bubble_point()
#: Exact times (s) at which the mixture begins to boil and is dry.
EXACT = (
    CP_LIQUID * (T_B - T0) / DUTY,
    (LATENT + CP_LIQUID * (T_B - T0) + CP_VAPOUR * (dew_point() - T_B)) / DUTY,
)


def build():
    """Build the flash with one mixed complementarity for the phases."""
    m = heated()

    @m.Complementarity(m.t)
    def phases(m, t):
        return complements(
            pyo.inequality(0, m.v[t], 1), sum(m.x[t, i] - m.y[t, i] for i in m.i)
        )

    return m


def build_modes():
    """Build the plant with three modes; they need the bubble and the dew point."""
    m = heated()
    boils, dry = (DUTY * t for t in EXACT)
    m.phases = Disjunction(
        m.t,
        rule=lambda m, t: [
            [m.H[t] <= boils, m.v[t] == 0],
            [pyo.inequality(boils, m.H[t], dry), rachford_rice(m, t) == 0],
            [m.H[t] >= dry, m.v[t] == 1],
        ],
    )
    return m


def rachford_rice(m, t):
    """sum_i (y_i - x_i) as a function of v, which the second mode defines."""
    return sum(FEED[i] * (m.K[t, i] - 1) / (1 + m.v[t] * (m.K[t, i] - 1)) for i in m.i)


def heated():
    """Build everything except the phase condition."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, HORIZON))
    m.i = pyo.Set(initialize=list(FEED))
    m.H = pyo.Var(m.t, initialize=0)  # kJ
    m.T = pyo.Var(m.t, initialize=T0, bounds=(300, 500))  # K
    m.v = pyo.Var(m.t, initialize=0.5, bounds=(0, 1))
    m.x = pyo.Var(m.t, m.i, initialize=lambda m, t, i: FEED[i], bounds=(0, None))
    m.y = pyo.Var(m.t, m.i, initialize=lambda m, t, i: FEED[i], bounds=(0, None))
    m.K = pyo.Var(m.t, m.i, initialize=1, bounds=(0, None))
    m.dH = dae.DerivativeVar(m.H)
    m.H[0].fix(0)

    @m.Constraint(m.t)
    def heat_balance(m, t):
        return m.dH[t] == DUTY

    @m.Constraint(m.t)
    def enthalpy(m, t):
        vapour = LATENT + CP_LIQUID * (T_B - T0) + CP_VAPOUR * (m.T[t] - T_B)
        return m.H[t] == (1 - m.v[t]) * CP_LIQUID * (m.T[t] - T0) + m.v[t] * vapour

    @m.Constraint(m.t, m.i)
    def antoine(m, t, i):
        A, B, C = ANTOINE[i]
        return m.K[t, i] == 10 ** (A - B / (C + m.T[t] - 273.15)) / PRESSURE

    @m.Constraint(m.t, m.i)
    def liquid(m, t, i):
        return m.x[t, i] * (1 + m.v[t] * (m.K[t, i] - 1)) == FEED[i]

    @m.Constraint(m.t, m.i)
    def vapour(m, t, i):
        return m.y[t, i] == m.K[t, i] * m.x[t, i]

    return m


def transform(m, nfe=20, ncp=2, scheme='LAGRANGE-RADAU'):
    """Make the elements movable; no equation shows that v is continuous."""
    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(
        m, nfe=nfe, ncp=ncp, scheme=scheme, continuous=[m.v]
    )
    return m


def solve(m, **keywords):
    """Transform and solve; returns the solver's results."""
    return pyo.SolverFactory('mpec_hybrid').solve(transform(m, **keywords))


def draw(m):
    """Draw temperature, vapour fraction and compositions, with the exact times."""
    frame = pyomo_fesd.trajectory(m)
    figure = Figure(figsize=(7, 7), layout='constrained')
    temperature, fraction, composition = axes = figure.subplots(3, 1, sharex=True)
    temperature.plot(frame['T'])
    temperature.set_ylabel('temperature (K)')
    fraction.plot(frame['v'], color='C1')
    fraction.set_ylabel('vapour fraction')
    composition.plot(frame['x[benzene]'], label='liquid')
    composition.plot(frame['y[benzene]'], label='vapour')
    composition.set_ylabel('mole fraction of benzene')
    composition.legend(fontsize='small')
    composition.set_xlabel('time (s)')
    for axis in axes:
        for time in EXACT:
            axis.axvline(time, color='0.4', linestyle='--', linewidth=0.8)
        axis.margins(x=0.01)
    figure.savefig(PICTURE, dpi=150)


def main():
    """Solve, print the answer, compare the size with that of three modes, draw."""
    m = build()
    results = solve(m)
    boils, dry = pyomo_fesd.switches(m)
    work = f'{results.solver.nlps} NLPs with {results.solver.nlp_iterations} iterations'
    print(f'mpec_hybrid: {results.solver.reason}; {work}.')
    for switch, event, exact in (
        (boils, 'It boils', EXACT[0]),
        (dry, 'It is dry', EXACT[1]),
    ):
        print(
            f'{event} from {switch.time:.9f} s on ({switch.before} -> {switch.after}), '
            f'{switch.time - exact:+.1e} s off.'
        )
    sizes = {
        'mixed complementarity': pyomo_fesd.report(m),
        'three modes': pyomo_fesd.report(transform(build_modes())),
    }
    print(pd.DataFrame(sizes).to_string())
    draw(m)
    print(f'Temperature, vapour fraction and compositions over time: {PICTURE}')


if __name__ == '__main__':
    main()
