"""
Predictive control of a heat store with an on/off heater
========================================================

A hot-water store has an electric heater with a relay: on from 3 degrees below its set
point until 3 degrees above it. The controller cannot switch the heater; it ramps the
set point, so that the relay heats while electricity is cheap and the water stays warm
enough. Which mode holds depends on the past, so the present mode is part of the
measurement. The water drawn differs from the forecast in every interval, so the relay
switches at times that the plan did not have. ::

    on (until y >= s + 3):  q = 6 kW         off (until y <= s - 3):  q = 0
    C dy/dt = q - k (y - 20) - D,    ds/dt = v,    -12 <= v <= 12 degrees/h

    min  int price q + w (y - 55)^2 + r v^2 dt

Time in hours, temperature in degrees Celsius, power in kW.

**Why the answer is right.** Temperature and set point of the plant come from a
simulation with the water that was really drawn, and the relay obeys its law: power
changes only where the temperature meets an edge of the grey band. The plans are
certified local optima of a problem with many of them, so the loop is not the best
possible: with a smoothed heater in the model it is cheaper (see the benchmarks).
"""

import random

import pyomo.dae as dae
import pyomo.environ as pyo
from matplotlib.figure import Figure
from pyomo.contrib.mpc import DynamicModelInterface, IntervalData

import pyomo_fesd
from pyomo_fesd.units import relay

INTERVAL, STAGES, ELEMENTS, NCP = 0.5, 6, 4, 2  # h
CAPACITY, LOSS, AMBIENT, POWER = 0.35, 0.02, 20.0, 6.0  # kWh/K, kW/K, degrees, kW
DRAWN = 2.0  # kW, forecast of the water drawn
BAND = 3.0  # degrees
WARM, WARM_WEIGHT, RAMP_WEIGHT = 55.0, 0.01, 2e-4
RATE = 12.0  # degrees/h
START = {'y': 56.0, 's': 56.0}
CAPACITY_OF_PLANT = 1.08  # relative to the model
CHEAP, DEAR, HALF_DAY = 0.1, 0.4, 6  # price per kWh, intervals at each price
PICTURE = 'mpc_heater.png'


