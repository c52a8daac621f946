"""The compiled MPCC evaluates as the model does, and the model is left as it was."""

import numpy as np
import pyomo.environ as pyo
import pytest
from problems import small_mpccs
from pyomo.common.timing import HierarchicalTimer
from pyomo.mpec import Complementarity, complements

from pyomo_fesd import FesdError
from pyomo_fesd.mpcc.compile.compile import compile_mpcc
from pyomo_fesd.mpcc.compile.read_mpcc import read_mpcc


def compiled(model):
    return compile_mpcc(read_mpcc(model), HierarchicalTimer())


def nonlinear_model():
    m = pyo.ConcreteModel()
    m.x = pyo.Var([1, 2, 3], initialize={1: 0.3, 2: 1.7, 3: 0.9})
    m.e = pyo.Expression(expr=m.x[1] * m.x[2])
    m.k = pyo.Constraint(expr=m.e + pyo.exp(m.x[3]) == 2)
    m.l = pyo.Constraint(expr=(None, 2 * m.x[1] + 3 + m.x[3], 7))
    m.f = pyo.Objective(expr=pyo.sin(m.x[1]) + m.e**2, sense=pyo.maximize)
    m.c = Complementarity(expr=complements(m.x[1] ** 2 + 1 >= 0.5, 3 - 2 * m.x[2] + m.x[3] >= 1))
    return m


def test_values_agree_with_pyomo():
    m = nonlinear_model()
    c = compiled(m)
    w = np.array([v.value for v in c.variables])
    at = c.evaluate(w)
    assert c.sign * at.f == pytest.approx(pyo.value(m.f))
    assert at.G[0] == pytest.approx(0.3**2 + 0.5)
    assert at.H[0] == pytest.approx(3 - 2 * 1.7 + 0.9 - 1)
    rows, _ = c.violations(w)
    by_name = dict(zip((con.name for con in c.constraints), rows))
    assert by_name['k'] == pytest.approx(abs(pyo.value(m.k.body) - 2))
    assert by_name['l'] == 0


def test_gradients_agree_with_differences():
    c = compiled(nonlinear_model())
    w = np.array([0.4, 1.1, 0.2])
    grad, J_g, J_G, J_H, _ = c.gradients(w)
    step = 1e-6
    for j in range(3):
        up, down = (c.evaluate(w + s * step * np.eye(3)[j]) for s in (1, -1))
        assert grad[j] == pytest.approx((up.f - down.f) / (2 * step), abs=1e-7)
        for J, name in ((J_g, 'g'), (J_G, 'G'), (J_H, 'H')):
            difference = (getattr(up, name) - getattr(down, name)) / (2 * step)
            np.testing.assert_allclose(J.toarray()[:, j], difference, atol=1e-7)


def test_nothing_is_left_on_the_model():
    m = nonlinear_model()
    m.scaling_factor = pyo.Suffix(direction=pyo.Suffix.EXPORT)
    m.scaling_factor[m.k] = 10
    names = set(m.component_map())
    compiled(m)
    assert set(m.component_map()) == names
    assert m.c.active and m.scaling_factor.active


def test_an_inactive_condition_stays_inactive_and_is_left_out():
    m = pyo.ConcreteModel()
    m.x = pyo.Var([1, 2], bounds=(0, None), initialize=1)
    m.y = pyo.Var([1, 2], bounds=(0, None), initialize=1)
    m.c = Complementarity([1, 2], rule=lambda m, i: complements(m.x[i] >= 0, m.y[i] >= 0))
    m.c[2].deactivate()
    assert [condition.name for condition in compiled(m).conditions] == ['c[1]']
    assert m.c[1].active and not m.c[2].active


def test_missing_values_are_counted_and_projected_to_the_bounds():
    m = small_mpccs.pair(None, None)
    m.x.setlb(2)
    m.k = pyo.Constraint(expr=m.x + m.y <= 5)
    c = compiled(m)
    assert c.missing == 2
    start = dict(zip((v.name for v in c.variables), c.x0))
    assert start == {'x': 2.0, 'y': 0.0}


@pytest.mark.parametrize('function', [pyo.asinh, pyo.acosh, pyo.atanh])
def test_a_function_that_cannot_be_evaluated_is_named_before_any_solve(function):
    m = small_mpccs.pair(1.5, 0.0)
    m.strange = pyo.Constraint(expr=function(m.x) <= 1)
    with pytest.raises(FesdError, match=r"strange: the function '\w+' cannot be evaluated"):
        pyo.SolverFactory('mpec_hybrid').solve(m)
    assert set(m.component_map()) == {'x', 'y', 'c', 'strange'}
    assert m.c.active


def test_a_fixed_side_counts_as_a_number():
    m = small_mpccs.pair(1.0, 0.5)
    m.f = pyo.Objective(expr=(m.y - 1) ** 2)
    m.x.fix(1.0)
    results = pyo.SolverFactory('mpec_hybrid').solve(m)
    assert pyo.check_optimal_termination(results)
    assert m.y.value == pytest.approx(0.0)
