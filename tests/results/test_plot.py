"""Pictures of trajectories: what is in which panel."""

import bouncing_ball
import gas_liquid_tank
import matplotlib.pyplot
import numpy as np
import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
import signum
from matplotlib.figure import Figure

import pyomo_fesd
from pyomo_fesd import FesdError
from tests.models import dcs
from tests.problems import air_friction, free_start, sliding, two_systems, weir
from tests.problems.running import LEGENDRE, SCHEMES, move, run, solve, transform


@pytest.fixture(scope='module')
def solved():
    """Signum, five Radau elements of two points."""
    return run(signum.build(), nfe=5, ncp=2)


def labels(figure):
    """Vertical labels of the panels."""
    return [axis.get_ylabel() for axis in figure.axes]


def verticals(axis, style):
    """Times of the vertical lines of one style, through the whole panel."""
    lines = [line for line in axis.lines if len(line.get_xdata()) == 2 and np.ptp(line.get_xdata()) == 0]
    return sorted(float(line.get_xdata()[0]) for line in lines if line.get_linestyle() == style)


def curves(axis):
    """The lines that are no verticals."""
    return [line for line in axis.lines if np.ptp(line.get_xdata()) > 0]


def test_each_name_is_a_panel_over_the_common_time(solved):
    figure = pyomo_fesd.plot(solved, solved.t, ['x', 'sgn: below', 'dx'])
    assert labels(figure) == ['x', 'sgn: below', 'dx']
    assert [axis.get_xlabel() for axis in figure.axes] == ['', '', 't']
    assert len({axis.get_xlim() for axis in figure.axes}) == 1


def test_a_state_is_drawn_through_all_its_points(solved):
    (line,) = curves(pyomo_fesd.plot(solved, solved.t, ['x']).axes[0])
    frame = pyomo_fesd.trajectory(solved)
    assert line.get_xdata().tolist() == frame.index.tolist()
    assert line.get_ydata().tolist() == frame['x'].tolist()


@pytest.mark.parametrize('scheme', SCHEMES)
def test_a_multiplier_is_drawn_element_by_element_and_jumps_at_the_switch(scheme):
    m = run(signum.build(), nfe=5, ncp=2, scheme=scheme)
    pieces = curves(pyomo_fesd.plot(m, m.t, ['sgn: below']).axes[0])
    ends = pyomo_fesd.element_lengths(m)
    assert [p.get_xdata()[0] for p in pieces] == pytest.approx(ends['start'].tolist())
    assert [p.get_xdata()[-1] for p in pieces] == pytest.approx(ends['end'].tolist())
    for piece, end in zip(pieces, ends['end']):
        assert piece.get_ydata() == pytest.approx(np.full(len(piece.get_ydata()), 1 if end < 2 / 3 + 1e-6 else 0), abs=1e-9)
    assert len({piece.get_color() for piece in pieces}) == 1


def test_switches_are_dashed_lines_in_every_panel(solved):
    for axis in pyomo_fesd.plot(solved, solved.t, ['x', 'dx']).axes:
        assert verticals(axis, '--') == pytest.approx([2 / 3], abs=1e-9)


def test_element_boundaries_are_marked(solved):
    (axis,) = pyomo_fesd.plot(solved, solved.t, ['x']).axes
    assert verticals(axis, '-') == pytest.approx(pyomo_fesd.element_lengths(solved)['end'].tolist())


def test_the_name_of_a_disjunction_takes_all_its_modes(solved):
    (axis,) = pyomo_fesd.plot(solved, solved.t, ['sgn']).axes
    assert [text.get_text() for text in axis.get_legend().get_texts()] == ['below', 'above']
    assert len({line.get_color() for line in curves(axis)}) == 2


def test_the_name_of_an_indexed_variable_takes_all_its_columns():
    m = solve(move(weir.build_series(), 6, 1))
    (axis,) = pyomo_fesd.plot(m, m.t, ['V']).axes
    assert [text.get_text() for text in axis.get_legend().get_texts()] == ['V[1]', 'V[2]']


def test_a_name_is_not_taken_for_the_beginning_of_another():
    m = states(collocation)
    m.xy = pyo.Var(m.t, initialize=2)
    (axis,) = pyomo_fesd.plot(m, m.t, ['x']).axes
    assert len(curves(axis)) == 1 and axis.get_legend() is None


def test_units_label_the_axis(solved):
    figure = pyomo_fesd.plot(solved, solved.t, ['x', 'dx'], units={'x': 'level (m)'})
    assert labels(figure) == ['level (m)', 'dx']


def test_without_names_the_differential_states_and_all_multipliers_are_drawn():
    m = run(gas_liquid_tank.build(), nfe=10)
    assert set(labels(pyomo_fesd.plot(m))) in (
        {'M_G', 'M_L', 'outlet: liquid', 'outlet: gas'},
        {'M_G', 'M_L', 'outlet'},
    )


