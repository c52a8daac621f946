"""Published IDAES models with a switch, against a reference that uses nothing of the package; the reference against scipy."""

import logging
import warnings
from math import cos, exp, sin

import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
from scipy.integrate import solve_ivp

pytest.importorskip('idaes', reason="needs the extra: pip install -e '.[idaes]'")

logging.getLogger('idaes').setLevel(logging.ERROR)
with warnings.catch_warnings():
    warnings.simplefilter('ignore')  # marks of IDAES' own tests that are not registered here
    from benchmarks.idaes.cases import CASES
    from benchmarks.idaes.reference import Equations, integrate
    from benchmarks.idaes.run import Run, built, reference


def test_the_reference_agrees_with_scipy():
    """The isothermal reactor as an ODE with a located event."""

    def rate(t, c, feed):
        return [feed - c[0] - c[0], -c[1] + c[0]]

    def diluted(t, c, feed):
        return c[1] - 1.5

    diluted.terminal = True
    exact = {'rtol': 1e-12, 'atol': 1e-13, 'method': 'DOP853'}
    before = solve_ivp(rate, (0, 5), [0, 0], args=(5,), events=diluted, **exact)
    after = solve_ivp(rate, (before.t[-1], 5), before.y[:, -1], args=(4,), **exact)
    case = CASES['simple CSTR']
    ((time, *_),) = (found := reference(case, built(case, 10), None)).switches
    assert time == pytest.approx(before.t[-1], abs=1e-6)
    assert [found.end[f'conc[5,{j}]'] for j in 'AB'] == pytest.approx(after.y[:, -1], abs=1e-6)


def test_the_reference_integrates_a_dae_of_higher_index():
    """x = 1e6 sin^4 t, y = dx/dt, z = dy/dt: index 3."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2))
    m.s, m.x, m.y, m.z = (pyo.Var(m.t, initialize=0) for _ in range(4))
    m.ds, m.dx, m.dy = dae.DerivativeVar(m.s), dae.DerivativeVar(m.x), dae.DerivativeVar(m.y)
    for v in (m.s, m.x, m.y):
        v[0].fix(0)
    m.clock = pyo.Constraint(m.t, rule=lambda m, t: m.ds[t] == 1)
    m.first = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.y[t])
    m.second = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == m.z[t])
    m.tied = pyo.Constraint(m.t, rule=lambda m, t: m.x[t] == 1e6 * pyo.sin(m.s[t]) ** 4)
    pyo.TransformationFactory('dae.collocation').apply_to(m, wrt=m.t, nfe=2, ncp=3)
    found = integrate([(2, Equations(m, m.t, 2))], tolerance=1e-6).end
    assert found['y[2]'] == pytest.approx(4e6 * sin(2) ** 3 * cos(2), rel=1e-5)


#: Model, elements, bounds on the errors of the switching time and, relatively, of the end state: those of the grid.
FAST = [
    ('simple CSTR', 20, 5e-4, 2e-5),
    ('CSTR', 10, 1e-4, 1e-6),
    ('lumped heat exchanger', 5, 1e-6, 1e-6),
    ('PID pump', 20, 2e-3, 1e-4),
    ('steam tanks, windup', 10, 5e-2, 2e-3),
    ('gas pipeline', 5, 1e-5, 1e-6),
    ('temperature-swing adsorption', 5, 1e-8, 1e-7),
]


@pytest.mark.parametrize('name, elements, time, end', FAST, ids=[case[0] for case in FAST])
def test_a_published_model_switches_where_the_reference_does(name, elements, time, end):
    row = Run(name, elements).measure()
    assert row['status'] == 'optimal', row
    assert row['switches'] == row['of reference'] == (2 if 'tanks' in name else 1)
    assert row['largest difference'] <= time and row['end state'] <= end


def test_the_largest_state_on_the_way_is_that_of_all_stages():
    case = CASES['simple CSTR']
    m = built(case, 10)
    case.switch(m)
    found = integrate([(end, Equations(m, m.time, end)) for end in (2.5, 5)])
    ((time, *_),) = found.switches
    assert found.scale['conc[5,A]'] == pytest.approx(2.5 * (1 - exp(-2 * time)), rel=1e-6)
