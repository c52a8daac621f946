"""
IDAES gas vessels with check valve and relief valve
===================================================

Two gas vessels in a row in an IDAES flowsheet block, with a check valve between them
and a relief valve on the second. The second vessel starts at the higher pressure, so
nothing flows until the first has caught up. The relief valve opens at 5 bar and
reseats at 4 bar: in between it has hysteresis. Each addition is one line
(``add_valves``). The time at which the first vessel catches up is known exactly; the
reference for the relief cycles integrates the same equations between located events
with scipy. ::

    feed --> vessel 1 --check valve--> vessel 2 --relief valve--> flare

    n1' = f - F,    n2' = F - G,    p = n R T/V
    0 <= F perp F/k - (p1 - p2) >= 0,    G = 0 or c (p2 - 1 bar)

Isothermal ideal gas. Units: mol, bar, s.

**Why the answer is right.** The time at which the first vessel catches up has a closed
form, and scipy integrates the cycles of the relief valve between located events: the
printed errors of nine switching times are below 1e-3 s, those of the final pressures
2e-5 bar.
"""

import pyomo.dae as dae
import pyomo.environ as pyo
from idaes.core import FlowsheetBlock
from matplotlib.figure import Figure
from scipy.integrate import solve_ivp

import pyomo_fesd
from pyomo_fesd.units import check_valve, relief_valve

END = 260.0
FEED = 2.0  # mol/s
CAPACITY = 1.0 / (8.314462618e-5 * 300)  # mol/bar: V/(R T) of 1 m3
START = {1: 1.0, 2: 2.0}  # bar
K_CHECK, K_RELIEF = 4.0, 3.0  # mol/s/bar
POPS, RESEATS, FLARE = 5.0, 4.0, 1.0  # bar
#: Exact time (s) at which the first vessel has caught up.
CATCHES_UP = (START[2] - START[1]) * CAPACITY / FEED
PICTURE = 'idaes_relief.png'
units = pyo.units
FLOW = units.mol / units.s


def build():
    """Build the flowsheet with both valves."""
    m = vessels()
    add_valves(m)
    return m


def vessels():
    """Build holdups and pressures; both flows are degrees of freedom."""
    m = pyo.ConcreteModel()
    m.fs = FlowsheetBlock(dynamic=True, time_set=[0, END], time_units=units.s)
    m.fs.vessel = pyo.Set(initialize=list(START))
    m.fs.holdup = pyo.Var(
        m.fs.time,
        m.fs.vessel,
        initialize=lambda b, t, i: START[i] * CAPACITY,
        units=units.mol,
    )
    m.fs.accumulation = dae.DerivativeVar(
        m.fs.holdup, wrt=m.fs.time, initialize=0, units=FLOW
    )
    m.fs.forward = pyo.Var(m.fs.time, initialize=0, units=FLOW)
    m.fs.vented = pyo.Var(m.fs.time, initialize=0, units=FLOW)
    m.fs.holdup[0, :].fix()

    @m.fs.Expression(m.fs.time, m.fs.vessel)
    def pressure(fs, t, i):
        return fs.holdup[t, i] / (CAPACITY * units.mol / units.bar)

    @m.fs.Constraint(m.fs.time, m.fs.vessel)
    def balance(fs, t, i):
        inflow, outflow = (
            (FEED * FLOW, fs.forward[t]) if i == 1 else (fs.forward[t], fs.vented[t])
        )
        return fs.accumulation[t, i] == inflow - outflow

    return m


def add_valves(m):
    """Add the two valves."""
    fs, per_bar = m.fs, FLOW / units.bar
    fs.check = check_valve(
        fs.time,
        upstream=lambda fs, t: fs.pressure[t, 1],
        downstream=lambda fs, t: fs.pressure[t, 2],
        flow=fs.forward,
        resistance=1 / (K_CHECK * per_bar),
    )
    fs.relief = relief_valve(
        fs.time,
        pressure=lambda fs, t: fs.pressure[t, 2],
        opens=POPS,
        reseats=RESEATS,
        flow=fs.vented,
        capacity=lambda fs, t: (
            K_RELIEF * per_bar * (fs.pressure[t, 2] - FLARE * units.bar)
        ),
    )


