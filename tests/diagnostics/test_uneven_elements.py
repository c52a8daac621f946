"""Elements that are much longer than others which could be spared are told, and mpec_hybrid evens them out."""

import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
import signum
from pyomo.gdp import Disjunction

import pyomo_fesd
from pyomo_fesd.diagnostics.uneven_elements import uneven_elements
from tests.models import dcs
from tests.problems.running import move, transform


def messages(m):
    return list(uneven_elements(m, m.t, []))


def with_lengths(*r):
    m = transform(signum.build(), len(r))
    for n, number in enumerate(r, start=1):
        m._pyomo_fesd_elements_t.r[n].value = number
    return m


def test_equal_elements_are_not_mentioned():
    assert not messages(with_lengths(1, 1, 1, 1))


def test_one_long_element_beside_many_short_ones_is_named():
    (message,) = messages(with_lengths(*[0.1] * 7, 7.3))
    assert message.startswith('t: the elements from time 0.175 to 2 are 73 times as long as the shortest')


def test_too_few_elements_for_the_switches_are_not_mentioned():
    assert not messages(with_lengths(0.05, 0.1, 0.15, 3.7))


def rising(x0):
    """x' = y below 0 and 0.3 y above, y' = -x y: a switch whose time depends on x0."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 1))
    m.x, m.y = pyo.Var(m.t, initialize=x0), pyo.Var(m.t, initialize=1)
    m.dx, m.dy = dae.DerivativeVar(m.x), dae.DerivativeVar(m.y)
    m.x[0].fix(x0)
    m.y[0].fix(1)
    m.growth = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == -m.x[t] * m.y[t])
    m.sgn = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 0, m.dx[t] == m.y[t]], [m.x[t] >= 0, m.dx[t] == 0.3 * m.y[t]]])
    return move(dcs(m), 14)


@pytest.mark.parametrize('first, then', [(-1.3, -0.15), (-0.1, -1.3)])
def test_a_warm_start_with_the_switch_elsewhere_ends_on_an_even_grid(first, then, caplog):
    m = rising(first)
    pyomo_fesd.simulate(m)
    m.x[0].fix(then)
    pyo.SolverFactory('mpec_hybrid').solve(m, warm_start=True)
    r = [v.value for v in m._pyomo_fesd_elements_t.r.values()]
    assert 0.5 < min(r) and max(r) < 1.5
    again = rising(then)
    pyomo_fesd.simulate(again)
    assert pyomo_fesd.switches(m)[0].time == pytest.approx(pyomo_fesd.switches(again)[0].time, abs=1e-5)
    assert not [record for record in caplog.records if 'times as long' in record.message]
