"""Beds of solids with gas."""

import pyomo.environ as pyo
from benchmarks.idaes.cases.case import Case, flowsheet_time
from benchmarks.idaes.cases.published import finer, fixture, replaced
from pyomo.gdp import Disjunction

# Thermogravimetric analyser: the gas becomes leaner where half of the oxygen is used


def tga(nfe):
    from idaes.models_extra.gas_solid_contactors.flowsheets import dyn_TGA_example

    return dyn_TGA_example.main(pyo.ConcreteModel())


def leaner_gas(m):
    fs, bed = m.fs, m.fs.TGA
    half = 0.5 * pyo.value(bed.solids_material_holdup[0, 'Fe2O3'])
    for t in fs.time:
        bed.gas[t].mole_frac_comp['CH4'].unfix()
    fs.lean = Disjunction(
        fs.time,
        rule=lambda b, t: [
            [bed.solids_material_holdup[t, 'Fe2O3'] >= half, bed.gas[t].mole_frac_comp['CH4'] == 0.1],
            [bed.solids_material_holdup[t, 'Fe2O3'] <= half, bed.gas[t].mole_frac_comp['CH4'] == 0.05],
        ],
    )


# Fixed bed without space, with energy balance: as above, unscaled


def bed_0d(nfe):
    from idaes.models_extra.gas_solid_contactors.unit_models.tests import test_FB0D

    m = fixture(test_FB0D.TestIronOC, 'iron_oc_unscaled')
    m.fs.unit.initialize(optarg={'tol': 1e-6})
    return m


def leaner_when_half_is_used(m):
    fs, bed = m.fs, m.fs.unit
    half = 0.5 * pyo.value(bed.solids_material_holdup[0, 'Fe2O3'])
    for t in fs.time:
        bed.gas[t].mole_frac_comp['CH4'].unfix()
    fs.lean = Disjunction(
        fs.time,
        rule=lambda b, t: [
            [bed.solids_material_holdup[t, 'Fe2O3'] >= half, bed.gas[t].mole_frac_comp['CH4'] == 0.1],
            [bed.solids_material_holdup[t, 'Fe2O3'] <= half, bed.gas[t].mole_frac_comp['CH4'] == 0.05],
        ],
    )


# Fixed bed with space: the gas is throttled where a quarter of the oxygen near the inlet is used


def bed_1d(nfe):
    from idaes.core.util.initialization import initialize_by_time_element
    from idaes.models_extra.gas_solid_contactors.unit_models.tests import test_FB1D as test

    with replaced(test, TransformationFactory=finer(nfe)):
        m = test.build_model()
    # as its class of tests does after ``initialize``, whose result is a cold bed, exact to the published scaling and tolerance
    m.fs.unit.block_triangularization_initialize(calc_var_kwds={'eps': 1e-5})
    test.set_scaling(m)
    options = {'tol': 1e-5, 'bound_push': 1e-22, 'nlp_scaling_method': 'user-scaling'}
    initialize_by_time_element(m.fs, m.fs.time, solver=test.get_solver('ipopt', options))
    return m


def throttle(m):
    fs, bed = m.fs, m.fs.unit
    near = bed.length_domain.at(2)
    left = 0.75 * pyo.value(bed.solid_properties[0, near].mass_frac_comp['Fe2O3'])
    bed.gas_inlet.flow_mol.unfix()
    bed.gas_inlet.flow_mol[0].fix()
    fs.gate = Disjunction(
        fs.time,
        rule=lambda b, t: (
            [
                [bed.solid_properties[t, near].mass_frac_comp['Fe2O3'] >= left],
                [bed.solid_properties[t, near].mass_frac_comp['Fe2O3'] <= left],
            ]
            if t == fs.time.first()
            else [
                [bed.solid_properties[t, near].mass_frac_comp['Fe2O3'] >= left, bed.gas_inlet.flow_mol[t] == 20],
                [bed.solid_properties[t, near].mass_frac_comp['Fe2O3'] <= left, bed.gas_inlet.flow_mol[t] == 10],
            ]
        ),
    )


# Temperature-swing adsorption, one of its time sets, with the length of the heating step free: milder heating of a warm bed


def swing(nfe):
    from idaes.models_extra.temperature_swing_adsorption.tests import test_fixed_bed_tsa0d as test

    m = fixture(test.TestTsaZeolite, 'model')
    test.FixedBedTSA0DInitializer().initialize(m.fs.unit, heating_time_guess=70000, cooling_time_guess=110000)
    return m


def milder_heating(m):
    unit, step = m.fs.unit, m.fs.unit.heating
    step.time.fix()
    step.fc_temperature_eq.deactivate()
    step.energy_balance_ode.deactivate()
    step.lower_by = pyo.Var(step.time_domain, initialize=0)
    area = unit.heat_transfer_coeff * unit.area_heat_transfer

    def energy(b, t):
        if t == step.time_domain.first():
            return pyo.Constraint.Skip
        return step.energy_balance_ode[t].body + area * step.lower_by[t] * step.time == step.energy_balance_ode[t].upper

    step.energy = pyo.Constraint(step.time_domain, rule=energy)
    step.milder = Disjunction(
        step.time_domain,
        rule=lambda b, t: [
            [step.temperature[t] <= 430, step.lower_by[t] == 0],
            [step.temperature[t] >= 430, step.lower_by[t] == 20],
        ],
    )


def free_length(m):
    m.fs.unit.heating.time.unfix()
    m.fs.unit.heating.fc_temperature_eq.activate()


def length_of_the_step(m):
    """The variable, and the name and value of the state at the end that determine each other."""
    return m.fs.unit.heating.time, m.fs.unit.heating.temperature[1].name, m.fs.unit.temperature_desorption.value


CASES = {
    'TGA': Case('models_extra/gas_solid_contactors/flowsheets/dyn_TGA_example.py: main', tga, leaner_gas, flowsheet_time, (100,)),
    'fixed bed 0D': Case(
        'models_extra/gas_solid_contactors/unit_models/tests/test_FB0D.py: TestIronOC',
        bed_0d,
        leaner_when_half_is_used,
        flowsheet_time,
        (10,),
    ),
    'fixed bed 1D': Case(
        'models_extra/gas_solid_contactors/unit_models/tests/test_FB1D.py: build_model',
        bed_1d,
        throttle,
        flowsheet_time,
        (3,),
    ),
    'temperature-swing adsorption': Case(
        'models_extra/temperature_swing_adsorption/tests/test_fixed_bed_tsa0d.py: TestTsaZeolite',
        swing,
        milder_heating,
        lambda m: m.fs.unit.heating.time_domain,
        (20,),
        freed=free_length,
        shot=length_of_the_step,
    ),
}
