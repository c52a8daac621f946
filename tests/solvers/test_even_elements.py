"""A point on elements that are shared evenly between its switches."""

import bouncing_ball
import numpy as np
import pyomo.environ as pyo
import pytest
from pyomo.common.timing import HierarchicalTimer

import pyomo_fesd
from pyomo_fesd.mpcc import compile_mpcc, read_mpcc
from pyomo_fesd.mpcc.algorithm.evenness import Evenness
from pyomo_fesd.solvers.even_elements import even_elements
from tests.diagnostics.test_uneven_elements import rising


def evened(m):
    """The model with the values that ``even_elements`` gives, or None."""
    compiled = compile_mpcc(read_mpcc(m), HierarchicalTimer())
    before = [(v.value, v.stale) for v in m.component_data_objects(pyo.Var)]
    found = even_elements(m, compiled)(compiled.x0)
    assert [(v.value, v.stale) for v in m.component_data_objects(pyo.Var)] == before
    if found is not None:
        for v, number in zip(compiled.variables, compiled.values(found)):
            v.set_value(float(number), skip_validation=True)
        return m
    return None


@pytest.fixture
def uneven(monkeypatch):
    """A solution whose switch came from far; the elements that it passed stay on its other side."""
    m = rising(-1.3)
    pyomo_fesd.simulate(m)
    m.x[0].fix(-0.15)
    with monkeypatch.context() as patch:
        patch.setattr(Evenness, 'improve', lambda self: None)
        pyo.SolverFactory('mpec_hybrid').solve(m, warm_start=True, review=False)
    lengths = pyomo_fesd.element_lengths(m)['length']
    assert lengths.max() > 5 * lengths.min()
    return m


def test_the_switch_stays_and_both_sides_get_elements_by_their_length(uneven):
    (t_s,) = (switch.time for switch in pyomo_fesd.switches(uneven))
    exact = pyomo_fesd.trajectory(uneven)[['x', 'y']]
    assert evened(uneven) is uneven
    lengths = pyomo_fesd.element_lengths(uneven)['length'].to_numpy()
    before = round(t_s * 14)
    assert lengths[:before] == pytest.approx(np.full(before, t_s / before), rel=1e-6)
    assert lengths[before:] == pytest.approx(np.full(14 - before, (1 - t_s) / (14 - before)), rel=1e-6)
    found = pyomo_fesd.trajectory(uneven)[['x', 'y']]
    for name in exact:
        assert found[name].to_numpy() == pytest.approx(np.interp(found.index, exact.index, exact[name]), abs=2e-2)
    assert pyomo_fesd.switches(uneven)[0].time == pytest.approx(t_s, abs=1e-6)
    # the values name a branch that has a solution
    results = pyo.SolverFactory('mpec_hybrid').solve(uneven, warm_start='only')
    assert results.solver.termination_condition == 'optimal'


def test_even_elements_are_left(uneven):
    assert evened(evened(uneven)) is None


def test_grids_with_state_jumps_keep_their_elements():
    m = bouncing_ball.build(horizon=1.0)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=6, ncp=2)
    assert even_elements(m, None) is None
