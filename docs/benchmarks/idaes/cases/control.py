"""Flowsheets with IDAES' PIDController."""

import pyomo.environ as pyo
from benchmarks.idaes.cases.case import Case, flowsheet_time
from benchmarks.idaes.cases.published import fixture, replaced
from pyomo.gdp import Disjunction


def limits_as_modes(m, pid):
    """The output of a PIDController within its limits, as three modes, for the reference."""
    pid.mv_eqn.deactivate()
    low, high, wanted, actual = pid.mv_lb, pid.mv_ub, pid.mv_unbounded, pid.manipulated_var

    def modes(b, t):
        if t == m.fs.time.first():
            return Disjunction.Skip
        return [
            [wanted[t] >= low, wanted[t] <= high, actual[t] == wanted[t]],
            [wanted[t] <= low, actual[t] == low],
            [wanted[t] >= high, actual[t] == high],
        ]

    pid.limits = Disjunction(m.fs.time, rule=modes)


def limited(pid):
    """The mode of a controller's output at a time, for counting switches."""

    def mode(m, t):
        wanted = pyo.value(pid(m).mv_unbounded[t])
        return (wanted > pyo.value(pid(m).mv_ub)) - (wanted < pyo.value(pid(m).mv_lb))

    return mode


# CSTR with a PID level controller, of IDAES' test of initialisation: its smooth limits become exact


def pid_cstr(nfe):
    from idaes.core.util.tests.test_pid_initialization import make_model

    return make_model(horizon=6, ntfe=nfe, ntcp=2)


def feed_until_the_step(m):
    m.fs.mixer.S_inlet.flow_vol[1.5].fix(2.1)  # the label of a boundary belongs to the stage that ends there


def exact_limits(m):
    pyo.TransformationFactory('fesd.smooth_to_complementarity').apply_to(m, wrt=m.fs.time)


# Two steam tanks with PID and a step of the setpoint, of IDAES' test of anti-windup; steam is an ideal gas


def steam_tanks(antiwindup):
    def build(nfe):
        from benchmarks.idaes.cases import ideal_water
        from idaes.models.control.tests import test_antiwindup as test

        with replaced(test, iapws95=ideal_water):
            opening = test.get_valve_openings(6.0e5, 1.5e5, 3.0e5)[0]
            m, _ = test.create_model(
                steady_state=False,
                time_set=[0, 2, 40],
                nfe=nfe,
                initial_valve1_opening=opening,
                antiwindup=test.ControllerAntiwindupType[antiwindup],
            )
        pid = m.fs.ctrl
        pid.gain_p.fix(5e-6)
        pid.gain_i.fix(1e-5)
        pid.gain_d.fix(0)
        if antiwindup == 'BACK_CALCULATION':
            pid.gain_b.fix(1.5)
        test._add_setpoint_step(m, time=2.0001, value=3.0e5)
        return m

    return build


def exact_valve(m):
    pyo.TransformationFactory('fesd.smooth_to_complementarity').apply_to(m, wrt=m.fs.time)


# Pump, water tank and valve with PI level control and a step of the feed; water is incompressible


def pump(nfe):
    from benchmarks.idaes.cases import ideal_water
    from benchmarks.idaes.cases.ideal_units import LiquidPump, LiquidValve
    from idaes.models.control.tests import test_pid_pump as test

    with replaced(test, iapws95=ideal_water, WaterPump=LiquidPump, WaterValve=LiquidValve):
        return fixture(test, 'm')


def flow_until_the_step(m):
    m.fs.pump.inlet.flow_mol[50].fix(7000)


def valve_stop(m):
    pid = m.fs.controller
    pid.mv_eqn.deactivate()

    def modes(b, t):
        if t == m.fs.time.first():
            return Disjunction.Skip
        return [
            [pid.mv_unbounded[t] <= 0.61, pid.manipulated_var[t] == pid.mv_unbounded[t]],
            [pid.mv_unbounded[t] >= 0.61, pid.manipulated_var[t] == 0.61],
        ]

    pid.stop = Disjunction(m.fs.time, rule=modes)


CASES = {
    'PID CSTR': Case(
        'core/util/tests/test_pid_initialization.py: make_model',
        pid_cstr,
        exact_limits,
        flowsheet_time,
        (12,),
        exact=lambda m: limits_as_modes(m, m.fs.pid),
        inputs=feed_until_the_step,
        stages=(1.5,),
        mode=limited(lambda m: m.fs.pid),
    ),
    'steam tanks, windup': Case(
        'models/control/tests/test_antiwindup.py: test_setpoint_change_windup',
        steam_tanks('NONE'),
        exact_valve,
        flowsheet_time,
        (20, 40),
        exact=lambda m: limits_as_modes(m, m.fs.ctrl),
        stages=(2,),
        mode=limited(lambda m: m.fs.ctrl),
    ),
    'steam tanks, back calculation': Case(
        'models/control/tests/test_antiwindup.py: test_setpoint_change_back_calculation',
        steam_tanks('BACK_CALCULATION'),
        exact_valve,
        flowsheet_time,
        (20, 40),
        exact=lambda m: limits_as_modes(m, m.fs.ctrl),
        stages=(2,),
        mode=limited(lambda m: m.fs.ctrl),
    ),
    'PID pump': Case(
        'models/control/tests/test_pid_pump.py: m',
        pump,
        valve_stop,
        flowsheet_time,
        (20,),
        inputs=flow_until_the_step,
        stages=(50,),
    ),
}
