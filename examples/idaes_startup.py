"""Start-up of an IDAES reactor with as little unreacted lye in the product as possible: optimal control through an overflow.

    min int F c_NaOH dt      s.t.  int F dt >= 0.6 m3,     0 <= F perp crest - V >= 0,     0.5 <= u <= 4 L/s on each stage

The plant is that of ``idaes_overflow``: mixer, reactor, weir.  What leaves over the weir is the product; what of the lye has not
reacted by then is lost.  The feed u is constant on each of three stages.  When the overflow begins is a result: the
element boundary that finds it moves while the feed is optimised.

March through time with a constant feed, then all elements at once from there.
"""

import pyomo.environ as pyo
from idaes_overflow import CREST_VOLUME, END, INFLOW, initialise, plant
from matplotlib.figure import Figure

import pyomo_fesd
from pyomo_fesd.units import scale_by_values, weir

STAGES = 3
LEAST, MOST = 0.5e-3, 4e-3  # m3/s
PRODUCT = 0.6  # m3
VOLUME = 'fs.cstr.control_volume.volume'
OUTFLOW = 'fs.cstr.control_volume.properties_out.flow_vol'
NAOH = 'fs.cstr.control_volume.properties_out.conc_mol_comp[NaOH]'
PICTURE = 'idaes_startup.png'
units = pyo.units


def build(stages=STAGES):
    """The plant with its weir, the feed as a control, and what it is to do."""
    m = plant([END * k / stages for k in range(stages + 1)])
    fs, flow = m.fs, units.m**3 / units.s
    fs.weir = weir(fs.time, level=fs.cstr.volume, crest=CREST_VOLUME, flow=fs.cstr.outlet.flow_vol)
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


def begin(nfe=12, ncp=2):
    """Discretise, guess, and simulate with the constant feed."""
    m = build()
    pyo.TransformationFactory('fesd.finite_elements').apply_to(
        m.fs, wrt=m.fs.time, nfe=nfe, ncp=ncp, piecewise_constant=[m.fs.feed_rate]
    )
    initialise(m)
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


def draw(m, constant):
    """Feed and outflow, volume, lye in the product; dashed with the constant feed."""
    figure = Figure(figsize=(7, 7), layout='constrained')
    flow, volume, naoh = axes = figure.subplots(3, 1, sharex=True)
    for table, style in ((constant, '--'), (pyomo_fesd.trajectory(m, m.fs.time), '-')):
        flow.plot(1e3 * table['fs.feed_rate'], 'C0' + style, drawstyle='steps-pre', label='feed' if style == '-' else None)
        flow.plot(1e3 * table[OUTFLOW], 'C1' + style, drawstyle='steps-pre', label='product' if style == '-' else None)
        volume.plot(table[VOLUME], 'C2' + style)
        naoh.plot(table[NAOH], 'C3' + style)
    flow.legend()
    naoh.set_xlabel('time (s)')
    for axis, label in zip(axes, ('flow (L/s)', 'volume (m³)', 'lye in the product (mol/m³)')):
        axis.set_ylabel(label)
        for switch in pyomo_fesd.switches(m, m.fs.time):
            axis.axvline(switch.time, color='grey', linestyle=':')
    figure.savefig(PICTURE, dpi=150)


def main():
    """Simulate, optimise, say what was found, draw."""
    m = begin()
    constant, lost = pyomo_fesd.trajectory(m, m.fs.time), pyo.value(m.fs.lost)
    results = solve(m)
    print(f'mpec_hybrid: {results.solver.reason}.')
    print(f'Lye lost: {pyo.value(m.fs.lost):.6f} mol, with a constant feed {lost:.6f} mol.')
    print('Feed: ' + ', '.join(f'{1e3 * feed:.6f}' for feed in feeds(m)) + f' L/s; product {pyo.value(m.fs.product):.6f} m3.')
    for switch in pyomo_fesd.switches(m, m.fs.time):
        print(f'The overflow begins at {switch.time:.6f} s.')
    draw(m, constant)
    print(f'Feed, volume and product over time: {PICTURE}')


if __name__ == '__main__':
    main()
