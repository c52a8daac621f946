"""Smoothed functions of IDAES made exact (needs the extra [idaes])."""

import warnings
from math import exp

import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
from pyomo.util.calc_var_value import calculate_variable_from_constraint

pytest.importorskip('idaes', reason="needs the extra: pip install -e '.[idaes]'")
with warnings.catch_warnings():
    warnings.simplefilter('ignore')  # marks of IDAES' own tests that are not registered here
    from idaes.core.util.tests.test_pid_initialization import make_model

from idaes.core import FlowsheetBlock, ProcessBlockData, declare_process_block_class  # noqa: E402
from idaes.core.util import math  # noqa: E402
from idaes.models.properties.modular_properties.base.generic_property import GenericParameterBlock  # noqa: E402
from idaes.models.properties.modular_properties.examples.BT_ideal import configuration  # noqa: E402
from idaes.models.unit_models import Flash, Mixer, MomentumMixingType  # noqa: E402

import pyomo_fesd  # noqa: E402
from tests.smoothing.support import conditions, exact, settle  # noqa: E402

LIMIT = 0.5  # lower limit of the outlet flow in make_model


def flows(m):
    return {t: m.fs.cstr.outlet.flow_vol[t].value for t in m.fs.time}


def certified(m, **options):
    results = pyo.SolverFactory('mpec_hybrid').solve(m, **options)
    assert results.solver.stationarity == 'B'
    return m


# The functions


@pytest.mark.parametrize(
    'write, limit',
    [
        (lambda x: math.smooth_abs(x), abs),
        (lambda x: math.smooth_max(x, 0.3), lambda x: max(x, 0.3)),
        (lambda x: math.smooth_min(0.3, x, eps=1e-3), lambda x: min(x, 0.3)),
        (lambda x: math.smooth_minmax(x, 2 * x - 1, sense='max'), lambda x: max(x, 2 * x - 1)),
        (lambda x: math.smooth_bound(x, -0.5, 0.5), lambda x: min(max(x, -0.5), 0.5)),
        (lambda x: math.smooth_bound(x, -0.5, 0.5, eps_lb=1e-3, eps_ub=1e-6), lambda x: min(max(x, -0.5), 0.5)),
    ],
)
def test_functions_become_exact(write, limit):
    m = pyo.ConcreteModel()
    m.x = pyo.Var(initialize=0)
    m.f = pyo.Objective(expr=write(m.x))
    assert exact(m).pairs == len(conditions(m)) > 0
    for x in (-2.0, -0.5, 0.0, 0.3, 0.4, 1.0, 3.0):
        m.x.value = x
        settle(m)
        assert pyo.value(m.f) == pytest.approx(limit(x), abs=1e-15)


@pytest.mark.parametrize('write', [math.safe_sqrt, math.safe_log, lambda x: math.smooth_heaviside(x, 100)])
def test_functions_that_protect_or_jump_stay(write):
    m = pyo.ConcreteModel()
    m.x = pyo.Var(initialize=1)
    m.f = pyo.Objective(expr=write(m.x))
    assert exact(m).replaced == 0


# A flowsheet with a PID controller, discretised already


@pytest.fixture(scope='module')
def smooth():
    return certified(make_model(horizon=6, ntfe=20, ntcp=2))


@pytest.fixture(scope='module')
def transformed(smooth):
    m = smooth.clone()
    return m, exact(m)


def test_all_smooth_bounds_are_found_with_two_pairs_each(transformed):
    m, summary = transformed
    # the first time is deactivated by IDAES; the inner maximum occurs twice in each smooth_bound
    assert (dict(summary.changed), summary.replaced, summary.pairs) == ({'fs.pid.mv_eqn': 40}, 120, 80)
    assert not m.fs.pid.mv_eqn[0].active and not summary.left
    # the measured limits are mutable Params; they stay
    assert str(m.fs.pid.mv_eqn[6].expr.args[1]) == (
        'fs.pid.mv_lb + fs.pid._pyomo_fesd_kinks.mv_eqn.s[6.0,1] - fs.pid._pyomo_fesd_kinks.mv_eqn.s[6.0,2]'
    )


def test_nothing_but_one_variable_and_pair_for_each_nonsmooth_term_is_added(smooth, transformed):
    before, after = pyomo_fesd.report(smooth), pyomo_fesd.report(transformed[0])
    assert {k: after[k] - before[k] for k in ('variables', 'constraints', 'pairs')} == {
        'variables': 80,
        'constraints': 0,
        'pairs': 80,
    }


def test_the_flow_saturates_exactly_and_is_the_limit_of_the_smooth_one(transformed):
    m = certified(transformed[0])
    assert min(flows(m).values()) == pytest.approx(LIMIT, abs=1e-9)
    distances = []
    for eps in (1e-3, 1e-4):
        rounded = make_model(horizon=6, ntfe=20, ntcp=2)
        rounded.fs.pid.smooth_eps.set_value(eps)
        certified(rounded)
        distances.append(max(abs(flows(rounded)[t] - flows(m)[t]) for t in m.fs.time))
    # the error of smooth_bound is eps**2/(4 |z|) away from the nonsmooth point: a tenth of eps gives a hundredth of it
    assert distances[1] < 1e-6 and distances[1] < distances[0] / 50


