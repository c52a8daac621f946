"""Sides and bounds of impacts and drifts that leave a branch NLP an interior."""

import numpy as np
import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
from pyomo.common.timing import HierarchicalTimer

import pyomo_fesd
from pyomo_fesd.mpcc.compile.compile import compile_mpcc
from pyomo_fesd.mpcc.compile.read_mpcc import read_mpcc
from pyomo_fesd.mpcc.subproblems.active_set import H_ZERO
from pyomo_fesd.mpcc.subproblems.impact_sides import give_interior
from pyomo_fesd.mpcc.subproblems.side_constraints import settle, sort_sides

ELEMENTS = 3


def row_of_bodies(number=1, curved=False):
    """A wall and ``number`` bodies in a row that push against each other; the first may move on a curve."""
    m = pyo.ConcreteModel()
    m.t, m.i = dae.ContinuousSet(bounds=(0, 3)), pyo.RangeSet(number)
    m.q, m.v = pyo.Var(m.i, m.t, initialize=0.5), pyo.Var(m.i, m.t, initialize=0)
    m.u = pyo.Var(m.i, bounds=(-2, 2), initialize=-1)
    m.dq, m.dv = dae.DerivativeVar(m.q, wrt=m.t), dae.DerivativeVar(m.v, wrt=m.t)

    def gap(m, i, t):
        before = m.q[i - 1, t] if i > 1 else 0
        return (m.q[i, t] + 1) ** 2 - 1 - before if curved else m.q[i, t] - before

    m.touch = pyomo_fesd.contact(m.i, m.t, gap=gap)

    @m.Constraint(m.i, m.t)
    def momentum(m, i, t):
        reaction = m.touch[i, t].normal * (2 * m.q[i, t] + 2 if curved else 1)
        return m.dv[i, t] == m.u[i] + reaction - (m.touch[i + 1, t].normal if i < number else 0)

    m.way = pyo.Constraint(m.i, m.t, rule=lambda m, i, t: m.dq[i, t] == m.v[i, t])
    m.cost = pyo.Objective(expr=sum(m.q[i, 3] + m.u[i] ** 2 for i in m.i))
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=ELEMENTS, ncp=2)
    return m


def body_that_must_not_slip():
    """A body with a height and a place along the ground, on which it must not slip."""
    m = pyo.ConcreteModel()
    m.t, m.i = dae.ContinuousSet(bounds=(0, 3)), pyo.RangeSet(2)
    m.q, m.v = pyo.Var(m.i, m.t, initialize=0.5), pyo.Var(m.i, m.t, initialize=0)
    m.u = pyo.Var(m.i, bounds=(-2, 2), initialize=-1)
    m.dq, m.dv = dae.DerivativeVar(m.q, wrt=m.t), dae.DerivativeVar(m.v, wrt=m.t)
    m.touch = pyomo_fesd.contact(m.t, gap=lambda m, t: m.q[1, t], friction=0.5, slip=lambda m, t: m.v[2, t], sticks=True)
    m.up = pyo.Constraint(m.t, rule=lambda m, t: m.dv[1, t] == m.u[1] + m.touch[t].normal)
    m.along = pyo.Constraint(m.t, rule=lambda m, t: m.dv[2, t] == m.u[2] + m.touch[t].friction)
    m.way = pyo.Constraint(m.i, m.t, rule=lambda m, i, t: m.dq[i, t] == m.v[i, t])
    m.cost = pyo.Objective(expr=sum(m.q[i, 3] + m.u[i] ** 2 for i in m.i))
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=ELEMENTS, ncp=2)
    return m


class Branch:
    """One branch, by the sides of contacts in elements and of impacts at boundaries."""

    def __init__(self, m, closed, impacts):
        self.c = compile_mpcc(read_mpcc(m), HierarchicalTimer())
        self.sides = sort_sides(self.c)
        self._names = [condition.source.name for condition in self.c.conditions]
        zero = np.zeros(self.c.pairs, dtype=int)
        for i, n in closed:
            zero[self.of(f"cross['touch[{i}].touching',{n}]")] = H_ZERO
        for i, b in impacts:
            zero[self.of(f"impact['touch[{i}]',{b},")] = H_ZERO
        self.settle(zero)

    def settle(self, zero):
        self.zero = settle(self.c, self.sides, self.c.x0, zero)

    def of(self, name):
        found = [k for k, other in enumerate(self._names) if name in other]
        assert found, (name, self._names)
        return found

    def impacts(self, i):
        """The boundaries at which a contact has an impulse."""
        return [b for b in range(1, ELEMENTS) if all(self.zero[self.of(f"impact['touch[{i}]',{b},")] == H_ZERO)]

    def bounds(self):
        """Bounds of the variables by name, and those of the rows by name."""
        lbx, ubx = self.sides.bounds(self.zero, self.c.lbx, self.c.ubx)
        lbg, ubg = self.c.lbg.copy(), self.c.ubg.copy()
        give_interior(self.c, self.zero, lbx, ubx, lbg, ubg)
        return (
            {v.name.split('jumps.')[-1]: pair for v, *pair in zip(self.c.variables, lbx, ubx)},
            {r.name.split('jumps.')[-1]: pair for r, *pair in zip(self.c.constraints, lbg, ubg)},
        )


