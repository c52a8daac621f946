"""``mpec_hybrid`` takes the march over where nothing is free: right against event-located scipy, with hardly any NLP."""

import pyomo.environ as pyo
import pytest

import pyomo_fesd
from tests.problems import simulations


@pytest.mark.parametrize('name', simulations.PROBLEMS)
def test_the_march_is_the_answer(name):
    m, states = simulations.discretised(name, small=True)
    results = pyo.SolverFactory('mpec_hybrid').solve(m, timelimit=60)
    assert results.solver.stationarity == 'B' and results.solver.nlps <= 3
    assert simulations.error(m, states) < 1e-7
    assert len(pyomo_fesd.switches(m)) >= 1
