"""Solutions for other parameters to first order: exact where the solution is linear, refused outside of the branch."""

import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
from pyomo.gdp import Disjunction

from pyomo_fesd import FesdError
from pyomo_fesd.sensitivities import LinearSolution
from pyomo_fesd.solvers import certified_model, user_names


@pytest.fixture
def ramp():
    """dx/dt = 3 below zero and 1 above, from -2: x(2) = 2 - t_s, t_s = -x(0)/3; and what solves it for other x(0)."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2))
    m.x = pyo.Var(m.t, initialize=-2)
    m.dx = dae.DerivativeVar(m.x)
    m.x[0].fix(-2)
    m.s = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 0, m.dx[t] == 3], [m.x[t] >= 0, m.dx[t] == 1]])
    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=4, ncp=2)
    pyo.SolverFactory('mpec_hybrid').solve(m)
    ready, certificate = certified_model(m, {}, 'test', [m.x[0]])
    assert certificate.certified
    linear = LinearSolution(ready, [m.x[0]], user_names(m))

    def end(start):
        m.x[0].set_value(start)
        ready.compiled.refresh()
        w = linear.present()
        return dict(zip((v.name for v in ready.compiled.variables), ready.compiled.values(w)))['x[2]'], linear.residual(w)

    return end


@pytest.mark.parametrize('start', [-2.0, -1.8, -2.7, -0.3])
def test_a_linear_solution_is_exact(ramp, start):
    found, residual = ramp(start)
    assert found == pytest.approx(2 + start / 3, abs=1e-9) and residual < 1e-9


@pytest.mark.parametrize('start', [0.3, -6.5])
def test_another_branch_is_refused_by_name(ramp, start):
    with pytest.raises(FesdError, match='it would leave the branch'):
        ramp(start)
