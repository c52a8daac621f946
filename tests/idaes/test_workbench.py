"""Tools of flowsheet engineers on transformed flowsheets: units, diagnostics, files, clones, scaling, costing, tables."""

import logging
import pickle

import pyomo.environ as pyo
import pytest
from pyomo.util.check_units import assert_units_consistent, identify_inconsistent_units

pytest.importorskip('idaes', reason="needs the extra: pip install -e '.[idaes]'")

import idaes_level  # noqa: E402
import idaes_overflow  # noqa: E402
import idaes_relief  # noqa: E402
from idaes.core import UnitModelCostingBlock  # noqa: E402
from idaes.core.scaling import AutoScaler, get_scaling_factor, set_scaling_factor  # noqa: E402
from idaes.core.util import from_json, to_json  # noqa: E402
from idaes.core.util.diagnostics_tools.diagnostics_toolbox import DiagnosticsToolbox  # noqa: E402
from idaes.core.util.tables import create_stream_table_dataframe  # noqa: E402
from idaes.models.costing.SSLW import SSLWCosting, SSLWCostingData  # noqa: E402

import pyomo_fesd  # noqa: E402

logging.getLogger('idaes').setLevel(logging.ERROR)


def transformed(m, name, **options):
    pyo.TransformationFactory(name).apply_to(m.fs, wrt=m.fs.time, **options)
    return m


def overflowing(form='auto'):
    m = transformed(idaes_overflow.build(), 'fesd.dcs', form=form)
    return transformed(m, 'fesd.finite_elements', nfe=4, ncp=2)


@pytest.fixture(scope='module')
def simulated():
    """A reactor that begins to overflow, and one whose level controller saturates; transformed and simulated."""
    overflow, level = overflowing(), idaes_level.specify(idaes_level.move(idaes_level.exact(idaes_level.build()), 4, 2))
    idaes_overflow.initialise(overflow)
    for m in (overflow, level):
        pyomo_fesd.simulate(m.fs)
    return {'overflow': overflow, 'level': level}


@pytest.fixture(params=['overflow', 'level'])
def m(request, simulated):
    return simulated[request.param]


# Units of measure; Pyomo's check refuses any Complementarity, so pairs are checked as the equations of their branch


@pytest.mark.parametrize('form', ['stewart', 'heaviside'])
def test_units_after_each_step_from_modes(form):
    m = idaes_overflow.build()
    assert_units_consistent(m)
    transformed(m, 'fesd.dcs', form=form)
    assert not identify_inconsistent_units(m)
    transformed(m, 'fesd.finite_elements', nfe=3, ncp=2)
    assert not identify_inconsistent_units(m)


@pytest.mark.parametrize('replace', [idaes_level.exact, idaes_level.exact_by_hand])
def test_units_after_each_step_from_a_smooth_bound(replace):
    m = idaes_level.build()
    assert_units_consistent(m)
    replace(m)
    assert not identify_inconsistent_units(m)
    idaes_level.move(m, 3, 2)
    assert not identify_inconsistent_units(m)


def test_units_of_units_of_this_package():
    m = idaes_relief.build()
    assert not identify_inconsistent_units(m)


def test_units_of_the_sides_of_pairs(m):
    assert_units_consistent(pyomo_fesd.branch_equations(m))


def test_the_discretisation_of_pyomo_dae_alone_has_inconsistent_units():
    """Why the moving elements multiply by the unit of time: this test fails when Pyomo does it itself."""
    m = idaes_overflow.plant()
    pyo.TransformationFactory('dae.collocation').apply_to(m.fs, wrt=m.fs.time, nfe=2, ncp=2)
    assert all(c.parent_component().local_name.endswith('_disc_eq') for c in identify_inconsistent_units(m))
    assert identify_inconsistent_units(m)


# Diagnostics


def test_no_structural_alarm_at_a_solution(m):
    DiagnosticsToolbox(pyomo_fesd.branch_equations(m)).assert_no_structural_warnings()


def test_a_structural_alarm_that_is_one(simulated):
    copy = pyomo_fesd.branch_equations(simulated['overflow'])
    copy.fs.mixer.lye.temperature[0].unfix()
    with pytest.raises(AssertionError):
        DiagnosticsToolbox(copy).assert_no_structural_warnings()


# Files and copies


def values(m):
    return {v.name: v.value for v in m.component_data_objects(pyo.Var)}


def test_json_puts_the_values_back_also_into_a_file(m, tmp_path):
    before = values(m)
    to_json(m, fname=str(tmp_path / 'values.json'))
    for v in m.component_data_objects(pyo.Var):
        v.set_value(None)
    from_json(m, fname=str(tmp_path / 'values.json'))
    assert values(m) == before


