"""Right limits of arguments that jump with the modes or with held controls."""

import logging

import pyomo.environ as pyo
import pytest
import signum

import pyomo_fesd
from pyomo_fesd.core import moving_grids
from tests.models import dcs
from tests.problems import ratio, set_point
from tests.problems.running import LEGENDRE, RADAU, move, solve, transform

RUNS = {'simulate': pyomo_fesd.simulate, 'solve': solve}


def test_a_model_without_such_arguments_gets_nothing():
    m = transform(signum.build(), 4)
    assert moving_grids(m)[m.t].limits is None


def test_every_element_has_copies_of_the_argument_and_of_what_determines_it(caplog):
    with caplog.at_level(logging.WARNING, 'pyomo_fesd'):
        m = transform(ratio.build(1.5), 4)
    assert not caplog.messages
    moving = moving_grids(m)[m.t]
    for n in range(1, 5):
        # s, w, r with the equations of w and r
        assert sum(1 for e, _ in moving.limits.copy if e == n) == 3
        assert sum(1 for e, _ in moving.limits.copied if e == n) == 2
    (kink,) = [c for c in moving.complementarities if c.has_right_limits]
    assert kink.continuous == (True, True) and set(kink.starts) == {1, 2, 3, 4}


@pytest.mark.parametrize('how', RUNS)
@pytest.mark.parametrize('scheme', [RADAU, LEGENDRE])
@pytest.mark.parametrize('b', [0.5, 1.1, 1.2, 1.5, 1.9])
def test_a_kink_of_an_argument_that_jumps_with_a_mode(b, scheme, how):
    m = transform(ratio.build(b), 4, scheme=scheme)
    RUNS[how](m)
    assert m.y[2].value == pytest.approx(ratio.exact(b), abs=1e-9)


@pytest.mark.parametrize('nfe', [4, 5])
@pytest.mark.parametrize('argument', ['variable', 'expression'])
@pytest.mark.parametrize('b', [1.1, 1.5])
def test_with_hysteresis_and_as_an_expression(b, argument, nfe):
    m = ratio.build(b, argument)
    move(dcs(m, hysteresis=[m.gear]), nfe, 2)
    pyomo_fesd.simulate(m)
    assert m.y[2].value == pytest.approx(ratio.exact(b), abs=1e-9)


@pytest.mark.parametrize('b', [1.2, 1.5])
def test_the_slope_through_jump_and_kink_is_certified(b):
    m = transform(ratio.build(b), 5)
    m.cost = pyo.Objective(expr=(m.y[2] - ratio.exact(b, 1.2)) ** 2)
    pyomo_fesd.simulate(m)
    m.k.unfix()
    results = pyo.SolverFactory('mpec_hybrid').solve(m, warm_start=True)
    assert results.solver.stationarity == 'B'
    assert m.k.value == pytest.approx(1.2, abs=1e-6)


@pytest.mark.parametrize('how', RUNS)
@pytest.mark.parametrize('U', [0.5, 1.05, 1.1, 1.3])
@pytest.mark.parametrize('kind, form', [('mode', 'heaviside'), ('mode', 'stewart'), ('kink', 'auto')])
def test_a_switch_just_after_a_set_point_has_changed(kind, form, U, how):
    m = set_point.build(U, kind)
    move(dcs(m, form=form), 6, 2, piecewise_constant=[m.u])
    RUNS[how](m)
    assert m.y[2].value == pytest.approx(set_point.exact(U, kind), abs=1e-8)
