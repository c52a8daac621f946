"""``simulate`` on a model without elements: the answers of the whole grid, and the model as it was."""

import threading
from math import log, pi, sin

import bouncing_ball
import gas_liquid_tank
import numpy as np
import oscillator
import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
import signum
import thermostat
from hypothesis import given, settings
from hypothesis import strategies as st
from pyomo.gdp import Disjunction

import pyomo_fesd
from pyomo_fesd import FesdError
from pyomo_fesd.core import moving_grids
from pyomo_fesd.diagnostics.review import CHECKS
from pyomo_fesd.simulation import without_grid
from tests.models import collocate, dcs
from tests.problems import burst_disc, clock, crossing, dumped, gears, relay, sliding, two_systems, two_tanks, weir
from tests.problems.running import LEGENDRE, SCHEMES, move, seen, transform
from tests.problems.states import over_time

#: Builds a model -> its Disjunction with hysteresis, or None.
MARCHING = {
    signum.build: None,
    gas_liquid_tank.build: None,
    gas_liquid_tank.build_in_blocks: None,
    oscillator.build: None,
    crossing.build: None,
    sliding.build: None,
    sliding.build_curved: None,
    two_systems.build: None,
    clock.build: None,
    burst_disc.build: None,
    weir.build: None,
    weir.build_series: None,
    relay.build: None,
    thermostat.build: 'relay',
    gears.build: 'gear',
    two_tanks.build: 'hose',
}


def prepared(build, hysteresis):
    m = build()
    return m if hysteresis is None else dcs(m, hysteresis=m.component(hysteresis))


def bare(m):
    """All of a model but the values of its variables."""
    found = {k: v for k, v in seen(m).items() if not (isinstance(v, tuple) and len(v) == 2)}
    for v in m.component_data_objects(pyo.Var):
        found[v.name] = (v.fixed, v.lower, v.upper)
    return found


@pytest.fixture
def laid(monkeypatch):
    """The numbers of elements that were laid, as given to ``fesd.finite_elements``."""
    found, lay = [], without_grid.WithoutGrid._lay

    def spy(self, **changes):
        found.append(changes.get('nfe', self._config.nfe))
        lay(self, **changes)

    monkeypatch.setattr(without_grid.WithoutGrid, '_lay', spy)
    return found


TWO, FEW = [2], [[3, 1]]


# The same answers


@pytest.mark.parametrize('scheme', SCHEMES)
@pytest.mark.parametrize('build', MARCHING, ids=lambda build: f'{build.__module__}.{build.__name__}')
def test_as_on_the_whole_grid(build, scheme, laid, caplog):
    m, whole = (prepared(build, MARCHING[build]) for _ in range(2))
    before = bare(m)
    nfe = 40
    frame = pyomo_fesd.simulate(m, nfe=nfe, ncp=3, scheme=scheme)
    said = [r.getMessage().partition(':')[0] for r in caplog.records]
    caplog.clear()
    assert laid == (FEW if MARCHING[build] else [*TWO, *FEW] if build is burst_disc.build else TWO)
    assert bare(m) == before
    move(whole if MARCHING[build] else dcs(whole), nfe, 3, scheme=scheme)
    table = pyomo_fesd.simulate(whole)
    assert [r.getMessage().partition(':')[0] for r in caplog.records] == said
    assert list(frame.columns) == list(table.columns)
    values = [c for c in table.columns if c not in ('label', 'element')]
    if build is sliding.build_curved and scheme == LEGENDRE:
        values = ['x', 'y']  # its multipliers on a curved surface are inaccurate, as both have warned
    # the lengths of the elements differ, and so do the errors of the discretisation
    assert frame[values].iloc[-1].to_numpy() == pytest.approx(table[values].iloc[-1].to_numpy(), rel=1e-4, abs=1e-5, nan_ok=True)
    assert frame[values].iloc[0].to_numpy() == pytest.approx(table[values].iloc[0].to_numpy(), rel=1e-6, abs=1e-6, nan_ok=True)
    ours, theirs = pyomo_fesd.switches(frame), pyomo_fesd.switches(whole)
    assert [s[1:] for s in ours] == [s[1:] for s in theirs]
    assert [s.time for s in ours] == pytest.approx([s.time for s in theirs], rel=1e-6)


