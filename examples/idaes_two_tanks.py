"""Two tanks with overflow weirs: the IDAES flowsheet of ``idaes_overflow``, one vessel longer.

    lye, ester --> Mixer --> reactor ==weir==> second tank ==weir==>       NaOH + EtOAc -> NaOAc + EtOH, in both

A weir is one line, ``pyomo_fesd.units.weir``: 0 <= F perp crest - volume >= 0.  It holds the volume at the crest for as long as
something flows in; no weir law, no capacity, no mode is needed, and it adds no variable and no equation to the flowsheet.

Nothing reaches the second tank before the first is full: with 0.6 m3 to fill at 2e-3 m3/s at 300 s.  Then 0.3 m3 are left in the
second, so that it overflows at 450 s.  What leaves is counted by an ``Integral``: sodium is neither made nor lost.
"""

from collections import namedtuple
from math import exp

import pyomo.environ as pyo
from idaes.core import MomentumBalanceType
from idaes.models.unit_models import CSTR
from idaes_overflow import (
    CREST_VOLUME,
    END,
    FEED_CONC,
    FEED_TEMPERATURE,
    INFLOW,
    OVERFLOW_TIME,
    PRESSURE,
    SOLUTES,
    START_TEMPERATURE,
    START_VOLUME,
    guess_reactor,
    guess_state,
    plant,
    settle_reactor,
    specify,
)
from matplotlib.figure import Figure
from pyomo.network import Arc
from scipy.constants import R
from scipy.integrate import solve_ivp

import pyomo_fesd
from pyomo_fesd.units import scale_by_values, weir

SECOND_START, SECOND_CREST = 0.2, 0.5  # m3
SECOND_TIME = OVERFLOW_TIME + (SECOND_CREST - SECOND_START) / INFLOW  # s, exact
VOLUMES = ('fs.cstr.control_volume.volume', 'fs.second.control_volume.volume')
OUTFLOWS = ('fs.cstr.control_volume.properties_out.flow_vol', 'fs.second.control_volume.properties_out.flow_vol')
NAOH = 'fs.second.control_volume.properties_out.conc_mol_comp[NaOH]'
TEMPERATURE = 'fs.second.control_volume.properties_out.temperature'
SODIUM = ('NaOH', 'SodiumAcetate')
PICTURE = 'idaes_two_tanks.png'
Reference = namedtuple('Reference', 'times naoh temperature')


def build():
    """Both vessels with their weirs; ``specify_both`` gives the inputs once it is discretised."""
    m = two_vessels()
    add_weirs(m)
    return m


def two_vessels():
    """The flowsheet of one vessel and a second one; nothing says yet how much leaves them."""
    m = plant()
    m.fs.second = CSTR(
        property_package=m.fs.props,
        reaction_package=m.fs.kinetics,
        has_holdup=True,
        has_heat_of_reaction=True,
        momentum_balance_type=MomentumBalanceType.none,
    )
    m.fs.over = Arc(source=m.fs.cstr.outlet, destination=m.fs.second.inlet)
    pyo.TransformationFactory('network.expand_arcs').apply_to(m)

    @m.fs.Integral(m.fs.time, wrt=m.fs.time)
    def sodium_out(fs, t):
        leaving = fs.second.control_volume.properties_out[t]
        return leaving.flow_vol * sum(leaving.conc_mol_comp[j] for j in SODIUM)

    return m


def add_weirs(m):
    """The two lines that make the flowsheet switch."""
    time = m.fs.time
    m.fs.weir = weir(time, level=m.fs.cstr.volume, crest=CREST_VOLUME, flow=m.fs.cstr.outlet.flow_vol)
    m.fs.second_weir = weir(time, level=m.fs.second.volume, crest=SECOND_CREST, flow=m.fs.second.outlet.flow_vol)


