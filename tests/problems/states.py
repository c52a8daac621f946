"""How the problems over time begin: states with their start values."""

import pyomo.dae as dae
import pyomo.environ as pyo


def over_time(end, **start):
    """A model on 0 <= t <= end with states of these names and start values; the derivative of x is dx."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, end))
    for name, now in start.items():
        m.add_component(name, pyo.Var(m.t, initialize=now))
    for name, now in start.items():
        state = m.component(name)
        m.add_component(f'd{name}', dae.DerivativeVar(state))
        state[0].fix(now)
    return m
