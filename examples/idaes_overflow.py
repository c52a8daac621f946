"""
IDAES reactor with an overflow weir
===================================

A mixer and a stirred reactor (saponification) with an overflow weir, an IDAES
flowsheet with a switch in it. The vessel starts half full of water, and nothing
leaves it until the liquid reaches the crest. The weir can carry more than the feeds
bring, so from then on the level slides at the crest and the inflow leaves: a sliding
mode that neither of the two weir equations describes alone. With 0.6 m3 to fill at
2e-3 m3/s the overflow begins at exactly 300 s; the temperatures agree with scipy's
integration between located events. ::

    lye   (NaOH)  --+
                    +--> Mixer --> CSTR ==weir==>     NaOH + EtOAc -> NaOAc + EtOH
    ester (EtOAc) --+

Units are those of the property packages: m3, s, mol, K, Pa, J.

**Why the answer is right.** The vessel fills at a known rate, so it must overflow at
exactly 300 s; from then on the outflow must be the inflow. Both are printed, beside an
integration by scipy between located events for the temperature. On fixed elements the
same flowsheet has a spike in the outflow, larger than all that flows in.
"""

import logging
from collections import namedtuple
from math import exp

import pyomo.environ as pyo
from idaes.core import FlowsheetBlock, MomentumBalanceType
from idaes.models.properties.examples.saponification_reactions import (
    SaponificationReactionParameterBlock,
)
from idaes.models.properties.examples.saponification_thermo import (
    SaponificationParameterBlock,
)
from idaes.models.unit_models import CSTR, Mixer, MomentumMixingType
from matplotlib.figure import Figure
from pyomo.gdp import Disjunction
from pyomo.network import Arc
from pyomo.util.calc_var_value import calculate_variable_from_constraint as calculate
from scipy.constants import R
from scipy.integrate import solve_ivp

import pyomo_fesd

logging.getLogger('idaes').setLevel(logging.ERROR)

END = 600.0  # s
INFLOW = 2e-3  # m3/s, half of it lye and half ester
FEED_CONC = 100.0  # mol/m3, of the one reactant in each feed
FEED_TEMPERATURE = 303.15  # K
PRESSURE = 101325.0  # Pa, everywhere; the packages do not use it
START_VOLUME = 0.6  # m3
START_TEMPERATURE = 300.0  # K
CREST_VOLUME = 1.2  # m3, of the vessel filled to the crest of its weir
WEIR_CAPACITY = 5e-3  # m3/s, more than the inflow
OVERFLOW_TIME = (CREST_VOLUME - START_VOLUME) / INFLOW  # s, exact

SOLUTES = ('NaOH', 'EthylAcetate', 'SodiumAcetate', 'Ethanol')
VOLUME = 'fs.cstr.control_volume.volume'
OUTFLOW = 'fs.cstr.control_volume.properties_out.flow_vol'
NAOH = 'fs.cstr.control_volume.properties_out.conc_mol_comp[NaOH]'
TEMPERATURE = 'fs.cstr.control_volume.properties_out.temperature'
Reference = namedtuple('Reference', 'overflow_time volume naoh temperature')


def build():
    """Build the plant with its weir; ``specify`` fixes the inputs later."""
    m = plant()
    add_weir(m)
    return m


def plant(times=(0, END)):
    """Build mixer and adiabatic CSTR; the outflow is a degree of freedom."""
    m = pyo.ConcreteModel()
    m.fs = FlowsheetBlock(dynamic=True, time_set=list(times), time_units=pyo.units.s)
    m.fs.props = SaponificationParameterBlock()
    m.fs.kinetics = SaponificationReactionParameterBlock(property_package=m.fs.props)
    m.fs.mixer = Mixer(
        dynamic=False,
        property_package=m.fs.props,
        inlet_list=['lye', 'ester'],
        momentum_mixing_type=MomentumMixingType.none,
    )
    m.fs.cstr = CSTR(
        property_package=m.fs.props,
        reaction_package=m.fs.kinetics,
        has_holdup=True,
        has_heat_of_reaction=True,
        momentum_balance_type=MomentumBalanceType.none,
    )
    m.fs.feed = Arc(source=m.fs.mixer.outlet, destination=m.fs.cstr.inlet)
    pyo.TransformationFactory('network.expand_arcs').apply_to(m)
    return m


def specify(m):
    """Fix feeds and pressures at all times, and the contents at the first.

    Call it on the discretised model: variables that pyomo.dae adds are not fixed.
    """
    for feed, reactant in (
        (m.fs.mixer.lye, 'NaOH'),
        (m.fs.mixer.ester, 'EthylAcetate'),
    ):
        feed.flow_vol.fix(INFLOW / 2)
        feed.temperature.fix(FEED_TEMPERATURE)
        feed.pressure.fix(PRESSURE)
        feed.conc_mol_comp[:, 'H2O'].fix(pyo.value(m.fs.props.dens_mol))
        for solute in SOLUTES:
            feed.conc_mol_comp[:, solute].fix(FEED_CONC if solute == reactant else 0.0)
    m.fs.mixer.outlet.pressure.fix(PRESSURE)
    m.fs.cstr.outlet.pressure.fix(PRESSURE)

    start = m.fs.time.first()
    m.fs.cstr.volume[start].fix(START_VOLUME)
    m.fs.cstr.outlet.temperature[start].fix(START_TEMPERATURE)
    for solute in SOLUTES:
        m.fs.cstr.outlet.conc_mol_comp[start, solute].fix(0.0)