def specify_both(m):
    """Fix feeds, pressures, and the contents of both vessels at the first time."""
    specify(m)
    m.fs.second.outlet.pressure.fix(PRESSURE)
    start = m.fs.time.first()
    m.fs.second.volume[start].fix(SECOND_START)
    m.fs.second.outlet.temperature[start].fix(START_TEMPERATURE)
    for solute in SOLUTES:
        m.fs.second.outlet.conc_mol_comp[start, solute].fix(0.0)


def initialise(m):
    """A first guess: both vessels fill and then stay full."""
    feed = dict.fromkeys(SOLUTES, 0.0) | dict(H2O=m.fs.props.dens_mol, NaOH=FEED_CONC / 2, EthylAcetate=FEED_CONC / 2)
    passed = dict.fromkeys(SOLUTES, FEED_CONC / 2) | dict(H2O=m.fs.props.dens_mol, NaOH=1.0, EthylAcetate=1.0)
    times = list(m.fs.time)
    for t in times:
        guess_state(m.fs.mixer.mixed_state[t], INFLOW, feed)
    guess_reactor(m.fs.cstr, {t: min(START_VOLUME + INFLOW * t, CREST_VOLUME) for t in times}, INFLOW, feed)
    late = {t: min(SECOND_START + INFLOW * max(0, t - OVERFLOW_TIME), SECOND_CREST) for t in times}
    guess_reactor(m.fs.second, late, INFLOW / 2, passed)
    specify_both(m)
    for vessel, fills_until in ((m.fs.cstr, OVERFLOW_TIME), (m.fs.second, SECOND_TIME)):
        for t in times:
            vessel.outlet.flow_vol[t].set_value(INFLOW if t > fills_until else 0.0)
        settle_reactor(vessel)


def moving_grid(nfe=20, ncp=3):
    """Elements whose boundaries find both times: guess, scale, march through time, then all elements at once from there."""
    m = build()
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m.fs, wrt=m.fs.time, nfe=nfe, ncp=ncp)
    initialise(m)
    scale_by_values(m)
    pyomo_fesd.simulate(m.fs)
    return m, solve(m, warm_start=True)


def fixed_grid(nfe=19, ncp=3):
    """The same on equal elements, complementarity at each point by itself; none of the 19 begins at 300 s or 450 s."""
    m = two_vessels()
    pyo.TransformationFactory('dae.collocation').apply_to(m.fs, wrt=m.fs.time, nfe=nfe, ncp=ncp)
    add_weirs(m)
    initialise(m)
    scale_by_values(m)
    return m, solve(m, warm_start=True)


def solve(m, **options):
    """Solve; returns the solver's results."""
    results = pyo.SolverFactory('mpec_hybrid').solve(m, **options)
    pyo.assert_optimal_termination(results)
    return results


def balances(m):
    """What the flowsheet has made of volume (m3) and of sodium (mol): contents at the end + left - contents at first - fed."""
    first, last = m.fs.time.first(), m.fs.time.last()

    def contents(t):
        for vessel in (m.fs.cstr, m.fs.second):
            yield sum(pyo.value(vessel.control_volume.material_holdup[t, 'Liq', j]) for j in SODIUM)

    fed = INFLOW / 2 * FEED_CONC * END
    return sum(contents(last)) + pyo.value(m.fs.sodium_out) - sum(contents(first)) - fed