def test_a_second_application_finds_nothing(transformed):
    assert exact(transformed[0]).replaced == 0


def test_on_movable_elements_saturation_begins_at_an_element_boundary(smooth):
    m = smooth.clone()
    exact(m)
    pid = m.fs.pid
    # inputs and gains are fixed variables over time, which only the user knows to be constant
    inputs = [pid.setpoint, pid.gain_p, pid.gain_i, pid.gain_d, pid.mv_ref, pid.derivative_term]
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, wrt=m.fs.time, stages=[1.5], continuous=inputs)
    certified(m)
    table = pyomo_fesd.trajectory(m, m.fs.time)
    requested, flow = table['fs.pid.mv_unbounded'], table['fs.cstr.control_volume.properties_out.flow_vol']
    begins = flow[flow < LIMIT + 1e-9].index[0]
    assert requested[begins] == pytest.approx(LIMIT, abs=1e-8)
    assert (requested[begins:].iloc[1:] < LIMIT).all() and (flow[begins:] - LIMIT).abs().max() < 1e-9
    assert (flow[:begins].iloc[:-1] - requested[:begins].iloc[:-1]).abs().max() < 1e-9


# A unit model of one's own


@declare_process_block_class('Brake')
class BrakeData(ProcessBlockData):
    """Its force is twice the part of x above 1."""

    def build(self):
        super().build()
        fs = self.parent_block()
        self.force = pyo.Expression(expr=2 * pyomo_fesd.positive_part(self, fs.x[self.index()] - 1))


def test_a_function_in_a_process_block_over_time():
    m = pyo.ConcreteModel()
    m.fs = FlowsheetBlock(dynamic=True, time_set=[0, 2], time_units=pyo.units.s)
    m.fs.x = pyo.Var(m.fs.time, initialize=0)
    m.fs.dx = dae.DerivativeVar(m.fs.x, wrt=m.fs.time)
    m.fs.x[0].fix(0)
    m.fs.brake = Brake(m.fs.time)  # noqa: F821  IDAES makes the class
    m.fs.ode = pyo.Constraint(m.fs.time, rule=lambda fs, t: fs.dx[t] == 1 - fs.brake[t].force)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m.fs, wrt=m.fs.time, nfe=12, ncp=3)
    certified(m)
    starts = pyomo_fesd.element_lengths(m, m.fs.time)['start']
    assert (starts - 1).abs().min() < 1e-9 and m.fs.x[2].value == pytest.approx(1 + (1 - exp(-2)) / 2, abs=2e-6)


# Steady units


@pytest.fixture
def flash():
    m = pyo.ConcreteModel()
    m.fs = FlowsheetBlock(dynamic=False)
    m.fs.props = GenericParameterBlock(**configuration)
    m.fs.flash = Flash(property_package=m.fs.props)
    inlet = m.fs.flash.inlet
    for var, number in ((inlet.flow_mol, 1), (inlet.temperature, 368), (inlet.pressure, 101325), (inlet.mole_frac_comp, 0.5)):
        var.fix(number)
    m.fs.flash.heat_duty.fix(0)
    m.fs.flash.deltaP.fix(0)
    return m


def test_smooth_vle_beyond_the_dew_point_is_exact(flash):
    """T_eq = min(max(T, T_bubble), T_dew): superheated it is T_dew, and no liquid is left."""
    assert exact(flash).pairs == 4
    out = flash.fs.flash.control_volume.properties_out[0]
    certified(flash)
    assert out._teq['Vap', 'Liq'].value == pytest.approx(out.temperature.value, abs=1e-9)  # two phases
    flash.fs.flash.heat_duty.fix(28000)
    certified(flash)
    assert out.temperature.value > out.temperature_dew['Vap', 'Liq'].value + 5
    assert out._teq['Vap', 'Liq'].value == pytest.approx(out.temperature_dew['Vap', 'Liq'].value, abs=1e-9)
    assert out.phase_frac['Vap'].value == pytest.approx(1, abs=1e-9)


def test_the_smallest_pressure_of_a_mixer():
    m = pyo.ConcreteModel()
    m.fs = FlowsheetBlock(dynamic=False)
    m.fs.props = GenericParameterBlock(**configuration)
    m.fs.mix = Mixer(property_package=m.fs.props, num_inlets=3, momentum_mixing_type=MomentumMixingType.minimize)
    summary = exact(m, targets=[m.fs.mix.minimum_pressure_constraint])
    assert dict(summary.changed) == {'fs.mix.minimum_pressure_constraint': 2} and summary.pairs == 2
    for inlet, pressure in ((1, 2e5), (2, 1.5e5), (3, 3e5)):
        getattr(m.fs.mix, f'inlet_{inlet}_state')[0].pressure.value = pressure
    smallest, rows = m.fs.mix.minimum_pressure, m.fs.mix.minimum_pressure_constraint
    smallest[0, :].value = 0.0
    for i in (1, 2, 3):
        settle(m)
        calculate_variable_from_constraint(smallest[0, i], rows[0, i])
    assert smallest[0, 3].value == pytest.approx(1.5e5, abs=1e-9)
