"""``casadi_ipopt``: an NLP solver for Pyomo without an executable.  Answers in closed form."""

import logging

import pyomo.environ as pyo
import pytest
from pyomo.contrib.incidence_analysis import solve_strongly_connected_components
from pyomo.contrib.solver.common.factory import SolverFactory as NewSolverFactory
from pyomo.contrib.solver.common.results import SolutionStatus, TerminationCondition
from pyomo.contrib.solver.common.util import NoOptimalSolutionError, NoSolutionError
from pyomo.core.base.suffix import Suffix
from pyomo.mpec import Complementarity, complements
from pyomo.util.subsystems import create_subsystem_block

import pyomo_fesd

SOLVERS = ('casadi_ipopt', 'mpec_hybrid')


@pytest.fixture
def solver():
    return pyo.SolverFactory('casadi_ipopt')


def nearest(sense=pyo.minimize):
    """The point of x1 + x2 <= 2, x1 <= 1.2 nearest to (2, 2), which is (1, 1); both multipliers are -2 or 0."""
    m = pyo.ConcreteModel()
    m.x = pyo.Var([1, 2], initialize=0.5)
    distance = (m.x[1] - 2) ** 2 + (m.x[2] - 2) ** 2
    m.cost = pyo.Objective(expr=distance if sense == pyo.minimize else -distance, sense=sense)
    m.line = pyo.Constraint(expr=m.x[1] + m.x[2] <= 2)
    m.x[1].setub(1.2)
    m.dual, m.rc = Suffix(direction=Suffix.IMPORT), Suffix(direction=Suffix.IMPORT)
    return m


def root(start=1.0):
    """y**2 = 4 on a block of its own, beside an x that it shares."""
    m = pyo.ConcreteModel()
    m.x = pyo.Var(initialize=3)
    m.b = pyo.Block()
    m.b.y = pyo.Var(initialize=start)
    m.b.square = pyo.Constraint(expr=m.b.y**2 == m.x + 1)
    return m


def values(m):
    return [v.value for v in m.component_data_objects(pyo.Var)]


# What it finds


@pytest.mark.parametrize('sense, multiplier', [(pyo.minimize, -2), (pyo.maximize, 2)])
def test_an_optimum_with_its_multipliers(solver, sense, multiplier):
    m = nearest(sense)
    results = solver.solve(m)
    pyo.assert_optimal_termination(results)
    assert values(m) == pytest.approx([1, 1], abs=1e-7)
    assert m.dual[m.line] == pytest.approx(multiplier, abs=1e-7)
    assert m.rc[m.x[1]] == pytest.approx(0, abs=1e-7)


def test_a_bound_has_its_multiplier(solver):
    m = nearest()
    m.x[1].setub(0.5)
    solver.solve(m)
    # x = (0.5, 1.5): 2 (x2 - 2) = -1 = dual, 2 (x1 - 2) = -3 = dual + rc
    assert (m.dual[m.line], m.rc[m.x[1]]) == pytest.approx((-1, -2), abs=1e-6)


def test_the_new_interface():
    m = nearest()
    results = NewSolverFactory('casadi_ipopt').solve(m)
    assert results.solution_status is SolutionStatus.optimal
    assert results.incumbent_objective == pytest.approx(2, abs=1e-7)
    assert results.extra_info.return_status == 'Solve_Succeeded' and results.extra_info.iteration_count > 0


def test_a_block_is_solved_with_what_is_fixed_elsewhere(solver):
    m = root()
    m.x.fix()
    m.other = pyo.Constraint(expr=m.x == 7)  # not on the block
    pyo.assert_optimal_termination(solver.solve(m.b))
    assert m.b.y.value == pytest.approx(2, abs=1e-8)
    assert [c.local_name for c in m.b.component_objects()] == ['y', 'square']


def test_nothing_to_solve(solver):
    m = root(2.0)
    m.x.fix()
    m.b.y.fix()
    pyo.assert_optimal_termination(solver.solve(m))


def test_values_that_are_missing_are_zero(solver):
    m = pyo.ConcreteModel()
    m.x = pyo.Var()
    m.c = pyo.Constraint(expr=pyo.exp(m.x) + m.x == 1)
    solver.solve(m)
    assert m.x.value == pytest.approx(0, abs=1e-12)


