"""Nonlinear parts of expressions in Pyomo's NL templates."""

import pyomo.environ as pyo

from pyomo_fesd.mpcc.compile.row_reader import RowReader


def test_variables_of_some_parts_are_those_of_named_expressions_in_them_too():
    m = pyo.ConcreteModel()
    m.x = pyo.Var(range(5), initialize=1)
    m.inner = pyo.Expression(expr=pyo.sin(m.x[0] * m.x[1]))
    m.outer = pyo.Expression(expr=m.inner**2 + pyo.exp(m.x[2]))
    reader = RowReader()
    rows = [reader.row(expr) for expr in (m.outer**3 + m.x[4], m.inner * m.x[0], pyo.exp(m.x[3]))]
    found = [reader.parts.variables(row.nonlinear for row in some) for some in (rows, rows[1:2], [])]
    assert found == [{id(m.x[k]) for k in some} for some in (range(4), (0, 1), ())]