def solve(nfe=80, ncp=3):
    """Simulate, then solve all elements at once; returns the model and the results."""
    m = build()
    pyo.TransformationFactory('fesd.dcs').apply_to(
        m.fs, wrt=m.fs.time, hysteresis=[m.fs.relief]
    )
    pyo.TransformationFactory('fesd.finite_elements').apply_to(
        m.fs, wrt=m.fs.time, nfe=nfe, ncp=ncp
    )
    pyomo_fesd.simulate(m.fs)
    return m, pyo.SolverFactory('mpec_hybrid').solve(m, warm_start=True)


def reference():
    """Integrate with scipy: times of all switches (s), final pressures (bar)."""

    def rates(t, p, relieved):
        forward = max(0.0, K_CHECK * (p[0] - p[1]))
        vented = K_RELIEF * (p[1] - FLARE) if relieved else 0.0
        return (FEED - forward) / CAPACITY, (forward - vented) / CAPACITY

    def event(gap):
        gap.terminal = True
        return gap

    catches_up = event(lambda t, p, relieved: p[0] - p[1])
    limit = {
        False: event(lambda t, p, relieved: p[1] - POPS),
        True: event(lambda t, p, relieved: p[1] - RESEATS),
    }
    t, p, relieved, found = 0.0, (START[1], START[2]), False, []
    while t < END:
        events = limit[relieved] if found else catches_up
        piece = solve_ivp(
            rates,
            (t, END),
            p,
            'DOP853',
            events=events,
            args=(relieved,),
            rtol=1e-13,
            atol=1e-13,
        )
        t, p = piece.t[-1], piece.y[:, -1]
        if piece.status == 1:
            relieved = bool(found) and not relieved
            found.append(t)
    return found, p


def draw(m):
    """Draw pressures with the thresholds, and flows."""
    table = pyomo_fesd.trajectory(m, m.fs.time)
    figure = Figure(figsize=(7, 6), layout='constrained')
    pressure, flow = axes = figure.subplots(2, 1, sharex=True)
    for i in START:
        pressure.plot(table[f'fs.holdup[{i}]'] / CAPACITY, label=f'vessel {i}')
    for threshold in (POPS, RESEATS):
        pressure.axhline(threshold, color='C3', linewidth=0.6)
    pressure.set_ylabel('pressure (bar)')
    pressure.legend()
    flow.plot(table['fs.forward'], label='check valve')
    flow.plot(table['fs.vented'], label='relief valve', drawstyle='steps-pre')
    flow.set_ylabel('flow (mol/s)')
    flow.set_xlabel('time (s)')
    flow.legend()
    for axis in axes:
        for switch in pyomo_fesd.switches(m, m.fs.time):
            axis.axvline(switch.time, color='grey', linestyle=':')
    figure.savefig(PICTURE, dpi=150)


def main():
    """Solve, compare with scipy, draw."""
    m, results = solve()
    times, end = reference()
    print(f'mpec_hybrid: {results.solver.reason}.')
    for switch, exact in zip(pyomo_fesd.switches(m, m.fs.time), times):
        print(f'{switch}, {switch.time - exact:+.1e} s off')
    found = [pyo.value(m.fs.pressure[END, i]) for i in START]
    print(
        f'Pressures at the end: {found[0]:.8f} and {found[1]:.8f} bar; errors '
        f'{found[0] - end[0]:+.1e}, {found[1] - end[1]:+.1e}.'
    )
    draw(m)
    print(f'Pressures and flows over time: {PICTURE}')


if __name__ == '__main__':
    main()
