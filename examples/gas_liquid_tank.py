"""Gas-liquid tank: the outlet takes liquid while the level is above it, gas below; after the switch the level slides on it.

    liquid mode (M_L/rho_L > V_s):  dM_G/dt = F_G,      dM_L/dt = F_L - L
    gas mode    (M_L/rho_L < V_s):  dM_G/dt = F_G - G,  dM_L/dt = F_L
    M_G R T/P + M_L/rho_L = V,      L = G = f (P - P_out)

Once the level has fallen to the outlet neither mode can hold it there, both together do: the fraction nu of the liquid mode
lets just as much liquid out as comes in,  nu f (P - P_out) = F_L,  and the remaining 1 - nu lets the pressure fall.

Source: paper, eq. (22) and (23), Table 1, Figs. 4 and 5; Moudgalya and Ryali (2001).  The paper's switching time of 9.37 s is
that of R = 0.082 L atm/(mol K); with the R below it is 9.35 s.
"""

import numpy as np
import pyomo.dae as dae
import pyomo.environ as pyo
from matplotlib.figure import Figure
from pyomo.gdp import Disjunct, Disjunction

import pyomo_fesd

F_L, F_G = 2.5, 0.1  # mol/s
V, V_S = 10.0, 5.0  # L
T = 300.0  # K
P_OUT = 1.0  # atm
RHO_L = 50.0  # mol/L
R = 0.082057  # L atm/(mol K)
VALVE = 0.1  # mol/(s atm)
M_G0, M_L0 = 6.83, 260.0  # mol
HORIZON = 20.0  # s

#: Event-located reference: switch time (s), gas holdup (mol) and pressure (atm) at the end.
EXACT = {'t_s': 9.354868538871, 'M_G': 5.496072704665, 'P': 27.059474275603}
PICTURE = 'gas_liquid_tank.png'


def build():
    """The tank as an engineer writes it: pressure and outlet flows are algebraic variables, the modes say what flows."""
    m = balances()
    m.liquid = Disjunct(m.t, rule=lambda d, t: takes_liquid(d, m, t))
    m.gas = Disjunct(m.t, rule=lambda d, t: takes_gas(d, m, t))
    m.outlet = Disjunction(m.t, rule=lambda m, t: [m.liquid[t], m.gas[t]])
    return m


def build_in_blocks():
    """The same with an outlet block at every time, which holds its two modes and the Disjunction."""
    m = balances()

    @m.Block(m.t)
    def pipe(b, t):
        b.liquid = Disjunct(rule=lambda d: takes_liquid(d, b.model(), t))
        b.gas = Disjunct(rule=lambda d: takes_gas(d, b.model(), t))
        b.outlet = Disjunction(expr=[b.liquid, b.gas])

    return m


def build_eliminated():
    """The same without algebraic variables: the modes give the derivatives of the two states, as in eq. (22a) and (22b)."""
    m = holdups()
    m.P = pyo.Expression(m.t, rule=lambda m, t: m.M_G[t] * R * T / (V - m.M_L[t] / RHO_L))

    @m.Disjunct(m.t)
    def liquid(d, t):
        d.region = pyo.Constraint(expr=m.M_L[t] / RHO_L >= V_S)
        d.M_G = pyo.Constraint(expr=m.dM_G[t] == F_G)
        d.M_L = pyo.Constraint(expr=m.dM_L[t] == F_L - through_valve(m, t))

    @m.Disjunct(m.t)
    def gas(d, t):
        d.region = pyo.Constraint(expr=m.M_L[t] / RHO_L <= V_S)
        d.M_G = pyo.Constraint(expr=m.dM_G[t] == F_G - through_valve(m, t))
        d.M_L = pyo.Constraint(expr=m.dM_L[t] == F_L)

    m.outlet = Disjunction(m.t, rule=lambda m, t: [m.liquid[t], m.gas[t]])
    return m