def test_a_model_is_written_where_it_is_asked_for(solver, tmp_path):
    m = root()
    m.x.fix()
    solver.config.working_dir = str(tmp_path)
    solver.solve(m)
    assert [p.suffix for p in tmp_path.iterdir()] == ['.nl']


# Temporary blocks, as initialisers make them


@pytest.mark.parametrize('name', SOLVERS)
def test_a_subsystem_of_another_model(name):
    m = root()
    m.x.fix()
    block = create_subsystem_block([m.b.square], [m.b.y])
    pyo.assert_optimal_termination(pyo.SolverFactory(name).solve(block))
    assert m.b.y.value == pytest.approx(2, abs=1e-8)


@pytest.mark.parametrize('name', SOLVERS)
def test_strongly_connected_components(name):
    m = pyo.ConcreteModel()
    m.x = pyo.Var([1, 2, 3], initialize=1.0)
    m.c = pyo.Constraint([1, 2, 3])
    m.c[1] = m.x[1] ** 2 + m.x[2] ** 2 == 25
    m.c[2] = m.x[1] * m.x[2] == 12
    m.c[3] = m.x[3] + m.x[1] + m.x[2] == 0
    m.x[1].value = 5
    solve_strongly_connected_components(m, solver=pyo.SolverFactory(name), use_calc_var=False)
    assert values(m) == pytest.approx([4, 3, -7], abs=1e-7)


@pytest.mark.parametrize('name', SOLVERS)
def test_a_clone_that_still_means_its_original_is_refused_all_the_same(name):
    m, other = root(), root()
    m.wrong = pyo.Constraint(expr=other.x + m.x == 1)
    with pytest.raises(pyomo_fesd.FesdError, match="'x' of another model"):
        pyo.SolverFactory(name).solve(m)


# Scaling


def badly_scaled():
    m = pyo.ConcreteModel()
    m.x, m.y = pyo.Var(initialize=1e6), pyo.Var(initialize=1e-6)
    m.sum = pyo.Constraint(expr=m.x * 1e-6 + m.y * 1e6 == 3)
    m.product = pyo.Constraint(expr=m.x * m.y == 2)
    m.cost = pyo.Objective(expr=m.y * 1e6)
    m.scaling_factor = Suffix(direction=Suffix.EXPORT)
    for component, factor in ((m.x, 1e-6), (m.y, 1e6), (m.cost, 10.0)):
        m.scaling_factor[component] = factor
    m.dual = Suffix(direction=Suffix.IMPORT)
    return m


@pytest.mark.parametrize('asked', [{'options': {'nlp_scaling_method': 'user-scaling'}}, {'writer_config': {'scale_model': True}}])
def test_values_and_multipliers_do_not_depend_on_the_scaling(solver, asked):
    m = badly_scaled()
    pyo.assert_optimal_termination(solver.solve(m, **asked))
    assert (m.x.value * 1e-6, m.y.value * 1e6) == pytest.approx((2, 1), rel=1e-6)
    # cost' = (0, 1e6): the rows' gradients are (1e-6, 1e6) and (1e-6, 2e6) at the solution
    assert (m.dual[m.sum], m.dual[m.product]) == pytest.approx((-1, 1), rel=1e-5)


def first_violation(m, asked, method):
    """What Ipopt's log says of the start of ``asked``, whose square on ``m.b`` misses 4 by 3."""
    options = {'nlp_scaling_method': method, 'print_level': 5}
    results = NewSolverFactory('casadi_ipopt').solve(asked, solver_options=options)
    line = next(line for line in results.solver_log.splitlines() if line.startswith('   0 '))
    return float(line.split()[2])


@pytest.mark.parametrize('home', ['model', 'block'])
@pytest.mark.parametrize('ask', ['model', 'block', 'temporary block'])
def test_user_scaling_is_what_ipopt_sees(home, ask):
    """Wherever the suffix stands: IDAES has one on every block, and solves temporary ones."""
    for method, seen in (('none', 3.0), ('gradient-based', 3.0), ('user-scaling', 300.0)):
        m = root()
        m.x.fix()
        place = {'model': m, 'block': m.b}[home]
        place.scaling_factor = Suffix(direction=Suffix.EXPORT)
        place.scaling_factor[m.b.square] = 100
        asked = {'model': m, 'block': m.b, 'temporary block': create_subsystem_block([m.b.square], [m.b.y])}[ask]
        assert first_violation(m, asked, method) == pytest.approx(seen)
        assert place.scaling_factor.active


