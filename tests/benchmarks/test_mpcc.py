"""The plain methods that the study of MPCCs compares with."""

import numpy as np
import pyomo.environ as pyo
import pytest
from benchmarks.mpcc import baselines, worker
from problems import small_mpccs


@pytest.mark.parametrize('method', baselines.HOMOTOPIES)
def test_each_method_solves_a_pair(method):
    m = small_mpccs.pair(0.2, 0.1)
    m.f = pyo.Objective(expr=(m.x - 1) ** 2 + (m.y - 0.5) ** 2)
    c = worker.expanded(m)

    def judge(w):
        at = c.evaluate(w)
        return float(max(-at.G.min(), -at.H.min(), 0.0)), float(np.minimum(at.G, at.H).max())

    answer = baselines.solve(method, c, judge, 60.0)
    values = dict(zip((v.name for v in c.variables), answer.w))
    assert answer.residuals[0] < 1e-6 and answer.residuals[1] < 1e-6
    assert values['y'] == pytest.approx(0, abs=1e-4) and values['x'] == pytest.approx(1, abs=1e-4)
