"""The LPEC against the answer that can be seen."""

import numpy as np
import pyomo.environ as pyo
import pytest
from problems import small_mpccs
from pyomo.common.timing import HierarchicalTimer
from pyomo.mpec import Complementarity, complements

from pyomo_fesd.mpcc.compile.compile import compile_mpcc
from pyomo_fesd.mpcc.compile.read_mpcc import read_mpcc
from pyomo_fesd.mpcc.subproblems.active_set import G_ZERO, H_ZERO, active_sets
from pyomo_fesd.mpcc.subproblems.lpec import Lpec
from pyomo_fesd.mpcc.subproblems.side_constraints import sort_sides


def lpec_at(model, w, tolerance=1e-6, Delta=1.0):
    c = compile_mpcc(read_mpcc(model), HierarchicalTimer())
    at = c.evaluate(np.array(w))
    return Lpec(c, sort_sides(c), {}).solve(np.array(w), active_sets(at.G, at.H, tolerance), Delta)


def test_at_the_origin_of_the_toy_one_axis_is_taken_and_the_other_side_stays_zero():
    result = lpec_at(small_mpccs.toy()[0], [0.0, 0.0])
    assert result.solved and result.binaries == 1
    assert result.value == pytest.approx(-2)
    assert sorted(np.round(result.d, 9)) == [0, 1]
    assert result.zero[0] == (H_ZERO if result.d[0] > 0.5 else G_ZERO)


def test_at_a_minimum_the_value_is_zero_and_no_binary_is_used():
    result = lpec_at(small_mpccs.toy()[0], [1.0, 0.0])
    assert result.value == 0 and result.binaries == 0


def test_the_trust_region_bounds_the_step():
    assert np.abs(lpec_at(small_mpccs.toy()[0], [0.0, 0.0], Delta=0.25).d).max() == pytest.approx(0.25)


def test_what_the_point_violates_is_not_asked_of_the_step():
    model, _ = small_mpccs.toy()
    model.k = pyo.Constraint(expr=model.x + model.y >= 10)
    result = lpec_at(model, [1.0, 0.0])
    assert result.solved and result.value == 0


def test_many_biactive_pairs_are_decided_together():
    m = pyo.ConcreteModel()
    m.i = pyo.RangeSet(30)
    m.x = pyo.Var(m.i, bounds=(0, None), initialize=0)
    m.y = pyo.Var(m.i, bounds=(0, None), initialize=0)
    m.c = Complementarity(m.i, rule=lambda m, i: complements(m.x[i] >= 0, m.y[i] >= 0))
    m.f = pyo.Objective(expr=sum((-1) ** i * m.x[i] - (-1) ** i * m.y[i] for i in m.i))
    result = lpec_at(m, np.zeros(60))
    assert result.binaries == 30
    assert result.value == pytest.approx(-30)
