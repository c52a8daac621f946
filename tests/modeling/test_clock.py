"""The clock: physical time as a variable."""

import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
from pyomo.gdp import Disjunction

import pyomo_fesd
from pyomo_fesd import FesdError
from tests.models import dcs
from tests.problems.running import EXACT_SCHEMES, move, solve, transform

SWITCH = 2**0.5  # of ramp


def ramp(first=0):
    """dx/dt = 2 (t - first) below zero, 1 above, from -2: zero is reached after sqrt(2)."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(first, first + 2))
    m.x = pyo.Var(m.t, initialize=-2)
    m.dx = dae.DerivativeVar(m.x)
    m.x[first].fix(-2)
    m.rate = pyo.Var(m.t, initialize=1)
    m.rising = pyo.Constraint(m.t, rule=lambda m, t: m.rate[t] == 2 * (pyomo_fesd.clock(m, m.t)[t] - first))
    m.sgn = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 0, m.dx[t] == m.rate[t]], [m.x[t] >= 0, m.dx[t] == 1]])
    return m


@pytest.mark.parametrize('first', [0, 5])
@pytest.mark.parametrize('scheme, ncp', EXACT_SCHEMES)
def test_a_rule_reads_the_time_of_the_plant(scheme, ncp, first, caplog):
    m = solve(transform(ramp(first), 6, ncp, scheme=scheme))
    assert not [r for r in caplog.records if 'time label' in r.message]
    (switch,) = pyomo_fesd.switches(m)
    if (scheme, ncp) != ('LAGRANGE-RADAU', 1):  # which is of first order
        assert switch.time == pytest.approx(first + SWITCH, abs=1e-9)
    c = pyomo_fesd.clock(m)
    for t, now in pyomo_fesd.physical_time(m).items():
        assert c[t].value == pytest.approx(now, abs=1e-9)


def test_there_is_one_clock_for_each_time():
    m = ramp()
    assert pyomo_fesd.clock(m)[0] is pyomo_fesd.clock(m, m.t)[0] is pyomo_fesd.clock(m.t)[0]
    m.s = dae.ContinuousSet(bounds=(0, 1))
    assert pyomo_fesd.clock(m, m.s)[0] is not pyomo_fesd.clock(m, m.t)[0]
    m.unit = pyo.Block()
    assert pyomo_fesd.clock(m.unit, m.t)[0] is pyomo_fesd.clock(m, m.t)[0]


@pytest.mark.parametrize('clock', [lambda m: pyomo_fesd.clock(m.t), lambda m: pyomo_fesd.clock(m, m.t)])
def test_a_clock_gets_a_name_as_any_component(clock):
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2))
    m.tau = clock(m)
    m.x = pyo.Var(m.t, initialize=0.0)
    m.dx = dae.DerivativeVar(m.x)
    m.x[0].fix()
    m.late = Disjunction(m.t, rule=lambda m, t: [[m.tau[t] <= 0.7, m.dx[t] == m.tau[t]], [m.tau[t] >= 0.7, m.dx[t] == -1]])
    m = move(dcs(m), 3, 2).clone()
    pyomo_fesd.simulate(m)
    (switch,) = pyomo_fesd.switches(m)
    assert switch.time == pytest.approx(0.7, abs=1e-12) and m.x[2].value == pytest.approx(0.245 - 1.3, abs=1e-12)
    assert {t: m.tau[t].value for t in m.t} == pytest.approx(pyomo_fesd.physical_time(m), abs=1e-12)


def test_a_clock_in_a_sub_block_with_its_own_time():
    m = pyo.ConcreteModel()
    m.fs = ramp()
    solve(move(dcs(m.fs, wrt=m.fs.t), 6, 2, wrt=m.fs.t))
    assert pyomo_fesd.switches(m)[0].time == pytest.approx(SWITCH, abs=1e-9)


def test_a_clone_has_its_own_clock():
    m = ramp()
    copy = m.clone()
    assert pyomo_fesd.clock(copy)[0].model() is copy
    for model in (copy, m):
        solve(transform(model, 6, 2))
        assert pyomo_fesd.switches(model)[0].time == pytest.approx(SWITCH, abs=1e-9)


def test_with_pyomo_dae_alone_it_is_the_label():
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 3))
    c = pyomo_fesd.clock(m)
    pyo.TransformationFactory('dae.collocation').apply_to(m, wrt=m.t, nfe=3, ncp=2)
    m.cost = pyo.Objective(expr=0)
    solve(m)
    assert len(c) == 7 and all(v.value == pytest.approx(t, abs=1e-6) for t, v in c.items())


def test_after_discretisation_a_new_clock_is_refused():
    m = ramp()
    m.del_component(m.rising)
    m.del_component('_pyomo_fesd_clock_t')
    transform(m, 4, 2)
    with pytest.raises(FesdError, match='^t: clock: it is discretised already'):
        pyomo_fesd.clock(m)


def test_a_model_without_time_has_no_clock():
    with pytest.raises(FesdError, match='clock: the model has no ContinuousSet'):
        pyomo_fesd.clock(pyo.ConcreteModel())


def test_it_is_no_trajectory_of_its_own_and_no_obstacle_to_a_plot():
    m = solve(transform(ramp(), 6, 2))
    assert not [c for c in pyomo_fesd.trajectory(m).columns if 'clock' in c]
    assert len(pyomo_fesd.plot(m).axes) == 2
