"""An IDAES flowsheet with an overflow weir written as a Disjunction over fs.time (needs the extra [idaes])."""

import pyomo.environ as pyo
import pytest

pytest.importorskip('idaes', reason="needs the extra: pip install -e '.[idaes]'")

import idaes_overflow as example  # noqa: E402

import pyomo_fesd  # noqa: E402


@pytest.fixture(scope='module')
def moving():
    return example.moving_grid(15, 2)


def test_overflow_starts_at_its_exact_time(moving):
    (switch,) = pyomo_fesd.switches(moving, moving.fs.time)
    assert abs(switch.time - example.OVERFLOW_TIME) <= 1e-6
    assert (switch.disjunction, switch.before, switch.after) == ('fs.weir', 'filling', 'sliding filling | overflowing')


def test_the_spurious_spike_of_the_fixed_grid_is_absent(moving):
    outflow = pyomo_fesd.trajectory(moving, moving.fs.time)[example.OUTFLOW]
    assert outflow.max() == pytest.approx(example.INFLOW, rel=1e-8)
    fixed = example.fixed_grid(15, 2)
    spiked = pyomo_fesd.trajectory(fixed, fixed.fs.time)[example.OUTFLOW]
    assert spiked.max() > 1.9 * example.INFLOW


def test_end_state_agrees_with_the_event_located_reference(moving):
    end, exact = pyomo_fesd.trajectory(moving, moving.fs.time).iloc[-1], example.reference()
    assert exact.overflow_time == pytest.approx(example.OVERFLOW_TIME, abs=1e-9)
    assert end[example.VOLUME] == pytest.approx(exact.volume, abs=1e-9)
    assert end[example.TEMPERATURE] == pytest.approx(exact.temperature, abs=1e-4)
    assert end[example.NAOH] == pytest.approx(exact.naoh, rel=1e-3)


def test_lengths_at_nominal_give_the_plain_collocation_answer():
    """With r = 1 fixed the transformed plant, its outflow given, is the plant that pyomo.dae discretises."""
    answers = []
    for moving_elements in (False, True):
        m = example.plant()
        if moving_elements:
            pyo.TransformationFactory('fesd.finite_elements').apply_to(m.fs, wrt=m.fs.time, nfe=6, ncp=2)
        else:
            pyo.TransformationFactory('dae.collocation').apply_to(m.fs, wrt=m.fs.time, nfe=6, ncp=2)
        example.initialise(m)
        m.fs.cstr.outlet.flow_vol.fix(1e-3)
        pyo.SolverFactory('mpec_hybrid').solve(m)
        answers.append(m.fs.cstr.outlet.temperature[m.fs.time.last()].value)
    assert answers[0] == pytest.approx(answers[1], abs=1e-9)


def test_a_steady_flowsheet_has_no_continuous_set_and_is_told_so():
    from idaes.core import FlowsheetBlock

    m = pyo.ConcreteModel()
    m.fs = FlowsheetBlock(dynamic=False)
    with pytest.raises(pyomo_fesd.FesdError, match='dynamic=True'):
        pyo.TransformationFactory('fesd.finite_elements').apply_to(m.fs, wrt=m.fs.time, nfe=2, ncp=2)


def test_without_elements_on_the_flowsheet():
    m = example.build()
    example.initialise(m)
    frame = pyomo_fesd.simulate(m.fs, m.fs.time, nfe=15, ncp=3)
    assert [s.time for s in pyomo_fesd.switches(frame)] == pytest.approx([example.OVERFLOW_TIME], rel=1e-9)
    assert list(m.fs.time) == [0, example.END]
    assert m.fs.cstr.volume[example.END].value == pytest.approx(example.CREST_VOLUME, rel=1e-9)
