"""
Pump curve: tables in an implicit equation
==========================================

A centrifugal pump fills a water tower. The data sheet gives head and efficiency as
tables over the flow. As the water rises the flow falls, and the operating point
passes the breakpoints at 40, 30 and 20 m3/h. The flow is given by an implicit
equation that contains the table. Both tables have the same breakpoints, so they share
their nonsmooth terms: four at each time. Between two breakpoints head(q) = a + m q,
hence dt = A dh/q = A (m - 2 FRICTION q)/q dq, and the exact times follow in closed
form. ::

    A dh/dt = q
    head(q) = LIFT + h + FRICTION q^2
    power = rho g q head(q) / efficiency(q)

Units: m, h, kW.

**Why the answer is right.** The exact times, level and energy follow in closed form
from the straight pieces of the table. The printed errors are below 1e-9 h, 1e-8 m and
1e-8 kWh, as every breakpoint that the operating point passes is an element boundary.
"""

from math import log

import numpy as np
import pyomo.dae as dae
import pyomo.environ as pyo
from pyomo.contrib.piecewise import PiecewiseLinearFunction
from scipy.integrate import quad
from scipy.optimize import brentq

import pyomo_fesd

FLOW = (0.0, 10.0, 20.0, 30.0, 40.0, 50.0)  # m3/h
HEAD = (32.0, 31.2, 29.0, 25.0, 19.0, 10.5)  # m
EFFICIENCY = (0.05, 0.35, 0.56, 0.66, 0.67, 0.58)
AREA = 10.0  # m2
LIFT = 14.0  # m
FRICTION = 0.002  # m/(m3/h)^2
HYDRAULIC = 9.81 / 3600  # rho g in kWh/(m3 m)
HORIZON = 5.0  # h
PICTURE = 'pump_curve.png'


def build():
    """Build the tower with its pump; the tables are PiecewiseLinearFunctions."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, HORIZON))
    m.h = pyo.Var(m.t, initialize=0.0, bounds=(0, 20))  # m
    m.q = pyo.Var(m.t, initialize=40.0, bounds=(FLOW[0], FLOW[-1]))  # m3/h
    m.power = pyo.Var(m.t, initialize=2.0)  # kW
    m.dh = dae.DerivativeVar(m.h)
    m.h[0].fix(0)
    m.head = PiecewiseLinearFunction(tabular_data=dict(zip(FLOW, HEAD)))
    m.efficiency = PiecewiseLinearFunction(tabular_data=dict(zip(FLOW, EFFICIENCY)))

    @m.Constraint(m.t)
    def balance(m, t):
        return AREA * m.dh[t] == m.q[t]

    @m.Constraint(m.t)
    def operating_point(m, t):
        return m.head(m.q[t]) == LIFT + m.h[t] + FRICTION * m.q[t] ** 2

    @m.Constraint(m.t)
    def shaft(m, t):
        return m.power[t] * m.efficiency(m.q[t]) == HYDRAULIC * m.q[t] * m.head(m.q[t])

    m.energy = dae.Integral(m.t, rule=lambda m, t: m.power[t])
    return m


def solve(nfe=12, ncp=3):
    """Transform and solve; returns the model and the solver's results."""
    m = build()
    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=nfe, ncp=ncp)
    return m, pyo.SolverFactory('mpec_hybrid').solve(m)


def exact():
    """Exact times (h) of the three breakpoints, final level (m), energy (kWh)."""

    def level(q):
        return np.interp(q, FLOW, HEAD) - LIFT - FRICTION * q**2

    def slope(q):
        k = np.searchsorted(FLOW, q) - 1
        return (HEAD[k + 1] - HEAD[k]) / (FLOW[k + 1] - FLOW[k])

    def duration(before, after):
        return AREA * (
            slope(before) * log(after / before) - 2 * FRICTION * (after - before)
        )

    def consumption(q):
        return (
            HYDRAULIC
            * AREA
            * (slope(q) - 2 * FRICTION * q)
            * np.interp(q, FLOW, HEAD)
            / np.interp(q, FLOW, EFFICIENCY)
        )

    corners = [brentq(level, 40.0, 50.0, xtol=1e-14), 40.0, 30.0, 20.0]
    times = np.cumsum([duration(*ends) for ends in zip(corners, corners[1:])])
    corners.append(
        brentq(
            lambda q: times[-1] + duration(20.0, q) - HORIZON, 10.0, 20.0, xtol=1e-14
        )
    )
    energy = sum(
        quad(consumption, *ends, epsabs=1e-13)[0] for ends in zip(corners, corners[1:])
    )
    return list(times), level(corners[-1]), energy


def found(m):
    """Values of the solved model, in the order of ``exact``."""
    return (
        [s.time for s in pyomo_fesd.switches(m)],
        m.h[HORIZON].value,
        pyo.value(m.energy),
    )


def draw(m):
    """Draw level, flow and power with elements and switches."""
    figure = pyomo_fesd.plot(
        m,
        m.t,
        ['h', 'q', 'power'],
        units={'h': 'level (m)', 'q': 'flow (m3/h)', 'power': 'power (kW)'},
    )
    figure.axes[-1].set_xlabel('time (h)')
    figure.savefig(PICTURE, dpi=150)


def main():
    """Solve, print the answer beside the exact values, draw."""
    m, _ = solve()
    (_, level, energy), (exact_times, exact_level, exact_energy) = found(m), exact()
    for switch, time in zip(pyomo_fesd.switches(m), exact_times):
        print(f"{switch}   ({switch.time - time:+.1e} h off the exact time)")
    print(f"The level at the end is {level:.9f} m, {level - exact_level:+.1e} m off.")
    print(f"The pump takes {energy:.9f} kWh, {energy - exact_energy:+.1e} kWh off.")
    print(f"Sizes:\n{pyomo_fesd.report(m)}")
    draw(m)
    print(f"Level, flow and power over time: {PICTURE}")


if __name__ == '__main__':
    main()
