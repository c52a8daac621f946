"""Thermostat with hysteresis: the heater goes off at 20 degrees and on again at 18; between the two the last mode goes on.

    heating (up to 20):   dy/dt = 10 - y/5          cooling (down to 18):   dy/dt = -y/5

The regions overlap where 18 <= y <= 20, so a Disjunction alone does not say what happens there: ``memory`` does.  Each mode is an
exponential, hence from 15 degrees with the heater on

    off after 5 log(35/30),   then it cools for 5 log(20/18) and heats for 5 log(32/30), again and again.

Time in hours, temperature in degrees.
"""

from itertools import accumulate, cycle, takewhile
from math import log

import pyomo.dae as dae
import pyomo.environ as pyo

import pyomo_fesd

START, LOW, HIGH = 15, 18, 20
HORIZON = 2.8
FIRST, COOLS, HEATS = 5 * log(35 / 30), 5 * log(20 / 18), 5 * log(32 / 30)
PICTURE = 'thermostat.png'


def switching_times(horizon=HORIZON):
    """When the heater goes off, on, off, ... up to the horizon."""
    stretches = cycle([COOLS, HEATS])
    return list(takewhile(lambda t: t < horizon, accumulate(stretches, initial=FIRST)))


def room(horizon=HORIZON):
    """A temperature over time."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, horizon))
    m.y = pyo.Var(m.t, initialize=START)
    m.dy = dae.DerivativeVar(m.y)
    m.y[0].fix(START)
    return m


def add_heater(m):
    """Two modes with overlapping regions, heating first."""

    @m.Disjunct(m.t)
    def heating(d, t):
        m = d.model()
        d.until = pyo.Constraint(expr=m.y[t] <= HIGH)
        d.ode = pyo.Constraint(expr=m.dy[t] == 10 - m.y[t] / 5)

    @m.Disjunct(m.t)
    def cooling(d, t):
        m = d.model()
        d.until = pyo.Constraint(expr=m.y[t] >= LOW)
        d.ode = pyo.Constraint(expr=m.dy[t] == -m.y[t] / 5)

    @m.Disjunction(m.t)
    def relay(m, t):
        return [m.heating[t], m.cooling[t]]

    m.heating[0].indicator_var.fix(True)
    return m


def build(horizon=HORIZON):
    """The room with its heater."""
    return add_heater(room(horizon))


def transform(m, nfe=15, ncp=3, scheme='LAGRANGE-RADAU'):
    """The two transformations in a row."""
    pyo.TransformationFactory('fesd.dcs').apply_to(m, memory=[m.relay])
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=nfe, ncp=ncp, scheme=scheme)
    return m


def main():
    """March through the elements, then solve all of them at once from there; say what was found, draw."""
    m = transform(build())
    pyomo_fesd.simulate(m)
    results = pyo.SolverFactory('mpec_hybrid').solve(m, warm_start=True)
    print(f'mpec_hybrid: {results.solver.reason}; {results.solver.nlps} NLPs.')
    for switch, exact in zip(pyomo_fesd.switches(m), switching_times()):
        print(f'{switch}, {switch.time - exact:+.1e} off')
    figure = pyomo_fesd.plot(m, m.t, ['y', 'relay: heating'], units={'y': 'temperature y (°C)', 'relay: heating': 'heater on'})
    for threshold in (LOW, HIGH):
        figure.axes[0].axhline(threshold, color='C3', linewidth=0.6)
    figure.savefig(PICTURE, dpi=150)
    print(f'Temperature and heater over time: {PICTURE}')


if __name__ == '__main__':
    main()
