"""A start for a flowsheet that switches: inputs and initial values, then ``simulate``, then all elements at once."""

import logging

import pyomo.environ as pyo
import pytest

pytest.importorskip('idaes', reason="needs the extra: pip install -e '.[idaes]'")

import idaes_overflow  # noqa: E402
from idaes.core.util import from_json, to_json  # noqa: E402

import pyomo_fesd  # noqa: E402
from tests.idaes.plants import PLANTS  # noqa: E402

logging.getLogger('idaes').setLevel(logging.ERROR)


def moving(m, nfe, **options):
    pyo.TransformationFactory('fesd.dcs').apply_to(m.fs, wrt=m.fs.time)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m.fs, wrt=m.fs.time, nfe=nfe, ncp=2, **options)
    return m


def values(m):
    return {v.name: v.value for v in m.component_data_objects(pyo.Var) if v.value is not None}


def test_without_any_guess_the_march_finds_the_overflow_and_the_full_problem_starts_there():
    """Nothing but feeds and contents is given; from there the homotopy over all elements at once is not needed."""
    m = moving(idaes_overflow.build(), 15)
    idaes_overflow.specify(m)
    table = pyomo_fesd.simulate(m, m.fs.time)
    assert table[idaes_overflow.OUTFLOW].max() == pytest.approx(idaes_overflow.INFLOW, rel=1e-9)
    results = pyo.SolverFactory('mpec_hybrid').solve(m, warm_start=True)
    assert results.solver.stationarity == 'B' and 'relaxation' not in str(results.solver.steps)
    (switch,) = pyomo_fesd.switches(m, m.fs.time)
    assert switch.time == pytest.approx(idaes_overflow.OVERFLOW_TIME, abs=1e-6)


@pytest.mark.parametrize('name', ['level control', 'two-phase vessel', 'tube', 'pipeline'])
def test_a_march_through_a_plant_without_switches_is_its_solution(name):
    """Saturation and equilibrium are smoothed there; with space, with states at a boundary that are inputs."""
    plant = PLANTS[name]
    m = moving(plant.build(), 4)
    plant.specify(m)
    pyomo_fesd.simulate(m, m.fs.time)
    marched = values(m)
    pyo.assert_optimal_termination(pyo.SolverFactory('casadi_ipopt').solve(m))
    found = values(m)
    assert max(abs(found[k] - marched[k]) / max(1, abs(found[k])) for k in found) <= 1e-6


def test_from_rest_through_a_step_with_an_exact_limit():
    """The vessel at rest, its controller made exact: it saturates where the demand passes the limit."""
    plant = PLANTS['level control']
    m = plant.build()
    pyo.TransformationFactory('fesd.smooth_to_complementarity').apply_to(m.fs, wrt=m.fs.time)
    inputs = ['setpoint', 'gain_p', 'gain_i', 'mv_ref']
    moving(m, 12, continuous=[m.fs.pid.component(name) for name in inputs])
    plant.specify(m)
    m.fs.pid.mv_ub.set_value(1.5e-3)
    m.fs.pid.gain_p.fix(-1e-2)
    pyomo_fesd.simulate(m, m.fs.time)
    results = pyo.SolverFactory('mpec_hybrid').solve(m, warm_start=True)
    assert results.solver.stationarity == 'B'
    flow = [v.value for v in m.fs.cstr.outlet.flow_vol.values()]
    asked = [pyo.value(e) for e in m.fs.pid.mv_unbounded.values()]
    assert min(flow) >= -1e-12 and max(flow) <= 1.5e-3 + 1e-12
    assert any(a > 1.5e-3 + 1e-6 for a in asked) or any(a < -1e-6 for a in asked)
    assert flow[1:] == pytest.approx([min(max(a, 0), 1.5e-3) for a in asked[1:]], abs=1e-10)


def test_a_failed_element_names_the_unit():
    """The vessel is emptied: 0.6 m3 last for 150 s; with a volume of 0 there is no concentration."""
    m = moving(idaes_overflow.plant(), 8)
    idaes_overflow.specify(m)
    m.fs.cstr.outlet.flow_vol.fix(idaes_overflow.INFLOW + 4e-3)
    with pytest.raises(pyomo_fesd.FesdError, match=r'(?s)from time 150.*largest residuals in fs'):
        pyomo_fesd.simulate(m, m.fs.time, max_iterations=100)


def test_values_go_through_json_and_back(tmp_path):
    m = moving(idaes_overflow.build(), 3)
    idaes_overflow.specify(m)
    pyomo_fesd.units.scale_by_values(m)
    before, file = values(m), str(tmp_path / 'values.json')
    to_json(m, fname=file)
    for v in m.component_data_objects(pyo.Var):
        v.set_value(0, skip_validation=True)
    from_json(m, fname=file)
    assert values(m) == {**values(m), **before}
