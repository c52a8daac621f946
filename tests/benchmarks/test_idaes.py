"""Published IDAES models with a switch, against a reference that uses nothing of the package; the reference against scipy."""

import logging
import warnings

import pytest
from scipy.integrate import solve_ivp

pytest.importorskip('idaes', reason="needs the extra: pip install -e '.[idaes]'")

logging.getLogger('idaes').setLevel(logging.ERROR)
with warnings.catch_warnings():
    warnings.simplefilter('ignore')  # marks of IDAES' own tests that are not registered here
    from benchmarks.idaes.cases import CASES
    from benchmarks.idaes.run import Run, reference


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
    ((time, *_),) = (found := reference(CASES['simple CSTR'], 10, None)).switches
    assert time == pytest.approx(before.t[-1], abs=1e-6)
    assert [found.end[f'conc[5,{j}]'] for j in 'AB'] == pytest.approx(after.y[:, -1], abs=1e-6)


#: Model, elements, bounds on the errors of the switching time and, relatively, of the end state: those of the grid.
FAST = [
    ('simple CSTR', 20, 5e-4, 2e-5),
    ('CSTR', 10, 1e-4, 1e-6),
    ('lumped heat exchanger', 5, 1e-6, 1e-6),
    ('PID pump', 20, 2e-3, 1e-4),
]


@pytest.mark.parametrize('name, elements, time, end', FAST, ids=[case[0] for case in FAST])
def test_a_published_model_switches_where_the_reference_does(name, elements, time, end):
    row = Run(name, elements).measure()
    assert row['status'] == 'optimal', row
    assert row['switches'] == row['of reference'] == 1
    assert row['largest difference'] <= time and row['end state'] <= end
