"""
IDAES reactor start-up: optimal control through an overflow
===========================================================

The reactor of ``idaes_overflow`` is started up with as little unreacted lye in the
product as possible. The product is what leaves over the weir; lye that has not
reacted by then is lost. The feed u is constant on each of three control stages. The
time at which the overflow begins is a result: the element boundary that finds it
moves while the feed is optimised. Independent shooting with scipy finds the same
feeds. ::

    min int F c_NaOH dt      s.t.  int F dt >= 0.6 m3
    0 <= F perp crest - V >= 0,    0.5 <= u <= 4 L/s

The solution starts from a simulation with a feed that fills the vessel within the
first stage. From the constant feed that just makes the product, the search ends with
the overflow at 200 s, on the boundary between two stages: a worse local minimum (see
the page on limits).

**Why the answer is right.** Shooting with scipy (``reference``) uses nothing of the
package and finds the same feeds to 1e-4 L/s and the same loss to 3e-5 mol. The answer
is certified as a local optimum; another one, worse, is known (above).
"""

from math import exp

import pyomo.environ as pyo
from idaes_overflow import (
    CREST_VOLUME,
    END,
    FEED_CONC,
    FEED_TEMPERATURE,
    INFLOW,
    START_TEMPERATURE,
    START_VOLUME,
    initialise,
    plant,
)
from matplotlib.figure import Figure
from scipy.constants import R
from scipy.integrate import solve_ivp
from scipy.optimize import minimize

import pyomo_fesd
from pyomo_fesd.units import scale_by_values, weir

STAGES = 3
LEAST, MOST = 0.5e-3, 4e-3  # m3/s
PRODUCT = 0.6  # m3
BRISK = 3.2e-3  # m3/s
VOLUME = 'fs.cstr.control_volume.volume'
OUTFLOW = 'fs.cstr.control_volume.properties_out.flow_vol'
NAOH = 'fs.cstr.control_volume.properties_out.conc_mol_comp[NaOH]'
PICTURE = 'idaes_startup.png'
units = pyo.units


def build(stages=STAGES):
    """Build the plant with its weir, the feed as a control, and the objective."""
    m = plant([END * k / stages for k in range(stages + 1)])
    fs, flow = m.fs, units.m**3 / units.s
    fs.weir = weir(
        fs.time, level=fs.cstr.volume, crest=CREST_VOLUME, flow=fs.cstr.outlet.flow_vol
    )
    fs.feed_rate = pyo.Var(fs.time, initialize=INFLOW, bounds=(LEAST, MOST), units=flow)
    streams = {'lye': fs.mixer.lye, 'ester': fs.mixer.ester}

    @fs.Constraint(fs.time, list(streams))
    def half(fs, t, stream):
        return streams[stream].flow_vol[t] == fs.feed_rate[t] / 2

    @fs.Integral(fs.time, wrt=fs.time)
    def lost(fs, t):
        leaving = fs.cstr.control_volume.properties_out[t]
        return leaving.flow_vol * leaving.conc_mol_comp['NaOH']

    @fs.Integral(fs.time, wrt=fs.time)
    def product(fs, t):
        return fs.cstr.control_volume.properties_out[t].flow_vol

    fs.enough = pyo.Constraint(expr=fs.product >= PRODUCT * units.m**3)
    fs.cost = pyo.Objective(expr=fs.lost)
    return m


def begin(feed=BRISK, nfe=12, ncp=3):
    """Discretise, initialise, and simulate with a constant feed."""
    m = build()
    pyo.TransformationFactory('fesd.finite_elements').apply_to(
        m.fs, wrt=m.fs.time, nfe=nfe, ncp=ncp, piecewise_constant=[m.fs.feed_rate]
    )
    initialise(m)
    m.fs.feed_rate[:].set_value(feed)
    for stream in (m.fs.mixer.lye, m.fs.mixer.ester):
        stream.flow_vol.unfix()
    scale_by_values(m)
    pyomo_fesd.simulate(m.fs)
    return m


def solve(m):
    """Optimise from the simulated start; returns the solver's results."""
    return pyo.SolverFactory('mpec_hybrid').solve(m, warm_start=True)


def feeds(m):
    """The feed (m3/s) of each stage."""
    return [m.fs.feed_rate[END * (k + 1) / STAGES].value for k in range(STAGES)]


