"""IDAES' own dynamic models, in the state in which an engineer has them: built, not discretised yet, and what is to be specified.

Each plant has ``build()``, which returns the flowsheet's model over a continuous time, and ``specify(m)``, to be called on the
discretised model, which fixes inputs and initial values and gives a start.  With these there is an equation for every unknown.
"""

from collections import namedtuple

import idaes_overflow
import pyomo.environ as pyo
from idaes.core import FlowsheetBlock, MaterialBalanceType, MomentumBalanceType
from idaes.models.control.controller import ControllerMVBoundType, ControllerType, PIDController
from idaes.models.properties.examples.saponification_reactions import SaponificationReactionParameterBlock
from idaes.models.properties.examples.saponification_thermo import SaponificationParameterBlock
from idaes.models.properties.modular_properties.base.generic_property import GenericParameterBlock
from idaes.models.properties.modular_properties.examples.BT_ideal import configuration
from idaes.models.unit_models import PFR, Heater, MSContactor
from idaes.models_extra.gas_distribution.properties.natural_gas import NaturalGasParameterBlock
from idaes.models_extra.gas_distribution.unit_models.pipeline import GasPipeline
from idaes.models_extra.gas_solid_contactors.properties.methane_iron_OC_reduction import (
    gas_phase_thermo,
    hetero_reactions,
    solid_phase_thermo,
)
from idaes.models_extra.gas_solid_contactors.unit_models.fixed_bed_0D import FixedBed0D
from pyomo.util.calc_var_value import calculate_variable_from_constraint as calculate

Plant = namedtuple('Plant', 'build specify')

LYE = {'H2O': 55388.0, 'NaOH': 100.0, 'EthylAcetate': 100.0, 'SodiumAcetate': 0.0, 'Ethanol': 0.0}  # mol/m3


def flowsheet(end, units=pyo.units.s):
    m = pyo.ConcreteModel()
    m.fs = FlowsheetBlock(dynamic=True, time_set=[0, end], time_units=units)
    return m


def fix_feed(port, concentrations=LYE, flow=1e-3, temperature=303.15):
    port.flow_vol.fix(flow)
    port.temperature.fix(temperature)
    port.pressure.fix(101325.0)
    for solute, concentration in concentrations.items():
        port.conc_mol_comp[:, solute].fix(concentration)


def spread(states, value_of):
    """Give all state blocks (m, fs.time ...) the same start."""
    for state in states:
        for name, given in value_of.items():
            state.component(name).set_values(given) if isinstance(given, dict) else state.component(name).set_value(given)


def later(var, given):
    """Fix an input over time to another value from the first collocation point on."""
    for t in list(var)[1:]:
        var[t].fix(given)


# Mixer and CSTR


def specify_cstr(m):
    idaes_overflow.initialise(m)
    m.fs.cstr.outlet.flow_vol.fix(1e-3)


# The same with a level controller that moves the outlet; IDAES switches its equations off at the first time


def level_control():
    m = idaes_overflow.plant()
    m.fs.pid = PIDController(
        process_var=m.fs.cstr.volume,
        manipulated_var=m.fs.cstr.outlet.flow_vol,
        mv_bound_type=ControllerMVBoundType.SMOOTH_BOUND,
        calculate_initial_integral=False,
        controller_type=ControllerType.PI,
    )
    return m


def specify_level_control(m):
    idaes_overflow.initialise(m)
    pid = m.fs.pid
    pid.gain_p.fix(-1e-2)
    pid.gain_i.fix(-1e-5)
    pid.setpoint.fix(0.9)
    pid.mv_ref.fix(1e-3)
    pid.mv_lb.set_value(0.0)
    pid.mv_ub.set_value(3e-3)
    pid.smooth_eps.set_value(1e-6)
    pid.mv_integral_component[0].fix(0)


# A vessel with two phases, in minutes


def heater():
    m = flowsheet(9, pyo.units.min)
    m.fs.props = GenericParameterBlock(**configuration)
    m.fs.heater = Heater(property_package=m.fs.props, dynamic=True, has_holdup=True)
    return m


def specify_heater(m):
    heater, cv = m.fs.heater, m.fs.heater.control_volume
    inlet = heater.inlet
    for var, given in ((inlet.flow_mol, 1), (inlet.temperature, 365), (inlet.pressure, 101325), (inlet.mole_frac_comp, 0.5)):
        var.fix(given)
    cv.volume.fix(1)
    heater.heat_duty.fix(5000)
    # the closure that IDAES leaves to the user: how the volume is shared
    cv.phase_fraction[:, 'Liq'].fix(0.1)
    heater.outlet.pressure.fix(101325)
    m.fs.fix_initial_conditions('steady-state')
    later(heater.heat_duty, 8000)
    heater.initialize(solver='casadi_ipopt')


# Two streams in contact, without anything that passes between them


def contactor():
    m = flowsheet(90)
    m.fs.props = SaponificationParameterBlock()
    streams = {name: {'property_package': m.fs.props} for name in ('rich', 'lean')}
    m.fs.contactor = MSContactor(number_of_finite_elements=3, streams=streams, has_holdup=True)
    return m