# Options


def test_options_of_one_call_do_not_outlive_it(solver):
    solver.options['tol'] = 1e-9
    assert solver.solve(nearest(), options={'max_iter': 1}).solver.termination_condition == 'maxIterations'
    assert solver.options.value() == {'tol': 1e-9}
    pyo.assert_optimal_termination(solver.solve(nearest()))


def test_what_idaes_asks_for_by_default_is_replaced_or_left_out(solver, caplog):
    with caplog.at_level(logging.DEBUG, 'pyomo_fesd'):
        results = solver.solve(nearest(), options={'linear_solver': 'ma57', 'halt_on_ampl_error': 'yes'})
    pyo.assert_optimal_termination(results)
    assert 'mumps is used instead' in caplog.text and 'halt_on_ampl_error' in caplog.text


@pytest.mark.parametrize('options', [{'tolerance': 1e-3}, {'mu_strategy': 'clever'}, {'tol': 1e-9, 'max_iter': 'many'}])
def test_an_option_that_ipopt_refuses_is_named(solver, options):
    *_, name = options
    with pytest.raises(pyomo_fesd.FesdError, match=rf"^options\['{name}'\]: ipopt refuses"):
        solver.solve(nearest(), options=options)


def test_the_log_is_ipopts(solver, capfd):
    solver.solve(nearest(), tee=True)
    assert 'EXIT: Optimal Solution Found.' in capfd.readouterr().out
    solver.solve(nearest())
    assert not capfd.readouterr().out


# How it ends


def test_limits(solver):
    iterations = solver.solve(nearest(), options={'max_iter': 1})
    assert iterations.solver.termination_condition == pyo.TerminationCondition.maxIterations
    late = solver.solve(nearest(), timelimit=1e-9)
    assert late.solver.termination_condition == pyo.TerminationCondition.maxTimeLimit
    assert late.solver.message == 'Maximum WallTime Exceeded'


def test_infeasible(solver):
    m = root()
    m.x.fix(-2)
    results = solver.solve(m)
    assert results.solver.termination_condition == pyo.TerminationCondition.infeasible
    with pytest.raises(NoOptimalSolutionError, match='Infeasible Problem Detected'):
        NewSolverFactory('casadi_ipopt').solve(m)


def test_fixed_values_that_contradict(solver):
    m = root()
    m.dual = Suffix(direction=Suffix.IMPORT)
    m.x.fix()
    m.b.y.fix()
    results = solver.solve(m)
    assert results.solver.termination_condition == pyo.TerminationCondition.infeasible
    assert "'b.square'" in results.solver.message and not m.dual
    results = NewSolverFactory('casadi_ipopt').solve(m, raise_exception_on_nonoptimal_result=False)
    assert results.termination_condition is TerminationCondition.provenInfeasible
    with pytest.raises(NoSolutionError):
        results.solution_loader.get_vars()


def test_unbounded(solver):
    m = pyo.ConcreteModel()
    m.x = pyo.Var(initialize=1)
    m.cost = pyo.Objective(expr=-m.x)
    assert solver.solve(m).solver.termination_condition == pyo.TerminationCondition.unbounded


def test_too_many_equations_are_named(solver):
    m = root()
    m.x.fix()
    m.b.cube = pyo.Constraint(expr=m.b.y**3 == 8)
    m.b.fourth = pyo.Constraint(expr=m.b.y**4 == 16)
    results = solver.solve(m)
    assert results.solver.termination_condition == pyo.TerminationCondition.error
    assert results.solver.message.startswith('Not Enough Degrees Of Freedom; 2 equation(s) too many, e.g. b.')


@pytest.mark.parametrize(
    'add, message',
    [
        (lambda m: Complementarity(expr=complements(m.x[1] >= 0, m.x[2] >= 0)), 'use mpec_hybrid'),
        (lambda m: pyo.Var(domain=pyo.Binary), 'an integer variable, which casadi_ipopt does not decide'),
        (lambda m: pyo.Objective(expr=m.x[1]), '2 active objectives'),
        (lambda m: pyo.Constraint(expr=pyo.asinh(m.x[1]) <= 1), "'asinh' cannot be evaluated"),
    ],
)
def test_what_it_refuses(solver, add, message):
    m = nearest()
    m.added = add(m)
    with pytest.raises(pyomo_fesd.FesdError, match=message):
        solver.solve(m)