@settings(max_examples=40, deadline=None)
@given(
    x0=st.floats(-3, -0.1),
    below=st.floats(0.5, 3),
    above=st.floats(-3, 3),
    nfe=st.integers(8, 60),
    ncp=st.integers(1, 4),
    scheme=st.sampled_from(SCHEMES),
    start=st.sampled_from([0.0, -5.0, 1e3]),
)
def test_one_switch_exactly(x0, below, above, nfe, ncp, scheme, start):
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(start, start + 10))
    m.x = pyo.Var(m.t, initialize=x0)
    m.dx = dae.DerivativeVar(m.x)
    m.x[start].fix(x0)
    m.sgn = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 0, m.dx[t] == below], [m.x[t] >= 0, m.dx[t] == above]])
    frame = pyomo_fesd.simulate(m, nfe=nfe, ncp=ncp, scheme=scheme)
    switch = start - x0 / below
    found = [s.time for s in pyomo_fesd.switches(frame)]
    assert found == pytest.approx([switch] if switch < start + 10 else [], abs=1e-8)
    x = np.where(frame.index < switch, x0 + below * (frame.index - start), max(above, 0.0) * (frame.index - switch))
    assert frame['x'].to_numpy() == pytest.approx(x, abs=1e-7)
    assert m.x[start + 10].value == pytest.approx(x[-1], abs=1e-7)
    assert frame.index[0] == start and frame.index[-1] == pytest.approx(start + 10, rel=1e-12)
    assert np.all(np.diff(frame.index) >= -1e-9)


@pytest.mark.parametrize('scale', [1e-9, 1e-3, 1e4, 1e9])
def test_time_in_other_units(scale):
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2 * scale))
    m.x = pyo.Var(m.t, initialize=-2)
    m.dx = dae.DerivativeVar(m.x)
    m.x[0].fix(-2)
    m.sgn = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 0, m.dx[t] == 3 / scale], [m.x[t] >= 0, m.dx[t] == 1 / scale]])
    frame = pyomo_fesd.simulate(m, nfe=50)
    assert [s.time for s in pyomo_fesd.switches(frame)] == pytest.approx([2 / 3 * scale], rel=1e-9)
    assert m.x[2 * scale].value == pytest.approx(4 / 3, rel=1e-9)


def test_the_order_of_the_scheme():
    def error(nfe):
        m = gas_liquid_tank.build()
        (switch,) = pyomo_fesd.switches(pyomo_fesd.simulate(m, nfe=nfe, ncp=2))
        return abs(switch.time - gas_liquid_tank.EXACT['t_s'])

    assert error(20) / error(40) > 2**2.7  # order 3


def test_long_runs_are_as_exact_as_short_ones(laid):
    m = over_time(200, x=0.0, y=1.0)  # y decays to 0.5 with x - 100, which is 0 from t = 100 on
    m.mode = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 100, m.dx[t] == 1], [m.x[t] >= 100, m.dx[t] == 0]])
    m.decay = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == 0.5 - m.y[t])
    frame = pyomo_fesd.simulate(m, nfe=2001)
    assert laid == TWO
    assert frame['element'].iloc[-1] == 2002
    assert [s.time for s in pyomo_fesd.switches(frame)] == pytest.approx([100], abs=1e-9)
    assert frame['y'].to_numpy() == pytest.approx(0.5 + 0.5 * np.exp(-frame.index), abs=1e-7)


# Intervals between boundaries that keep their time


