"""What the results say of a feasible point below the certified one."""

from dataclasses import replace

import pyomo.environ as pyo
import pytest
from problems import small_mpccs
from pyomo.contrib.solver.common.factory import SolverFactory

from pyomo_fesd.mpcc.algorithm.hybrid import HybridSolver


def solved(gain, monkeypatch, sense=pyo.minimize, starts=1):
    """The results of a run that has also kept a point lower by ``gain``: the start, x = 0 and y = 1."""
    m = small_mpccs.pair(0.0, 1.0)
    m.f = pyo.Objective(expr=sense * ((m.x - 1) ** 2 + (m.y - 1) ** 2 / 2), sense=sense)
    solve = HybridSolver.solve

    def with_another_point(self):
        run = solve(self)
        lower = replace(run.point.nlp, w=self._c.x0)
        run.lowest = replace(run.point, f=run.point.f - gain, nlp=lower)
        return run

    monkeypatch.setattr(HybridSolver, 'solve', with_another_point)
    return SolverFactory('mpec_hybrid').solve(m, starts=starts)


@pytest.mark.parametrize('sense', [pyo.minimize, pyo.maximize])
@pytest.mark.parametrize('starts', [1, 2])
def test_a_lower_point_that_is_not_certified_is_told_of(sense, starts, monkeypatch):
    info = solved(0.1, monkeypatch, sense, starts).extra_info
    assert info.stationarity == 'B'
    assert info.lower_objective == pytest.approx(sense * 1.0)
    assert f'objective {info.lower_objective:.7g} was found too' in info.reason


def test_one_that_is_lower_by_the_error_of_the_method_is_not(monkeypatch):
    info = solved(0.01, monkeypatch).extra_info
    assert info.lower_objective is None and 'found too' not in info.reason
