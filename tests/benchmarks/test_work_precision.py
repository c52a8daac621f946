"""The methods of the work-precision study solve its problems, each to its accuracy."""

import numpy as np
import pandas as pd
import pyomo.environ as pyo
import pytest
from benchmarks.work_precision import fronts
from benchmarks.work_precision.charts import NEAR, spread
from benchmarks.work_precision.models import smooth
from benchmarks.work_precision.runs import (
    BIG_M,
    CONTROLS,
    EVENTS,
    EXACT,
    FIXED,
    NOSNOC,
    OURS,
    PROBLEMS,
    REFINE,
    RUNS,
    SIMULATE,
    SQRT,
    TANH,
    TIGHT_STEPS,
    Run,
)
from benchmarks.work_precision.systems import Found, errors, reached
from benchmarks.work_precision.worker import row_of

import pyomo_fesd

#: problem -> K, N of a quick run
GRIDS = {
    'signum': (2, 4),
    'tank': (3, 12),
    'oscillator': (4, 20),
    'sensitivity': (2, 4),
    'false minima': (2, 10),
    'tank control': (3, 10),
    'sliding-mode control': (2, 12),
}
#: Largest error of each method there
PRECISE = {OURS: 5e-5, SIMULATE: 1e-5, REFINE: 1e-6, EVENTS: 1e-7}
ROUGH = {FIXED: 0.35, BIG_M: 0.35, TANH: 0.5, SQRT: 0.5}
TOLERANCES = {EVENTS: 1e-10, REFINE: 1e-6}
PAIRS = dict.fromkeys((r.problem, r.method) for r in RUNS)


def quick(problem, method, N=None, K=None):
    """The row of a quick run."""
    points, number = GRIDS[problem]
    width, start = TOLERANCES.get(method, 1e-2), -1.4 if problem == 'false minima' else 0.0
    return row_of(Run(problem, method, 'Radau', K or points, N or number, width, start), 30)


@pytest.fixture(autouse=True)
def once(monkeypatch):
    """Do not repeat short runs, whose times do not matter here."""
    monkeypatch.setattr('benchmarks.work_precision.worker.SHORT', 0)


@pytest.mark.parametrize('problem, method', [p for p in PAIRS if p[0] in GRIDS and p[1] in PRECISE], ids=str)
def test_methods_that_find_switches_are_precise(problem, method):
    row = quick(problem, method)
    assert row['claimed'], row['status']
    assert row['error'] < PRECISE[method]


def test_the_control_of_the_tank_is_found_on_a_coarse_grid():
    assert quick('tank control', OURS, K=2)['error'] < PRECISE[OURS]


@pytest.mark.parametrize(
    'problem, method', [p for p in PAIRS if p[0] in ('signum', 'tank', 'oscillator') and p[1] in ROUGH], ids=str
)
def test_methods_on_fixed_grids_are_rough(problem, method):
    row = quick(problem, method, N=40, K=1 if problem == 'signum' else 2)
    assert row['claimed'], row['status']
    assert 1e-4 < row['error'] < ROUGH[method]


@pytest.mark.parametrize('method', [FIXED, TANH, SQRT])
def test_fixed_grids_miss_the_sensitivity(method):
    assert quick('sensitivity', method, N=40)['error sensitivity'] > 0.1


def test_a_binary_step_is_infeasible_where_a_slide_begins():
    assert quick('signum', BIG_M, N=20, K=1)['status'] == 'provenInfeasible'


@pytest.mark.parametrize('method', [FIXED, TANH])
def test_fixed_grids_have_false_minima(method):
    row = quick('false minima', method)
    assert row['claimed'], row['status']
    assert row['error x0'] > NEAR


@pytest.mark.parametrize('method', [NOSNOC, TIGHT_STEPS])
@pytest.mark.parametrize('problem', ['signum', 'tank'])
def test_nosnoc_solves_the_same_systems(problem, method):
    pytest.importorskip('nosnoc', reason='the peer is no dependency: pip install nosnoc==0.2.0')
    row = quick(problem, method)
    assert row['claimed'], row['status']
    assert row['error'] < 1e-5


def test_nosnoc_moves_a_free_start():
    pytest.importorskip('nosnoc', reason='the peer is no dependency: pip install nosnoc==0.2.0')
    row = quick('false minima', NOSNOC)
    assert -2 <= row['x0'] <= -0.8
    truth = -(row['x0'] ** 3) / 9 + (2 + row['x0'] / 3) ** 3 / 3 + (1 / 3 + row['x0'] / 3) ** 2
    assert row['error objective'] == pytest.approx(truth / EXACT['false minima']['objective'] - 1, abs=1e-6)


@pytest.mark.parametrize('name', ['friction motor', 'cart-pole'])
def test_the_larger_control_problems_are_built_on_all_grids(name):
    problem, stages = CONTROLS[name], CONTROLS[name].module.STAGES
    assert len(pyomo_fesd.element_lengths(problem.moving(2, 2 * stages, 'Radau'))) == 2 * stages
    m = problem.fixed(1, stages, 'Radau')
    assert len(m.hold) == 1  # the value at the first time; one point in each stage
    assert len(smooth(m, lambda c: 1 / (1 + pyo.exp(-c))).mixture) == len(m.t)


def test_mixtures_are_the_modes_on_their_sides():
    m = smooth(PROBLEMS['signum'].fixed(1, 2, 'Radau'), lambda c: pyo.tanh(100 * c) / 2 + 0.5)
    m.dx[1, 0].set_value(0.0)
    for x, rate in ((-1, 3), (1, 1)):
        m.x[1, 0].set_value(x)
        assert pyo.value(m.mixture[2].body) - m.mixture[2].upper == pytest.approx(-rate)


@pytest.mark.parametrize(
    'values, time', [((-2, -1, 1, 2), 1.5), ((2, 1, 0, 0), 2), ((1, 1, 1, 1), None), ((0.5, 1e-9, -0.5, -1), 1)]
)
def test_time_at_which_a_surface_is_reached(values, time):
    assert reached((0, 1, 2, 3), values) == time


def test_errors_of_the_known_quantities():
    found = Found('', True, 0, 0, state=[1.0, 7.0], switch=None, objective=200.0, control=[0.1, 0.3])
    exact = {'state': {0: 1.5}, 'switch': 1.0, 'objective': 250.0, 'control': 0.1}
    assert errors(exact, found) == pytest.approx({'state': 0.5 / 1.5, 'objective': 0.2, 'control': 0.2})


def test_a_front_holds_the_runs_that_no_other_run_beats():
    rows = pd.DataFrame(
        {
            'cpu': [1.0, 2.0, 3.0, 4.0, 0.5],
            'error': [1e-2, 1e-1, 1e-4, 1e-3, 1e-9],
            'claimed': [True, True, True, True, False],
        }
    )
    times, found = fronts.front(rows)
    assert times.tolist() == [1, 3]
    assert found.tolist() == [1e-2, 1e-4]
    assert fronts.time_at(rows, 1e-3) == pytest.approx(3**0.5)
    assert fronts.time_at(rows, 1e-5) == np.inf
    assert fronts.time_at(rows, 1.0) == 1


def test_slopes():
    N = np.array([10.0, 20, 40])
    assert fronts.slope(N, 3 * N**-5) == pytest.approx(5)


def test_labels_keep_their_order_and_distance():
    heights = spread([0.0, 0.01, 0.99, 1.3])
    assert all(np.diff(heights) >= 0.0649)
    assert heights[-1] <= 1


def test_no_run_stands_twice_in_the_table():
    assert len(RUNS) == len(set(RUNS))