@pytest.mark.parametrize('nfe, few', [(40, [3, 1, 3, 1]), ([60, 3], [3, 1, 3, 1]), (8, 8)])
def test_control_stages(nfe, few, laid):
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=[0, 1, 2])
    m.x, m.u = pyo.Var(m.t, initialize=0), pyo.Var(m.t, initialize=lambda m, t: 1.0 if t <= 1 else -3.0)
    m.dx = dae.DerivativeVar(m.x)
    m.x[0].fix(0)
    m.u.fix()
    m.sgn = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 0.5, m.dx[t] == m.u[t]], [m.x[t] >= 0.5, m.dx[t] == 2 * m.u[t]]])
    frame = pyomo_fesd.simulate(m, nfe=nfe, piecewise_constant=[m.u])
    assert laid == [few]
    assert [s.time for s in pyomo_fesd.switches(frame)] == pytest.approx([0.5, 1 + 1 / 6], abs=1e-9)
    assert [m.x[t].value for t in m.t] == pytest.approx([0, 1.5, 0.5 - 2.5], abs=1e-9)
    assert [m.u[t].value for t in m.t] == [1, 1, -3]
    t = frame.index.to_numpy()
    exact = np.select([t < 0.5, t < 1, t < 7 / 6], [t, 0.5 + 2 * (t - 0.5), 1.5 - 6 * (t - 1)], 0.5 - 3 * (t - 7 / 6))
    assert frame['x'].to_numpy() == pytest.approx(exact, abs=1e-8)
    assert t[-1] == pytest.approx(2, abs=1e-14) and np.all(np.diff(t) > 0)


@pytest.mark.parametrize('kind', ['stepped', 'linear'])
def test_signals(kind, laid):
    def plant():
        m = over_time(4, x=0.0)
        m.u = pyomo_fesd.signal(m.t, [0, 1, 2, 4], [1.0, 2.0, -1.0, -1.0], kind=kind)
        m.mode = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 1, m.dx[t] == m.u[t]], [m.x[t] >= 1, m.dx[t] == m.u[t] / 2]])
        return m

    m = plant()
    frame = pyomo_fesd.simulate(m, nfe=60)
    assert laid == [[3, 1] * 3]
    exact = move(dcs(plant()), 60, 3)
    table = pyomo_fesd.simulate(exact)
    assert [s.time for s in pyomo_fesd.switches(frame)] == pytest.approx([s.time for s in pyomo_fesd.switches(exact)], abs=1e-9)
    assert frame['x'].iloc[-1] == pytest.approx(table['x'].iloc[-1], abs=1e-9)


def test_fixed_points(laid):
    m = signum.build()
    frame = pyomo_fesd.simulate(m, nfe=[40, 20], fixed_points=[0.5])
    assert laid == [[3, 1, 3, 1]]
    assert (frame.index <= 0.5).sum() == 121
    assert [s.time for s in pyomo_fesd.switches(frame)] == pytest.approx([2 / 3], abs=1e-9)


# What is left on the model


def test_values_at_the_first_and_the_last_time():
    m = dcs(gas_liquid_tank.build())
    pyomo_fesd.simulate(m, nfe=50)
    whole = move(dcs(gas_liquid_tank.build()), 50, 3)
    pyomo_fesd.simulate(whole)
    for v in m.component_data_objects((pyo.Var, dae.DerivativeVar)):
        assert v.value == pytest.approx(whole.find_component(v.name).value, rel=1e-6, abs=1e-6), v.name
    assert list(m.t) == [0, 20]


def test_indicators_and_what_follows_from_the_end():
    m = signum.build()
    m.at_end = pyo.Var()
    m.twice = pyo.Constraint(expr=m.at_end == 2 * m.x[2])
    pyomo_fesd.simulate(m, nfe=20)
    assert m.at_end.value == pytest.approx(8 / 3, abs=1e-9)
    assert [m.below[t].indicator_var.value for t in m.t] == [True, False]
    assert [m.above[t].indicator_var.value for t in m.t] == [False, True]


def test_afterwards_it_can_be_transformed_and_solved():
    m = signum.build()
    pyomo_fesd.simulate(m, nfe=20)
    transform(m, 10, 2)
    assert pyo.check_optimal_termination(pyo.SolverFactory('mpec_hybrid').solve(m))
    assert [s.time for s in pyomo_fesd.switches(m)] == pytest.approx([2 / 3], abs=1e-9)