def build(stages, capacity=CAPACITY):
    """Build the store and its relay over some control stages."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=[k * INTERVAL for k in range(stages + 1)])
    m.drawn = pyo.Param(initialize=DRAWN, mutable=True)
    m.y = pyo.Var(m.t, initialize=START['y'], bounds=(0, 100))
    m.s = pyo.Var(m.t, initialize=START['s'], bounds=(40, 75))
    m.v = pyo.Var(m.t, initialize=0.0, bounds=(-RATE, RATE))
    m.q = pyo.Var(m.t, initialize=0.0)
    m.price = pyo.Var(m.t, initialize=CHEAP)
    m.price.fix()
    m.dy, m.ds = dae.DerivativeVar(m.y), dae.DerivativeVar(m.s)
    for name, number in START.items():
        m.component(name)[0].fix(number)

    @m.Constraint(m.t)
    def heat(m, t):
        losses = LOSS * (m.y[t] - AMBIENT) + m.drawn
        return capacity * m.dy[t] == m.q[t] - losses

    @m.Constraint(m.t)
    def ramp(m, t):
        return m.ds[t] == m.v[t]

    m.relay = relay(
        m.t,
        signal=lambda b, t: m.y[t] - m.s[t],
        low=-BAND,
        high=BAND,
        output=m.q,
        on=POWER,
        acts='below',
        start='off',
    )
    m.loss = dae.Integral(m.t, rule=stage_cost)
    return m


def stage_cost(m, t):
    """Write the rate of the cost."""
    comfort = WARM_WEIGHT * (m.y[t] - WARM) ** 2
    return m.price[t] * m.q[t] + comfort + RAMP_WEIGHT * m.v[t] ** 2


def transform(m, elements=ELEMENTS):
    """Apply both transformations; price and rate are held on each control stage."""
    pyo.TransformationFactory('fesd.dcs').apply_to(m, hysteresis=[m.relay])
    pyo.TransformationFactory('fesd.finite_elements').apply_to(
        m, nfe=elements * (len(m.t) - 1), ncp=NCP, piecewise_constant=[m.v, m.price]
    )
    return m


def control_problem():
    """Build the control problem over six stages."""
    m = build(STAGES)
    m.cost = pyo.Objective(expr=m.loss)
    return transform(m)


def plant():
    """Build the plant over one interval; it stores more heat than the model."""
    m = build(1, CAPACITY * CAPACITY_OF_PLANT)
    return pyomo_fesd.Plant(transform(m, 12), [m.v])


def price(interval):
    """Return the price of electricity in an interval of the day."""
    return DEAR if interval // HALF_DAY % 2 else CHEAP


def control(problem, levels=5):
    """Build the controller; with ``levels`` it tries held controls too."""
    return pyomo_fesd.Controller(problem, [problem.v], [problem.price], levels=levels)


def loop(
    steps=48,
    seed=0,
    time_limit=10,
    build=control_problem,
    control=control,
    advanced=False,
):
    """Close the loop; return plant and the table of steps with the cost of each.

    With ``advanced`` each plan is prepared before its measurement is there.
    """
    problem, real, chance, losses = build(), plant(), random.Random(seed), []
    controller, interface = control(problem), DynamicModelInterface(problem, problem.t)
    stages = [(k * INTERVAL, (k + 1) * INTERVAL) for k in range(STAGES)]

    def before(number):
        prices = [price(number + k) for k in range(STAGES)]
        interface.load_data(IntervalData({problem.price: prices}, stages))
        if number:
            losses.append(pyo.value(real.model.loss))
        for t in real.model.t:
            real.model.price[t].set_value(prices[0])
        real.model.drawn.set_value(DRAWN * chance.choice((0.3, 0.7, 1.0, 1.3, 1.7)))

    table = pyomo_fesd.receding_horizon(
        controller, real, steps, before, time_limit, advanced
    )
    table['cost'] = [*losses, pyo.value(real.model.loss)]
    return real, table


def draw(real, steps):
    """Draw temperature with the band of the relay, power, and the rate of the band."""
    table = real.trajectory()
    figure = Figure(figsize=(7, 6.5), layout='constrained')
    warm, power, rate = figure.subplots(3, 1, sharex=True)
    low, high = table['s'] - BAND, table['s'] + BAND
    warm.fill_between(table.index, low, high, color='0.88', label='band of the relay')
    warm.plot(table['y'], label='water')
    warm.set_ylabel('temperature (°C)')
    warm.legend(loc='lower right', bbox_to_anchor=(1, 1), ncols=2, frameon=False)
    power.plot(table['q'], drawstyle='steps-pre', color='C3')
    power.set_ylabel('heater (kW)')
    prices = power.twinx()
    shown = [price(k) for k in range(len(steps))]
    prices.step(steps.index, shown, 'k--', where='post', linewidth=0.8)
    prices.set_ylabel('price (1/kWh), dashed')
    rate.step(steps.index, steps['v'], where='post', color='0.3')
    for number, (origin, some) in enumerate(steps.groupby('origin')):
        rate.plot(some.index, some['v'], '.', color=f'C{number}', label=origin)
    rate.set_ylabel('rate of the band (°C/h)')
    rate.set_xlabel('time (h)')
    rate.legend(loc='lower right', bbox_to_anchor=(1, 1), ncols=4, frameon=False)
    figure.savefig(PICTURE, dpi=150)


def main():
    """Close the loop, count the origins of the answers, draw."""
    real, steps = loop()
    print(steps['origin'].value_counts().to_string())
    print(f"median time of a step: {1e3 * steps['seconds'].median():.0f} ms")
    draw(real, steps)
    print(f'Temperature, heater and band over time: {PICTURE}')


if __name__ == '__main__':
    main()