def holdups():
    """The two states, in mol, with their derivatives and initial values."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, HORIZON))
    m.M_G = pyo.Var(m.t, initialize=M_G0, bounds=(0, None))
    m.M_L = pyo.Var(m.t, initialize=M_L0, bounds=(0, None))
    m.dM_G = dae.DerivativeVar(m.M_G)
    m.dM_L = dae.DerivativeVar(m.M_L)
    m.M_G[0].fix(M_G0)
    m.M_L[0].fix(M_L0)
    return m


def balances():
    """The tank with pressure (atm) and outlet flows (mol/s); nothing says yet what flows."""
    m = holdups()
    m.P = pyo.Var(m.t, initialize=35.0, bounds=(P_OUT, None))
    m.L = pyo.Var(m.t, initialize=1.0)
    m.G = pyo.Var(m.t, initialize=1.0)

    @m.Constraint(m.t)
    def gas_balance(m, t):
        return m.dM_G[t] == F_G - m.G[t]

    @m.Constraint(m.t)
    def liquid_balance(m, t):
        return m.dM_L[t] == F_L - m.L[t]

    @m.Constraint(m.t)
    def ideal_gas(m, t):
        return m.P[t] * (V - m.M_L[t] / RHO_L) == m.M_G[t] * R * T

    return m


def through_valve(m, t):
    """What the valve lets through, in mol/s, be it liquid or gas (eq. 22d)."""
    return VALVE * (m.P[t] - P_OUT)


def takes_liquid(d, m, t):
    """Mode of a level above the outlet."""
    d.region = pyo.Constraint(expr=m.M_L[t] / RHO_L >= V_S)
    d.L = pyo.Constraint(expr=m.L[t] == through_valve(m, t))
    d.G = pyo.Constraint(expr=m.G[t] == 0)


def takes_gas(d, m, t):
    """Mode of a level below the outlet."""
    d.region = pyo.Constraint(expr=m.M_L[t] / RHO_L <= V_S)
    d.L = pyo.Constraint(expr=m.L[t] == 0)
    d.G = pyo.Constraint(expr=m.G[t] == through_valve(m, t))


def solve(m, nfe=100, ncp=3):
    """Radau elements, then the solver; returns its results."""
    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, wrt=m.t, nfe=nfe, ncp=ncp)
    return pyo.SolverFactory('mpec_hybrid').solve(m)


def found(m):
    """What EXACT lists, as solved; and the one switch."""
    (switch,) = pyomo_fesd.switches(m, m.t)
    return {'t_s': switch.time, 'M_G': m.M_G[HORIZON].value, 'P': pyo.value(m.P[HORIZON])}, switch


def draw(m, filename):
    """Liquid holdup, pressure, fraction of the liquid mode and element lengths over time (s), the true switch marked."""
    frame, times = pyomo_fesd.trajectory(m, m.t), pyomo_fesd.physical_time(m, m.t)
    boundaries = [times[label] for label in m.t.get_finite_elements()]
    fraction = next(name for name in frame.columns if name.endswith('outlet: liquid'))
    figure = Figure(figsize=(10, 6.5), layout='constrained')
    axes = figure.subplots(2, 2, sharex=True)
    axes[0, 0].plot(frame.index, frame['M_L'])
    axes[0, 0].set_ylabel('liquid holdup $M_L$ (mol)')
    axes[0, 1].plot(frame.index, frame['P'])
    axes[0, 1].set_ylabel('pressure $P$ (atm)')
    axes[1, 0].plot(frame.index, frame[fraction])
    axes[1, 0].set_ylabel('fraction ν of the liquid mode (–)')
    axes[1, 1].stairs(np.diff(boundaries), boundaries, baseline=None)
    axes[1, 1].set_ylabel('element length $h_n$ (s)')
    for axis in axes.flat:
        axis.axvline(EXACT['t_s'], color='0.4', linestyle='--', linewidth=0.8)
        axis.margins(x=0.01)
    for axis in axes[1]:
        axis.set_xlabel('time (s)')
    figure.savefig(filename, dpi=150)


def main():
    pass


if __name__ == '__main__':
    main()
