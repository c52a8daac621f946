"""The time in the index of a component, and the choice of a ContinuousSet."""

import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
import signum
from hypothesis import given
from hypothesis import strategies as st
from pyomo.gdp import Disjunct, Disjunction

from pyomo_fesd import FesdError
from pyomo_fesd.core import time_index
from pyomo_fesd.core.time_index import (
    TimeIndex,
    ancestry,
    continuous_sets,
    derivatives,
    discretised,
    find_continuous_set,
    index_tuple,
    is_indexed_by,
    refuse_foreign,
    strip_time,
    time_position,
)
from tests.problems.running import move


@pytest.fixture
def m():
    """Time, space, and a set of two names and one of pairs."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=[0, 0.5, 2])
    m.z = dae.ContinuousSet(bounds=(0, 1))
    m.i = pyo.Set(initialize=['a', 'b'])
    m.pairs = pyo.Set(dimen=2, initialize=[(1, 'x'), (2, 'y')])
    return m


# Positions


@pytest.mark.parametrize(
    'sets, position',
    [(['t'], 0), (['t', 'i'], 0), (['i', 't'], 1), (['i', 'z', 't'], 2), (['pairs', 't'], 2), (['t', 'pairs'], 0), (['i'], None)],
)
def test_the_position_of_time_counts_the_places_before_it(m, sets, position):
    m.v = pyo.Var(*(m.component(name) for name in sets))
    assert time_position(m.v, m.t) == position
    assert is_indexed_by(m.v, m.t) is (position is not None)


def test_whole_components_are_grouped_as_their_data_are(m):
    m.v, m.w, m.x, m.u = pyo.Var(m.i, m.t), pyo.Var(m.pairs, m.t, m.i), pyo.Var(m.t), pyo.Var(m.i)
    m.b = pyo.Block(m.t, rule=lambda b, t: (b.add_component('y', pyo.Var(m.i)), b.add_component('z', pyo.Var()))[0])
    components = list(m.component_objects(pyo.Var))
    found, expected = TimeIndex(m.t).families_in(components), TimeIndex(m.t).families(m.component_data_objects(pyo.Var))
    assert list(found) == list(expected) and len(found) == 10
    assert all(list(found[name].items()) == list(expected[name].items()) for name in found)


def test_a_product_that_was_made_before_is_taken_apart(m):
    m.grid = m.i * m.t
    m.v = pyo.Var(m.grid)
    assert time_position(m.v, m.t) == 1
    assert TimeIndex(m.t).split(m.v['a', 0.5]) == (0.5, 'v[a,*]')


def test_a_set_made_by_an_operator_is_one_set(m, caplog):
    m.v = pyo.Var(m.t, m.i - pyo.Set(initialize=['b']))
    assert time_position(m.v, m.t) == 0
    assert not caplog.messages


def test_a_scalar_has_no_time(m):
    m.v = pyo.Var()
    assert time_position(m.v, m.t) is None and not is_indexed_by(m.v, m.t)
    assert TimeIndex(m.t).split(m.v) == (None, 'v')
    assert TimeIndex(m.t).time(m.v) is None


def test_a_set_with_the_same_points_is_another_set(m):
    m.other = dae.ContinuousSet(initialize=[0, 0.5, 2])
    m.v = pyo.Var(m.other)
    assert not is_indexed_by(m.v, m.t) and is_indexed_by(m.v, m.other)


# Splitting


@pytest.mark.parametrize('index, expected', [(None, ()), (0.5, (0.5,)), ('ab', ('ab',)), ((1, 'x'), (1, 'x'))])
def test_an_index_as_a_tuple(index, expected):
    assert index_tuple(index) == expected


def test_the_blocks_around_data_and_their_continuous_sets(m):
    m.unit = pyo.Block(m.i, m.t)
    m.unit['a', 0.5].v = pyo.Var(m.z)
    unit = m.unit['a', 0.5]
    assert list(ancestry(unit.v[0])) == [unit.v[0], unit] and not list(ancestry(m))
    assert set(s.name for s in continuous_sets(unit.v[0])) == {'t', 'z'}


def test_time_is_found_at_every_level_of_blocks(m):
    m.unit = pyo.Block(m.i)
    m.unit['a'].pipe = pyo.Block(m.t, [1, 2])
    pipe = m.unit['a'].pipe[0.5, 2]
    pipe.F, pipe.G = pyo.Var(), pyo.Var(['k'])
    pipe.open = Disjunct()
    pipe.open.c = pyo.Constraint(expr=pipe.F == 1)
    times = TimeIndex(m.t)
    for data, name in (
        (pipe, 'unit[a].pipe[*,2]'),
        (pipe.F, 'unit[a].pipe[*,2].F'),
        (pipe.G['k'], 'unit[a].pipe[*,2].G[k]'),
        (pipe.open.c, 'unit[a].pipe[*,2].open.c'),
    ):
        assert times.split(data) == (0.5, name)
        assert times.time(data) == 0.5


def test_families_group_data_by_name_and_time(m):
    m.v = pyo.Var(m.i, m.t)
    m.w = pyo.Var(m.i)
    found = TimeIndex(m.t).families([*m.v.values(), *m.w.values()])
    assert set(found) == {'v[a,*]', 'v[b,*]'}
    assert found['v[b,*]'] == {t: m.v['b', t] for t in m.t}


def test_families_keep_their_order(m):
    m.c = pyo.Var(m.t)
    m.a = pyo.Var(m.t)
    assert list(TimeIndex(m.t).families([*m.c.values(), *m.a.values()])) == ['c[*]', 'a[*]']


def test_times_that_were_added_later_are_found_too(m):
    m.v = pyo.Var(m.t)
    times = TimeIndex(m.t)
    assert times.time(m.v[0]) == 0
    m.t.add(1.5)
    assert times.split(m.v[1.5]) == (1.5, 'v[*]')


@pytest.mark.parametrize(
    'name, short',
    [
        ('x[*]', 'x'),
        ('x[*,a]', 'x[a]'),
        ('x[a,*]', 'x[a]'),
        ('x[a,*,1]', 'x[a,1]'),
        ('unit[a].pipe[*].dj[k]', 'unit[a].pipe.dj[k]'),
        ('x', 'x'),
    ],
)
def test_names_for_people_have_no_time(name, short):
    assert strip_time(name) == short


@given(st.permutations(['t', 'i', 'n']), st.sampled_from(['a', 'b']), st.integers(1, 3), st.sampled_from([0, 0.5, 2]))
def test_any_order_of_indices_is_split_rightly(order, i, n, t):
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=[0, 0.5, 2])
    m.i, m.n = pyo.Set(initialize=['a', 'b']), pyo.RangeSet(3)
    m.v = pyo.Var(*(m.component(name) for name in order))
    index = {'t': t, 'i': i, 'n': n}
    time, name = TimeIndex(m.t).split(m.v[tuple(index[k] for k in order)])
    assert time == t
    assert name == f"v[{','.join('*' if k == 't' else str(index[k]) for k in order)}]"


# The ContinuousSet


def test_the_only_continuous_set_is_found():
    m = signum.build()
    assert find_continuous_set(m, None, 'test') is m.t
    m.unit = pyo.Block()
    assert find_continuous_set(m.unit, None, 'test') is m.t  # above the block
    plant = pyo.ConcreteModel()
    plant.fs = signum.build()
    assert find_continuous_set(plant, None, 'test') is plant.fs.t  # below it


def test_the_set_below_a_block_comes_before_those_elsewhere():
    m = signum.build()
    m.unit = pyo.Block()
    m.unit.z = dae.ContinuousSet(bounds=(0, 1))
    assert find_continuous_set(m.unit, None, 'test') is m.unit.z


def test_of_several_sets_one_must_be_named(m):
    with pytest.raises(FesdError, match=r'test: the model has several ContinuousSets \(t, z\)') as error:
        find_continuous_set(m, None, 'test')
    assert 'wrt' in error.value.fix
    assert find_continuous_set(m, m.z, 'test') is m.z


@pytest.mark.parametrize('wrt', ['t', 3, [0, 1]])
def test_what_is_no_set_of_time_is_refused(m, wrt):
    with pytest.raises(FesdError, match="'wrt' must be a pyomo.dae.ContinuousSet, not (str|int|list)"):
        find_continuous_set(m, wrt, 'test')


def test_an_ordinary_set_is_refused_by_name(m):
    with pytest.raises(FesdError, match="^i: test: 'wrt' must be a pyomo.dae.ContinuousSet"):
        find_continuous_set(m, m.i, 'test')


# Derivatives


def test_derivatives_are_found_in_blocks_and_disjuncts_and_after_discretisation(m):
    m.x = pyo.Var(m.t)
    m.dx = dae.DerivativeVar(m.x)
    m.T = pyo.Var(m.t, m.z)
    m.dT, m.dTz = dae.DerivativeVar(m.T, wrt=m.t), dae.DerivativeVar(m.T, wrt=m.z)
    m.unit = pyo.Block(m.i)
    m.unit['a'].y = pyo.Var(m.t)
    m.unit['a'].dy = dae.DerivativeVar(m.unit['a'].y)
    names = ['dx', 'dT', 'unit[a].dy']
    assert [d.name for d in derivatives(m, m.t)] == names
    assert [d.name for d in derivatives(m, m.z)] == ['dTz']
    assert not discretised(m.z)
    pyo.TransformationFactory('dae.finite_difference').apply_to(m, wrt=m.z, nfe=2)
    assert discretised(m.z) and not discretised(m.t)
    move(m, 2, 1, wrt=m.t)
    assert discretised(m.t)
    assert [d.name for d in derivatives(m, m.t)] == names


def test_disjuncts_of_expressions_are_passed_over_and_declared_ones_are_not(m, monkeypatch):
    m.x = pyo.Var(m.t)
    m.dx = dae.DerivativeVar(m.x)
    m.mode = Disjunct(m.i)
    m.mode['b'].y = pyo.Var(m.t)
    m.mode['b'].dy = dae.DerivativeVar(m.mode['b'].y)
    m.choice = Disjunction(m.t, rule=lambda m, t: [[m.x[t] >= 0, m.dx[t] == 1], [m.x[t] <= 0]])
    searched, walk = [], time_index.declared
    monkeypatch.setattr(time_index, 'declared', lambda b, types: (searched.append(b.name), walk(b, types))[1])
    assert [d.name for d in derivatives(m, m.t)] == ['dx', 'mode[b].dy']
    assert 'mode[a]' in searched and not any('choice_disjuncts' in name for name in searched)


def test_variables_of_another_model_are_refused():
    one, other = signum.build(), signum.build()
    refuse_foreign([one.x[0], one.dx[0]], one, one.sgn)
    with pytest.raises(FesdError, match=r"^sgn: it refers to 'x' of another model"):
        refuse_foreign([one.dx[0], other.x[0]], one, one.sgn)


def test_a_disjunction_over_time_in_a_block_has_the_time_of_its_index(m):
    m.x = pyo.Var(m.t)
    m.unit = pyo.Block()
    m.unit.dj = Disjunction(m.i, m.t, rule=lambda b, i, t: [[m.x[t] <= 0], [m.x[t] >= 0]])
    times = TimeIndex(m.t)
    assert times.split(m.unit.dj['b', 2]) == (2, 'unit.dj[b,*]')
    # the disjuncts that Pyomo makes for it are numbered, not timed
    assert times.time(m.unit.dj['b', 2].disjuncts[0]) is None
