"""The record of a moving grid."""

from copy import deepcopy

import bouncing_ball
import pyomo.environ as pyo
import pytest
import signum
import thermostat
from pyomo.mpec import Complementarity

import pyomo_fesd
from pyomo_fesd.core import moving_grids
from tests.models import dcs
from tests.problems import walls
from tests.problems.running import move, transform


def test_an_ordinary_model_has_none():
    m = signum.build()
    assert not moving_grids(m) and m.t not in moving_grids(m)


@pytest.mark.parametrize('copy_of', [pyo.ConcreteModel.clone, deepcopy])
def test_a_copy_has_its_own(copy_of):
    m = transform(signum.build(), 3)
    copy = copy_of(m)
    ours, theirs = moving_grids(m)[m.t], moving_grids(copy)[copy.t]
    assert theirs.r.model() is copy and theirs.eta.model() is copy and theirs.block.model() is copy
    assert theirs.grid == ours.grid and theirs.grid is not ours.grid
    assert all(pair.model() is copy and all(c.model() is copy for c in sources) for pair, sources in theirs.sources.items())
    theirs.r[1].value = 1.5
    assert ours.r[1].value == 1
    assert theirs.physical_time() != ours.physical_time()


def test_physical_time_follows_the_lengths():
    m = transform(signum.build(), 4, 2)
    moving = moving_grids(m)[m.t]
    for n, r in zip(moving.r, (0.5, 1.5, 0.8, 1.2)):
        moving.r[n].value = r
    ends = [moving.physical_time()[e.right] for e in moving.grid.elements]
    assert ends == pytest.approx([0.25, 1.0, 1.4, 2.0])
    assert pyomo_fesd.physical_time(m, m.t) == moving.physical_time()
    assert [pyo.value(moving.duration(e)) for e in moving.grid.elements] == pytest.approx([0.25, 0.75, 0.4, 0.6])


def test_every_pair_knows_the_conditions_that_it_sums_up():
    m = transform(signum.build(), 3, 2)
    moving = moving_grids(m)[m.t]
    assert all(pair.ctype is Complementarity and len(sources) == 2 for pair, sources in moving.sources.items())
    assert len(moving.sources) == len(moving.pairs) == 2 * 3


def test_the_pairs_of_a_mixed_condition_know_their_source():
    m = move(walls.build(), 3, 2)
    moving = moving_grids(m)[m.t]
    assert moving.splits and all(not condition.active for condition in moving.splits)
    for pair, source in moving.split_sources.items():
        assert moving.source(pair) is source and source in moving.splits
    assert all(moving.source(source) is source for source in moving.splits)


def test_modes_with_hysteresis_belong_to_the_grid():
    m = thermostat.build(1)
    move(dcs(m, hysteresis=[m.relay]), 3, 2)
    moving = moving_grids(m)[m.t]
    assert [law.title for law in moving.hysteresis.modes] == ['relay: heating', 'relay: cooling']
    assert moving.state_jumps is None


def test_state_jumps_belong_to_the_grid():
    m = move(bouncing_ball.build(), 3, 2)
    moving = moving_grids(m)[m.t]
    assert [law.name for law in moving.state_jumps.laws] == ['impact']
    assert moving.hysteresis is None
    assert moving.state_jumps.active(1) == []
    moving.state_jumps.block.e['impact', 1].value = 1.0
    assert moving.state_jumps.active(1) == ['impact']
    (state,) = moving.state_jumps.values_after(moving.grid.elements[0])
    assert state.parent_component() is m.v


def test_pairs_by_element_and_by_boundary():
    m = transform(signum.build(), 3, 2)
    moving = moving_grids(m)[m.t]
    assert list(moving.pairs_of_elements()) == [moving.pairs] and not list(moving.pairs_of_boundaries())
    m = move(bouncing_ball.build(), 3, 2)
    jumps = moving_grids(m)[m.t].state_jumps
    assert list(moving_grids(m)[m.t].pairs_of_boundaries()) == [jumps.happens, jumps.binary]
    m = thermostat.build(1)
    move(dcs(m, hysteresis=[m.relay]), 3, 2)
    moving = moving_grids(m)[m.t]
    law = moving.hysteresis
    assert list(moving.pairs_of_elements()) == [moving.pairs, law.binary]
    assert list(moving.pairs_of_boundaries()) == [law.parts, law.region, law.least, law.leaving]
    assert all(component.parent_block() is law.block for component in (law.n, law.m, law.beyond, law.parts))


def test_a_copy_has_its_own_state_jumps():
    m = move(bouncing_ball.build(), 3, 2)
    copy = m.clone()
    jumps = moving_grids(copy)[copy.t].state_jumps
    assert {c.model() for c in (jumps.block, jumps.e, jumps.happens, jumps.after, jumps.copy, jumps.copied)} == {copy}


def test_inner_boundaries_lie_inside_control_stages():
    m = transform(signum.build(), 4, 2)
    grid = moving_grids(m)[m.t].grid
    assert [(e.n, f.n) for e, f in grid.inner_boundaries()] == [(1, 2), (2, 3), (3, 4)]
    assert [e.own_labels for e in grid.elements] == [e.points for e in grid.elements]


def test_models_that_are_added_to_another_keep_their_grids():
    whole = pyo.ConcreteModel()
    whole.first, whole.second = transform(signum.build(), 5, 2), transform(signum.build(), 4, 2)
    grids = moving_grids(whole)
    assert list(grids) == [whole.first.t, whole.second.t] and moving_grids(whole.second.x) == grids
    pyomo_fesd.simulate(whole.first)
    pyo.SolverFactory('mpec_hybrid').solve(whole)
    for part in (whole.first, whole.second):
        (switch,) = pyomo_fesd.switches(part)
        assert switch.time == pytest.approx(signum.SWITCH, abs=1e-9)
    copy = whole.clone()
    assert list(moving_grids(copy)) == [copy.first.t, copy.second.t]
    whole.del_component(whole.first)
    assert list(moving_grids(whole)) == [whole.second.t]
