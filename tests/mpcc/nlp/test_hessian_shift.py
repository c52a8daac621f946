"""The shift of Ipopt's Hessian: its size, the matrix, and a problem on which Ipopt then adds less."""

import re

import casadi as ca
import numpy as np
import pytest

from pyomo_fesd.mpcc.nlp.casadi_solvers import SHIFTED, CasadiIpopt
from pyomo_fesd.mpcc.nlp.hessian_shift import LEAST, PART, HessianShift


@pytest.fixture
def shift():
    return HessianShift()


def hessian(kind):
    """Function of the Hessian of lam_f x0^3 + lam_g x0 x1, whose second diagonal entry is structurally zero."""
    x, p, lam_f, lam_g = (kind.sym(name, n) for name, n in (('x', 2), ('p', 0), ('lam_f', 1), ('lam_g', 1)))
    h, _ = ca.hessian(lam_f * x[0] ** 3 + lam_g * x[0] * x[1], x)
    return ca.Function('h', [x, p, lam_f, lam_g], [ca.triu(h)], ['x', 'p', 'lam_f', 'lam_g'], ['h'])


@pytest.mark.parametrize('kind', [ca.SX, ca.MX])
def test_the_shift_is_added_to_the_whole_diagonal_at_each_call(shift, kind):
    own = hessian(kind)
    shifted = shift.shifted(own)
    assert (shifted.name_in(), shifted.name_out()) == (own.name_in(), own.name_out())
    for added in (0.0, 3.0, 0.5):
        shift.follow(added)
        difference = shifted([2.0, 1.0], [], 1.5, 0.7) - own([2.0, 1.0], [], 1.5, 0.7)
        np.testing.assert_allclose(difference.full(), shift.eval([0.0])[0] * np.eye(2), rtol=1e-14)
    assert shift.eval([0.0])[0] > 0.0


def test_the_shift_is_a_part_of_the_whole_and_fades(shift):
    shift.follow(8.0)
    assert shift.eval([0.0]) == [PART * 8.0]
    shift.follow(4.0)
    assert shift.eval([0.0]) == [PART * (PART * 8.0 + 4.0)]
    sizes = []
    while not sizes or sizes[-1]:
        shift.follow(0.0)
        sizes += shift.eval([0.0])
    assert sizes == sorted(sizes, reverse=True)
    assert sizes[-2] >= LEAST
    shift.follow(1.0)
    shift.begin()
    assert shift.eval([0.0]) == [0.0]


def chain(n, shifts, capfd, **options):
    """A chain of springs on a plate with hollows, from the middle between them: its solution, and how often Ipopt added to W."""
    x, p = ca.SX.sym('x', n), ca.SX.sym('p')
    f = ca.sum1(ca.cos(3 * x)) + p * ca.sumsqr(x[1:] - x[:-1])
    solver = CasadiIpopt('chain', x, p, f, x[0] + x[-1], {'tol': 1e-9}, options={'print_level': 5} | options, shifts=shifts)
    start = 0.1 * np.sin(np.arange(n))
    capfd.readouterr()
    result = solver.solve(start, [0.05], np.full(n, -5.0), np.full(n, 5.0), np.zeros(1), np.zeros(1))
    logged = re.findall(r'^ *\d+r? +\S+ +\S+ +\S+ +\S+ +\S+ +(\S+) ', capfd.readouterr().out, re.M)
    return result, sum(one != '-' for one in logged), len(logged)


def test_ipopt_adds_less_and_ends_at_a_solution(capfd):
    plain, added, iterations = chain(SHIFTED, False, capfd)
    shifted, less, more = chain(SHIFTED, True, capfd)
    assert plain.solved
    assert shifted.solved
    # without a shift it adds in most iterations before the last ones
    assert added > iterations / 3
    assert less < added / 1.5
    assert more < 2 * iterations
    # of the two ends each is a minimum: no curvature is negative there
    for end in (plain, shifted):
        assert np.cos(3 * end.w).max() < 0.5
    # the next solve begins without a shift
    again, *_ = chain(SHIFTED, True, capfd)
    np.testing.assert_array_equal(again.w, shifted.w)


def test_a_small_problem_has_no_shift(capfd):
    plain, added, _ = chain(SHIFTED - 1, False, capfd)
    same, as_often, _ = chain(SHIFTED - 1, True, capfd)
    assert added == as_often > 0
    np.testing.assert_array_equal(same.w, plain.w)
