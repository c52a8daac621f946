"""Units of IDAES' own tests, made dynamic: at rest at first, then an input steps, then something switches."""

from benchmarks.idaes.cases.case import Case, flowsheet_time
from benchmarks.idaes.cases.published import finer, fixture, later, made_dynamic, model_of, replaced
from pyomo.gdp import Disjunction

# Stirred reactor: warm feed, and a cooler that starts at 308 K


def cstr(nfe):
    from idaes.models.unit_models.tests import test_cstr as test

    m = made_dynamic(test, test.TestSaponification, 10, nfe)
    later(m.fs.unit.inlet.temperature, 315)
    return m


def cooler(m):
    for t in list(m.fs.time)[1:]:
        m.fs.unit.heat_duty[t].unfix()
    m.fs.cooler = Disjunction(
        m.fs.time,
        rule=lambda b, t: (
            Disjunction.Skip
            if t == 0
            else [
                [m.fs.unit.outlet.temperature[t] <= 308, m.fs.unit.heat_duty[t] == 0],
                [m.fs.unit.outlet.temperature[t] >= 308, m.fs.unit.heat_duty[t] == -5000],
            ]
        ),
    )


# Plug flow reactor: warm feed, and more of it once the outlet is warm


def plug_flow(nfe):
    from idaes.models.unit_models.tests import test_pfr as test

    m = made_dynamic(test, test.TestSaponification, 0.2, nfe)
    later(m.fs.unit.inlet.temperature, 315)
    return m


def more_feed(m):
    inlet, outlet = m.fs.unit.inlet, m.fs.unit.outlet
    for t in list(m.fs.time)[1:]:
        inlet.flow_vol[t].unfix()
    m.fs.feed = Disjunction(
        m.fs.time,
        rule=lambda b, t: (
            Disjunction.Skip
            if t == 0
            else [
                [outlet.temperature[t] <= 308, inlet.flow_vol[t] == 1.0],
                [outlet.temperature[t] >= 308, inlet.flow_vol[t] == 1.5],
            ]
        ),
    )


# Heater: more heat until the outlet has 312 K


def heater(nfe):
    from idaes.models.unit_models.tests import test_heater as test

    m = made_dynamic(test, test.TestSaponification, 10, nfe, complete=lambda m: m.fs.unit.control_volume.volume.fix(1.5e-3))
    later(m.fs.unit.inlet.temperature, 315)
    return m


def less_heat(m):
    for t in list(m.fs.time)[1:]:
        m.fs.unit.heat_duty[t].unfix()
    m.fs.thermostat = Disjunction(
        m.fs.time,
        rule=lambda b, t: (
            Disjunction.Skip
            if t == 0
            else [
                [m.fs.unit.outlet.temperature[t] <= 319, m.fs.unit.heat_duty[t] == 1000],
                [m.fs.unit.outlet.temperature[t] >= 319, m.fs.unit.heat_duty[t] == 500],
            ]
        ),
    )


# Two phases in equilibrium (smooth VLE): the same for benzene and toluene


def boiling_heater(nfe):
    from idaes.models.unit_models.tests import test_heater as test

    def closure(m):
        m.fs.unit.control_volume.volume.fix(1)
        m.fs.unit.control_volume.phase_fraction[:, 'Liq'].fix(0.1)

    m = made_dynamic(test, test.TestBT_Generic, 10, nfe, name='btg', complete=closure)
    later(m.fs.unit.heat_duty, 0)
    return m


def more_heat(m):
    for t in list(m.fs.time)[1:]:
        m.fs.unit.heat_duty[t].unfix()
    warm = m.fs.unit.outlet.temperature[0].value + 0.5
    m.fs.thermostat = Disjunction(
        m.fs.time,
        rule=lambda b, t: (
            Disjunction.Skip
            if t == 0
            else [
                [m.fs.unit.outlet.temperature[t] <= warm, m.fs.unit.heat_duty[t] == 0],
                [m.fs.unit.outlet.temperature[t] >= warm, m.fs.unit.heat_duty[t] == -1000],
            ]
        ),
    )


# Heat exchanger with space on both sides: the cold side gets more flow once the hot outlet is warm


def exchanger_1d(nfe):
    from idaes.models.unit_models.tests import test_heat_exchanger_1D as test

    def complete(m):
        # cross sections of the two sides, which a steady exchanger does not need
        m.fs.unit.hot_side.area.fix(0.01)
        m.fs.unit.cold_side.area.fix(0.01)

    m = made_dynamic(test, test.TestSaponification_cocurrent, 600, nfe, complete=complete)
    later(m.fs.unit.hot_side_inlet.temperature, 323)
    return m


