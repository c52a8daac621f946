"""Bad input of every kind is an error of the house that names the component, the cause and the fix; the model is as it was."""

import pyomo.environ as pyo
import pytest
from pyomo import dae
from pyomo.contrib.solver.common.factory import SolverFactory as SolverFactoryV2

import pyomo_fesd
from pyomo_fesd import FesdError
from tests.models import dcs, finite_elements, signum, snapshot
from tests.problems import small_mpccs


def fesd(name, **keywords):
    return lambda m: pyo.TransformationFactory(f'fesd.{name}').apply_to(m, **keywords)


def solve(m):
    return SolverFactoryV2('mpec_hybrid').solve(m)


def plain_solve(m):
    return SolverFactoryV2('casadi_ipopt').solve(m)


@pytest.mark.parametrize('step', [fesd('dcs'), fesd('finite_elements'), solve, plain_solve, pyomo_fesd.simulate, pyomo_fesd.refine])
def test_what_is_no_model(step):
    with pytest.raises(FesdError, match=r"(?s)^x: .*not a model.*Fix: pass the model"):
        step(signum().x)
    m = pyo.AbstractModel()
    m.t = dae.ContinuousSet(bounds=(0, 1))
    m.x = pyo.Var(m.t)
    with pytest.raises(FesdError, match=r"(?s)abstract model.*Fix: .*create_instance"):
        step(m)


@pytest.mark.parametrize('keyword', ['nfe', 'ncp'])
def test_numbers_that_are_none(keyword):
    m = dcs(signum())
    before = snapshot(m)
    with pytest.raises(FesdError, match=rf"(?s){keyword}=None.*Fix: "):
        fesd('finite_elements', **{keyword: None})(m)
    assert snapshot(m) == before


def test_a_state_is_no_control():
    m = dcs(signum())
    with pytest.raises(FesdError, match=r"(?s)^x: piecewise_constant: this is a state"):
        finite_elements(m, piecewise_constant=[m.x])


@pytest.mark.parametrize('keywords', [{'tolerance': 'a'}, {'tolerance': None}, {'max_rounds': 'a'}, {'max_rounds': 2.5}])
def test_numbers_of_refine(keywords):
    with pytest.raises(FesdError, match=r"(?s)refine: it is .*Fix: "):
        pyomo_fesd.refine(dcs(signum()), **keywords)


@pytest.mark.parametrize(
    'relation',
    [lambda m: m.x / m.p == 1, lambda m: m.x / m.p + m.y == 1, lambda m: m.x + 1 / m.z == 1, lambda m: m.y**2 + m.x / m.z == 1],
)
@pytest.mark.parametrize('step', [solve, plain_solve])
def test_a_division_by_zero(step, relation):
    """Pyomo's writer leaves out such a term, or the whole equation, with a warning."""
    m = pyo.ConcreteModel()
    m.x, m.y, m.z = pyo.Var(initialize=1.0), pyo.Var(initialize=1.0), pyo.Var(initialize=0.0)
    m.z.fix()
    m.p = pyo.Param(initialize=0.0, mutable=True)
    m.c = pyo.Constraint(expr=relation(m))
    with pytest.raises(FesdError, match=r"(?s)has no value.*division by zero.*Fix: "):
        step(m)


@pytest.mark.parametrize('options, name', [({'nonsense': 1}, 'nonsense'), ({'threads': 1, 'presolve': 7}, 'presolve')])
def test_options_of_highs(options, name):
    m, _ = small_mpccs.scholtes4()
    with pytest.raises(FesdError, match=rf"(?s)lpec_options\['{name}'\]: HiGHS refuses.*Fix: "):
        SolverFactoryV2('mpec_hybrid').solve(m, lpec_options=options)


def test_names_with_dots_are_whole():
    m = signum()
    m.kind = pyo.Set(initialize=['a.low', 'b.high'])
    m.del_component(m.sgn)
    m.del_component(m.below)
    m.del_component(m.above)

    @m.Disjunct(m.kind, m.t)
    def mode(d, kind, t):
        low = kind == 'a.low'
        d.region = pyo.Constraint(expr=m.x[t] <= 0 if low else m.x[t] >= 0)
        d.ode = pyo.Constraint(expr=m.dx[t] == (3 if low else 1))

    @m.Disjunction(m.t)
    def sgn(m, t):
        return [m.mode[kind, t] for kind in m.kind]

    m.y[0].fix(1.0)
    m.rest = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == 0)
    finite_elements(dcs(m))
    pyomo_fesd.simulate(m)
    (switch,) = pyomo_fesd.switches(m)
    assert (switch.before, switch.after) == ('mode[a.low]', 'mode[b.high]')
    picture = pyomo_fesd.plot(m)._repr_png_()
    assert picture.startswith(b'\x89PNG')