def add_weir(m):
    """Add two modes: no outflow below the crest, weir capacity above it."""
    volume, outflow = m.fs.cstr.volume, m.fs.cstr.outlet.flow_vol
    m.fs.crest_volume = pyo.Param(initialize=CREST_VOLUME, units=pyo.units.m**3)
    m.fs.weir_capacity = pyo.Param(
        initialize=WEIR_CAPACITY, units=pyo.units.m**3 / pyo.units.s
    )

    @m.fs.Disjunct(m.fs.time)
    def filling(d, t):
        d.region = pyo.Constraint(expr=volume[t] <= m.fs.crest_volume)
        d.outflow = pyo.Constraint(expr=outflow[t] == 0)

    @m.fs.Disjunct(m.fs.time)
    def overflowing(d, t):
        d.region = pyo.Constraint(expr=volume[t] >= m.fs.crest_volume)
        d.outflow = pyo.Constraint(expr=outflow[t] == m.fs.weir_capacity)

    m.fs.weir = Disjunction(
        m.fs.time, rule=lambda fs, t: [fs.filling[t], fs.overflowing[t]]
    )


def initialise(m):
    """Give the discretised model a cheap, consistent initial guess.

    The guess is a vessel that fills and then stays full, with most of its feed
    converted; every other variable follows from one equation at a time. From Pyomo's
    own initial values Ipopt fails even if the outflow is given.
    """
    feed = dict.fromkeys(SOLUTES, 0.0) | dict(
        H2O=m.fs.props.dens_mol, NaOH=FEED_CONC / 2, EthylAcetate=FEED_CONC / 2
    )
    for t in m.fs.time:
        guess_state(m.fs.mixer.mixed_state[t], INFLOW, feed)
    volumes = {t: min(START_VOLUME + INFLOW * t, CREST_VOLUME) for t in m.fs.time}
    guess_reactor(m.fs.cstr, volumes, INFLOW, feed)
    specify(m)
    settle_reactor(m.fs.cstr)


def guess_reactor(reactor, volumes, inflow, feed):
    """Set streams (m3/s, mol/m3) and volumes (m3) of a reactor at high conversion."""
    cv = reactor.control_volume
    contents = dict.fromkeys(SOLUTES, FEED_CONC / 2) | dict(
        H2O=feed['H2O'], NaOH=1.0, EthylAcetate=1.0
    )
    for t, volume in volumes.items():
        guess_state(cv.properties_in[t], inflow, feed)
        guess_state(cv.properties_out[t], inflow / 2, contents)
        cv.volume[t].set_value(volume)


def settle_reactor(reactor):
    """Calculate the other variables of a reactor from its streams and volume."""
    cv = reactor.control_volume
    for t in cv.volume:
        calculate(cv.reactions[t].k_rxn, cv.reactions[t].arrhenius_eqn)
        calculate(
            cv.reactions[t].reaction_rate['R1'], cv.reactions[t].rate_expression['R1']
        )
        calculate(
            cv.rate_reaction_extent[t, 'R1'], reactor.cstr_performance_eqn[t, 'R1']
        )
        for i in ((t, 'Liq', j) for j in ('H2O', *SOLUTES)):
            calculate(
                cv.rate_reaction_generation[i],
                cv.rate_reaction_stoichiometry_constraint[i],
            )
            calculate(cv.material_holdup[i], cv.material_holdup_calculation[i])
            calculate(cv.material_accumulation[i], cv.material_balances[i])
        calculate(cv.energy_holdup[t, 'Liq'], cv.energy_holdup_calculation[t, 'Liq'])
        calculate(cv.energy_accumulation[t, 'Liq'], cv.enthalpy_balances[t])


def guess_state(state, flow, concentrations):
    """Set flow (m3/s) and concentrations (mol/m3) at the feed temperature."""
    state.flow_vol.set_value(flow)
    state.temperature.set_value(FEED_TEMPERATURE)
    state.pressure.set_value(PRESSURE)
    state.conc_mol_comp.set_values(concentrations)


def solve(m):
    """Initialise the discretised model and solve it."""
    initialise(m)
    pyo.assert_optimal_termination(pyo.SolverFactory('mpec_hybrid').solve(m))
    return m


def moving_grid(nfe, ncp):
    """Solve on ``nfe`` movable Radau elements of ``ncp`` points."""
    m = build()
    pyo.TransformationFactory('fesd.dcs').apply_to(m.fs, wrt=m.fs.time)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(
        m.fs, wrt=m.fs.time, nfe=nfe, ncp=ncp
    )
    return solve(m)


