"""Gas-liquid tank: the outlet takes liquid while the level is above it, gas below; after the switch the level slides on it.

    liquid mode (M_L/rho_L > V_s):  dM_G = F_G,      dM_L = F_L - L
    gas mode    (M_L/rho_L < V_s):  dM_G = F_G - G,  dM_L = F_L
    M_G R T/P + M_L/rho_L = V,      L = G = f (P - P_out)

Source: paper, eq. (22) and Table 1; Moudgalya and Ryali (2001).
"""

import matplotlib

matplotlib.use('Agg')

import pyomo.dae as dae
import pyomo.environ as pyo

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

#: Event-located reference: switch time, holdup and pressure at the end, fraction of the liquid mode in the slide.
EXACT = {'t_s': 9.354868538871, 'M_G': 5.496072704665, 'P': 27.059474275603}


def build():
    """The tank as an engineer writes it: pressure and outlet flows are algebraic variables, the modes say what flows."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, HORIZON))
    m.M_G = pyo.Var(m.t, initialize=M_G0, bounds=(0, None))
    m.M_L = pyo.Var(m.t, initialize=M_L0, bounds=(0, None))
    m.P = pyo.Var(m.t, initialize=35.0, bounds=(P_OUT, None))
    m.L = pyo.Var(m.t, initialize=1.0)
    m.G = pyo.Var(m.t, initialize=1.0)
    m.dM_G = dae.DerivativeVar(m.M_G)
    m.dM_L = dae.DerivativeVar(m.M_L)
    m.M_G[0].fix(M_G0)
    m.M_L[0].fix(M_L0)

    @m.Constraint(m.t)
    def gas_balance(m, t):
        return m.dM_G[t] == F_G - m.G[t]

    @m.Constraint(m.t)
    def liquid_balance(m, t):
        return m.dM_L[t] == F_L - m.L[t]

    @m.Constraint(m.t)
    def ideal_gas(m, t):
        return m.P[t] * (V - m.M_L[t] / RHO_L) == m.M_G[t] * R * T

    @m.Disjunct(m.t)
    def liquid(d, t):
        d.region = pyo.Constraint(expr=m.M_L[t] / RHO_L >= V_S)
        d.L = pyo.Constraint(expr=m.L[t] == VALVE * (m.P[t] - P_OUT))
        d.G = pyo.Constraint(expr=m.G[t] == 0)

    @m.Disjunct(m.t)
    def gas(d, t):
        d.region = pyo.Constraint(expr=m.M_L[t] / RHO_L <= V_S)
        d.L = pyo.Constraint(expr=m.L[t] == 0)
        d.G = pyo.Constraint(expr=m.G[t] == VALVE * (m.P[t] - P_OUT))

    @m.Disjunction(m.t)
    def outlet(m, t):
        return [m.liquid[t], m.gas[t]]

    return m