def more_coolant(m):
    unit = m.fs.unit
    for t in list(m.fs.time)[1:]:
        unit.cold_side_inlet.flow_vol[t].unfix()
    warm = unit.hot_side_outlet.temperature[0].value + 0.5
    m.fs.coolant = Disjunction(
        m.fs.time,
        rule=lambda b, t: (
            [[unit.hot_side_outlet.temperature[t] <= warm], [unit.hot_side_outlet.temperature[t] >= warm]]
            if t == 0
            else [
                [unit.hot_side_outlet.temperature[t] <= warm, unit.cold_side_inlet.flow_vol[t] == 1.0e-3],
                [unit.hot_side_outlet.temperature[t] >= warm, unit.cold_side_inlet.flow_vol[t] == 1.2e-3],
            ]
        ),
    )


# Heat exchanger with the heat capacity of its wall: hot feed, and better transfer once the wall is warm


def lumped_capacitance(nfe):
    from benchmarks.idaes.cases import ideal_water
    from idaes.models.unit_models.tests import test_heat_exchanger_lc as test

    with replaced(test, iapws95=ideal_water, TransformationFactory=finer(nfe)):
        m = fixture(test.TestHXLCGeneric, 'unconstrained_model', None)
        m = fixture(test.TestHXLCGeneric, 'model', m)
    m.fs.unit.heat_capacity_wall = 50
    m.fs.unit.initialize()
    later(m.fs.unit.shell_inlet.enth_mol, 8000)
    return m


def better_transfer(m):
    unit = m.fs.unit
    for t in list(m.fs.time)[1:]:
        unit.ua_cold_side[t].unfix()
    m.fs.fan = Disjunction(
        m.fs.time,
        rule=lambda b, t: (
            Disjunction.Skip
            if t == 0
            else [
                [unit.temperature_wall[t] <= 335, unit.ua_cold_side[t] == 100],
                [unit.temperature_wall[t] >= 335, unit.ua_cold_side[t] == 150],
            ]
        ),
    )


# Gas pipeline: demand falls while the pressure at its end is low.  Forward differences in space and a pressure that is given at
# the inlet make a DAE of higher index: nine states, five degrees of freedom


def pipeline(nfe):
    from idaes.models_extra.gas_distribution.unit_models.tests import test_pipeline as test

    tests = test.TestSolveDynamicPipeline('test_sim_inlet_pressure_outlet_flow_nominal')
    return model_of(test, tests.test_sim_inlet_pressure_outlet_flow_nominal)


def yielding_demand(m):
    cv = m.fs.pipeline.control_volume
    x = cv.length_domain.last()
    for t in list(m.fs.time)[1:]:
        cv.flow_mass[t, x].unfix()
    m.fs.demand = Disjunction(
        m.fs.time,
        rule=lambda b, t: (
            Disjunction.Skip
            if t == 0
            else [
                [cv.pressure[t, x] >= 50, cv.flow_mass_dt[t, x] == 2e4],
                [cv.pressure[t, x] <= 50, cv.flow_mass_dt[t, x] == 0],
            ]
        ),
    )


TESTS = 'models/unit_models/tests/'
CASES = {
    'CSTR': Case(TESTS + 'test_cstr.py: TestSaponification', cstr, cooler, flowsheet_time, (10, 20)),
    'plug flow': Case(TESTS + 'test_pfr.py: TestSaponification', plug_flow, more_feed, flowsheet_time, (10, 20)),
    'heater': Case(TESTS + 'test_heater.py: TestSaponification', heater, less_heat, flowsheet_time, (10,)),
    'two-phase heater': Case(TESTS + 'test_heater.py: TestBT_Generic', boiling_heater, more_heat, flowsheet_time, (10,)),
    'heat exchanger 1D': Case(
        TESTS + 'test_heat_exchanger_1D.py: TestSaponification_cocurrent', exchanger_1d, more_coolant, flowsheet_time, (10, 20)
    ),
    'lumped heat exchanger': Case(
        TESTS + 'test_heat_exchanger_lc.py: TestHXLCGeneric', lumped_capacitance, better_transfer, flowsheet_time, (5,)
    ),
    'gas pipeline': Case(
        'models_extra/gas_distribution/unit_models/tests/test_pipeline.py: TestSolveDynamicPipeline',
        pipeline,
        yielding_demand,
        flowsheet_time,
        (20,),
        reference={'begin': (1, 10)},
    ),
}
