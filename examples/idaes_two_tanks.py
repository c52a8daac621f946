"""
IDAES: two tanks with overflow weirs
====================================

The IDAES flowsheet of ``idaes_overflow`` with a second vessel. A weir is one line,
``pyomo_fesd.units.weir``: 0 <= F perp crest - volume >= 0. It holds the volume at the
crest as long as there is inflow. It needs no weir law, no capacity and no mode, and
adds no variable and no equation to the flowsheet. The second tank gets nothing before
the first is full: 0.6 m3 at 2e-3 m3/s take exactly 300 s. Then 0.3 m3 are left in the
second, which overflows at exactly 450 s. An ``Integral`` counts the outflow, and the
sodium balance closes. ::

    lye, ester --> Mixer --> reactor ==weir==> second tank ==weir==>

    NaOH + EtOAc -> NaOAc + EtOH in both vessels

**Why the answer is right.** Both times are known from the volumes alone, 300 s and 450
s. The sodium that was fed is in the vessels or in the product: the printed balance
closes. scipy integrates the same reaction between the two events and ends at the same
temperature.
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
    fixed_grid,
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
OUTFLOWS = (
    'fs.cstr.control_volume.properties_out.flow_vol',
    'fs.second.control_volume.properties_out.flow_vol',
)
NAOH = 'fs.second.control_volume.properties_out.conc_mol_comp[NaOH]'
TEMPERATURE = 'fs.second.control_volume.properties_out.temperature'
SODIUM = ('NaOH', 'SodiumAcetate')
FED = INFLOW / 2 * FEED_CONC * END  # mol of sodium
PICTURE = 'idaes_two_tanks.png'
Reference = namedtuple('Reference', 'times naoh temperature')


def build():
    """Build both vessels with their weirs; ``specify_both`` fixes the inputs later."""
    m = two_vessels()
    add_weirs(m)
    return m


def two_vessels():
    """Build both vessels; both outflows are degrees of freedom."""
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
    """Add the two weirs."""
    time = m.fs.time
    m.fs.weir = weir(
        time, level=m.fs.cstr.volume, crest=CREST_VOLUME, flow=m.fs.cstr.outlet.flow_vol
    )
    m.fs.second_weir = weir(
        time,
        level=m.fs.second.volume,
        crest=SECOND_CREST,
        flow=m.fs.second.outlet.flow_vol,
    )


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
    """Initial guess: both vessels fill and then stay full."""
    feed = dict.fromkeys(SOLUTES, 0.0) | dict(
        H2O=m.fs.props.dens_mol, NaOH=FEED_CONC / 2, EthylAcetate=FEED_CONC / 2
    )
    passed = dict.fromkeys(SOLUTES, FEED_CONC / 2) | dict(
        H2O=m.fs.props.dens_mol, NaOH=1.0, EthylAcetate=1.0
    )
    times = list(m.fs.time)
    for t in times:
        guess_state(m.fs.mixer.mixed_state[t], INFLOW, feed)
    guess_reactor(
        m.fs.cstr,
        {t: min(START_VOLUME + INFLOW * t, CREST_VOLUME) for t in times},
        INFLOW,
        feed,
    )
    late = {
        t: min(SECOND_START + INFLOW * max(0, t - OVERFLOW_TIME), SECOND_CREST)
        for t in times
    }
    guess_reactor(m.fs.second, late, INFLOW / 2, passed)
    specify_both(m)
    for vessel, fills_until in ((m.fs.cstr, OVERFLOW_TIME), (m.fs.second, SECOND_TIME)):
        for t in times:
            vessel.outlet.flow_vol[t].set_value(INFLOW if t > fills_until else 0.0)
        settle_reactor(vessel)


def moving_grid(nfe=24, ncp=2):
    """Discretise, initialise, scale, simulate, solve; returns model and results."""
    m = build()
    pyo.TransformationFactory('fesd.finite_elements').apply_to(
        m.fs, wrt=m.fs.time, nfe=nfe, ncp=ncp
    )
    initialise(m)
    scale_by_values(m)
    pyomo_fesd.simulate(m.fs)
    return m, solve(m, warm_start=True)


def solve(m, **options):
    """Solve; returns the solver's results."""
    results = pyo.SolverFactory('mpec_hybrid').solve(m, **options)
    pyo.assert_optimal_termination(results)
    return results


def balance(m):
    """Sodium balance (mol): final contents + outflow - initial contents - feed."""
    ends = {t: sum(holdup(m, t)) for t in (m.fs.time.first(), m.fs.time.last())}
    return (
        ends[m.fs.time.last()]
        + pyo.value(m.fs.sodium_out)
        - ends[m.fs.time.first()]
        - FED
    )


