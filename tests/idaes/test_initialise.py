"""IDAES initialises and solves with ``casadi_ipopt`` alone: no executable is asked for."""

import logging

import pyomo.environ as pyo
import pytest

idaes = pytest.importorskip('idaes', reason="needs the extra: pip install -e '.[idaes]'")

import idaes_overflow  # noqa: E402
from idaes.core import FlowsheetBlock  # noqa: E402
from idaes.core.initialization import BlockTriangularizationInitializer, InitializationStatus  # noqa: E402
from idaes.core.solvers import get_solver  # noqa: E402
from idaes.core.util.exceptions import InitializationError  # noqa: E402
from idaes.core.util.initialization import initialize_by_time_element  # noqa: E402
from idaes.models.properties.modular_properties.base.generic_property import GenericParameterBlock  # noqa: E402
from idaes.models.properties.modular_properties.examples.BT_ideal import configuration  # noqa: E402
from idaes.models.unit_models import Flash  # noqa: E402

from pyomo_fesd import casadi_ipopt  # noqa: E402
from tests.idaes.plants import PLANTS  # noqa: E402

logging.getLogger('idaes').setLevel(logging.CRITICAL)


@pytest.fixture
def flash():
    m = pyo.ConcreteModel()
    m.fs = FlowsheetBlock(dynamic=False)
    m.fs.props = GenericParameterBlock(**configuration)
    m.fs.flash = Flash(property_package=m.fs.props)
    inlet = m.fs.flash.inlet
    for var, given in ((inlet.flow_mol, 1), (inlet.temperature, 368), (inlet.pressure, 101325), (inlet.mole_frac_comp, 0.5)):
        var.fix(given)
    m.fs.flash.heat_duty.fix(0)
    m.fs.flash.deltaP.fix(0)
    return m


def is_solved(m):
    """What IDAES left is a solution already, within its tolerances."""
    variables = [v for v in m.component_data_objects(pyo.Var) if not v.fixed and v.value is not None]
    before = [v.value for v in variables]
    pyo.assert_optimal_termination(pyo.SolverFactory('casadi_ipopt').solve(m))
    return [v.value for v in variables] == pytest.approx(before, rel=1e-5, abs=1e-5)


def components(m):
    return [c.name for c in m.component_objects()], [c.name for c in m.component_data_objects(pyo.Constraint, active=True)]


@pytest.mark.parametrize('solver', ['casadi_ipopt', 'mpec_hybrid'])
def test_a_unit_is_initialised(flash, solver):
    before = components(flash)
    flash.fs.flash.initialize(solver=solver)
    assert components(flash) == before
    assert is_solved(flash)
    # an adiabatic flash without loss of pressure leaves a feed of two phases as it is
    assert flash.fs.flash.control_volume.properties_out[0].temperature.value == pytest.approx(368, abs=1e-4)


def test_as_the_default_solver(flash):
    with idaes.temporary_config_ctx():
        idaes.cfg.default_solver = 'casadi_ipopt'
        flash.fs.flash.initialize()
    assert is_solved(flash)


def test_what_idaes_sets_by_itself():
    solver = get_solver('casadi_ipopt', solver_options={'tol': 1e-7}, writer_config={'linear_presolve': True, 'scale_model': True})
    assert solver.options['tol'] == 1e-7 and solver.config.writer_config.scale_model


def test_initialiser_objects(flash):
    unit = flash.fs.flash
    initialiser = unit.default_initializer(solver='casadi_ipopt')
    for states in (unit.control_volume.properties_in, unit.control_volume.properties_out):
        initialiser.add_submodel_initializer(states, states.default_initializer(solver='casadi_ipopt'))
    initialiser.initialize(unit)
    assert initialiser.summary[unit]['status'] == InitializationStatus.Ok
    assert is_solved(flash)


def test_a_dynamic_flowsheet_block_by_block():
    m = idaes_overflow.plant()
    pyo.TransformationFactory('dae.collocation').apply_to(m.fs, wrt=m.fs.time, nfe=3, ncp=2)
    PLANTS['mixer and CSTR'].specify(m)
    initialiser = BlockTriangularizationInitializer(block_solver='casadi_ipopt')
    initialiser.initialize(m.fs)
    assert initialiser.summary[m.fs]['status'] == InitializationStatus.Ok
    assert is_solved(m)


def test_a_dynamic_flowsheet_element_by_element():
    m = idaes_overflow.plant()
    pyo.TransformationFactory('dae.collocation').apply_to(m.fs, wrt=m.fs.time, nfe=3, ncp=2)
    PLANTS['mixer and CSTR'].specify(m)
    initialize_by_time_element(m.fs, m.fs.time, solver=pyo.SolverFactory('casadi_ipopt'))
    assert is_solved(m)


def test_a_unit_that_cannot_be_solved_says_so(flash):
    flash.fs.flash.control_volume.properties_out[0].temperature.fix(250)
    with pytest.raises(InitializationError):
        flash.fs.flash.initialize(solver='casadi_ipopt')


@pytest.mark.parametrize('way', ['initialize', 'objects', 'get_solver'])
def test_scripts_that_name_the_executable_run_as_they_are(flash, way):
    """No solver is named here: IDAES' defaults are ``ipopt`` and, in initialiser objects and their sub-models, ``ipopt_v2``."""
    unit = flash.fs.flash
    with casadi_ipopt.stand_in():
        if way == 'initialize':
            unit.initialize()
        elif way == 'objects':
            unit.default_initializer().initialize(unit)
        else:
            unit.initialize()
            unit.heat_duty.fix(10.0)
            pyo.assert_optimal_termination(get_solver('ipopt_v2', solver_options={'linear_solver': 'ma57'}).solve(flash))
    assert is_solved(flash)
