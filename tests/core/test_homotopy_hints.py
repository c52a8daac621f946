"""Hints for the homotopy: written on blocks, read from the whole model, carried along by copies."""

import copy
import doctest
import pickle

import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
import signum
from pyomo.core.expr.visitor import identify_variables
from pyomo.gdp import Disjunction
from pyomo.mpec import Complementarity, complements

import pyomo_fesd
from pyomo_fesd.core import BranchConstraint, Change, NeighbourBranch, Penalty, all_hints, homotopy_hints, records_below
from pyomo_fesd.core.homotopy_hints import SCOPE
from tests.models import dcs
from tests.problems import carried
from tests.problems.running import move, transform


def equal_parts(block):
    """Two parts that are to run alike where both run, with every kind of hint on ``block``."""
    block.x, block.y = pyo.Var(bounds=(0, 4), initialize=1), pyo.Var(bounds=(0, 4), initialize=2)
    block.demand = pyo.Constraint(expr=block.x + block.y == 3)
    block.alike = Complementarity(expr=complements((block.x - block.y) ** 2 >= 0, block.x * block.y >= 0))
    block.other = Complementarity(expr=complements(block.x >= 0, 4 - block.y >= 0))
    block.equal = pyo.Constraint(expr=block.x == block.y)
    block.equal.deactivate()
    block.difference = pyo.Expression(expr=(block.x - block.y) ** 2)
    hints = homotopy_hints(block)
    hints.branch_constraints.append(BranchConstraint(block.alike, block.equal, tentative=True))
    hints.penalties.append(Penalty(block.difference, 0.1))
    hints.guide_bounds[block.x] = (0.5, 2)
    change = Change(((block.other, block.alike),), ((block.other, block.alike), (block.alike, None)), ())
    hints.neighbour_branches.append(NeighbourBranch(((block.y, 3.0),), (block.x,), (change,)))
    return block


def assert_hints_of(block, model):
    """The hints of ``equal_parts``, on the components of ``block``, found from ``model``."""
    hints = all_hints(model)
    ((constraint,), (penalty,), (branch,)) = hints.branch_constraints, hints.penalties, hints.neighbour_branches
    assert constraint.pair is block.alike and constraint.constraint is block.equal and constraint.tentative
    assert penalty.expression is block.difference and penalty.weight == 0.1
    assert [v for v in identify_variables(penalty.expression.expr)] == [block.x, block.y]
    assert [(v, bounds) for v, bounds in hints.guide_bounds.items()] == [(block.x, (0.5, 2))]
    ((start, value),), (short,), (change,) = branch.starts, branch.if_at_lower_bound, branch.changes
    assert start is block.y and value == 3.0 and short is block.x and branch.later
    assert change.later == ((block.other, block.alike), (block.alike, None))


def test_hints_stay_on_the_block_and_are_found_from_the_model():
    m = pyo.ConcreteModel()
    m.b = pyo.Block([1, 2])
    equal_parts(m.b[2])
    assert_hints_of(m.b[2], m)
    assert_hints_of(m.b[2], m.b[2])
    assert not all_hints(m.b[1]).penalties
    assert homotopy_hints(m.b[2]) is homotopy_hints(m.b[2])


def test_reading_writes_nothing():
    m = pyo.ConcreteModel()
    m.b = pyo.Block([1, 2])
    equal_parts(m.b[2])
    all_hints(m).penalties.clear()
    assert m._private_data is None and m.b[1]._private_data is None
    assert len(homotopy_hints(m.b[2]).penalties) == 1
    assert list(records_below(m, SCOPE)) == [homotopy_hints(m.b[2])] and not list(records_below(m, 'something else'))


def test_hints_of_inactive_blocks_do_not_count():
    m = pyo.ConcreteModel()
    m.b = pyo.Block([1, 2])
    for b in m.b.values():
        equal_parts(b)
    assert [h.expression.parent_block() for h in all_hints(m).penalties] == [m.b[1], m.b[2]]
    m.b[1].deactivate()
    assert [h.expression.parent_block() for h in all_hints(m).penalties] == [m.b[2]]


def test_a_block_that_is_deactivated_as_a_whole_has_none():
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 1))
    m.b = pyo.Block(m.t, rule=lambda b, t: equal_parts(b) and None)
    m.b.deactivate()
    # pyomo.dae makes the new data active
    pyo.TransformationFactory('dae.collocation').apply_to(m, wrt=m.t, nfe=2, ncp=1)
    assert m.b[0.5].active
    assert not all_hints(m).penalties


COPIES = {
    'clone': lambda m: m.clone(),
    'deepcopy': copy.deepcopy,
    'pickle': lambda m: pickle.loads(pickle.dumps(m)),
    'create_using': lambda m: pyo.TransformationFactory('core.relax_integer_vars').create_using(m),
}


@pytest.mark.parametrize('way', COPIES)
def test_hints_of_a_copy_point_into_the_copy(way):
    m = pyo.ConcreteModel()
    m.b = pyo.Block()
    equal_parts(m.b)
    other = COPIES[way](m)
    assert other is not m and other.b is not m.b
    assert_hints_of(other.b, other)
    assert_hints_of(m.b, m)