def holdup(m, t):
    """Sodium (mol) in each vessel."""
    for vessel in (m.fs.cstr, m.fs.second):
        yield sum(
            pyo.value(vessel.control_volume.material_holdup[t, 'Liq', j])
            for j in SODIUM
        )


def reference():
    """Integrate the same balances with scipy between located events."""
    m = plant()
    cold = pyo.value(m.fs.props.temperature_ref)
    k0, activation_energy = (
        pyo.value(m.fs.kinetics.arrhenius),
        pyo.value(m.fs.kinetics.energy_activation),
    )
    heating = -pyo.value(
        m.fs.kinetics.dh_rxn['R1'] / (m.fs.props.dens_mol * m.fs.props.cp_mol)
    )  # m3 K/mol
    feed = (
        INFLOW,
        INFLOW / 2 * FEED_CONC,
        INFLOW / 2 * FEED_CONC,
        INFLOW * (FEED_TEMPERATURE - cold),
    )

    def vessel(y, inflow, out):
        """Rates and outflows of volume, NaOH, ester and V (T - T_ref) (m3, mol, K)."""
        volume, naoh, ester, heat = y
        extent = (
            k0
            * exp(-activation_energy / R / (cold + heat / volume))
            * naoh
            * ester
            / volume
        )
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
    for outs, event in (
        ((0, 0), full(0, CREST_VOLUME)),
        ((INFLOW, 0), full(4, SECOND_CREST)),
        ((INFLOW, INFLOW), None),
    ):
        piece = solve_ivp(
            rates, (t, END), y, 'Radau', events=event, args=outs, rtol=1e-11, atol=1e-12
        )
        t, y = piece.t[-1], piece.y[:, -1]
        times.append(t)
    return Reference(times[:2], y[5] / y[4], cold + y[7] / y[4])


def draw(table, spiked):
    """Draw volumes, outflows and NaOH; dashed: outflow on fixed elements."""
    figure = Figure(figsize=(7, 8), layout='constrained')
    volume, outflow, naoh = axes = figure.subplots(3, 1, sharex=True)
    for name, column, flow in zip(('reactor', 'second tank'), VOLUMES, OUTFLOWS):
        volume.plot(table[column], label=name)
        outflow.plot(1e3 * table[flow], marker='.', drawstyle='steps-pre', label=name)
    outflow.plot(
        1e3 * spiked[OUTFLOWS[0]],
        'k--',
        linewidth=0.8,
        drawstyle='steps-pre',
        label='reactor, fixed elements',
    )
    naoh.plot(table[NAOH], color='C2')
    volume.legend()
    outflow.legend()
    naoh.set_xlabel('time (s)')
    for axis, label in zip(
        axes, ('volume (m³)', 'outflow (L/s)', 'NaOH in the product (mol/m³)')
    ):
        axis.set_ylabel(label)
        for time in (OVERFLOW_TIME, SECOND_TIME):
            axis.axvline(time, color='grey', linestyle=':')
    figure.savefig(PICTURE, dpi=150)


def main():
    """Solve, print the answer beside that of fixed elements, draw."""
    m, results = moving_grid()
    table, exact = pyomo_fesd.trajectory(m, m.fs.time), reference()
    print(f'mpec_hybrid: {results.solver.reason}.')
    for switch, time, name in zip(
        pyomo_fesd.switches(m, m.fs.time), exact.times, ('reactor', 'second tank')
    ):
        print(
            f'The {name} overflows from {switch.time:.9f} s on, '
            f'{switch.time - time:+.1e} s off an event-located integration.'
        )
    print(
        f'The product ends at {table[TEMPERATURE].iloc[-1]:.6f} K, '
        f'{table[TEMPERATURE].iloc[-1] - exact.temperature:+.1e} K off.'
    )
    peak = max(table[flow].max() for flow in OUTFLOWS)
    print(
        f'The largest outflow is {peak:.12f} m3/s; the sodium balance closes '
        f'to {balance(m):+.1e} mol of {FED:g} mol.'
    )
    fixed = fixed_grid(15, 2)  # the first vessel only
    spiked = pyomo_fesd.trajectory(fixed, fixed.fs.time)
    print(
        'On fixed elements the largest outflow of the reactor is '
        f'{spiked[OUTFLOWS[0]].max():.6f} m3/s.'
    )
    draw(table, spiked)
    print(f'Volumes, outflows and product over time: {PICTURE}')


if __name__ == '__main__':
    main()
