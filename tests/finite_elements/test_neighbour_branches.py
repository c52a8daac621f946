"""Neighbouring branches: those beside a solution that carry a switch over the boundary of a control stage."""

import pyomo.environ as pyo
import pytest
import signum
from pyomo.mpec import Complementarity

import pyomo_fesd
from pyomo_fesd.core import all_hints, moving_grids
from tests.models import dcs
from tests.problems import carried
from tests.problems.running import LEGENDRE, RADAU, move, transform


def branches(m):
    """``{(boundary, step): NeighbourBranch}``."""
    keys = [(b, step) for b in m._pyomo_fesd_elements_t.element if b > 1 for step in (-1, 1)]
    found = all_hints(m).neighbour_branches
    assert len(found) == len(keys)
    return {(b - 1, step): branch for (b, step), branch in zip(keys, found)}


def moves(branch):
    """The pairs that change, with those that they take over from, or None."""
    return [couple for change in branch.changes for couple in (change.later if branch.later else change.earlier)]


def pairs(branch):
    """Indices of ``moves``."""
    return [(pair.index(), source and source.index()) for pair, source in moves(branch)]


# What is written


def test_two_branches_for_each_inner_boundary():
    assert set(branches(transform(carried.build(), 6))) == {(b, s) for b in range(1, 6) for s in (-1, 1)}


def test_the_element_beside_the_boundary_takes_over_the_active_set():
    found = branches(transform(signum.build(), 4))
    (family, *_) = {index[0] for index, _ in pairs(found[2, 1])}
    # the switch goes from boundary 2 to 3: element 3 gets the mode of element 2; to 1: element 2 gets that of element 3
    assert ((family, 3), (family, 2)) in pairs(found[2, 1])
    assert ((family, 2), (family, 3)) in pairs(found[2, -1])


def test_inside_a_stage_only_an_element_of_least_length_is_worth_a_look():
    m = transform(signum.build(), 4)
    r = m._pyomo_fesd_elements_t.r
    branch = branches(m)[2, 1]
    (short,) = branch.if_at_lower_bound
    assert short is r[3] and not branch.starts


@pytest.mark.parametrize('boundary, step, changed', [(3, 1, 4), (3, -1, 3)])
def test_at_a_stage_boundary_the_element_starts_short_and_the_others_fill_the_stage(boundary, step, changed):
    m = transform(carried.build(), 6)
    branch = branches(m)[boundary, step]
    assert not branch.if_at_lower_bound
    starts = {v.index(): start for v, start in branch.starts}
    grid = moving_grids(m)[m.t].grid
    (stage,) = [elements for elements in grid.stages.values() if any(e.n == changed for e in elements)]
    assert set(starts) == {e.n for e in stage}
    assert starts[changed] == m._pyomo_fesd_elements_t.r[changed].lb
    assert sum(e.length * starts[e.n] for e in stage) == pytest.approx(stage[-1].right - stage[0].left)


def test_with_hysteresis_the_law_of_switching_goes_along():
    m = carried.build()
    move(dcs(m, hysteresis=[m.zero]), 4, 2)
    components = {pair.parent_component().local_name for pair, _ in moves(branches(m)[2, 1]) if pair.ctype is Complementarity}
    assert components == {'binary', 'parts', 'region', 'leaving'}


def test_with_jumps_they_go_along():
    m = move(carried.build_with_jump(), 6, 2)
    found = pairs(branches(m)[3, 1])
    # nothing happens any longer where they were, though it may one boundary before
    assert (('change', 4), ('change', 3)) in found and (('change', 3), None) in found
    # at the ends of the horizon nothing happens
    assert (('change', 1), None) in pairs(branches(m)[1, 1])


def test_a_single_element_has_none():
    assert not branches(transform(signum.build(), 1))


# What they find


def solved(m):
    """Certified, with its value and controls."""
    results = pyo.SolverFactory('mpec_hybrid').solve(m)
    assert results.solver.stationarity == 'B'
    return pyo.value(m.cost), (m.u[1].value, m.u[2].value)


@pytest.mark.parametrize('start, scheme', [(0.5, RADAU), (1.0, RADAU), (2.0, LEGENDRE)])
@pytest.mark.parametrize('form', ['heaviside', 'stewart', 'hysteresis'])
def test_a_switch_that_sticks_to_a_stage_boundary_is_carried_over_it(form, start, scheme):
    m = carried.build(start)
    dcs(m, **({'hysteresis': [m.zero]} if form == 'hysteresis' else {'form': form}))
    move(m, 6, 2, piecewise_constant=[m.u], scheme=scheme)
    if form == 'hysteresis':
        m.u[...].set_value(start)
        pyomo_fesd.simulate(m)
    value, controls = solved(m)
    assert value == pytest.approx(carried.VALUE, abs=1e-6)
    assert controls == pytest.approx(carried.CONTROLS, abs=1e-6)
    (switch,) = pyomo_fesd.switches(m)
    assert switch.time == pytest.approx(carried.SWITCH, abs=1e-6)


@pytest.mark.parametrize('nfe', [4, 8])
def test_a_jump_that_sticks_to_a_stage_boundary(nfe):
    m = carried.build_with_jump(2 / 3)
    move(m, nfe, 2, piecewise_constant=[m.u])
    m.u[...].set_value(1.0)
    for t in m.t:
        if t <= 1:
            m.u[t].value = 2 / 3
    pyomo_fesd.simulate(m)
    (jump,) = pyomo_fesd.switches(m)
    assert jump.time == pytest.approx(1, abs=1e-6)
    value, controls = solved(m)
    assert value == pytest.approx(carried.VALUE, abs=1e-6)
    assert controls == pytest.approx(carried.CONTROLS, abs=1e-6)


def test_a_warm_start_leaves_the_point_where_the_switch_sticks():
    m = carried.build()
    move(dcs(m), 6, 2, piecewise_constant=[m.u])
    for t in m.t:
        m.u[t].value = carried.STUCK[0] if t <= 1 else carried.STUCK[1]
    pyomo_fesd.simulate(m)
    assert pyo.value(m.cost) == pytest.approx(carried.STUCK_VALUE, abs=1e-6)
    assert not pyomo_fesd.certify(m).certified
    results = pyo.SolverFactory('mpec_hybrid').solve(m, warm_start=True)
    assert results.solver.stationarity == 'B'
    assert pyo.value(m.cost) == pytest.approx(carried.VALUE, abs=1e-6)
