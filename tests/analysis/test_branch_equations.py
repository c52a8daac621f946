"""The copy is a square system whose solution is that of the model."""

import gas_liquid_tank
import pyomo.environ as pyo
import pytest
import saturating_valve
import signum
from pyomo.contrib.incidence_analysis import IncidenceGraphInterface

import pyomo_fesd
from tests.problems.running import transform


@pytest.mark.parametrize('module', [signum, gas_liquid_tank, saturating_valve])
def test_a_solution_is_that_of_a_square_system(module):
    m = transform(module.build(), 6)
    pyomo_fesd.simulate(m)
    before = {v.name: v.value for v in m.component_data_objects(pyo.Var)}
    copy = pyomo_fesd.branch_equations(m)
    assert pyomo_fesd.structure(copy).degrees_of_freedom == 0 and not pyomo_fesd.structure(copy).problem
    graph = IncidenceGraphInterface(copy, include_inequality=False)
    assert len(graph.variables) == len(graph.constraints)
    pyo.SolverFactory('casadi_ipopt').solve(copy)
    for v in copy.component_data_objects(pyo.Var):
        if v.value is not None:
            assert v.value == pytest.approx(before[v.name], abs=1e-6)
    assert before == {v.name: v.value for v in m.component_data_objects(pyo.Var)}


def test_without_values_and_for_a_block_it_is_refused():
    m = transform(signum.build(), 2)
    for v in m.component_data_objects(pyo.Var):
        v.set_value(None)
    with pytest.raises(pyomo_fesd.FesdError, match="a side has no value"):
        pyomo_fesd.branch_equations(m)
    m.b = pyo.Block()
    with pytest.raises(pyomo_fesd.FesdError, match="this is a Block of a model"):
        pyomo_fesd.branch_equations(m.b)