def test_a_clone_is_solved_and_the_original_is_not(m):
    before, copy = values(m), m.clone()
    results = pyo.SolverFactory('mpec_hybrid').solve(copy, warm_start=True)
    assert results.solver.stationarity == 'B' and values(m) == before
    assert [s.time for s in pyomo_fesd.switches(copy, copy.fs.time)] == pytest.approx(
        [s.time for s in pyomo_fesd.switches(m, m.fs.time)], abs=1e-3
    )


def test_create_using_leaves_the_original():
    """On a discretised flowsheet: IDAES' rules refer to the original, so that a clone cannot be discretised."""
    m = idaes_level.build()
    pyo.TransformationFactory('dae.collocation').apply_to(m, wrt=m.fs.time, nfe=3, ncp=2)
    before = len(values(m))
    exact = pyo.TransformationFactory('fesd.smooth_to_complementarity').create_using(m)
    moving = pyo.TransformationFactory('fesd.finite_elements').create_using(exact, wrt=exact.fs.time)
    assert len(values(m)) == before < len(values(exact)) < len(values(moving))


def test_a_clone_that_is_not_discretised_is_refused():
    """pyomo.dae takes the KeyError of such a rule for Skip, and the clone has lost its equations at the new times."""
    m = idaes_overflow.plant()
    with pytest.raises(pyomo_fesd.FesdError, match="if this model is a clone, its rules may still refer to the original"):
        pyo.TransformationFactory('fesd.finite_elements').create_using(m, wrt=m.fs.time, nfe=3, ncp=2)


def test_idaes_models_cannot_be_pickled_with_or_without_this_package():
    for m in (idaes_overflow.plant(), overflowing()):
        with pytest.raises(pickle.PicklingError, match='FlowsheetBlock'):
            pickle.dumps(m)


# Scaling


def test_scalers_of_units_on_a_transformed_model(simulated):
    """IDAES' Scaler objects fill the Suffixes; the answer is that of the model without."""
    m = simulated['level'].clone()
    for suffix in list(m.component_data_objects(pyo.Suffix)):
        if suffix.local_name == 'scaling_factor':
            suffix.clear()
    for v in m.fs.cstr.control_volume.volume.values():
        set_scaling_factor(v, 2.0)
    m.fs.cstr.default_scaler().scale_model(m.fs.cstr)
    AutoScaler(overwrite=False).scale_variables_by_magnitude(m)
    assert get_scaling_factor(m.fs.cstr.control_volume.volume[0]) == 2.0
    results = pyo.SolverFactory('mpec_hybrid').solve(m, warm_start=True)
    assert results.solver.stationarity == 'B'
    reference = simulated['level'].fs.cstr.volume
    assert m.fs.cstr.volume[600].value == pytest.approx(reference[600].value, abs=1e-6)


# Costing and tables


def costed():
    m = idaes_overflow.build()
    m.fs.costing = SSLWCosting()
    m.fs.cstr.length, m.fs.cstr.diameter = (pyo.Var(initialize=n, units=pyo.units.m) for n in (2, 1))
    m.fs.cstr.costing = UnitModelCostingBlock(
        flowsheet_costing_block=m.fs.costing,
        costing_method=SSLWCostingData.cost_vessel,
        costing_method_arguments={'vertical': True},
    )
    for v in (m.fs.cstr.length, m.fs.cstr.diameter):
        v.fix()
    return m


def test_costing_is_the_same_after_the_transformations():
    m = costed()
    equations = {c.name: str(c.expr) for c in m.fs.cstr.costing.component_data_objects(pyo.Constraint)}
    transformed(m, 'fesd.dcs')
    transformed(m, 'fesd.finite_elements', nfe=3, ncp=2)
    assert equations == {c.name: str(c.expr) for c in m.fs.cstr.costing.component_data_objects(pyo.Constraint)}
    idaes_overflow.initialise(m)
    pyo.assert_optimal_termination(pyo.SolverFactory('mpec_hybrid').solve(m))
    assert equations and pyo.value(m.fs.cstr.costing.capital_cost) > 0


def test_a_stream_table_at_the_end(simulated):
    m = simulated['overflow']
    table = create_stream_table_dataframe({'in': m.fs.cstr.inlet, 'out': m.fs.cstr.outlet}, time_point=m.fs.time.last())
    end = pyomo_fesd.trajectory(m, m.fs.time).iloc[-1]
    assert table.loc['Volumetric Flowrate', 'out'] == pytest.approx(end[idaes_overflow.OUTFLOW])
    assert table.loc['Temperature', 'out'] == pytest.approx(end[idaes_overflow.TEMPERATURE])
    assert m.fs.cstr.report(time_point=m.fs.time.last()) is None
