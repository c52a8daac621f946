"""What every NLP solver has to do, on small problems whose solutions and multipliers are known."""

import importlib
import sys
import time

import casadi as ca
import numpy as np
import pytest

from pyomo_fesd import FesdError
from pyomo_fesd.mpcc.compile.derivatives import automatic
from pyomo_fesd.mpcc.nlp.casadi_solvers import derivative_functions
from pyomo_fesd.mpcc.nlp.deadline import Deadline
from pyomo_fesd.mpcc.nlp.solver import (
    ACCEPTABLE,
    DIVERGING,
    NLP_SOLVERS,
    RUNNING,
    SOLVED,
    STALLED,
    Fall,
    NlpResult,
    NlpSolver,
    Stall,
    nlp_solver,
)

SOLVERS = ['ipopt', 'uno', 'cyipopt', 'pounce']
#: The limit of iterations in each solver's own words.
LIMIT = {'uno': 'max_iterations'}
INF = np.inf


@pytest.fixture(params=SOLVERS)
def solver(request):
    try:
        nlp_solver(request.param)
    except FesdError as error:
        pytest.skip(str(error))
    return request.param


def distance(solver, extra=(), budget=None, own=False, **settings):
    """min (x - 1)^2 + (y - p)^2  s.t.  x + y <= 2 and x y >= 0.1, x and y in [0, 10]; more rows behind them."""
    x, p = ca.SX.sym('x', 2), ca.SX.sym('p')
    f = (x[0] - 1) ** 2 + (x[1] - p) ** 2
    g = ca.vertcat(x[0] + x[1], x[0] * x[1], *(row(x, p) for row in extra))
    derivatives = automatic(x, f, g) if own else None
    return nlp_solver(solver)('distance', x, p, f, g, {'tol': 1e-9} | (budget or {}), derivatives=derivatives, **settings)


def valley(solver, **settings):
    """Rosenbrock's function, which takes many iterations from (-1.2, 1)."""
    x, p = ca.SX.sym('x', 2), ca.SX(0, 1)
    f = 100 * (x[1] - x[0] ** 2) ** 2 + (1 - x[0]) ** 2
    problem = nlp_solver(solver)('valley', x, p, f, ca.SX(0, 1), **settings)
    return problem.solve(np.array([-1.2, 1.0]), [], np.full(2, -INF), np.full(2, INF), np.zeros(0), np.zeros(0))


def solve(problem, w0=(0.5, 0.5), p=2.0, lbx=(0, 0), ubx=(10, 10), lbg=(-INF, 0.1), ubg=(2, INF)):
    w0, lbx, ubx, lbg, ubg = (np.array(v, dtype=float) for v in (w0, lbx, ubx, lbg, ubg))
    return problem.solve(w0, [p], lbx, ubx, lbg, ubg)


def same(found, wanted):
    np.testing.assert_allclose(found, wanted, atol=1e-5)


@pytest.mark.parametrize('own', [False, True])
def test_point_objective_and_multipliers(solver, own):
    result = solve(distance(solver, own=own))
    assert result.solved
    assert result.iterations >= 1
    same(result.w, [0.5, 1.5])
    same(result.f, 0.5)
    same(result.lam_g, [1, 0])
    same(result.lam_x, [0, 0])


@pytest.mark.parametrize(
    ('change', 'w', 'lam_g', 'lam_x'),
    [
        ({'ubx': (10, 1.2)}, [0.8, 1.2], [0.4, 0], [0, 1.2]),
        ({'lbx': (0.7, 0)}, [0.7, 1.3], [1.4, 0], [-0.8, 0]),
        ({'lbx': (0, 0.5), 'ubx': (10, 0.5)}, [1, 0.5], [0, 0], [0, 3]),
        ({'p': 2.5}, [0.25, 1.75], [1.5, 0], [0, 0]),
        ({'w0': (5, 5)}, [0.5, 1.5], [1, 0], [0, 0]),
        ({'lbg': (-INF, -INF), 'ubg': (INF, INF)}, [1, 2], [0, 0], [0, 0]),
        ({'lbg': (2, 0.1), 'ubg': (2, INF)}, [0.5, 1.5], [1, 0], [0, 0]),
        ({'lbg': (3.5, 0.1), 'ubg': (INF, INF)}, [1.25, 2.25], [-0.5, 0], [0, 0]),
    ],
    ids=['upper bound', 'lower bound', 'fixed', 'parameter', 'start', 'free rows', 'equation', 'lower side of a row'],
)
def test_bounds_parameter_and_start_change_without_a_rebuild(solver, change, w, lam_g, lam_x):
    problem = distance(solver)
    same(solve(problem).w, [0.5, 1.5])
    result = solve(problem, **change)
    assert result.solved
    same(result.w, w)
    same(result.lam_g, lam_g)
    same(result.lam_x, lam_x)
    same(solve(problem).w, [0.5, 1.5])


