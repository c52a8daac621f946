"""Differences of variables >= 0 get one variable each in a branch, and both have their parts at its solution."""

import numpy as np
import pyomo.environ as pyo
import pytest
from pyomo.common.timing import HierarchicalTimer
from pyomo.mpec import Complementarity, complements

from pyomo_fesd.mpcc.compile.compile import compile_mpcc
from pyomo_fesd.mpcc.compile.read_mpcc import read_mpcc
from pyomo_fesd.mpcc.subproblems.differences import Differences


def slip(speed=-2.0, factor=1.0):
    """factor p - 3 n = speed; the force is 0 where p + n is not."""
    m = pyo.ConcreteModel()
    m.speed, m.factor = pyo.Param(initialize=speed, mutable=True), pyo.Param(initialize=factor, mutable=True)
    m.p, m.n, m.force = (pyo.Var(bounds=(0, None), initialize=1) for _ in range(3))
    m.y = pyo.Var(initialize=0)
    m.parts = pyo.Constraint(expr=m.factor * m.p - 3 * m.n == m.speed)
    m.sticks = Complementarity(expr=complements(m.force >= 0, m.p + m.n >= 0))
    m.push = pyo.Constraint(expr=m.y == m.force)
    m.cost = pyo.Objective(expr=(m.y - 1) ** 2)
    return m


def compiled(m):
    return compile_mpcc(read_mpcc(m), HierarchicalTimer())


def differences(c):
    return Differences(c, np.arange(len(c.lbg)))


def joined(c, box=None, **bounds):
    names = [v.name for v in c.variables]
    w, lbx, ubx = np.array(c.x0), c.lbx.copy(), c.ubx.copy()
    for name, (low, high) in bounds.items():
        lbx[names.index(name)], ubx[names.index(name)] = low, high
    return differences(c).join(w, lbx, ubx, box), w, lbx, ubx


@pytest.mark.parametrize('values', [(3.0, 1.0), (1.0, 3.0), (1e5, 1e5), (0.0, 2.0)])
def test_one_variable_has_the_difference_and_both_get_their_parts(values):
    m = slip()
    m.p.value, m.n.value = values
    c = compiled(m)
    (i, j, ratio), w, lbx, ubx = joined(c)
    assert len(i) == 1 and lbx[i] == ubx[i] == w[i] == 0.0 and (lbx[j], ubx[j]) == (-np.inf, np.inf)
    parted = Differences.parted(w, (i, j, ratio))
    there, before = (dict(zip((v.name for v in c.variables), point / c.scale.x)) for point in (parted, c.x0))
    assert there['p'] - 3 * there['n'] == pytest.approx(before['p'] - 3 * before['n'], rel=1e-12, abs=1e-10)
    assert min(there['p'], there['n']) == 0.0 and max(there['p'], there['n']) >= 0.0


@pytest.mark.parametrize('bounds', [{'p': (0.0, 0.0)}, {'n': (0.0, 0.0)}, {'p': (1.0, np.inf)}, {'n': (0.0, 5.0)}])
def test_with_other_bounds_there_is_no_common_part(bounds):
    (i, *_), w, lbx, ubx = joined(compiled(slip()), **bounds)
    assert len(i) == 0


def test_no_region_of_trust_bounds_a_difference():
    c = compiled(slip())
    box = np.array(c.x0) - 0.1, np.array(c.x0) + 0.1
    (_, j, _), *_ = joined(c, box)
    assert box[0][j] == -np.inf and box[1][j] == np.inf and np.isinf(box[0]).sum() == 1


@pytest.mark.parametrize(
    'change',
    [
        lambda m: setattr(m.cost, 'expr', m.cost.expr + m.p),
        lambda m: m.add_component('sum', pyo.Constraint(expr=m.p + m.n <= 9)),
        lambda m: m.add_component('product', pyo.Constraint(expr=m.p * m.y - 3 * m.n * m.y <= 9)),
        lambda m: m.p.setub(4),
    ],
    ids=['in the cost', 'as a sum', 'in a product', 'bounded'],
)
def test_what_contains_more_than_the_difference_has_none(change):
    m = slip()
    change(m)
    (i, *_), *_ = joined(compiled(m))
    assert len(i) == 0


def test_slopes_may_be_parameters():
    m, solver = slip(2.0), pyo.SolverFactory('mpec_hybrid')
    solver.set_instance(m, parameters=[m.factor])
    for factor in (1.0, 4.0):
        m.factor.value = factor
        assert solver.solve(m).solver.stationarity == 'B'
        assert [m.p.value, m.n.value] == pytest.approx([2 / factor, 0.0], abs=1e-7)


@pytest.mark.parametrize('speed, y', [(-2.0, 0.0), (2.0, 0.0), (0.0, 1.0)])
def test_a_solve_ends_without_a_common_part(speed, y):
    m = slip(speed)
    results = pyo.SolverFactory('mpec_hybrid').solve(m)
    assert results.solver.stationarity == 'B'
    assert [m.y.value, m.p.value, m.n.value] == pytest.approx([y, max(speed, 0.0), max(-speed, 0.0) / 3], abs=1e-7)
