"""A start at which the equations are dependent is tried once more with perturbed constraints, and this is said."""

import casadi as ca
import numpy as np
import pyomo.environ as pyo
import pytest
from pyomo.common.timing import HierarchicalTimer

from pyomo_fesd.mpcc import compile_mpcc, read_mpcc
from pyomo_fesd.mpcc.nlp import NlpResult
from pyomo_fesd.solvers.singular_start import is_singular, with_perturbation


def compiled(start):
    """x y = 2, x + y = 3: dependent where x = y."""
    m = pyo.ConcreteModel()
    m.x, m.y = pyo.Var(initialize=start[0]), pyo.Var(initialize=start[1])
    m.product = pyo.Constraint(expr=m.x * m.y == 2)
    m.sum = pyo.Constraint(expr=m.x + m.y == 3)
    return compile_mpcc(read_mpcc(m), HierarchicalTimer())


class Runs:
    """Answers of Ipopt by the options that they were asked with."""

    def __init__(self, first, second):
        self.answers, self.asked = {False: first, True: second}, []

    def __call__(self, more):
        self.asked.append(more)
        return NlpResult(np.zeros(2), 0.0, self.answers[bool(more)], 1, np.zeros(2), np.zeros(2)), 'log'


def test_dependent_equations_are_recognised():
    assert is_singular(compiled((1.0, 1.0))) and not is_singular(compiled((1.0, 1.5)))


@pytest.mark.parametrize('second', ['Solve_Succeeded', 'Restoration_Failed'])
def test_the_second_run_counts_if_it_succeeds(second, caplog):
    runs = Runs('Restoration_Failed', second)
    answer, _ = with_perturbation(runs, compiled((1.0, 1.0)), {})
    assert answer.status == second and runs.asked == [{}, {'perturb_always_cd': 'yes'}]
    assert "perturb_always_cd='yes'" in caplog.text


@pytest.mark.parametrize(
    'first, start, options',
    [
        ('Solve_Succeeded', (1.0, 1.0), {}),
        ('Restoration_Failed', (1.0, 1.5), {}),
        ('Restoration_Failed', (1.0, 1.0), {'perturb_always_cd': 'no'}),
        ('Invalid_Option', (1.0, 1.0), {}),
    ],
)
def test_there_is_one_run_elsewhere(first, start, options, caplog):
    runs = Runs(first, 'Solve_Succeeded')
    assert with_perturbation(runs, compiled(start), options)[0].status == first and len(runs.asked) == 1
    assert not caplog.text


def test_casadi_has_the_option():
    x = ca.SX.sym('x')
    ca.nlpsol('s', 'ipopt', {'x': x, 'f': x**2}, {'ipopt.perturb_always_cd': 'yes', 'print_time': False, 'ipopt.print_level': 0})()
