"""Simulations on which a cold homotopy is slow: a buck converter, many relays, a batch with a threshold, a third-order relay.

Each ``build`` returns a model before ``fesd.dcs``; each ``reference`` its final states by an ODE solver that locates events.
"""

import numpy as np
import pyomo.environ as pyo
from pyomo import dae
from pyomo.gdp import Disjunction
from scipy.integrate import solve_ivp

import pyomo_fesd


def _located(modes, mode, x, end, first=0.0):
    """States at ``end``: ``modes[mode]`` is ``(f(t, x), [(g(t, x), mode after, reset(x))])``, left where some g falls to zero."""
    t = first
    while True:
        f, exits = modes[mode]
        events = [lambda t, x, g=g: g(t, x) for g, *_ in exits]
        for event in events:
            event.terminal, event.direction = True, -1
        run = solve_ivp(f, (t, end), x, events=events, rtol=1e-11, atol=1e-13)
        if run.status != 1:
            return run.y[:, -1]
        k = next(k for k, found in enumerate(run.t_events) if found.size)
        t, x = run.t[-1], exits[k][2](run.y[:, -1])
        mode = exits[k][1]


def _states(m, **first):
    for name, number in first.items():
        x = pyo.Var(m.t, initialize=number)
        m.add_component(name, x)
        m.add_component('d' + name, dae.DerivativeVar(x))
        x[0].fix(number)


# Buck converter: L di/dt = u E - v, C dv/dt = i - v/R, the switch u of a hysteresis controller or of a comparator with a ramp

E, R, L, C = 24.0, 22.0, 20.0, 47.0  # volt, ohm, mH, uF; times in ms, currents in A
RAMP, LOW, RISE, GAIN, AIM = 0.4, 3.8, 4.4, 8.4, 11.3


def _buck_rates(u):
    return lambda t, x: [(u * E - x[1]) / L, (x[0] - x[1] / R) * 1000 / C]


def buck_hysteresis(end=4.0, band=0.2):
    """On until v reaches 12 + band, off until it reaches 12 - band."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, end))
    _states(m, i=0.5, v=11.9)
    m.balance = pyo.Constraint(m.t, rule=lambda m, t: m.dv[t] == (m.i[t] - m.v[t] / R) * 1000 / C)

    @m.Disjunct(m.t)
    def on(d, t):
        m = d.model()
        d.until = pyo.Constraint(expr=m.v[t] <= 12 + band)
        d.coil = pyo.Constraint(expr=m.di[t] == (E - m.v[t]) / L)

    @m.Disjunct(m.t)
    def off(d, t):
        m = d.model()
        d.until = pyo.Constraint(expr=m.v[t] >= 12 - band)
        d.coil = pyo.Constraint(expr=m.di[t] == -m.v[t] / L)

    m.switch = Disjunction(m.t, rule=lambda m, t: [m.on[t], m.off[t]])
    m.on[0].indicator_var.fix(True)
    return m


def buck_hysteresis_reference(end=4.0, band=0.2):
    same = np.copy
    modes = {
        'on': (_buck_rates(1), [(lambda t, x: 12 + band - x[1], 'off', same)]),
        'off': (_buck_rates(0), [(lambda t, x: x[1] - 12 + band, 'on', same)]),
    }
    return dict(zip('iv', _located(modes, 'on', [0.5, 11.9], end)))


def buck_ramp(periods=3):
    """On where GAIN (v - AIM) is below a ramp that begins anew in each period: a state that is reset."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, RAMP * (periods - 0.5)))
    _states(m, i=0.5, v=11.9, s=0.0)
    m.ramp = pyo.Constraint(m.t, rule=lambda m, t: m.ds[t] == 1 / RAMP)
    m.anew = pyomo_fesd.state_jump(m.t, guard=lambda m, t: 1 - m.s[t], reset=lambda m, t: [(m.s[t], 0.0)])
    m.balance = pyo.Constraint(m.t, rule=lambda m, t: m.dv[t] == (m.i[t] - m.v[t] / R) * 1000 / C)

    def above(m, t):
        return GAIN * (m.v[t] - AIM) - LOW - RISE * m.s[t]

    m.comparator = Disjunction(
        m.t,
        rule=lambda m, t: [
            [above(m, t) <= 0, m.di[t] == (E - m.v[t]) / L],
            [above(m, t) >= 0, m.di[t] == -m.v[t] / L],
        ],
    )
    return m


def buck_ramp_reference(periods=3):
    end = RAMP * (periods - 0.5)

    def above(t, x):
        return GAIN * (x[1] - AIM) - LOW - RISE * x[2]

    def rates(u):
        return lambda t, x: [*_buck_rates(u)(t, x), 1 / RAMP]

    def anew(t, x):
        return 1 - x[2]

    def reset(x):
        return [x[0], x[1], 0.0]

    # after a reset the comparator may change at once: the mode follows from the state
    def located(x, t):
        while t < end - 1e-12:
            u = int(above(t, x) < 0 or (above(t, x) == 0))
            sign = -1 if u else 1
            found = [lambda t, x, sign=sign: sign * above(t, x), anew]
            for event in found:
                event.terminal, event.direction = True, -1
            run = solve_ivp(rates(u), (t, end), x, events=found, rtol=1e-11, atol=1e-13)
            t, x = run.t[-1], run.y[:, -1]
            if run.status == 1:
                x = reset(x) if run.t_events[1].size else run.y[:, -1] + 1e-13 * np.array(rates(1 - u)(t, x))
        return x

    return dict(zip('ivs', located([0.5, 11.9, 0.0], 0.0)))


