"""The SX graph as a Pyomo model, and executables that are found by their path, take too long, or break down."""

import os
import time

import casadi as ca
import numpy as np
import pyomo.environ as pyo
import pytest

from pyomo_fesd import FesdError
from pyomo_fesd.mpcc.nlp.deadline import Deadline
from pyomo_fesd.mpcc.nlp.solver import nlp_solver
from pyomo_fesd.mpcc.nlp.sx_to_pyomo import sx_to_pyomo

x, p = ca.SX.sym('x', 2), ca.SX.sym('p')
a, b = x[0], x[1]
ROWS = [
    a + b - p * a * b / (a - 3 * b),
    -a + 2 * a + 1 / b + a**2 + b**3 + a**b + a**1.5 + b**p,
    ca.exp(a) + ca.log(b) + ca.log10(a) + ca.sqrt(a * b) + ca.fabs(a - b) + ca.log1p(a) + ca.expm1(b),
    ca.sin(a) + ca.cos(b) + ca.tan(a) + ca.asin(a) + ca.acos(b) + ca.atan(a),
    ca.sinh(a) + ca.cosh(b) + ca.tanh(a) + ca.asinh(a) + ca.acosh(1 + b) + ca.atanh(a),
    ca.floor(7 * a) + ca.ceil(7 * b) + 4.0,
]


def test_operations_have_the_values_of_casadi():
    f, g = ca.sin(a * b) ** 2, ca.vertcat(*ROWS)
    m = sx_to_pyomo(x, p, f, g)
    m.x[0], m.x[1], m.p[0] = 0.3, 0.7, 1.7
    wanted_f, wanted_g = ca.Function('values', [x, p], [f, g])([0.3, 0.7], 1.7)
    assert pyo.value(m.f) == pytest.approx(float(wanted_f))
    assert [pyo.value(m.g[i].body) for i in range(len(ROWS))] == pytest.approx(wanted_g.full().ravel())


def test_other_operations_are_refused_by_name():
    with pytest.raises(FesdError, match='OP_FMAX'):
        sx_to_pyomo(x, p, ca.fmax(a, b), ca.SX(0, 1))


def test_shared_expressions_stay_shared(tmp_path):
    deep = a
    for _ in range(60):  # 2^60 terms if each use were written out
        deep = ca.sin(deep) * deep
    m = sx_to_pyomo(x, p, deep, ca.SX(0, 1))
    m.x[0] = 0.5
    m.write(str(tmp_path / 'deep.nl'))
    assert (tmp_path / 'deep.nl').stat().st_size < 10_000


@pytest.mark.parametrize('prefix', ['', 'asl:'])
def test_executable_by_its_path_takes_options_of_ipopt_if_it_is_called_so(tmp_path, prefix):
    pytest.importorskip('pyomo_pounce')
    path = tmp_path / 'ipopt'
    path.symlink_to(pyo.SolverFactory('pounce').executable())
    result = solve(f'{prefix}{path}', budget={'max_iter': 1})
    assert (result.iterations, result.solved) == (1, False)
    assert solve(f'{prefix}{path}', budget={'max_iter': 50}).solved


def test_executable_that_does_not_stop_is_stopped(tmp_path):
    started = time.perf_counter()
    result = solve(script(tmp_path, 'exec sleep 60'), deadline=Deadline(started + 0.2))
    assert time.perf_counter() < started + 30
    assert (result.status, list(result.w)) == ('time limit', [0.4, 0.6])


def test_executable_that_breaks_down_leaves_the_start(tmp_path):
    result = solve(script(tmp_path, 'exit 3'))
    assert (result.status, result.solved, list(result.w)) == ('error', False, [0.4, 0.6])
    assert result.f == pytest.approx(0.16 + 0.36)


def script(folder, command):
    """An executable that tells its version and then does ``command``."""
    path = folder / 'mysolver'
    path.write_text(f'#!/bin/sh\n[ "$1" = -v ] && echo "mysolver 1.0" && exit 0\n{command}\n')
    os.chmod(path, 0o755)
    return str(path)


def solve(name, budget=None, deadline=None):
    """Start at (0.4, 0.6): min a^2 + b^2  s.t.  a b >= 1."""
    problem = nlp_solver(name)('p', x, ca.SX(0, 1), a**2 + b**2, a * b, budget or {}, deadline)
    return problem.solve(np.array([0.4, 0.6]), [], np.zeros(2), np.full(2, 10.0), np.ones(1), np.full(1, np.inf))