def test_hints_of_a_cloned_block_point_into_the_clone():
    m = pyo.ConcreteModel()
    m.b = pyo.Block()
    equal_parts(m.b)
    m.c = m.b.clone()
    assert_hints_of(m.c, m.c)
    assert len(all_hints(m).penalties) == 2


def test_hints_disappear_with_their_block():
    m = pyo.ConcreteModel()
    m.b = pyo.Block()
    equal_parts(m.b)
    m.del_component(m.b)
    assert not all_hints(m).penalties


def test_the_example_of_the_docstring_runs():
    example = doctest.DocTestFinder().find(homotopy_hints, 'homotopy_hints', globs={})
    (found,) = [e for e in example if e.examples]
    assert doctest.DocTestRunner().run(found).failed == 0


# What fesd.finite_elements writes


def test_every_pair_of_equal_lengths_points_to_its_equation():
    m = transform(signum.build(), 5)
    hints = all_hints(m).branch_constraints
    found = [hint for hint in hints if hint.constraint.parent_component().local_name == 'equal_length']
    assert len(found) == 4
    for hint in found:
        assert hint.pair.ctype is Complementarity and hint.pair.active and not hint.tentative
        assert not hint.constraint.active and hint.constraint.index() == hint.pair.index()


def test_the_penalty_is_small_and_carries_its_weight():
    m = transform(signum.build(), 5, rho=0.25)
    (penalty,) = all_hints(m).penalties
    assert penalty.weight == 0.25 and pyo.value(penalty.expression) == 0
    pyo.TransformationFactory('fesd.finite_elements').get_element_lengths(m.t)[1].value = 1.5
    assert pyo.value(penalty.expression) == pytest.approx(0.25)


def test_the_lengths_have_guide_bounds():
    m = transform(signum.build(), 5, length_bounds=0.25)
    ((lengths, bounds),) = all_hints(m).guide_bounds.items()
    assert lengths is pyo.TransformationFactory('fesd.finite_elements').get_element_lengths(m.t)
    assert bounds == (0.75, 1.25)


def put_on_a_slope(m):
    """Add a body that touches a curved surface, along which it must not slip."""
    m.along = pyo.Var(m.t, initialize=0)
    m.dalong = dae.DerivativeVar(m.along, wrt=m.t)
    m.q, m.v = pyo.Var(m.t, initialize=0), pyo.Var(m.t, initialize=0)
    m.dq, m.dv = dae.DerivativeVar(m.q, wrt=m.t), dae.DerivativeVar(m.v, wrt=m.t)
    m.slope = pyomo_fesd.contact(m.t, gap=lambda m, t: pyo.exp(m.q[t]) - 1, friction=0.5, slip=lambda m, t: m.along[t], sticks=True)
    m.held = pyo.Constraint(m.t, rule=lambda m, t: m.dalong[t] == m.slope[t].friction)
    m.along[m.t.first()].fix(0)
    m.way = pyo.Constraint(m.t, rule=lambda m, t: m.dq[t] == m.v[t])
    m.momentum = pyo.Constraint(m.t, rule=lambda m, t: m.dv[t] == pyo.exp(m.q[t]) * m.slope[t].normal - 1)
    m.q[m.t.first()].fix(0)
    m.v[m.t.first()].fix(0)


@pytest.mark.parametrize('way', ['clone', 'deepcopy'])
def test_a_copy_of_a_discretised_model_has_hints_of_its_own(way):
    m = carried.build_with_jump(2 / 3)
    m.y = pyo.Var(m.t, initialize=0)
    m.sign = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 0, m.y[t] == 3], [m.x[t] >= 0, m.y[t] == 1]])
    m.level = pyo.Var(m.t, initialize=0)
    m.rise = dae.DerivativeVar(m.level)
    m.level[0].fix(0)
    m.ramp = pyo.Constraint(m.t, rule=lambda m, t: m.rise[t] == 1)
    put_on_a_slope(m)
    move(dcs(m), 4, 2)
    m.measured = pyo.Constraint(expr=pyomo_fesd.at(m.level, 0.3) <= 1)
    other = COPIES[way](m)
    ours, theirs = all_hints(m), all_hints(other)
    for kind in ours.__slots__:
        assert len(getattr(ours, kind)) == len(getattr(theirs, kind)) > 0
    for hint in theirs.branch_constraints:
        assert hint.pair.model() is other and hint.constraint.model() is other
    for branch in theirs.neighbour_branches:
        for pair, source in branch.changes[0].later:
            assert pair.model() is other and (source is None or source.model() is other)
        for v, _ in branch.starts:
            assert v.model() is other
    for follower in theirs.followers:
        assert follower.pair.model() is other and follower.leader.model() is other
    for impact in theirs.impacts:
        components = (*impact.pairs, impact.above, impact.below, impact.room, *impact.within, *impact.before)
        assert all(component.model() is other for component in components)
    for drift in theirs.drifts:
        components = (drift.drift, drift.rate, drift.row, *drift.distances, *drift.forces)
        assert all(component.model() is other for component in components)
    assert all(v.model() is other for v in theirs.guide_bounds)