def test_several_disjunctions_have_all_their_switches_in_every_panel():
    m = run(two_systems.build(), nfe=8)
    for axis in pyomo_fesd.plot(m, names=['x', 'friction']).axes:
        assert verticals(axis, '--') == pytest.approx([time for time, _ in two_systems.SWITCHES], abs=1e-8)


@pytest.mark.parametrize('name', ['y', 'sgn: beside', 'X'])
def test_an_unknown_name_is_refused_with_those_that_there_are(solved, name):
    with pytest.raises(FesdError, match=f'^{name}: plot: no trajectory of this name') as error:
        pyomo_fesd.plot(solved, solved.t, ['x', name])
    assert 'x, dx, sgn: below, sgn: above' in error.value.fix


def test_the_figure_is_saved_as_a_png_and_not_shown(solved, tmp_path):
    figure = pyomo_fesd.plot(solved)
    figure.savefig(tmp_path / 'signum.png')
    assert (tmp_path / 'signum.png').read_bytes().startswith(b'\x89PNG')
    assert isinstance(figure, Figure) and matplotlib.pyplot.get_fignums() == []


def test_a_slide_is_drawn():
    m = run(sliding.build(), nfe=5)
    pieces = curves(pyomo_fesd.plot(m, m.t, ['friction: rising']).axes[0])
    assert pieces[-1].get_ydata() == pytest.approx([0.5] * 3, abs=1e-8)


@pytest.mark.parametrize('name', ['element', 'label'])
def test_a_variable_with_the_name_of_an_own_column_does_not_spoil_the_picture(name):
    m = signum.build()
    m.add_component(name, pyo.Var(m.t, initialize=5.0))
    run(m, nfe=5)
    pieces = curves(pyomo_fesd.plot(m, m.t, ['sgn: below']).axes[0])
    assert [p.get_xdata()[-1] for p in pieces] == pytest.approx(pyomo_fesd.element_lengths(m)['end'].tolist())


# Ordinary models


def states(discretise):
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2))
    m.x = pyo.Var(m.t, initialize=1)
    m.dx = dae.DerivativeVar(m.x)
    discretise(m)
    return m


def collocation(m, **keywords):
    pyo.TransformationFactory('dae.collocation').apply_to(m, wrt=m.t, nfe=3, ncp=2, **keywords)


def difference(m, scheme='BACKWARD'):
    pyo.TransformationFactory('dae.finite_difference').apply_to(m, wrt=m.t, nfe=3, scheme=scheme)


ORDINARY = {'Radau': collocation, 'Legendre': lambda m: collocation(m, scheme=LEGENDRE), 'backward': difference}


@pytest.mark.parametrize('kind', ORDINARY)
def test_an_ordinary_model_is_drawn(kind):
    m = states(ORDINARY[kind])
    (axis,) = pyomo_fesd.plot(m, m.t, ['x']).axes
    (line,) = curves(axis)
    assert line.get_xdata().tolist() == list(m.t)
    assert verticals(axis, '--') == []


@pytest.mark.parametrize(
    'discretise, cause', [(lambda m: None, 'not discretised yet'), (lambda m: difference(m, 'CENTRAL'), 'CENTRAL Difference')]
)
def test_a_model_without_elements_is_not_drawn(discretise, cause):
    m = states(discretise)
    with pytest.raises(FesdError, match=f'^t: .*{cause}'):
        pyomo_fesd.plot(m, m.t, ['x'])


def test_multipliers_on_a_backward_difference_are_drawn():
    m = solve(move(dcs(free_start.build(-2, discretise=difference))))
    assert len(curves(pyomo_fesd.plot(m, m.t, ['sgn: mode 1']).axes[0])) == 3


def test_a_state_that_jumps_is_drawn_as_it_is_on_both_sides():
    m = move(bouncing_ball.build(), 10, 2)
    pyomo_fesd.simulate(m)
    figure = pyomo_fesd.plot(m, m.t)
    assert labels(figure) == ['q', 'v']
    (line,) = curves(figure.axes[1])
    time, v = line.get_xdata(), line.get_ydata()
    at = np.flatnonzero(np.diff(time) == 0)
    assert time[at].tolist() == pytest.approx(bouncing_ball.impacts(), abs=1e-7)
    assert v[at + 1].tolist() == pytest.approx((-v[at]).tolist())
    assert verticals(figure.axes[1], '--') == pytest.approx(bouncing_ball.impacts(), abs=1e-7)


def test_multipliers_beside_jumps_are_drawn_element_by_element():
    m = transform(air_friction.build(), 10, 2)
    pyomo_fesd.simulate(m)
    lines = curves(pyomo_fesd.plot(m, m.t, ['drag: mode 1']).axes[0])
    assert len(lines) == 10
    assert all(np.ptp(line.get_ydata()) <= 1e-9 for line in lines)
