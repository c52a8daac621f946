"""A Disjunction that leaves out the first time: a switch before the first collocation point is warned of, or found."""

from math import log

import pyomo.environ as pyo
import pytest
from pyomo.gdp import Disjunction

import pyomo_fesd
from pyomo_fesd.core import FesdError
from pyomo_fesd.diagnostics.review import diagnose
from tests.models import dcs
from tests.problems.running import move, transform
from tests.problems.states import over_time

MISSED = 'a switch before the first collocation point'
FIRST_TIME = {
    'skipped': lambda seen, limit: Disjunction.Skip,
    'regions': lambda seen, limit: [[seen <= limit], [seen >= limit]],
}


def fast_start(first_time, end=60, threshold=0.5, scale=1.0, seen='x'):
    """x = 1 - exp(-10 t) passes ``threshold`` early; y' = u with u = 1 before and -1 after it; no equation gives level at 0."""
    m = over_time(end, x=0, y=0)
    m.u = pyo.Var(m.t, initialize=0)
    m.u[0].fix(1)
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == -10 * (m.x[t] - scale))
    m.way = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == m.u[t])

    m.level = pyo.Var(m.t, initialize=0)
    m.reading = pyo.Constraint(m.t, rule=lambda m, t: pyo.Constraint.Skip if t == 0 else m.level[t] == m.x[t])

    @m.Disjunction(m.t)
    def low(m, t):
        value, limit = m.component(seen)[t], threshold * scale
        if t == 0:
            return FIRST_TIME[first_time](value, limit)
        return [[value <= limit, m.u[t] == 1], [value >= limit, m.u[t] == -1]]

    return m


def warnings_of(m):
    return [w for w in pyo.SolverFactory('mpec_hybrid').solve(m).solver.warnings if MISSED in w]


@pytest.mark.parametrize('form', ['heaviside', 'stewart'])
@pytest.mark.parametrize('scale', [1.0, 1e-6, 1e6])
def test_a_switch_that_is_missed_is_warned_of(form, scale):
    m = transform(fast_start('skipped', scale=scale), 6, 3, form=form)
    (message,) = warnings_of(m)
    assert message.startswith('low: ') and 'State its regions at the first time' in message
    assert len(pyomo_fesd.switches(m)) == 0


@pytest.mark.parametrize('form', ['heaviside', 'stewart'])
@pytest.mark.parametrize('scale', [1.0, 1e-6, 1e6])
def test_regions_at_the_first_time_find_it(form, scale):
    m = transform(fast_start('regions', scale=scale), 6, 3, form=form)
    assert warnings_of(m) == []
    assert [s.time for s in pyomo_fesd.switches(m)] == pytest.approx([log(2) / 10], rel=1e-3)


def test_simulate_warns_and_finds_it_too():
    m = transform(fast_start('skipped'), 6, 3)
    pyomo_fesd.simulate(m)
    assert [MISSED in w for w in diagnose(m)] == [True]
    m = transform(fast_start('regions'), 6, 3)
    pyomo_fesd.simulate(m)
    assert diagnose(m) == [] and len(pyomo_fesd.switches(m)) == 1


@pytest.mark.parametrize('threshold', [0.0, 1.5], ids=['begins on it', 'never reached'])
def test_a_mode_that_holds_at_the_first_time_is_not_warned_of(threshold):
    assert warnings_of(transform(fast_start('skipped', threshold=threshold), 6, 3)) == []


def test_a_switch_behind_the_first_point_is_not_warned_of():
    m = transform(fast_start('skipped', end=0.5), 6, 3)
    assert warnings_of(m) == []
    assert [s.time for s in pyomo_fesd.switches(m)] == pytest.approx([log(2) / 10], rel=1e-3)


def test_a_variable_that_nothing_determines_there_is_not_looked_at():
    assert warnings_of(transform(fast_start('skipped', seen='level'), 6, 3)) == []


def test_a_function_that_jumps_is_looked_at():
    m = over_time(60, x=0, y=0)
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == -10 * (m.x[t] - 1))
    m.way = pyo.Constraint(
        m.t,
        rule=lambda m, t: pyo.Constraint.Skip if t == 0 else m.dy[t] == pyo.Expr_if(m.x[t] <= 0.5, 1.0, -1.0),
    )
    (message,) = warnings_of(transform(m, 6, 3))
    assert message.startswith('x = 0.5: ') and 'State the equation' in message


def test_regions_alone_say_nothing_at_later_times():
    m = over_time(1, x=0)
    m.low = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 0.5], [m.x[t] >= 0.5]])
    with pytest.raises(FesdError, match='no disjunct defines anything'):
        move(dcs(m), 2, 2)
