"""
Thermostat: two modes with hysteresis
=====================================

The heater of a room is switched off at 20 degrees and on again at 18. Between the two
temperatures the regions of the modes overlap and the previous mode continues, so the
Disjunction is named in ``hysteresis``. Each mode is an exponential, so every switching
time is known in closed form: from 15 degrees with the heater on, it is switched off
after 5 log(35/30) hours; then the room cools for 5 log(20/18) and heats for 5
log(32/30) hours, again and again. ::

    heating (up to 20):   dy/dt = 10 - y/5        cooling (down to 18):   dy/dt = -y/5

Time in hours, temperature in degrees Celsius.

**Why the answer is right.** Each printed time is compared with the logarithms above:
the errors are below 1e-10 h, the accuracy of collocation on an exponential. In between,
a mode can end only at its own threshold, which the picture shows.
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
    """Exact times at which the heater goes off, on, off, ..."""
    durations = cycle([COOLS, HEATS])
    return list(takewhile(lambda t: t < horizon, accumulate(durations, initial=FIRST)))


def room(horizon=HORIZON):
    """Declare the temperature over time."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, horizon))
    m.y = pyo.Var(m.t, initialize=START)
    m.dy = dae.DerivativeVar(m.y)
    m.y[0].fix(START)
    return m


def add_heater(m):
    """Add two modes with overlapping regions; heating is the first one."""

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
    """Build the room with its heater."""
    return add_heater(room(horizon))


def transform(m, nfe=15, ncp=3, scheme='LAGRANGE-RADAU'):
    """Apply both transformations."""
    pyo.TransformationFactory('fesd.dcs').apply_to(m, hysteresis=[m.relay])
    pyo.TransformationFactory('fesd.finite_elements').apply_to(
        m, nfe=nfe, ncp=ncp, scheme=scheme
    )
    return m


def main():
    """Simulate, solve all elements at once from there, print the answer, draw."""
    m = transform(build())
    pyomo_fesd.simulate(m)
    results = pyo.SolverFactory('mpec_hybrid').solve(m, warm_start=True)
    print(f'mpec_hybrid: {results.solver.reason}; {results.solver.nlps} NLPs.')
    for switch, exact in zip(pyomo_fesd.switches(m), switching_times()):
        print(f'{switch}, {switch.time - exact:+.1e} off')
    figure = pyomo_fesd.plot(
        m,
        m.t,
        ['y', 'relay: heating'],
        units={'y': 'temperature y (°C)', 'relay: heating': 'heater on'},
    )
    for threshold in (LOW, HIGH):
        figure.axes[0].axhline(threshold, color='C3', linewidth=0.6)
    figure.savefig(PICTURE, dpi=150)
    print(f'Temperature and heater over time: {PICTURE}')


if __name__ == '__main__':
    main()