# Relays: dx_k/dt = 1 - 3/2 (1 + sgn x_k) + k/100, which slide after different times


def relays(number=30, end=2.0):
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, end))
    m.k = pyo.RangeSet(number)
    m.x = pyo.Var(m.k, m.t, initialize=lambda m, k, t: -0.5 - k / number)
    m.dx = dae.DerivativeVar(m.x, wrt=m.t)
    for k in m.k:
        m.x[k, 0].fix()
    m.relay = Disjunction(
        m.k,
        m.t,
        rule=lambda m, k, t: [[m.x[k, t] <= 0, m.dx[k, t] == 1], [m.x[k, t] >= 0, m.dx[k, t] == 0.5 - 0.1 * m.x[k, t]]],
    )
    return m


def relays_reference(number=30, end=2.0):
    """x = -x0 + t up to zero, 5 (1 - exp(-(t - t0)/10)) after t0."""
    begun = {k: 0.5 + k / number for k in range(1, number + 1)}
    return {('x', k): end - t if t > end else 5 * (1 - np.exp(-(end - t) / 10)) for k, t in begun.items()}


# A batch: filled while a counter runs, emptied at a level by a jump


def batch(end=5.0):
    """Level h rises with an inflow that depends on a threshold; where it reaches 1, the vessel is emptied to 0.1."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, end))
    _states(m, h=0.2, total=0.0)
    m.empty = pyomo_fesd.state_jump(
        m.t, guard=lambda m, t: 1 - m.h[t], reset=lambda m, t: [(m.h[t], 0.1), (m.total[t], m.total[t] + m.h[t] - 0.1)]
    )
    m.count = pyo.Constraint(m.t, rule=lambda m, t: m.dtotal[t] == 0)
    m.valve = Disjunction(
        m.t,
        rule=lambda m, t: [
            [m.h[t] <= 0.7, m.dh[t] == 1 - 0.2 * m.h[t]],
            [m.h[t] >= 0.7, m.dh[t] == 0.3 - 0.1 * m.h[t]],
        ],
    )
    return m


def batch_reference(end=5.0):
    modes = {
        'fast': (lambda t, x: [1 - 0.2 * x[0], 0], [(lambda t, x: 0.7 - x[0], 'slow', np.copy)]),
        'slow': (
            lambda t, x: [0.3 - 0.1 * x[0], 0],
            [(lambda t, x: 1 - x[0], 'fast', lambda x: [0.1, x[1] + x[0] - 0.1])],
        ),
    }
    return dict(zip(('h', 'total'), _located(modes, 'fast', [0.2, 0.0], end)))


# A relay behind three lags: x''' + 2 x'' + 2 x' + x = -3 sgn(x), which oscillates


def third_order(end=8.0):
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, end))
    _states(m, x=1.0, v=0.0, a=0.0)
    m.first = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.v[t])
    m.second = pyo.Constraint(m.t, rule=lambda m, t: m.dv[t] == m.a[t])
    m.relay = Disjunction(
        m.t,
        rule=lambda m, t: [
            [m.x[t] >= 0, m.da[t] == -m.x[t] - 2 * m.v[t] - 2 * m.a[t] - 3],
            [m.x[t] <= 0, m.da[t] == -m.x[t] - 2 * m.v[t] - 2 * m.a[t] + 3],
        ],
    )
    return m


def third_order_reference(end=8.0):
    def rates(u):
        return lambda t, x: [x[1], x[2], -x[0] - 2 * x[1] - 2 * x[2] - 3 * u]

    modes = {
        1: (rates(1), [(lambda t, x: x[0], -1, np.copy)]),
        -1: (rates(-1), [(lambda t, x: -x[0], 1, np.copy)]),
    }
    return dict(zip('xva', _located(modes, 1, [1.0, 0.0, 0.0], end)))


#: name -> build, reference, keywords of fesd.dcs (names of Disjunctions with hysteresis), number of elements at full and at small
#: size, arguments at small size.
PROBLEMS = {
    'buck, hysteresis': (buck_hysteresis, buck_hysteresis_reference, ['switch'], 40, 10, {'end': 0.8}),
    'buck, ramp': (buck_ramp, buck_ramp_reference, [], 40, 14, {'periods': 2}),
    'relays': (relays, relays_reference, [], 70, 8, {'number': 3}),
    'batch': (batch, batch_reference, [], 40, 12, {'end': 2.5}),
    'third order': (third_order, third_order_reference, [], 30, 12, {'end': 3.0}),
}


def discretised(name, small=False):
    """Return the model of a problem on its grid, and its final states by the reference."""
    build, reference, hysteresis, full, few, arguments = PROBLEMS[name]
    arguments = arguments if small else {}
    m = build(**arguments)
    pyo.TransformationFactory('fesd.dcs').apply_to(m, hysteresis=[m.component(d) for d in hysteresis])
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=few if small else full, ncp=4)
    return m, reference(**arguments)


def error(m, states):
    """Return the largest difference of final states."""
    end = m.t.last()
    found = {name: m.component(name[0])[name[1], end] if isinstance(name, tuple) else m.component(name)[end] for name in states}
    return max(abs(found[name].value - number) for name, number in states.items())
