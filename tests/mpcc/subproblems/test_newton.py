"""Newton's method finds the solutions of branches near relaxations, and leaves all others to an NLP solver."""

import numpy as np
import pyomo.environ as pyo
import pytest
from problems import small_mpccs
from problems.parts import compiled
from pyomo.contrib.solver.common.factory import SolverFactory
from pyomo.mpec import Complementarity, complements

from pyomo_fesd.core import BranchConstraint, Penalty, homotopy_hints
from pyomo_fesd.mpcc.compile import scaled_functions
from pyomo_fesd.mpcc.nlp import NEWTON, NlpResult
from pyomo_fesd.mpcc.subproblems import G_ZERO, H_ZERO
from pyomo_fesd.mpcc.subproblems.branch import Branch
from pyomo_fesd.mpcc.subproblems.side_constraints import sort_sides


@pytest.fixture(params=[-1, 10**9], ids=['by the chain rule', 'short'], autouse=True)
def short(request, monkeypatch):
    monkeypatch.setattr(scaled_functions, 'SHORT', request.param)


def curved(repeated=1):
    """At the solution of the branch x = 0 a curved row holds, as often as it is ``repeated``, and the bound of z does not."""
    m = pyo.ConcreteModel()
    m.x, m.y = (pyo.Var(bounds=(0, None), initialize=0.5) for _ in range(2))
    m.z = pyo.Var(bounds=(-3, 3), initialize=0)
    m.rows = pyo.Constraint(range(repeated), rule=lambda m, k: m.y**2 + m.z**2 <= 2)
    m.pair = Complementarity(expr=complements(m.x >= 0, m.y >= 0))
    m.cost = pyo.Objective(expr=(m.x - 1) ** 2 + (m.y - 2) ** 2 + (m.z - 2) ** 2)
    return m


def no_solver(*args):
    raise AssertionError("an NLP solver was made")


def solve(m, values, zero=G_ZERO, of_rows=None, of_bounds=None, make=no_solver, **more):
    """The result of a branch near ``values`` (by name) with multipliers, and the compiled model."""
    c = compiled(m)
    branch = Branch(c, sort_sides(c), make)
    w = np.array([values[v.name] for v in c.variables]) * c.scale.x
    z = np.array([(of_bounds or {}).get(v.name, 0.0) for v in c.variables])
    rows = np.zeros(len(c.lbg) + len(sort_sides(c).chosen)) if of_rows is None else np.array(of_rows)
    duals = NlpResult(w, 0.0, more.pop('status', 'Solve_Succeeded'), 1, rows, z)
    return branch.solve(w, np.array([zero]), duals=duals, **more), c


def by_name(result, c):
    return dict(zip((v.name for v in c.variables), c.values(result.w).tolist()))


@pytest.mark.parametrize('repeated', [1, 3])
def test_the_solution_and_its_multipliers(repeated):
    result, c = solve(curved(repeated), {'x': 1e-3, 'y': 1.02, 'z': 0.99}, of_rows=[1 / repeated] * repeated)
    assert result.status == NEWTON and result.is_exact
    assert by_name(result, c) == pytest.approx({'x': 0, 'y': 1, 'z': 1}, abs=1e-10)
    assert result.f == pytest.approx(3)
    # rows that depend on each other share the multiplier 1
    assert result.lam_g.sum() == pytest.approx(1) and result.lam_g.min() > 0
    assert result.lam_x == pytest.approx([2.0 if v.name == 'x' else 0.0 for v in c.variables], abs=1e-8)


def test_bounds_become_active_and_free():
    m = curved()
    m.y.setub(0.99)
    values = {'x': 0, 'y': 0.97, 'z': 1.0}
    result, c = solve(m, values, of_rows=[1.0], of_bounds={'z': 0.1})
    assert by_name(result, c) == pytest.approx({'x': 0, 'y': 0.99, 'z': np.sqrt(2 - 0.99**2)}, abs=1e-10)


class Called(Exception):
    """An NLP solver was made."""


def called(*args):
    raise Called


@pytest.mark.parametrize(
    'change',
    [
        {'values': {'x': 0, 'y': 0.2, 'z': 0.2}},
        {'zero': H_ZERO},
        {'status': 'Maximum_Iterations_Exceeded'},
        {'box': (np.full(3, -1.0), np.full(3, 2.0))},
    ],
    ids=['far away', 'another branch', 'from a point that is no solution', 'in a trust region'],
)
def test_other_branches_are_left_to_an_nlp_solver(change):
    given = {'values': {'x': 1e-3, 'y': 1.02, 'z': 0.99}, 'of_rows': [1.0]} | change
    with pytest.raises(Called):
        solve(curved(), make=called, **given)
    result, _ = solve(curved(), nearby=True, **given)
    assert result is None


@pytest.mark.parametrize('kind', ['decision', 'penalty'])
def test_decisions_and_penalties_are_left_to_an_nlp_solver(kind):
    m = curved()
    hints = homotopy_hints(m)
    if kind == 'decision':
        m.decided = Complementarity(expr=complements(m.x >= 0, m.z >= 0))
        m.impose = pyo.Constraint(expr=m.z <= 0)
        m.impose.deactivate()
        hints.branch_constraints.append(BranchConstraint(m.decided, m.impose))
    else:
        m.small = pyo.Expression(expr=m.z**2)
        hints.penalties.append(Penalty(m.small, 1e-2))
    result, c = solve(m, {'x': 1e-3, 'y': 1.02, 'z': 0.99}, of_rows=[1.0] if kind == 'penalty' else None, nearby=True)
    assert result is None and (c.equal.numel() > 0, c.has_penalty) == (kind == 'decision', kind == 'penalty')


def test_a_run_ends_there():
    m, best = small_mpccs.bard1()[:2]
    results = SolverFactory('mpec_hybrid').solve(m)
    assert [step.status for step in results.extra_info.steps if step.kind == 'branch'] == [NEWTON]
    assert results.extra_info.stationarity == 'B' and results.incumbent_objective == pytest.approx(best)