def shoot(feeds):
    """Lye lost (mol) with given feeds (m3/s), by scipy between located events."""
    m = plant()
    cold, k0 = pyo.value(m.fs.props.temperature_ref), pyo.value(m.fs.kinetics.arrhenius)
    activation = pyo.value(m.fs.kinetics.energy_activation) / R
    heating = -pyo.value(
        m.fs.kinetics.dh_rxn['R1'] / (m.fs.props.dens_mol * m.fs.props.cp_mol)
    )  # m3 K/mol

    def rates(t, y, feed, full):
        volume, naoh, ester, heat, _ = y
        out, fed = (feed if full else 0.0), feed / 2 * FEED_CONC
        extent = k0 * exp(-activation / (cold + heat / volume)) * naoh * ester / volume
        lost = out * naoh / volume
        warm = feed * (FEED_TEMPERATURE - cold) + extent * heating - out * heat / volume
        return (
            feed - out,
            fed - extent - lost,
            fed - extent - out * ester / volume,
            warm,
            lost,
        )

    def crest(t, y, feed, full):
        return y[0] - CREST_VOLUME

    crest.terminal = True
    y, full = (
        [START_VOLUME, 0.0, 0.0, START_VOLUME * (START_TEMPERATURE - cold), 0.0],
        False,
    )
    for k, feed in enumerate(feeds):
        t, end = END * k / len(feeds), END * (k + 1) / len(feeds)
        while t < end:
            event = None if full else crest
            piece = solve_ivp(
                rates,
                (t, end),
                y,
                'Radau',
                events=event,
                args=(feed, full),
                rtol=1e-9,
                atol=1e-11,
            )
            t, y = piece.t[-1], piece.y[:, -1]
            full = full or piece.status == 1
    return y[4]


def reference():
    """Best feeds and lye lost by shooting; the product fixes the sum of feeds."""
    total = STAGES * (PRODUCT + CREST_VOLUME - START_VOLUME) / END

    def of_two(late):
        return shoot([total - sum(late) * 1e-3, *(1e-3 * feed for feed in late)])

    found = minimize(
        of_two, [1.4, 1.5], method='Nelder-Mead', options=dict(xatol=1e-4, fatol=1e-9)
    )
    return [total - sum(found.x) * 1e-3, *(1e-3 * found.x)], found.fun


def draw(m, constant):
    """Draw feed, outflow, volume and lye; dashed with the constant feed."""
    figure = Figure(figsize=(7, 7), layout='constrained')
    flow, volume, naoh = axes = figure.subplots(3, 1, sharex=True)
    for table, style in ((constant, '--'), (pyomo_fesd.trajectory(m, m.fs.time), '-')):
        flow.plot(
            1e3 * table['fs.feed_rate'],
            'C0' + style,
            drawstyle='steps-pre',
            label='feed' if style == '-' else None,
        )
        flow.plot(
            1e3 * table[OUTFLOW],
            'C1' + style,
            drawstyle='steps-pre',
            label='product' if style == '-' else None,
        )
        volume.plot(table[VOLUME], 'C2' + style)
        naoh.plot(table[NAOH], 'C3' + style)
    flow.legend()
    naoh.set_xlabel('time (s)')
    for axis, label in zip(
        axes, ('flow (L/s)', 'volume (m³)', 'lye in the product (mol/m³)')
    ):
        axis.set_ylabel(label)
        for switch in pyomo_fesd.switches(m, m.fs.time):
            axis.axvline(switch.time, color='grey', linestyle=':')
    figure.savefig(PICTURE, dpi=150)


def main():
    """Simulate, optimise, print the answer, draw."""
    plain, m = begin(INFLOW), begin()
    constant, lost = (
        pyomo_fesd.trajectory(plain, plain.fs.time),
        pyo.value(plain.fs.lost),
    )
    results = solve(m)
    print(f'mpec_hybrid: {results.solver.reason}.')
    print(
        f'Lye lost: {pyo.value(m.fs.lost):.6f} mol, with a constant feed of '
        f'{1e3 * INFLOW:g} L/s {lost:.6f} mol.'
    )
    print(
        'Feed: '
        + ', '.join(f'{1e3 * feed:.6f}' for feed in feeds(m))
        + f' L/s; product {pyo.value(m.fs.product):.6f} m3.'
    )
    best, least = reference()
    print(
        f'By shooting: {least:.6f} mol with '
        + ', '.join(f'{1e3 * feed:.4f}' for feed in best)
        + ' L/s.'
    )
    for switch in pyomo_fesd.switches(m, m.fs.time):
        print(f'The overflow begins at {switch.time:.6f} s.')
    draw(m, constant)
    print(f'Feed, volume and product over time: {PICTURE}')


if __name__ == '__main__':
    main()