def fixed_grid(nfe, ncp):
    """Solve on equal, fixed elements with complementarity at each point separately.

    Where the crest is reached inside an element, its last points must discharge the
    surplus of its first ones: a spike in the outflow.
    """
    m = plant()
    pyo.TransformationFactory('dae.collocation').apply_to(
        m.fs, wrt=m.fs.time, nfe=nfe, ncp=ncp
    )
    add_weir(m)  # after the discretisation: pyomo.dae cannot expand a Disjunction
    pyo.TransformationFactory('fesd.dcs').apply_to(m.fs, wrt=m.fs.time)
    return solve(m)


def reference():
    """Integrate the same balances with scipy, filling and overflow as two problems.

    The packages give the mixture the constant density and heat capacity of water, so
    the water balance is a volume balance and the energy balance one of V (T - T_ref).
    Returns overflow time (s) and final volume (m3), NaOH (mol/m3), temperature (K).
    """
    m = plant()
    reference_temperature = pyo.value(m.fs.props.temperature_ref)
    k0, activation_energy = (
        pyo.value(m.fs.kinetics.arrhenius),
        pyo.value(m.fs.kinetics.energy_activation),
    )
    heating = -pyo.value(
        m.fs.kinetics.dh_rxn['R1'] / (m.fs.props.dens_mol * m.fs.props.cp_mol)
    )  # m3 K/mol

    def balances(y, outflow):
        volume, naoh, ester, heat = y  # m3, mol, mol, m3 K
        extent = (
            k0
            * exp(-activation_energy / R / (reference_temperature + heat / volume))
            * naoh
            * ester
            / volume
        )  # mol/s
        return [
            INFLOW - outflow,
            INFLOW / 2 * FEED_CONC - extent - outflow * naoh / volume,
            INFLOW / 2 * FEED_CONC - extent - outflow * ester / volume,
            INFLOW * (FEED_TEMPERATURE - reference_temperature)
            + extent * heating
            - outflow * heat / volume,
        ]

    def crest(t, y):
        return y[0] - CREST_VOLUME

    crest.terminal = True
    tight = dict(method='Radau', rtol=1e-11, atol=1e-12)
    start = [
        START_VOLUME,
        0.0,
        0.0,
        START_VOLUME * (START_TEMPERATURE - reference_temperature),
    ]
    fill = solve_ivp(
        lambda t, y: balances(y, 0.0), (0.0, END), start, events=crest, **tight
    )
    overflow = solve_ivp(
        lambda t, y: balances(y, INFLOW), (fill.t[-1], END), fill.y[:, -1], **tight
    )
    volume, naoh, _, heat = overflow.y[:, -1]
    return Reference(
        fill.t[-1], volume, naoh / volume, reference_temperature + heat / volume
    )


def draw(tables, filename):
    """Draw volume, outflow and NaOH over time (s), one column for each titled table."""
    figure = Figure(figsize=(10, 8), layout='constrained')
    axes = figure.subplots(3, len(tables), sharex=True, sharey='row')
    for (title, table), (volume, outflow, naoh) in zip(tables.items(), axes.T):
        volume.set_title(title)
        volume.plot(table[VOLUME], marker='.')
        # the outflow is discontinuous; a switch has the value from before
        outflow.plot(table[OUTFLOW], marker='.', drawstyle='steps-pre')
        naoh.plot(table[NAOH], marker='.')
        naoh.set_xlabel('time (s)')
    for axis, label in zip(
        axes[:, 0], ('volume (m³)', 'outflow (m³/s)', 'NaOH (mol/m³)')
    ):
        axis.set_ylabel(label)
    for axis in axes.flat:
        axis.axvline(OVERFLOW_TIME, color='grey', linestyle=':')
    figure.savefig(filename, dpi=150)


def main(nfe=15, ncp=2):
    """Solve on both grids, print and draw both answers.

    With an odd number of elements the fixed grid has no boundary at 300 s.
    """
    moving, fixed = moving_grid(nfe, ncp), fixed_grid(nfe, ncp)
    (switch,) = pyomo_fesd.switches(moving, moving.fs.time)
    found = pyomo_fesd.trajectory(moving, moving.fs.time)
    spiked = pyomo_fesd.trajectory(fixed, fixed.fs.time)
    exact = reference()
    error, fixed_error = (
        table[TEMPERATURE].iloc[-1] - exact.temperature for table in (found, spiked)
    )

    print(
        f'The vessel overflows from {switch.time:.9f} s on, '
        f'{switch.time - OVERFLOW_TIME:+.1e} s off the exact time.'
    )
    print(
        f'After that {found[OUTFLOW].iloc[-1]:.6e} m3/s leave it, at most '
        f'{found[OUTFLOW].max():.6e}; {INFLOW:.6e} flow in.'
    )
    print(
        f'On fixed elements the outflow rises to {spiked[OUTFLOW].max():.6e} m3/s '
        'before it settles.'
    )
    print(
        f'The final temperature is {error:+.1e} K off an event-located integration, on '
        f'fixed elements {fixed_error:+.1e} K.'
    )
    draw(
        {'elements that find the switch': found, 'fixed elements': spiked},
        'idaes_overflow.png',
    )


if __name__ == '__main__':
    main()
