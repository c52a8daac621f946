"""The additions on IDAES flowsheets: the five examples against event-located references (needs the extra [idaes])."""

import pyomo.environ as pyo
import pytest

pytest.importorskip('idaes', reason="needs the extra: pip install -e '.[idaes]'")

import flash  # noqa: E402
import idaes_boiling  # noqa: E402
import idaes_level  # noqa: E402
import idaes_relief  # noqa: E402
import idaes_startup  # noqa: E402
import idaes_two_tanks  # noqa: E402

import pyomo_fesd  # noqa: E402
from tests.units.support import assert_units_consistent  # noqa: E402


@pytest.fixture(scope='module')
def tanks():
    return idaes_two_tanks.moving_grid(nfe=20)[0]


def test_both_tanks_overflow_at_their_exact_times(tanks):
    first, second = pyomo_fesd.switches(tanks, tanks.fs.time)
    exact = idaes_two_tanks.reference()
    assert exact.times == pytest.approx([idaes_two_tanks.OVERFLOW_TIME, idaes_two_tanks.SECOND_TIME], abs=1e-8)
    assert (first.time, second.time) == pytest.approx(exact.times, abs=1e-6)


def test_sodium_is_neither_made_nor_lost_and_nothing_spikes(tanks):
    assert abs(idaes_two_tanks.balance(tanks)) < 1e-8 * idaes_two_tanks.FED
    table = pyomo_fesd.trajectory(tanks, tanks.fs.time)
    assert max(table[flow].max() for flow in idaes_two_tanks.OUTFLOWS) == pytest.approx(idaes_two_tanks.INFLOW, rel=1e-8)


def test_the_product_agrees_with_scipy(tanks):
    end, exact = pyomo_fesd.trajectory(tanks, tanks.fs.time).iloc[-1], idaes_two_tanks.reference()
    assert end[idaes_two_tanks.TEMPERATURE] == pytest.approx(exact.temperature, abs=1e-5)
    assert end[idaes_two_tanks.NAOH] == pytest.approx(exact.naoh, rel=1e-3)


def test_a_weir_adds_neither_variables_nor_equations_and_has_the_flowsheets_units(tanks):
    last = tanks.fs.weir[tanks.fs.time.last()]
    assert not list(last.component_data_objects((pyo.Var, pyo.Constraint)))
    assert_units_consistent(last)


@pytest.fixture(scope='module')
def level():
    return idaes_level.moving_grid(nfe=20, ncp=3)[0]


def test_the_valve_saturates_at_its_times_and_exactly(level):
    found, (known, end) = idaes_level.changes(level), idaes_level.reference()
    assert [c.now for c in found] == [c.now for c in known] == ['follows', 'closed', 'follows']
    assert [c.time for c in found] == pytest.approx([c.time for c in known], abs=1e-3)
    flow = pyomo_fesd.trajectory(level, level.fs.time)[idaes_level.FLOW]
    assert flow.max() == pytest.approx(idaes_level.OPEN, abs=1e-12) and abs(flow.min()) < 1e-12
    assert level.fs.cstr.volume[idaes_level.END].value == pytest.approx(end, abs=1e-5)


def test_it_is_the_limit_of_the_smooth_bound(level):
    """On the same elements a tenth of the smoothing leaves less than a tenth of the difference."""
    far, near = (idaes_level.largest_difference(level, idaes_level.smooth(eps, level)) for eps in (1e-4, 1e-5))
    assert near < far / 10


def test_saturation_is_smaller_than_the_replaced_bound(level):
    by_hand = idaes_level.move(idaes_level.exact_by_hand(idaes_level.build()), 20, 3)
    small, large = pyomo_fesd.report(idaes_level.specify(by_hand)), pyomo_fesd.report(level)
    assert large['variables'] - small['variables'] == len(level.fs.time) and large['pairs'] == small['pairs']


def test_a_relief_valve_remembers():
    m, results = idaes_relief.solve(nfe=60)
    assert results.solver.stationarity == 'B'
    found, (known, end) = pyomo_fesd.switches(m, m.fs.time), idaes_relief.reference()
    assert found[0].time == pytest.approx(idaes_relief.CATCHES_UP, abs=1e-8)
    assert [s.time for s in found] == pytest.approx(known, abs=5e-3)
    assert [s.after for s in found[1:3]] == ['open', 'closed']
    assert_units_consistent(m.fs.relief[0].open)
    assert [pyo.value(m.fs.pressure[idaes_relief.END, i]) for i in (1, 2)] == pytest.approx(list(end), abs=5e-4)


def test_the_package_boils_and_is_dry_at_its_times():
    rounded = idaes_boiling.smooth(nfe=12)
    m = idaes_boiling.exact(rounded.clone())
    assert idaes_boiling.solve(m).solver.stationarity == 'B'
    assert idaes_boiling.switching_times(m) == pytest.approx(flash.EXACT, abs=1e-6)
    idaes_boiling.solve(rounded)
    assert idaes_boiling.largest_error(m) < 1e-8 < 1e-5 < idaes_boiling.largest_error(rounded)


def test_start_up_is_certified_and_the_overflow_moves():
    m = idaes_startup.begin()
    (before,), lost = pyomo_fesd.switches(m, m.fs.time), pyo.value(m.fs.lost)
    assert idaes_startup.solve(m).solver.stationarity == 'B'
    (after,) = pyomo_fesd.switches(m, m.fs.time)
    assert before.time == pytest.approx(300, abs=1e-6)
    assert pyo.value(m.fs.lost) == pytest.approx(0.439153, abs=1e-5) and pyo.value(m.fs.lost) < 0.9 * lost
    # the vessel is full when the first feed has filled it
    fill = (idaes_startup.CREST_VOLUME - 0.6) / idaes_startup.feeds(m)[0]
    assert after.time == pytest.approx(fill, abs=1e-6)
    assert pyo.value(m.fs.product) == pytest.approx(idaes_startup.PRODUCT, abs=1e-8)
