"""Generated equations have consistent units, whatever the units of what they are made of."""

import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
from pyomo.gdp import Disjunction
from pyomo.util.check_units import assert_units_equivalent, identify_inconsistent_units

import pyomo_fesd
from pyomo_fesd.core import in_unit_of, time_unit, unit_of, without_unit

pytest.importorskip('pint')
u = pyo.units


@pytest.fixture
def m():
    m = pyo.ConcreteModel()
    m.V, m.F, m.plain = pyo.Var(units=u.m**3), pyo.Var(units=u.m**3 / u.hr), pyo.Var()
    m.crest = pyo.Param(initialize=2, units=u.m**3)
    return m


def test_an_expression_as_a_multiple_of_its_unit(m):
    m.V.value = 5
    assert_units_equivalent(unit_of(m.V - m.crest), u.m**3)
    scaled = without_unit(m.V - m.crest)
    assert_units_equivalent(scaled, u.dimensionless)
    assert pyo.value(scaled) == 3
    assert_units_equivalent(in_unit_of(m.plain, m.V), u.m**3)


def test_what_has_no_unit_or_an_inconsistent_one_stays_as_it_is(m):
    for expr in (m.plain + 1, m.V + m.F, m.V / m.crest, 3.0):
        assert unit_of(expr) is None and without_unit(expr) is expr and in_unit_of(m.plain, expr) is m.plain


def test_the_unit_of_time_of_a_derivative(m):
    assert_units_equivalent(time_unit(m.V, m.F), u.hr)
    assert_units_equivalent(time_unit(m.V, m.plain), u.m**3)
    assert time_unit(m.plain, m.plain) is None and time_unit(m.V, m.V) is None


def tank(**options):
    """A tank with a hysteresis-free relay on level and temperature: two switching functions in different units."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 4))
    m.V = pyo.Var(m.t, initialize=1, units=u.m**3)
    m.T = pyo.Var(m.t, initialize=300, units=u.K)
    m.dV = dae.DerivativeVar(m.V, units=u.m**3 / u.hr)
    m.dT = dae.DerivativeVar(m.T, units=u.K / u.hr)
    m.low, m.hot = pyo.Param(initialize=1.5, units=u.m**3), pyo.Param(initialize=305, units=u.K)
    m.V[0].fix(1)
    m.T[0].fix(300)
    flow, heat = u.m**3 / u.hr, u.K / u.hr

    def modes(m, t):
        cold, filling = m.T[t] <= m.hot, m.V[t] <= m.low
        return [
            [cold, filling, m.dV[t] == 1 * flow, m.dT[t] == 3 * heat],
            [cold, m.V[t] >= m.low, m.dV[t] == 0.5 * flow, m.dT[t] == 2 * heat],
            [m.T[t] >= m.hot, m.dV[t] == 0 * flow, m.dT[t] == 1 * heat],
        ]

    m.modes = Disjunction(m.t, rule=modes)
    pyo.TransformationFactory('fesd.dcs').apply_to(m, **options)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=6, ncp=2)
    return m


@pytest.mark.parametrize('form', ['stewart', 'heaviside'])
def test_switching_functions_in_several_units(form):
    m = tank(form=form)
    assert not identify_inconsistent_units(m)
    pyomo_fesd.simulate(m)
    # 0.5 h at 3 K/h, then 3.5 K at 2 K/h
    assert [s.time for s in pyomo_fesd.switches(m)] == pytest.approx([0.5, 2.25], abs=1e-6)


def test_nonsmooth_functions_have_the_unit_of_their_arguments():
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 1))
    m.V = pyo.Var(m.t, initialize=1, units=u.m**3)
    m.dV = dae.DerivativeVar(m.V, units=u.m**3 / u.s)
    m.V[0].fix(1)

    @m.Block(m.t)
    def weir(b, t):
        m = b.model()
        over = pyomo_fesd.maximum(b, m.V[t] - 1.2 * u.m**3, 0 * u.m**3)
        b.balance = pyo.Constraint(expr=m.dV[t] == 0.5 * u.m**3 / u.s - over / u.s)

    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=3, ncp=2)
    assert not identify_inconsistent_units(m)
