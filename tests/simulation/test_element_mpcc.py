"""The MPCC of one element as a model of its own."""

import pyomo.environ as pyo
import pytest
import signum

from pyomo_fesd.simulation.element_mpcc import ElementMpcc
from tests.models import scalar_ode
from tests.problems import crossing
from tests.problems.running import move, seen, transform
from tests.simulation.test_equation_reader import problems


def first_mpcc(m, number=0, **options):
    """The MPCC of an element, and its equations."""
    equations = problems(m)[number]
    return ElementMpcc(equations, options), equations


def start(m, x):
    """Values on the left of the first element."""
    m.x[0].fix(x)
    block = m._pyomo_fesd_dcs.component('sgn') or m._pyomo_fesd_dcs.zero
    block.p[0].value, block.n[0].value = (max(-x, 0), max(x, 0))


def test_the_longest_step_is_as_long_as_allowed():
    m = transform(signum.build(), 4, 2)
    one, equations = first_mpcc(m)
    start(m, -2.0)
    assert one.solve(equations, 1.0).stationarity == 'B'
    assert one.length == pytest.approx(1.0)


def test_or_ends_at_the_switch():
    m = transform(signum.build(), 4, 2)
    one, equations = first_mpcc(m)
    start(m, -0.75)
    assert one.solve(equations, 1.0).stationarity == 'B'
    # 0.25 of a time, half an element
    assert one.length == pytest.approx(0.5, abs=1e-8)


def test_it_serves_every_element_of_its_class():
    m = transform(signum.build(), 4, 2)
    one, _ = first_mpcc(m)
    start(m, -2.0)
    reached = []
    for equations, label in zip(problems(m), (0.5, 1.0)):
        assert one.solve(equations, 1.0).stationarity == 'B'
        one.write(equations)
        reached.append((one.length, m.x[label].value))
    # zero is reached in the second element, at t = 2/3
    assert reached == [pytest.approx((1.0, -0.5)), pytest.approx((1 / 3, 0.0), abs=1e-7)]


def test_the_model_does_not_change_before_values_are_written():
    m = transform(crossing.build(), 4, 2)
    before = seen(m)
    one, equations = first_mpcc(m)
    one.solve(equations, 1.0)
    assert seen(m) == before


def test_factors_of_the_user_scale_variables_and_rows():
    m = scalar_ode(end=2)
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == -m.x[t])
    m.scaling_factor = pyo.Suffix(direction=pyo.Suffix.EXPORT)
    m.scaling_factor[m.x] = 100.0
    m.scaling_factor[m.dx] = 10.0
    one, equations = first_mpcc(move(m, 2, 2))
    given = {equations.unknown[v.index()].name.split('[')[0]: f for v, f in one.model.scaling_factor.items() if v.ctype is pyo.Var}
    assert given == {'x': 100.0, 'dx': 10.0}
    assert {f for c, f in one.model.scaling_factor.items() if c.ctype is pyo.Constraint} == {10.0}


def test_options_reach_the_solver():
    m = transform(crossing.build(), 4, 2)
    one, equations = first_mpcc(m, max_iterations=1)
    assert one.solve(equations, 1.0).stationarity != 'B'