def test_bodies_that_meet_have_a_free_impulse():
    branch = Branch(row_of_bodies(), closed=[(1, 2), (1, 3)], impacts=[])
    assert branch.impacts(1) == [1], "the law of (21) leaves N no room where they meet"
    variables, rows = branch.bounds()
    assert variables["below['touch[1]',1]"] == [0, 0] and rows["room['touch[1]',1]"] == [-np.inf, np.inf]


def test_bodies_that_touched_before_have_no_impulse():
    branch = Branch(row_of_bodies(), closed=[(1, 1), (1, 2), (1, 3)], impacts=[(1, 1), (1, 2)])
    assert branch.impacts(1) == []
    variables, rows = branch.bounds()
    for b in (1, 2):
        assert variables[f"below['touch[1]',{b}]"] == [-np.inf, np.inf] and variables[f"above['touch[1]',{b}]"] == [0, 0]
        assert rows[f"room['touch[1]',{b}]"] == [-np.inf, np.inf]


def test_an_impact_goes_on_through_bodies_that_touch():
    closed = [(1, n) for n in (1, 2, 3)] + [(2, 2), (2, 3)]
    assert Branch(row_of_bodies(2), closed, impacts=[(1, 1), (2, 1)]).impacts(1) == [1]
    assert Branch(row_of_bodies(2), closed, impacts=[(1, 2), (2, 1)]).impacts(1) == []


@pytest.mark.parametrize('touched, is_free', [((2, 3), True), ((3,), False), ((1, 2, 3), False)])
def test_bodies_that_must_not_slip_have_a_free_impulse_where_they_meet_and_stay(touched, is_free):
    # the boundary is that between the elements 1 and 2
    branch = Branch(body_that_must_not_slip(), closed=[], impacts=[])
    zero = branch.zero.copy()
    for n in touched:
        zero[[*branch.of(f"cross['touch.touching',{n},"), *branch.of(f"cross['touch.sticking',{n},")]] = H_ZERO
    branch.settle(zero)
    assert all(branch.zero[branch.of("slip['touch.sticking',1]")] == H_ZERO) is is_free


def test_in_flight_nothing_is_decided():
    m = row_of_bodies()
    branch = Branch(m, closed=[], impacts=[])
    variables, rows = branch.bounds()
    assert branch.impacts(1) == [] and variables["below['touch[1]',1]"] == [0, np.inf] and rows["room['touch[1]',1]"] == [0, np.inf]


def test_a_branch_has_a_drift_or_a_normal_velocity():
    variables, rows = Branch(row_of_bodies(curved=True), closed=[(1, 2)], impacts=[(1, 1)]).bounds()
    for n, zero, free in ((1, 'drift', 'rate'), (2, 'rate', 'drift'), (3, 'drift', 'rate')):
        for r in (1, 2):
            index = f"['touch[1]',{n},{r}]"
            assert variables[zero + index] == [0, 0] and variables[free + index] == [-np.inf, np.inf]
            assert rows['closed' + index] == [-np.inf, np.inf] and rows['rates' + index] == [0, 0]


@pytest.mark.parametrize('curved', [False, True])
def test_a_body_that_is_pushed_against_the_wall(curved):
    # it falls with u = -1 from 1/2 and stays at q = 0
    m = row_of_bodies(curved=curved)
    m.q[1, 0].fix(0.5)
    m.v[1, 0].fix(0)
    m.u.fix(-1)
    results = pyo.SolverFactory('mpec_hybrid').solve(m)
    assert results.solver.stationarity == 'B' and m.q[1, 3].value == pytest.approx(0, abs=1e-8)