def test_fixed_variables_are_accepted_where_nothing_is_left_to_decide(solver):
    free = (-INF, -INF), (INF, INF)
    result = solve(distance(solver), lbx=(1, 1), ubx=(1, 1), lbg=free[0], ubg=free[1])
    assert result.solved
    same(result.w, [1, 1])


def test_infeasible_problem_is_not_solved(solver):
    result = solve(distance(solver, budget={'max_iter': 100}), lbg=(5, 20), ubg=(5, 20))
    assert not result.solved
    assert np.isfinite(result.w).all()


def test_row_without_variables_holds_or_not(solver):
    problem = distance(solver, extra=[lambda x, p: p])
    assert solve(problem, lbg=(-INF, 0.1, 1), ubg=(2, INF, 3)).solved
    assert not solve(problem, lbg=(-INF, 0.1, 5), ubg=(2, INF, 6)).solved


def test_model_is_not_evaluable_everywhere(solver):
    x = ca.SX.sym('x')
    problem = nlp_solver(solver)('entropy', x, ca.SX(0, 1), x * ca.log(x), ca.SX(0, 1), {'tol': 1e-9})
    result = problem.solve(np.array([3.0]), [], np.array([-1.0]), np.array([10.0]), np.zeros(0), np.zeros(0))
    assert result.solved
    same(result.w, [np.exp(-1)])


def test_budget_limits_iterations(solver):
    assert valley(solver, budget={'max_iter': 100}).solved
    result = valley(solver, budget={'max_iter': 2})
    assert not result.solved
    assert result.iterations == 2


@pytest.mark.parametrize('name', ['ipopt', 'cyipopt'])
def test_a_start_with_multipliers_may_have_a_budget_of_its_own_and_the_user_overrides_it(name):
    if name != 'ipopt':
        pytest.importorskip(name)
    w0, p, lbx, ubx, lbg, ubg = np.full(2, 0.5), [2.0], np.zeros(2), np.full(2, 10.0), np.array([-INF, 0.1]), np.array([2, INF])
    problem = distance(name, warm={'max_iter': 0})
    cold = problem.solve(w0, p, lbx, ubx, lbg, ubg)
    assert cold.solved and problem.solve(w0, p, lbx, ubx, lbg, ubg, duals=cold).iterations == 0
    given = distance(name, warm={'max_iter': 0}, options={'max_iter': 100})
    assert given.solve(w0, p, lbx, ubx, lbg, ubg, duals=cold).solved


@pytest.mark.parametrize(('steepest', 'diverges'), [(0.0, True), (1e9, False), (INF, False)])
def test_multipliers_that_stay_above_their_limit_end_the_solve(steepest, diverges):
    # Newton's method goes a sixteenth of the way to the root of x^16 in each iteration
    x, p = ca.SX.sym('x'), ca.SX(0, 1)
    problem = nlp_solver('ipopt')('flat', x, p, x, x**16, {'max_iter': 300})
    result = problem.solve(np.array([10.0]), [], np.array([-INF]), np.array([INF]), np.zeros(1), np.zeros(1), steepest=steepest)
    assert (result.status == DIVERGING) == diverges
    if diverges:
        assert result.iterations < RUNNING and not (result.solved or result.stopped)


@pytest.mark.parametrize(
    ('constant', 'stall', 'is_left'),
    [(1.0, [3], True), (1.0, None, False), (0.0, [3], False), (1.0, [3, 2.0], True), (1.0, [3, 0.9], False)],
)
def test_a_violation_that_does_not_halve_ends_the_solve(constant, stall, is_left):
    # without the constant each of Newton's iterations takes the violation to a third; with it, it stays above 1
    x, p = ca.SX.sym('x'), ca.SX(0, 1)
    problem = nlp_solver('ipopt')('parabola', x, p, x, x**16 + constant, {'max_iter': 300})
    stalls = [Stall(*stall)] if stall else []
    result = problem.solve(np.array([2.0]), [], np.array([-INF]), np.array([INF]), np.zeros(1), np.zeros(1), stalls=stalls)
    assert (result.status == STALLED) == is_left
    assert not is_left or (result.stopped and not result.solved)


