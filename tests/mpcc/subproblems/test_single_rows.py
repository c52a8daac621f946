"""Linear equations of one variable that put it at a bound."""

import numpy as np
import pyomo.environ as pyo
import pytest
from pyomo.common.timing import HierarchicalTimer
from pyomo.mpec import Complementarity, complements

from pyomo_fesd.mpcc.compile.compile import compile_mpcc
from pyomo_fesd.mpcc.compile.read_mpcc import read_mpcc
from pyomo_fesd.mpcc.subproblems.single_rows import fix_single


def with_rows(at):
    """x has bounds 0 and 4 and the row 2 x - 1 = 2 at - 1; y has a row with another variable, z a nonlinear one."""
    m = pyo.ConcreteModel()
    m.x, m.y = pyo.Var(bounds=(0, 4), initialize=1), pyo.Var(bounds=(0, 4), initialize=1)
    m.z = pyo.Var(bounds=(1, 4), initialize=2)
    m.single = pyo.Constraint(expr=2 * m.x - 1 == 2 * at - 1)
    m.two = pyo.Constraint(expr=m.x + m.y == at)
    m.nonlinear = pyo.Constraint(expr=m.z**2 == 1)
    m.pair = Complementarity(expr=complements(m.y >= 0, m.z >= 1))
    m.cost = pyo.Objective(expr=(m.y - 1) ** 2 + m.x)
    return m


@pytest.mark.parametrize('at, fixed', [(0, True), (4, True), (2, False), (1e-9, False)])
def test_only_a_value_at_a_bound_is_fixed(at, fixed):
    m = with_rows(at)
    c = compile_mpcc(read_mpcc(m), HierarchicalTimer())
    lbx, ubx, lbg, ubg = c.lbx.copy(), c.ubx.copy(), c.lbg.copy(), c.ubg.copy()
    fix_single(c, c.x0, lbx, ubx, lbg, ubg)
    x, single = [v.name for v in c.variables].index('x'), [r.name for r in c.constraints].index('single')
    assert (lbx[x] == ubx[x]) == fixed and (lbg[single] == -np.inf and ubg[single] == np.inf) == fixed
    others = np.arange(len(lbx)) != x
    assert np.array_equal(lbx[others], c.lbx[others]) and np.array_equal(ubx[others], c.ubx[others])
    assert np.count_nonzero(np.isneginf(lbg)) == fixed
    if fixed:
        assert lbx[x] / c.scale.x[x] == at


@pytest.mark.parametrize('at, fixed', [(0, True), (4, False)])
def test_least_only_leaves_a_value_at_an_upper_bound(at, fixed):
    c = compile_mpcc(read_mpcc(with_rows(at)), HierarchicalTimer())
    lbx, ubx, lbg, ubg = c.lbx.copy(), c.ubx.copy(), c.lbg.copy(), c.ubg.copy()
    fix_single(c, c.x0, lbx, ubx, lbg, ubg, least_only=True)
    assert np.any((lbx != c.lbx) | (ubx != c.ubx)) == fixed and np.any(lbg != c.lbg) == fixed


@pytest.mark.parametrize('at', [0, 4, 2])
def test_a_solve_has_such_a_row(at):
    m = with_rows(at)
    m.two.deactivate()
    results = pyo.SolverFactory('mpec_hybrid').solve(m)
    assert results.solver.stationarity == 'B' and m.x.value == pytest.approx(at) and m.y.value == pytest.approx(1)
