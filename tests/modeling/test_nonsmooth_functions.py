"""max, min, abs and clip for the user's own constraints (theory, eq. 8)."""

from math import exp, log

import pyomo.dae as dae
import pyomo.environ as pyo
import pytest

import pyomo_fesd
from pyomo_fesd import FesdError, absolute, clip, maximum, minimum, positive_part
from pyomo_fesd.core.complementarity import read_complementarity
from tests.smoothing.support import conditions, settle


@pytest.fixture
def m():
    m = pyo.ConcreteModel()
    m.x = pyo.Var(initialize=0.5)
    m.y = pyo.Var(initialize=-2.0)
    m.inside = pyo.Var(bounds=(1, 3), initialize=2)
    return m


def over_time(flow):
    """x over time and a Block over time with an Expression ``flow(b, x)``."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2))
    m.x = pyo.Var(m.t, initialize=0.5)

    @m.Block(m.t)
    def b(b, t):
        b.flow = pyo.Expression(expr=flow(b, b.model().x[t]))

    return m


# Values


@pytest.mark.parametrize('x, y', [(0.5, -2.0), (-2.0, 0.5), (3.0, 3.0), (0.0, 0.0)])
def test_values_at_complementary_points(m, x, y):
    made = [
        (maximum(m, m.x, m.y), max(x, y)),
        (minimum(m, m.x, m.y), min(x, y)),
        (maximum(m, m.x, 1, m.y, -1), max(x, 1, y)),
        (minimum(m, m.x, 1, m.y, -1), min(x, -1, y)),
        (absolute(m, m.x - m.y), abs(x - y)),
        (positive_part(m, m.x), max(0, x)),
        (clip(m, m.x, -1, 1), min(max(x, -1), 1)),
        (clip(m, m.x, m.y - 1, m.y + 1), min(max(x, y - 1), y + 1)),
    ]
    m.x.value, m.y.value = x, y
    settle(m)
    for expression, expected in made:
        assert pyo.value(expression) == pytest.approx(expected, abs=1e-15)


def test_s_starts_at_its_complementary_value(m):
    absolute(m, m.y - m.x)
    maximum(m, m.x, m.y)
    assert [pyo.value(read_complementarity(c).G) for c in conditions(m)] == [0.0, 0.0]
    assert [pyo.value(read_complementarity(c).H) for c in conditions(m)] == [2.5, 2.5]


# Sizes


def test_each_costs_one_variable_and_one_pair_and_no_equation(m):
    m.rows = pyo.ConstraintList()
    for f in (lambda: maximum(m, m.x, 0), lambda: minimum(m, m.x, m.y), lambda: absolute(m, m.x), lambda: positive_part(m, m.y)):
        m.rows.add(m.y == f())
    report = pyomo_fesd.report(m)
    assert (report['multipliers'], report['pairs'], report['constraints']) == (4, 4, len(m.rows))


def test_max_with_zero_is_the_variable_itself(m):
    for expression in (maximum(m, 0, m.x), maximum(m, m.x, 0.0), positive_part(m, m.x)):
        assert expression.is_variable_type() and expression.bounds == (0, None)


def test_numbers_together_are_one_argument(m):
    assert str(maximum(m, 1, m.x, 3, 2)) == '3 + _pyomo_fesd_functions.kink_1.s'
    assert str(minimum(m, 1, m.x, 3, 2)) == '1 - _pyomo_fesd_functions.kink_2.s'


def test_numbers_alone_give_a_number_and_leave_nothing(m):
    m.p = pyo.Param(initialize=-4)
    assert (maximum(m, 1, 2, m.p), minimum(m, 1, 2, m.p), absolute(m, m.p), positive_part(m, -1)) == (2, -4, 4, 0)
    assert (clip(m, 5, 0, 1), clip(m, -5, 0, 1), clip(m, 0.5, 0, 1)) == (1, 0, 0.5)
    assert not conditions(m) and m.component('_pyomo_fesd_functions') is None


def test_a_mutable_param_is_no_number(m):
    m.p = pyo.Param(initialize=-4, mutable=True)
    largest = maximum(m, m.p, 0)
    m.p = 3
    assert pyo.value(settle(m) and largest) == 3


def test_where_declared_bounds_decide_nothing_is_left(m):
    assert maximum(m, m.inside, 0) is m.inside
    assert maximum(m, m.inside, 3) == 3
    assert minimum(m, m.inside, 5, 4) is m.inside
    assert str(absolute(m, m.inside - 4)) == '- (inside - 4)'
    assert positive_part(m, -m.inside) == 0
    assert str(clip(m, m.inside, 0, 2)) == 'inside - _pyomo_fesd_functions.kink_7.s'  # the seventh positive part requested
    assert clip(m, m.inside, 1, 3) is m.inside
    assert len(conditions(m)) == 1


def test_a_fixed_variable_counts_with_its_bounds_and_a_mutable_param_as_unknown(m):
    m.x.fix(2)
    m.p = pyo.Param(initialize=0, mutable=True)
    maximum(m, m.x, 0)
    maximum(m, m.inside, m.p)
    assert len(conditions(m)) == 2


def test_functions_without_interval_arithmetic_do_not_decide(m):
    maximum(m, pyo.sinh(m.inside), 0)
    maximum(m, pyo.log(m.y) + 5, 0)
    assert len(conditions(m)) == 2


def test_the_same_rule_gives_the_same_names_at_every_time_also_where_bounds_decide():
    def flow(b, x):
        maximum(b, x, 0)
        maximum(b, x, 1)

    m = over_time(lambda b, x: None)
    m.x[0].setlb(0)
    for t in m.t:
        flow(m.b[t], m.x[t])
    names = [[c.local_name for c in m.b[t]._pyomo_fesd_functions.component_objects(pyo.Block)] for t in m.t]
    assert names == [['kink_2'], ['kink_1', 'kink_2']]


# Refusals


def test_limits_that_are_exchanged_are_refused(m):
    with pytest.raises(FesdError, match='above the upper limit'):
        clip(m, m.x, 1, 0)
    assert not conditions(m)


@pytest.mark.parametrize('function', [maximum, minimum])
def test_one_argument_is_refused(m, function):
    with pytest.raises(FesdError, match='1 argument'):
        function(m, m.x)


def test_a_block_that_is_not_over_the_time_of_the_arguments_is_refused_and_nothing_is_left():
    m = over_time(lambda b, x: None)
    with pytest.raises(FesdError, match=r"'x\[0\]' is a function of 't' and this block is not") as error:
        m.c = pyo.Constraint(m.t, rule=lambda m, t: m.x[t] == maximum(m, m.x[t], 0))
    assert "Block over 't'" in str(error.value)
    assert not conditions(m) and m.component('_pyomo_fesd_functions') is None


def test_a_block_over_time_alone_does_not_do_for_arguments_over_space_too():
    m = pyo.ConcreteModel()
    m.t, m.z = dae.ContinuousSet(bounds=(0, 1)), dae.ContinuousSet(bounds=(0, 1))
    m.x = pyo.Var(m.t, m.z)
    with pytest.raises(FesdError, match="function of 'z'"):
        m.b = pyo.Block(m.t, rule=lambda b, t: b.add_component('flow', pyo.Expression(expr=maximum(b, m.x[t, 0], 0))))

    @m.Block(m.t, m.z)
    def both(b, t, z):
        b.flow = pyo.Expression(expr=maximum(b, m.x[t, z], 0))

    assert len(conditions(m)) == 4


def test_an_indexed_block_is_refused():
    m = over_time(lambda b, x: None)
    with pytest.raises(FesdError, match='must be one block'):
        maximum(m.b, m.x[0], 0)


def test_variables_of_another_model_are_refused(m):
    other = m.clone()
    with pytest.raises(FesdError, match='another model'):
        maximum(m, other.x, 0)
    assert not conditions(m)


def test_inside_a_disjunct_fesd_dcs_refuses_it():
    from pyomo.gdp import Disjunct, Disjunction

    m = over_time(lambda b, x: None)
    m.dx = dae.DerivativeVar(m.x)

    def mode(sign):
        def rule(d, t):
            d.region = pyo.Constraint(expr=sign * m.x[t] >= 0)
            d.ode = pyo.Constraint(expr=m.dx[t] == maximum(d, m.x[t] - 1, 0))

        return rule

    m.above, m.below = Disjunct(m.t, rule=mode(1)), Disjunct(m.t, rule=mode(-1))
    m.sgn = Disjunction(m.t, rule=lambda m, t: [m.above[t], m.below[t]])
    with pytest.raises(FesdError, match='contains a Complementarity'):
        pyo.TransformationFactory('fesd.dcs').apply_to(m)


# Blocks


def test_a_block_inside_a_block_over_time_will_do():
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2))
    m.x = pyo.Var(m.t, ['a', 'b'], initialize=0.5)

    @m.Block(m.t)
    def state(b, t):
        @b.Block(['a', 'b'])
        def part(c, i):
            c.flow = pyo.Expression(expr=maximum(c, b.model().x[t, i], 0))

    names = {c.name for c in conditions(m)}
    assert names == {f'state[{t}].part[{i}]._pyomo_fesd_functions.kink_1.complementarity' for t in m.t for i in 'ab'}


def test_initial_and_final_values_may_occur_beside_the_present_ones():
    m = over_time(lambda b, x: maximum(b, x - b.model().x[0], 0))
    assert len(conditions(m)) == 2


def test_a_fixed_place_of_a_discretised_space_is_a_function_of_time():
    """p' = 1 - dp/dz from rest, upwind on one cell: p(t, 1) = 1 - exp(-t), and the kink lies where it passes 1/2."""
    m = pyo.ConcreteModel()
    m.t, m.z = dae.ContinuousSet(bounds=(0, 2)), dae.ContinuousSet(bounds=(0, 1))
    m.p, m.q = pyo.Var(m.t, m.z, initialize=0), pyo.Var(m.t)
    m.pt, m.pz = dae.DerivativeVar(m.p, wrt=m.t), dae.DerivativeVar(m.p, wrt=m.z)
    pyo.TransformationFactory('dae.finite_difference').apply_to(m, wrt=m.z, nfe=1, scheme='BACKWARD')
    m.flow = pyo.Constraint(m.t, rule=lambda m, t: m.pt[t, 1] == 1 - m.pz[t, 1])
    m.inlet = pyo.Constraint(m.t, rule=lambda m, t: m.p[t, 0] == 0)
    m.rest = pyo.Constraint(m.t, rule=lambda m, t: m.pt[t, 0] == 0 if t == 0 else pyo.Constraint.Skip)

    @m.Block(m.t)
    def relief(b, t):
        b.law = pyo.Constraint(expr=b.model().q[t] == maximum(b, 0, b.model().p[t, 1] - 0.5))

    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, wrt=m.t, nfe=6, ncp=3)
    m.p[0, 1].fix(0)
    pyomo_fesd.simulate(m, m.t)
    time = pyomo_fesd.physical_time(m, m.t)
    opened = max(time[t] for t in m.t if m.p[t, 1].value <= 0.5 + 1e-9)
    assert opened == pytest.approx(log(2), abs=1e-5)
    assert m.q[2].value == pytest.approx(0.5 - exp(-2), abs=1e-5)
