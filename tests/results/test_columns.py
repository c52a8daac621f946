"""The columns of a trajectory, typed by name and mode."""

import signum

import pyomo_fesd
from pyomo_fesd.results.trajectory import columns_over_time
from tests.problems import walls
from tests.problems.running import move, transform


def test_multipliers_have_a_mode_and_variables_have_none():
    m = transform(signum.build(), 2, 1)
    columns = list(columns_over_time(m, m.t))
    modes = {c.name: [other.mode for other in columns if other.name == c.name] for c in columns if c.mode is not None}
    assert list(modes) == ['sgn'] and len(modes['sgn']) == 2
    assert {'x', 'dx'} <= {c.name for c in columns if c.mode is None}
    assert all(set(c.values) <= set(m.t) for c in columns)


def test_titles_are_those_of_the_table():
    m = move(walls.build(), 3, 1)
    titles = [c.title for c in columns_over_time(m, m.t)]
    assert list(pyomo_fesd.trajectory(m).columns) == ['label', 'element', *titles]
    assert any(title.endswith(': at lower bound') for title in titles)