@pytest.mark.parametrize(
    ('fall', 'iterations'), [(None, 5), (Fall(0.9, 3, 4.0), 20), (Fall(0.99, 3, 4.0), 5), (Fall(0.9, 8, 4.0), 5)], ids=str
)
def test_a_limit_of_iterations_waits_while_the_objective_falls(fall, iterations):
    # each of Newton's iterations takes the objective to (15/16)^16, three of them to 4.5 percent
    x, p = ca.SX.sym('x'), ca.SX(0, 1)
    problem = nlp_solver('ipopt')('flat', x, p, x**16, ca.SX(0, 1), {'max_iter': 300})
    result = problem.solve(np.array([10.0]), [], np.array([-INF]), np.array([INF]), np.zeros(0), np.zeros(0), None, 5, fall=fall)
    assert result.stopped and result.iterations == pytest.approx(iterations, abs=1)


def test_options_of_the_user_pass_through_and_win(solver):
    result = valley(solver, budget={'max_iter': 100}, options={LIMIT.get(solver, 'max_iter'): 2})
    assert result.iterations == 2


@pytest.mark.parametrize(('option', 'setting'), [('no_such_option', 1), ('linear_solver', 'abacus'), ('print_level', 'much')])
def test_refused_option_is_an_error_that_names_it(solver, option, setting):
    if solver == 'uno':
        # Uno solves small problems without a linear solver
        option = {'linear_solver': 'QP_solver', 'print_level': 'logger'}.get(option, option)
    with pytest.raises(FesdError, match=rf"nlp_options\['{option}'\]"):
        distance(solver, options={'print_solution' if solver == 'uno' else 'print_level': 0, option: setting})


def test_deadline_ends_the_solve(solver):
    result = valley(solver, budget={'max_iter': 1000}, deadline=Deadline(time.perf_counter() - 1))
    assert not result.solved
    assert result.iterations <= 1
    assert valley(solver, budget={'max_iter': 1000}, deadline=Deadline(time.perf_counter() + 60)).solved


@pytest.mark.parametrize(
    ('name', 'module', 'fix'),
    [('cyipopt', 'cyipopt', 'pip install cyipopt.*apt-get install'), ('pounce', 'pyomo_pounce', 'pip install pyomo-pounce')],
)
def test_solver_that_is_not_installed_says_how_to_get_it(monkeypatch, name, module, fix):
    monkeypatch.setitem(sys.modules, module, None)
    monkeypatch.delitem(sys.modules, f'pyomo_fesd.mpcc.nlp.{name}_solver', raising=False)
    with pytest.raises(FesdError, match=rf"(?s)nlp_solver='{name}'.*{module}.*Fix: .*{fix}"):
        nlp_solver(name)


def test_casadi_without_the_solver(monkeypatch):
    monkeypatch.setattr(ca, 'has_nlpsol', lambda name: False)
    with pytest.raises(FesdError, match=r"(?s)nlp_solver='uno'.*casadi \d.*Fix: pip install"):
        nlp_solver('uno')


@pytest.mark.parametrize(('name', 'cause'), [('no_such_solver', 'no working executable'), ('mpec_hybrid', 'not read NL files')])
def test_name_that_is_not_an_nlp_solver(name, cause):
    with pytest.raises(FesdError, match=rf"(?s){name}.*{cause}.*Fix: .*'ipopt', 'uno', 'cyipopt'"):
        nlp_solver(name)


def test_table_names_classes_that_exist():
    for module, kind, _ in NLP_SOLVERS.values():
        if module != 'cyipopt_solver':
            assert issubclass(getattr(importlib.import_module(f'pyomo_fesd.mpcc.nlp.{module}'), kind), NlpSolver)


def test_a_solution_to_acceptable_tolerances_is_solved_but_not_exact():
    found = {
        status: NlpResult(np.zeros(1), 0.0, status, 1, np.zeros(0), np.zeros(1)) for status in (SOLVED[0], ACCEPTABLE, DIVERGING)
    }
    assert [(one.solved, one.is_exact) for one in found.values()] == [(True, True), (True, False), (False, False)]


def test_functions_of_derivatives_evaluate_no_values():
    x, p = ca.SX.sym('x', 2), ca.SX.sym('p')
    f, g = p * ca.exp(x[0]), ca.vertcat(ca.sin(x[1]), x[0] * x[1])
    given = derivative_functions(x, p, f, g, automatic(x, f, g))
    assert [given[name].size_out(0) for name in ('grad_f', 'jac_g')] == [(1, 1), (2, 1)]
    assert [given[name].nnz_out(0) for name in ('grad_f', 'jac_g')] == [0, 0]
    assert given['grad_f']([0.0, 0.0], 3.0)[1].full().tolist() == [[3.0], [0.0]]