def specify_contactor(m):
    unit, first = m.fs.contactor, m.fs.time.first()
    unit.material_transfer_term.fix(0)
    unit.energy_transfer_term.fix(0)
    unit.volume.fix(1)
    unit.volume_frac_stream[:, :, 'rich'].fix(0.5)
    for stream in ('rich', 'lean'):
        unit.component(f'{stream}_material_accumulation')[first, ...].fix(0)
        unit.component(f'{stream}_energy_accumulation')[first, ...].fix(0)
    later(unit.rich_inlet.temperature, 320.0)
    for state in (*unit.rich.values(), *unit.lean.values()):
        state.flow_vol.set_value(1e-3)
        state.conc_mol_comp.set_values(LYE)
    fix_feed(unit.rich_inlet)
    fix_feed(unit.lean_inlet, LYE | {'NaOH': 20.0}, 2e-3, 310.0)


# A tubular reactor: space and time


def tube():
    m = flowsheet(180)
    m.fs.props = SaponificationParameterBlock()
    m.fs.kinetics = SaponificationReactionParameterBlock(property_package=m.fs.props)
    m.fs.tube = PFR(
        property_package=m.fs.props,
        reaction_package=m.fs.kinetics,
        material_balance_type=MaterialBalanceType.componentTotal,
        momentum_balance_type=MomentumBalanceType.none,
        has_heat_of_reaction=True,
        transformation_method='dae.finite_difference',
        transformation_scheme='BACKWARD',
        finite_elements=5,
    )
    return m


def specify_tube(m):
    tube = m.fs.tube
    fix_feed(tube.inlet)
    tube.volume.fix(0.1)
    tube.length.fix(1.0)
    m.fs.fix_initial_conditions('steady-state')
    later(tube.inlet.temperature, 320.0)
    tube.initialize(solver='casadi_ipopt')


# A gas pipeline: space and time


def pipeline():
    m = flowsheet(18, pyo.units.hr)
    m.fs.props = NaturalGasParameterBlock()
    m.fs.pipeline = GasPipeline(property_package=m.fs.props, finite_elements=4)
    return m


def specify_pipeline(m):
    cv, first = m.fs.pipeline.control_volume, m.fs.time.first()
    inlet, outlet = cv.length_domain.first(), cv.length_domain.last()
    m.fs.pipeline.diameter.fix(0.92 * pyo.units.m)
    cv.length.fix(300.0 * pyo.units.km)
    calculate(cv.area, m.fs.pipeline.diameter_eqn)  # km2
    cv.pressure[:, inlet].fix(57.0)
    cv.flow_mass[:, outlet].fix(3.6e5)
    for t in m.fs.time:
        cv.properties[t, inlet].mole_frac_comp.fix(1.0)
        cv.properties[t, inlet].temperature.fix(293.15)
    for (t, x), state in cv.properties.items():
        state.pressure.set_value(57.0 - 6.0 * x)
        state.temperature.set_value(293.15)
        cv.flow_mass[t, x].set_value(3.0e5)
        calculate(state.flow_mol, cv.flow_mass_linking_constraint[t, x])
    for x in cv.length_domain:
        if x != inlet:
            cv.pressure[first, x].fix()
        if x != outlet:
            cv.flow_mass[first, x].fix()


# A bed of iron oxide that methane reduces


def bed():
    m = flowsheet(360)
    m.fs.gas = gas_phase_thermo.GasPhaseParameterBlock()
    m.fs.solid = solid_phase_thermo.SolidPhaseParameterBlock()
    m.fs.kinetics = hetero_reactions.HeteroReactionParameterBlock(solid_property_package=m.fs.solid, gas_property_package=m.fs.gas)
    m.fs.bed = FixedBed0D(gas_property_package=m.fs.gas, solid_property_package=m.fs.solid, reaction_package=m.fs.kinetics)
    return m


def specify_bed(m):
    bed, start = m.fs.bed, m.fs.bed.solids[0]
    bed.bed_diameter.fix(1)
    bed.bed_height.fix(1)
    start.temperature.fix(1273.15)
    start.particle_porosity.fix(0.20)
    for solid, fraction in (('Fe2O3', 0.45), ('Fe3O4', 0), ('Al2O3', 0.55)):
        start.mass_frac_comp[solid].fix(fraction)
    for gas in bed.gas.values():
        gas.temperature.fix(1273.15)
        gas.pressure.fix(1.01325e5)
        for species, fraction in (('CO2', 0.4), ('H2O', 0.5), ('CH4', 0.1)):
            gas.mole_frac_comp[species].fix(fraction)
    bed.initialize(solver='casadi_ipopt')


PLANTS = {
    'mixer and CSTR': Plant(idaes_overflow.plant, specify_cstr),
    'level control': Plant(level_control, specify_level_control),
    'two-phase vessel': Plant(heater, specify_heater),
    'contactor': Plant(contactor, specify_contactor),
    'tube': Plant(tube, specify_tube),
    'pipeline': Plant(pipeline, specify_pipeline),
    'fixed bed': Plant(bed, specify_bed),
}
