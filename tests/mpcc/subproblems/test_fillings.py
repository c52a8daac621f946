"""Places that are filled in their order: their sides follow from the extents where a branch starts."""

import numpy as np
import pyomo.environ as pyo
import pytest
from pyomo.common.timing import HierarchicalTimer
from pyomo.mpec import Complementarity, complements

from pyomo_fesd import certify
from pyomo_fesd.core import Filling, homotopy_hints
from pyomo_fesd.mpcc.compile import compile_mpcc, read_mpcc
from pyomo_fesd.mpcc.subproblems import FREE, G_ZERO, H_ZERO, settle, sort_sides

AMOUNT = 1.5


def places(wanted=(1.0, 1.0, 1.0)):
    """Three places of total extent 3, as near as possible to those that are wanted, filled up to ``AMOUNT``."""
    m = pyo.ConcreteModel()
    m.n = pyo.RangeSet(3)
    m.r = pyo.Var(m.n, bounds=(1e-3, None), initialize=1.0)
    m.s = pyo.Var(m.n, bounds=(0, 1), initialize={1: 1.0, 2: 0.5, 3: 0.0})
    m.total = pyo.Constraint(expr=sum(m.r[n] for n in m.n) == 3)
    m.place = pyo.Constraint(expr=sum(m.s[n] * m.r[n] for n in m.n) == AMOUNT)
    m.order = Complementarity([1, 2], rule=lambda m, n: complements(1 - m.s[n] >= 0, m.s[n + 1] >= 0))
    m.o = pyo.Objective(expr=sum((m.r[n] - x) ** 2 for n, x in zip(m.n, wanted)))
    extents = [(1.0, m.r[n]) for n in m.n]
    homotopy_hints(m).fillings.append(Filling(list(m.order.values()), list(m.s.values()), extents, AMOUNT))
    return m


@pytest.mark.parametrize(
    'extents, given, sides',
    [
        ((1, 1, 1), (H_ZERO, G_ZERO), (G_ZERO, H_ZERO)),
        ((2, 0.5, 0.5), (G_ZERO, G_ZERO), (H_ZERO, H_ZERO)),
        ((0.5, 0.5, 2), (H_ZERO, H_ZERO), (G_ZERO, G_ZERO)),
        # at the end of a place both sides hold, and an open pair stays open
        ((1.5, 1, 0.5), (G_ZERO, G_ZERO), (G_ZERO, H_ZERO)),
        ((1.5, 1, 0.5), (H_ZERO, H_ZERO), (H_ZERO, H_ZERO)),
        ((1, 1, 1), (FREE, FREE), (FREE, FREE)),
    ],
)
def test_sides_follow_the_extents(extents, given, sides):
    c = compile_mpcc(read_mpcc(places()), HierarchicalTimer())
    w = c.x0.copy()
    for v, x in zip(c.fillings[0].extents, extents):
        w[v] = x
    assert settle(c, sort_sides(c), w, np.array(given)).tolist() == list(sides)


@pytest.mark.parametrize('wanted', [(1, 1, 1), (2, 0.5, 0.5), (0.5, 0.5, 2), (1.4, 0.8, 0.8)])
def test_the_solver_finds_the_place(wanted):
    m = places(wanted)
    results = pyo.SolverFactory('mpec_hybrid').solve(m)
    assert results.solver.stationarity == 'B' and pyo.value(m.o) == pytest.approx(0, abs=1e-8)
    before = np.concatenate([[0], np.cumsum(wanted)[:-1]])
    assert [m.s[n].value for n in m.n] == pytest.approx(np.clip((AMOUNT - before) / wanted, 0, 1), abs=1e-5)


def test_a_filling_without_all_of_its_variables_is_no_hint():
    m = places()
    m.r[2].fix(1.0)
    assert compile_mpcc(read_mpcc(m), HierarchicalTimer()).fillings == []


def test_a_descent_that_goes_on_beyond_a_near_place_is_not_overlooked():
    m = places()
    m.z = pyo.Var(initialize=1.499995)
    m.tied = pyo.Constraint(expr=m.z == m.r[1])
    # two terms cancel: the slope is 1e-3 of them, and 5e-6 before the next place is empty the descent is within tolerance
    m.o.set_value(0.999 * m.z - m.r[1])
    for n, (extent, share) in enumerate(zip((1.499995, 0.8, 0.700005), (1.0, 6.25e-6, 0.0)), start=1):
        m.r[n].value, m.s[n].value = extent, share
    assert not certify(m).certified
    solver = pyo.SolverFactory('mpec_hybrid')
    assert solver.solve(m, warm_start=True).solver.stationarity == 'B'
    assert m.r[1].value == pytest.approx(3 - 2e-3, abs=1e-6) and m.s[1].value == pytest.approx(AMOUNT / m.r[1].value, abs=1e-6)
