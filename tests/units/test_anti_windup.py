"""u = I + a t with dI/dt = 1 while -1 <= u <= 1."""

import pyomo.environ as pyo
import pytest

import pyomo_fesd
from pyomo_fesd.units import anti_windup
from tests.units.support import plant, rate, solved, switching_times


def integrator(a, low=-1):
    m = plant(3, I=0.0, s=0.0)
    m.rest = anti_windup(m.t, integral_rate=m.dI, rate=1, command=lambda m, t: m.I[t] + m.s[t], low=low, high=1)
    rate(m, 's', lambda m, t: a)
    return m


def test_the_integrator_rests_beyond_the_limit():
    m = solved(integrator(0.5))
    assert switching_times(m) == pytest.approx([2 / 3], abs=1e-9)
    assert m.I[3].value == pytest.approx(2 / 3, abs=1e-9)


def test_it_slides_where_resting_lets_the_command_fall_back():
    m = integrator(-0.5)
    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=8, ncp=3)
    assert pyo.SolverFactory('mpec_hybrid').solve(m).solver.stationarity == 'B'
    assert switching_times(m) == pytest.approx([2], abs=1e-9)
    assert m.I[3].value == pytest.approx(2.5, abs=1e-9)


def test_refused():
    with pytest.raises(pyomo_fesd.FesdError, match='not below'):
        integrator(1, low=2)


@pytest.mark.parametrize('gain', [0.0, 0.1])
def test_a_derivative_counts_in_the_command_only_with_a_gain(gain):
    """A PID controller whose derivative gain is fixed to 0 is a PI controller."""
    m = plant(3, I=0.0, s=0.0)
    m.gain = pyo.Var(initialize=gain)
    m.gain.fix()
    m.rest = anti_windup(m.t, integral_rate=m.dI, rate=1, command=lambda m, t: m.I[t] + m.s[t] + m.gain * m.ds[t], low=-1, high=1)
    rate(m, 's', lambda m, t: 0.5)
    if gain:
        with pytest.raises(pyomo_fesd.FesdError, match="the region condition contains the derivative"):
            pyo.TransformationFactory('fesd.dcs').apply_to(m)
    else:
        assert solved(m).I[3].value == pytest.approx(2 / 3, abs=1e-9)
