"""Right-hand sides show the sizes of variables only where nothing can cancel."""

import numpy as np
import pyomo.environ as pyo
import pytest
from pyomo.common.timing import HierarchicalTimer
from pyomo.mpec import Complementarity, complements

from pyomo_fesd.mpcc.compile.compile import compile_mpcc
from pyomo_fesd.mpcc.compile.natural_units import natural_units
from pyomo_fesd.mpcc.compile.read_mpcc import read_mpcc
from pyomo_fesd.mpcc.compile.row_functions import RowFunctions

TINY = 1e-10


def scales(*rows, side=lambda m: m.y[1] >= 0):
    """Factors of x[0], x[1] (free) and y[0], y[1] (not negative) in a model with these rows and a pair."""
    m = pyo.ConcreteModel()
    m.x, m.y = pyo.Var([0, 1], initialize=1), pyo.Var([0, 1], bounds=(0, None), initialize=1)
    m.rows = pyo.ConstraintList()
    for row in rows:
        m.rows.add(row(m))
    m.pair = Complementarity(expr=complements(m.y[0] >= 0, side(m)))
    m.cost = pyo.Objective(expr=sum((v - 1) ** 4 for v in (*m.x.values(), *m.y.values())))
    return compile_mpcc(read_mpcc(m), HierarchicalTimer(), natural_units='auto').scale.x


def test_lengths_with_a_small_sum_are_small():
    assert np.all(scales(lambda m: m.y[0] + m.y[1] == TINY)[-2:] > 1e8)


@pytest.mark.parametrize(
    'row',
    [
        pytest.param(lambda m: m.x[0] == TINY, id="an initial value near 0"),
        pytest.param(lambda m: m.x[0] + m.x[1] == TINY, id="a difference of free variables"),
        pytest.param(lambda m: m.y[0] - m.y[1] == TINY, id="a difference"),
    ],
)
def test_an_equation_that_may_cancel_shows_no_small_size(row):
    assert np.all(scales(row) == 1.0)


def test_a_large_value_shows_a_large_size():
    assert scales(lambda m: m.x[0] == 1e10).min() < 1e-4


def test_the_constant_of_a_side_shows_no_small_size():
    assert np.all(scales(side=lambda m: m.x[0] + m.y[1] + TINY >= 0) == 1.0)


def test_without_an_objective_a_model_sized_by_starts_is_not_evaluated():
    m = pyo.ConcreteModel()
    m.x = pyo.Var(initialize=1e8)
    m.row = pyo.Constraint(expr=m.x**2 == 4e16)
    c = compile_mpcc(read_mpcc(m), HierarchicalTimer(), natural_units='starts')
    assert c.scale.x[0] < 1e-6
    assert '_jacobian' not in vars(c) and natural_units(c, True).ordinary and '_jacobian' not in vars(c)


def test_the_coefficients_of_linear_rows_are_their_jacobian(monkeypatch):
    rows = lambda m: m.x[0] == 1e10, lambda m: m.y[0] + 2 * m.y[1] == TINY  # noqa: E731
    found = scales(*rows)
    monkeypatch.setattr(RowFunctions, 'is_linear', False)
    assert found.min() < 1e-4 and found.max() > 1e8
    np.testing.assert_array_equal(found, scales(*rows))