def test_twice_gives_the_same():
    m = gas_liquid_tank.build()
    first, second = (pyomo_fesd.simulate(m, nfe=30) for _ in range(2))
    assert first.to_numpy() == pytest.approx(second.to_numpy(), rel=1e-9, abs=1e-9)
    assert [s.time for s in pyomo_fesd.switches(first)] == pytest.approx([s.time for s in pyomo_fesd.switches(second)], rel=1e-12)


def test_states_fixed_at_the_end_keep_their_values():
    m = signum.build()
    m.x[2].fix(7.0)
    frame = pyomo_fesd.simulate(m, nfe=20)
    assert frame['x'].iloc[-1] == pytest.approx(4 / 3, abs=1e-9)
    assert m.x[2].value == 7.0 and m.x[2].fixed


def test_a_block_of_a_model():
    m = pyo.ConcreteModel()
    m.plant = signum.build()
    m.other = pyo.Var(initialize=3)
    frame = pyomo_fesd.simulate(m.plant, nfe=20)
    assert [s.time for s in pyomo_fesd.switches(frame)] == pytest.approx([2 / 3], abs=1e-9)
    assert m.other.value == 3


def test_in_threads():
    found = {}

    def run(k):
        m = over_time(2, x=-1.0 - k)
        m.sgn = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 0, m.dx[t] == 3], [m.x[t] >= 0, m.dx[t] == 1]])
        found[k] = [s.time for s in pyomo_fesd.switches(pyomo_fesd.simulate(m, nfe=30))]

    threads = [threading.Thread(target=run, args=(k,)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == {k: pytest.approx([(1 + k) / 3], abs=1e-9) for k in range(4)}


# Where each element needs a place of its own


def whole(m, laid, **keywords):
    frame = pyomo_fesd.simulate(m, **keywords)
    assert laid[-1] == keywords['nfe']
    return frame


@pytest.mark.parametrize('how', ['inputs', 'piecewise_constant'])
def test_inputs_hold_on_the_whole_horizon(how, laid):
    m = over_time(2, x=0.0)
    m.u = pyo.Var(m.t, initialize=7.0)
    m.u[...].set_value(1.5)
    m.mode = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 1, m.dx[t] == m.u[t]], [m.x[t] >= 1, m.dx[t] == -m.u[t]]])
    frame = pyomo_fesd.simulate(m, nfe=20, **{how: m.u})
    assert laid == TWO
    assert set(frame['u']) == {1.5}
    assert [s.time for s in pyomo_fesd.switches(frame)] == pytest.approx([2 / 3], abs=1e-9)
    assert [v.value for v in m.u.values()] == [1.5, 1.5]


def test_state_jumps(laid):
    m = bouncing_ball.build(0.8, 1)
    frame = whole(m, laid, nfe=12, ncp=2)
    assert [s.time for s in pyomo_fesd.switches(frame)] == pytest.approx(bouncing_ball.impacts(0.8, 1), abs=1e-9)


