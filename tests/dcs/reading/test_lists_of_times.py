"""A Disjunction that is written out for several times is refused; about one time, or without time, it is passed over as before."""

import pyomo.environ as pyo
import pytest
from pyomo.gdp import Disjunction

import pyomo_fesd
from tests.models import above, below, dcs, scalar_ode


def written_out(labels):
    m = scalar_ode(discretised=True)
    m.d = Disjunction(labels(m), rule=lambda m, t: [below(m, t), above(m, t)])
    return m


@pytest.mark.parametrize('labels', [lambda m: list(m.t)[1:], lambda m: list(m.t), lambda m: [0, 2]])
def test_a_list_of_times_is_no_time(labels):
    with pytest.raises(pyomo_fesd.FesdError, match=r"(?s)d: a Disjunction for several times.*declare Disjunction\(t, rule"):
        dcs(written_out(labels))


def test_one_time_and_no_time_are_left_to_others():
    m = written_out(lambda m: [m.t.last()])
    m.p = pyo.Var()
    m.choice = Disjunction([1, 2], rule=lambda m, k: [[m.p <= k], [m.p >= 3 * k]])
    dcs(m)
    assert m.d[m.t.last()].active and m.choice[1].active
