"""1,000 scenarios of the gas-liquid tank with a disturbed feed: table, model, outputs, and a reference with located events.

    F_L(t) = feed (1 + amplitude sin(frequency t))

Drawn at random besides: the coefficient of the valve, the height of the outlet (as volume below it), and the liquid at the begin;
the gas at the begin has 35 atm.  The level falls or rises to the outlet or not, slides there, and leaves it where the feed is more
than the outlet lets through.
"""

import gas_liquid_tank as plant
import numpy as np
import pandas as pd
import pyomo.dae as dae
import pyomo.environ as pyo
from scipy.integrate import solve_ivp

import pyomo_fesd

NUMBER, SEED, NFE, NCP = 1000, 17, 20, 3
P_0 = 35.0  # atm
RANGES = {
    'feed': (1.8, 3.2),  # mol/s
    'amplitude': (0.05, 0.5),
    'frequency': (0.2, 1.5),  # 1/s
    'valve': (0.07, 0.13),  # mol/(s atm)
    'outlet': (4.8, 5.2),  # L
    'liquid': (235.0, 270.0),  # mol
}


def table(number=NUMBER):
    """The first scenarios; a row does not depend on their number."""
    random = np.random.default_rng(SEED)
    low, high = np.array(list(RANGES.values())).T
    return pd.DataFrame(low + (high - low) * random.random((NUMBER, len(RANGES))), columns=list(RANGES)).head(number)


def gas_at_begin(liquid):
    """Gas holdup at the begin (mol)."""
    return P_0 * (plant.V - liquid / plant.RHO_L) / (plant.R * plant.T)


def pressure(gas, liquid):
    """Pressure (atm) of the holdups."""
    return gas * plant.R * plant.T / (plant.V - liquid / plant.RHO_L)


def build(feed, amplitude, frequency, valve, outlet, liquid):
    """Build the tank of a scenario, ready for the solver."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, plant.HORIZON))
    m.time = pyomo_fesd.clock(m.t)
    m.M_G = pyo.Var(m.t, initialize=gas_at_begin(liquid), bounds=(0, None))
    m.M_L = pyo.Var(m.t, initialize=liquid, bounds=(0, None))
    m.dM_G, m.dM_L = dae.DerivativeVar(m.M_G), dae.DerivativeVar(m.M_L)
    m.M_G[0].fix(gas_at_begin(liquid))
    m.M_L[0].fix(liquid)
    m.F_L = pyo.Expression(m.t, rule=lambda m, t: feed * (1 + amplitude * pyo.sin(frequency * m.time[t])))
    m.P = pyo.Expression(m.t, rule=lambda m, t: pressure(m.M_G[t], m.M_L[t]))
    m.through = pyo.Expression(m.t, rule=lambda m, t: valve * (m.P[t] - plant.P_OUT))

    @m.Disjunction(m.t)
    def outflow(m, t):
        return [
            [m.M_L[t] / plant.RHO_L >= outlet, m.dM_G[t] == plant.F_G, m.dM_L[t] == m.F_L[t] - m.through[t]],
            [m.M_L[t] / plant.RHO_L <= outlet, m.dM_G[t] == plant.F_G - m.through[t], m.dM_L[t] == m.F_L[t]],
        ]

    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, wrt=m.t, nfe=NFE, ncp=NCP)
    return m


def switches(m):
    """Number of switches."""
    return len(pyomo_fesd.switches(m))


def first_switch(m):
    """Time of the first switch, or None."""
    found = pyomo_fesd.switches(m)
    return found[0].time if found else None


def last_switch(m):
    """Time of the last switch, or None."""
    found = pyomo_fesd.switches(m)
    return found[-1].time if found else None


OUTPUTS = {
    'switches': switches,
    'first switch': first_switch,
    'last switch': last_switch,
    'gas at end': f'M_G[{plant.HORIZON:g}]',
    'liquid at end': f'M_L[{plant.HORIZON:g}]',
}


def reference(feed, amplitude, frequency, valve, outlet, liquid, max_step=0.25):
    """``OUTPUTS`` of a scenario by scipy, each mode integrated to its event; shorter excursions than ``max_step`` may be missed."""

    def F_L(t):
        return feed * (1 + amplitude * np.sin(frequency * t))

    def through(x):
        return valve * (pressure(*x) - plant.P_OUT)

    surface = outlet * plant.RHO_L
    rates = {
        'liquid': lambda t, x: [plant.F_G, F_L(t) - through(x)],
        'gas': lambda t, x: [plant.F_G - through(x), F_L(t)],
        'slide': lambda t, x: [plant.F_G - through(x) + F_L(t), 0.0],
    }
    arrives = lambda t, x: x[1] - surface  # noqa: E731
    full = lambda t, x: through(x) - F_L(t)  # noqa: E731
    events = {'liquid': (arrives, -1), 'gas': (arrives, 1), 'slide': (full, -1)}
    t, x, times = 0.0, [gas_at_begin(liquid), liquid], []
    mode = 'liquid' if liquid > surface else 'gas'
    while t < plant.HORIZON:
        event, event.direction = events[mode]
        event.terminal = True
        run = solve_ivp(rates[mode], (t, plant.HORIZON), x, 'DOP853', events=event, rtol=1e-11, atol=1e-11, max_step=max_step)
        t, x = run.t[-1], run.y[:, -1].tolist()
        if run.status == 1:
            times.append(t)
            if mode != 'slide':
                x[1] = surface
            # the feed is more than the outlet lets through, or less
            mode = 'liquid' if mode == 'slide' or F_L(t) > through(x) else 'slide'
    return dict(zip(OUTPUTS, (len(times), times[0] if times else None, times[-1] if times else None, *x)))