@pytest.mark.parametrize('first_time', [True, False])
def test_time_in_the_equations(first_time, laid, caplog):
    """dx/dt = t: found by a comparison of elements, as the rule is written for the first time too or not."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2))
    m.x = pyo.Var(m.t, initialize=0)
    m.dx = dae.DerivativeVar(m.x)
    m.x[0].fix(0)
    skipped = lambda t: not first_time and t == 0  # noqa: E731
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: pyo.Constraint.Skip if skipped(t) else m.dx[t] == t)
    frame = whole(m, laid, nfe=20)
    assert frame['x'].iloc[-1] == pytest.approx(2, abs=1e-6)  # labels are rounded
    assert len(caplog.records) == 1 and 'clock' in caplog.text


def test_time_in_an_expression_that_no_equation_contains(laid):
    m = signum.build()
    m.scaled = pyo.Expression(m.t, rule=lambda m, t: m.x[t] * t)
    frame = whole(m, laid, nfe=20)
    assert frame['scaled'].to_numpy() == pytest.approx((frame['x'] * frame['label']).to_numpy(), abs=1e-6)


def test_integrals(laid):
    m = signum.build()
    m.J = dae.Integral(m.t, rule=lambda m, t: m.x[t] ** 2)
    m.area = pyo.Var()
    m.is_area = pyo.Constraint(expr=m.area == m.J)
    whole(m, laid, nfe=20)
    exact = 2 / 3 * 4 / 3 + (4 / 3) ** 3 / 3
    assert m.area.value == pytest.approx(exact, abs=1e-9)
    assert pyo.value(m.J) != pytest.approx(exact, abs=1e-3)  # it is again that of two points


def test_few_elements(laid):
    frame = whole(signum.build(), laid, nfe=7)
    assert len(frame) == 22


# Refusals


def test_without_a_number_of_elements():
    m = signum.build()
    with pytest.raises(FesdError, match='simulate: its elements are not movable') as error:
        pyomo_fesd.simulate(m)
    assert 'nfe' in error.value.fix


@pytest.mark.parametrize('lay', [lambda m: move(m, 10), lambda m: collocate(m, 10, 2)], ids=['movable', 'fixed'])
def test_with_elements_already(lay):
    m = over_time(1, y=1.0)
    m.decay = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == -m.y[t])
    lay(m)
    with pytest.raises(FesdError, match='it has elements already, so nfe does not apply'):
        pyomo_fesd.simulate(m, nfe=20)


@pytest.mark.parametrize('keywords', [{'nfe': 0}, {'nfe': 'many'}, {'nfe': 20, 'ncp': 0}, {'nfe': 20, 'scheme': 'EULER'}])
def test_bad_options(keywords):
    m = signum.build()
    before = seen(m)
    with pytest.raises(FesdError, match=f'simulate: {list(keywords)[-1]}='):
        pyomo_fesd.simulate(m, **keywords)
    assert seen(m) == before


def test_accumulating_switches():
    m = two_tanks.build(10)
    dcs(m, hysteresis=m.hose)
    before = seen(m)
    with pytest.raises(FesdError, match=r'accumulate \(Zeno\): .*, their limit is about 8\n') as error:
        pyomo_fesd.simulate(m, nfe=30, ncp=2)
    assert seen(m) == before
    assert 7.9 < error.value.trajectory.index[-1] < 8
    assert len(pyomo_fesd.switches(error.value.trajectory)) > 5


def test_a_solution_that_ends():
    """dx/dt = x^2, x(0) = 1 bursts at t = 1."""
    m = over_time(2, x=1.0)
    m.level = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 2, m.dx[t] == m.x[t] ** 2], [m.x[t] >= 2, m.dx[t] == m.x[t] ** 2]])
    before = seen(m)
    with pytest.raises(FesdError, match=r'their limit is about 0\.997') as error:  # steps shrink
        pyomo_fesd.simulate(m, nfe=40)
    assert seen(m) == before
    assert error.value.trajectory.index[-1] > 0.997  # all elements that were solved


def test_a_time_limit():
    m = gas_liquid_tank.build()
    before = seen(m)
    with pytest.raises(FesdError, match='time limit'):
        pyomo_fesd.simulate(m, nfe=100000, time_limit=0.5)
    assert seen(m) == before


def test_an_error_in_the_model():
    m = signum.build()
    m.x[0].unfix()
    before = seen(m)
    with pytest.raises(FesdError, match=r'x\[0\]: simulate: this state is neither fixed'):
        pyomo_fesd.simulate(m, nfe=20)
    assert seen(m) == before


def test_an_interruption(monkeypatch):
    m = signum.build()
    before = seen(m)

    def interrupt(*args):
        raise KeyboardInterrupt

    monkeypatch.setattr('pyomo_fesd.simulation.marching_elements.MarchingElements._take_down', interrupt)
    with pytest.raises(KeyboardInterrupt):
        pyomo_fesd.simulate(m, nfe=20)
    assert seen(m) == before


# Reviews


def test_a_start_on_a_boundary_that_repels_is_said_once(caplog):
    m = over_time(1.5, x=0.0)
    m.sgn = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 0, m.dx[t] == -1], [m.x[t] >= 0, m.dx[t] == 1]])
    pyomo_fesd.simulate(m, nfe=40)
    assert ['not unique' in r.getMessage() for r in caplog.records] == [True]


def test_each_element_is_reviewed_once_on_physical_time(monkeypatch, caplog):
    seen_at = []

    def check(model, wrt, functions, largest):
        moving = moving_grids(model)[wrt]
        time = moving.physical_time()
        for element in moving.new_elements:
            seen_at.append((time[element.left], time[element.right]))
            yield "sgn: there is something here"

    monkeypatch.setitem(CHECKS, 'missed crossings', check)
    frame = pyomo_fesd.simulate(signum.build(), nfe=20)
    begin, end = zip(*seen_at)
    assert begin == pytest.approx([0, *end[:-1]], abs=1e-12) and end[-1] == pytest.approx(2)
    assert len(seen_at) == frame['element'].iloc[-1]
    assert [r.getMessage() for r in caplog.records] == ["sgn: there is something here"]


def test_uneven_growth_has_a_known_solution():
    # dx/dt = 1 until x = 1, then -2 (x - 1): to the switch at log 1 ... exact exponential afterwards
    m = over_time(3, x=0.0)
    m.mode = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 1, m.dx[t] == 2], [m.x[t] >= 1, m.dx[t] == m.x[t]]])
    frame = pyomo_fesd.simulate(m, nfe=60, scheme=LEGENDRE)
    assert [s.time for s in pyomo_fesd.switches(frame)] == pytest.approx([0.5], abs=1e-10)
    assert log(m.x[3].value) == pytest.approx(2.5, abs=1e-9)


def test_a_table_without_switches():
    m = transform(signum.build(), 10)
    with pytest.raises(FesdError, match='this table has none'):
        pyomo_fesd.switches(pyomo_fesd.trajectory(m))


def test_dumped(laid):
    assert len(pyomo_fesd.switches(pyomo_fesd.simulate(dumped.build(), nfe=40))) == 6


def test_without_anything_that_switches(laid):
    m = over_time(1, y=1.0)
    m.decay = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == -m.y[t])
    frame = pyomo_fesd.simulate(m, nfe=20)
    assert laid == TWO
    assert frame['y'].to_numpy() == pytest.approx(np.exp(-frame.index), abs=1e-6)
    assert pyomo_fesd.switches(frame) == []


@pytest.mark.parametrize('written', ['equation', 'named expression'])
def test_numbers_with_the_period_of_two_places(written, laid):
    m = over_time(2, y=1.0)
    m.wave = pyo.Expression(m.t, rule=lambda m, t: sin(2 * pi * t) + 2)
    m.decay = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == -(m.wave[t] if written == 'equation' else 1) * m.y[t])
    frame = pyomo_fesd.simulate(m, nfe=20, ncp=3)
    assert laid[-1] == 20
    rate = frame['wave'].to_numpy() if 'wave' in frame else np.full(len(frame), np.nan)
    assert np.ptp(rate) > 1.5


def test_one_point_in_each_element(laid):
    m = over_time(1, y=1.0)
    m.decay = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == -m.y[t])
    pyomo_fesd.simulate(m, nfe=20, ncp=1)
    assert laid == FEW


@pytest.mark.parametrize('part', [1e-3, 1e-6])
@pytest.mark.parametrize('above', [1.0, -2.0])
def test_a_switch_just_before_the_end_of_a_short_element(part, above):
    nfe, h = 1000, 0.01
    switch = 333 * h - part * h
    m = over_time(nfe * h, x=-switch)
    m.mode = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 0, m.dx[t] == 1], [m.x[t] >= 0, m.dx[t] == above]])
    frame = pyomo_fesd.simulate(m, nfe=nfe, ncp=2)
    assert [s.time for s in pyomo_fesd.switches(frame)] == pytest.approx([switch], abs=1e-9 * h)