def reference():
    """The same balances by scipy, from one located overflow to the next: both times (s), NaOH (mol/m3) and temperature (K)."""
    m = plant()
    cold = pyo.value(m.fs.props.temperature_ref)
    k0, activation_energy = pyo.value(m.fs.kinetics.arrhenius), pyo.value(m.fs.kinetics.energy_activation)
    heating = -pyo.value(m.fs.kinetics.dh_rxn['R1'] / (m.fs.props.dens_mol * m.fs.props.cp_mol))  # m3 K/mol
    feed = (INFLOW, INFLOW / 2 * FEED_CONC, INFLOW / 2 * FEED_CONC, INFLOW * (FEED_TEMPERATURE - cold))

    def vessel(y, inflow, out):
        """Rates of volume (m3), NaOH, ester (mol) and V (T - T_ref) (m3 K), and the outflow of each."""
        volume, naoh, ester, heat = y
        extent = k0 * exp(-activation_energy / R / (cold + heat / volume)) * naoh * ester / volume
        made = (0.0, -extent, -extent, extent * heating)
        outflow = [out * part / volume for part in y]
        return [i + g - o for i, g, o in zip(inflow, made, outflow)], outflow

    def rates(t, y, first_out, second_out):
        first, passed = vessel(y[:4], feed, first_out)
        return first + vessel(y[4:], passed, second_out)[0]

    def full(number, crest):
        def event(t, y, *outs):
            return y[number] - crest

        event.terminal = True
        return event

    def start(volume):
        return [volume, 0.0, 0.0, volume * (START_TEMPERATURE - cold)]

    t, y, times = 0.0, start(START_VOLUME) + start(SECOND_START), []
    for outs, event in (((0, 0), full(0, CREST_VOLUME)), ((INFLOW, 0), full(4, SECOND_CREST)), ((INFLOW, INFLOW), None)):
        piece = solve_ivp(rates, (t, END), y, 'Radau', events=event, args=outs, rtol=1e-11, atol=1e-12)
        t, y = piece.t[-1], piece.y[:, -1]
        times.append(t)
    return Reference(times[:2], y[5] / y[4], cold + y[7] / y[4])


def draw(tables):
    """Volumes, outflows and NaOH in the product over time (s), one column of pictures for each titled table."""
    figure = Figure(figsize=(10, 8), layout='constrained')
    axes = figure.subplots(3, len(tables), sharex=True, sharey='row')
    for (title, table), (volume, outflow, naoh) in zip(tables.items(), axes.T):
        volume.set_title(title)
        for name, column, flow in zip(('reactor', 'second tank'), VOLUMES, OUTFLOWS):
            volume.plot(table[column], label=name)
            outflow.plot(1e3 * table[flow], marker='.', drawstyle='steps-pre', label=name)  # it jumps
        naoh.plot(table[NAOH], color='C2')
        naoh.set_xlabel('time (s)')
    axes[0, 0].legend()
    for axis, label in zip(axes[:, 0], ('volume (m³)', 'outflow (L/s)', 'NaOH in the product (mol/m³)')):
        axis.set_ylabel(label)
    for axis in axes.flat:
        for time in (OVERFLOW_TIME, SECOND_TIME):
            axis.axvline(time, color='grey', linestyle=':')
    figure.savefig(PICTURE, dpi=150)


def main():
    """Solve on both grids, say what was found, draw."""
    (m, results), (fixed, _) = moving_grid(), fixed_grid()
    found, spiked = (pyomo_fesd.trajectory(model, model.fs.time) for model in (m, fixed))
    exact = reference()
    print(f'mpec_hybrid: {results.solver.reason}.')
    for switch, time, name in zip(pyomo_fesd.switches(m, m.fs.time), exact.times, ('reactor', 'second tank')):
        print(f'The {name} overflows from {switch.time:.9f} s on, {switch.time - time:+.1e} s off an event-located integration.')
    end = found[TEMPERATURE].iloc[-1]
    print(f'The product ends at {end:.6f} K, {end - exact.temperature:+.1e} K off.')
    for name, table, model in (('moving', found, m), ('fixed', spiked, fixed)):
        peak = max(table[flow].max() for flow in OUTFLOWS)
        print(f'On {name} elements the largest outflow is {peak:.9f} m3/s; sodium from nowhere: {balances(model):+.1e} mol.')
    draw({'elements that find the switches': found, 'fixed elements': spiked})
    print(f'Volumes, outflows and product over time: {PICTURE}')


if __name__ == '__main__':
    main()
