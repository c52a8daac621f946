"""Which variables the modes define, where equations could be solved for several: by the keyword ``defines``."""

import pyomo.environ as pyo
import pytest
from pyomo.gdp import Disjunction

import pyomo_fesd
from pyomo_fesd import FesdError
from tests.problems.laws import over


def squares(power=1):
    """q**2 is a multiple of u: each could be what the modes define."""
    m = over(2, x=1)
    m.q, m.u = pyo.Var(m.t, bounds=(0, None), initialize=1), pyo.Var(m.t, initialize=1)
    m.follows = pyo.Constraint(m.t, rule=lambda m, t: m.u[t] == 0.5 * m.x[t])
    m.outflow = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == 0.3 - m.q[t])

    @m.Disjunction(m.t)
    def mode(m, t):
        q, u = m.q[t] ** 2, m.u[t] ** power
        return [[m.x[t] >= 0.5, q == u], [m.x[t] <= 0.5, q == 0.1 * u]]

    return m


@pytest.mark.parametrize('defines', ['q', ['q'], 'data'])
@pytest.mark.parametrize('power', [1, 2])
def test_the_user_names_the_defined_variable(defines, power):
    m = squares(power)
    named = [m.q[t] for t in m.t] if defines == 'data' else m.q if defines == 'q' else [m.q]
    pyo.TransformationFactory('fesd.dcs').apply_to(m, defines=named)
    for t in m.t:
        assert m.component('_pyomo_fesd_dcs').mode.mode[t, 1].expr.args[0] is m.q[t]


def test_the_named_variable_is_blended_over_all_times():
    m = squares()
    pyo.TransformationFactory('fesd.dcs').apply_to(m, defines=m.q)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=6, ncp=2)
    pyomo_fesd.simulate(m)
    # it slides at x = 0.5: q = 0.3 between sqrt(0.25) and sqrt(0.025)
    assert [m.x[2].value, m.q[2].value] == pytest.approx([0.5, 0.3])
    nu = (0.3 - 0.025**0.5) / (0.5 - 0.025**0.5)
    assert pyomo_fesd.trajectory(m)['mode: mode 1'].iloc[-1] == pytest.approx(nu)


def test_the_message_names_the_keyword_and_no_internal_variable():
    m = over(2, x=1)
    m.q, m.u = pyo.Var(m.t, initialize=1), pyo.Var(m.t, initialize=1)
    m.follows = pyo.Constraint(m.t, rule=lambda m, t: m.u[t] == 0.5 * m.x[t])

    @m.Disjunction(m.t)
    def mode(m, t):
        kink = pyo.Expr_if(m.x[t] >= 0.3, 2 * m.x[t] - 0.6, 0)
        return [[m.x[t] >= 0.5, m.q[t] ** 2 == m.u[t] ** 2 + kink], [m.x[t] <= 0.5, m.q[t] ** 2 == 0.1 * m.u[t] ** 2 + kink]]

    with pytest.raises(FesdError, match='cannot be told') as error:
        pyo.TransformationFactory('fesd.dcs').apply_to(m)
    assert 'q[0] or u[0]' in str(error.value)
    assert 'defines=[m.F]' in str(error.value)
    assert '_pyomo_fesd' not in str(error.value)


@pytest.mark.parametrize('wrong', ['q', 3.0, lambda m: m.outflow])
def test_anything_but_vars_is_refused(wrong):
    m = squares()
    with pytest.raises(FesdError, match="'defines' must name Vars"):
        pyo.TransformationFactory('fesd.dcs').apply_to(m, defines=wrong(m) if callable(wrong) else wrong)
    assert isinstance(m.mode, Disjunction) and m.mode[0].active
