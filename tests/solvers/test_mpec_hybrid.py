"""mpec_hybrid as a Pyomo solver: options, results, log, limits, refusals."""

import io
import itertools
import os
import signal
import time

import numpy as np
import oscillator
import pyomo.environ as pyo
import pytest
from problems import small_mpccs
from pyomo.contrib.solver.common.factory import SolverFactory as SolverFactoryV2
from pyomo.contrib.solver.common.results import SolutionStatus, TerminationCondition
from pyomo.contrib.solver.common.util import NoOptimalSolutionError
from pyomo.gdp import Disjunction
from pyomo.mpec import Complementarity, complements

from pyomo_fesd import FesdError
from pyomo_fesd.mpcc.nlp import NEWTON, casadi_solvers


def toy():
    return small_mpccs.toy(0.0, 0.0)[0]


def big_oscillator():
    m = oscillator.build()
    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=300, ncp=3)
    return m


def test_both_interfaces_give_the_same_answer():
    legacy, new = toy(), toy()
    results = pyo.SolverFactory('mpec_hybrid').solve(legacy)
    results_v2 = SolverFactoryV2('mpec_hybrid').solve(new)
    assert pyo.check_optimal_termination(results)
    assert results_v2.termination_condition is TerminationCondition.convergenceCriteriaSatisfied
    assert results_v2.solution_status is SolutionStatus.optimal
    assert results_v2.incumbent_objective == pytest.approx(1)
    assert pyo.value(legacy.f) == pytest.approx(pyo.value(new.f))


def test_results_tell_what_was_done():
    info = SolverFactoryV2('mpec_hybrid').solve(toy()).extra_info
    assert info.stationarity == 'B'
    assert info.pairs == 1
    assert info.nlps >= 2 and info.nlp_iterations > 0 and info.lpecs >= 1
    assert info.complementarity <= 1e-9 and info.violation <= 1e-9
    assert info.complementarity_scaled <= 1e-9 and info.violation_scaled <= 1e-9
    assert info.biactive_pairs == 0
    assert len(info.steps) >= info.nlps


def test_time_is_reported_by_phase():
    timer = SolverFactoryV2('mpec_hybrid').solve(toy()).timing_info.timer
    assert {'compile', 'build', 'relaxation', 'branch', 'lpec'} <= set(timer.timers)


@pytest.mark.parametrize(
    'solve',
    [
        lambda m: pyo.SolverFactory('mpec_hybrid', eps_init=1e-3).solve(m),
        lambda m: pyo.SolverFactory('mpec_hybrid').solve(m, options={'eps_init': 1e-3}),
        lambda m: pyo.SolverFactory('mpec_hybrid').solve(m, eps_init=1e-3),
        lambda m: SolverFactoryV2('mpec_hybrid').solve(m, eps_init=1e-3),
        lambda m: SolverFactoryV2('mpec_hybrid').solve(m, solver_options={'eps_init': 1e-3}),
    ],
)
def test_every_way_to_give_an_option_works(solve):
    results = solve(toy())
    steps = results.extra_info.steps if hasattr(results, 'extra_info') else results.solver.steps
    assert steps[0].eps == pytest.approx(1e-3)


def test_options_can_be_set_on_config():
    solver = pyo.SolverFactory('mpec_hybrid')
    solver.config.eps_init = 1e-3
    assert solver.solve(toy()).solver.steps[0].eps == pytest.approx(1e-3)


def test_options_of_one_call_do_not_outlive_it():
    solver = pyo.SolverFactory('mpec_hybrid')
    solver.solve(toy(), options={'eps_init': 1e-3})
    assert solver.solve(toy()).solver.steps[0].eps == pytest.approx(1.0)


def test_the_older_name_of_a_warm_start_is_known():
    m = toy()
    pyo.SolverFactory('mpec_hybrid').solve(m)
    again = pyo.SolverFactory('mpec_hybrid').solve(m, warmstart=True, tee=False, load_solutions=True)
    assert again.solver.steps[0].kind == 'branch'
    pyo.SolverFactory('mpec_hybrid').solve(m, warmstart=None)


@pytest.mark.parametrize('sense', [pyo.minimize, pyo.maximize])
def test_bounds_that_are_not_known_are_infinite_in_the_older_interface(sense):
    # progressive hedging of mpi-sppy calculates with them
    m = pyo.ConcreteModel()
    m.x = pyo.Var(bounds=(0, 2), initialize=1)
    m.y = pyo.Var(bounds=(0, None), initialize=1)
    m.c = Complementarity(expr=complements(m.x >= 0, m.y >= 0))
    m.o = pyo.Objective(expr=sense * ((m.x - 1) ** 2 + (m.y - 0.5) ** 2), sense=sense)
    problem = pyo.SolverFactory('mpec_hybrid').solve(m).problem
    known, unknown = ('upper_bound', 'lower_bound') if sense == pyo.minimize else ('lower_bound', 'upper_bound')
    assert getattr(problem, known) == pytest.approx(sense * 0.25, abs=1e-6)
    assert getattr(problem, unknown) == -sense * float('inf')


def test_unknown_option_is_named():
    with pytest.raises(FesdError, match='unknown option.*no_such_thing'):
        pyo.SolverFactory('mpec_hybrid').solve(toy(), options={'no_such_thing': 1})


def test_options_reach_ipopt():
    results = SolverFactoryV2('mpec_hybrid').solve(toy(), nlp_options={'max_iter': 1}, raise_exception_on_nonoptimal_result=False)
    assert max(step.iterations for step in results.extra_info.steps if step.status != NEWTON) <= 1


def test_tee_prints_a_table_one_line_a_step(capsys):
    results = pyo.SolverFactory('mpec_hybrid').solve(toy(), tee=True)
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == 'mpec_hybrid: 2 variables, 0 constraints, 1 pairs'
    assert lines[1].split()[:3] == ['step', 'what', 'eps']
    assert len(lines) == 2 + len(list(results.solver.steps)) + 2
    assert 'B-stationary point found and certified' in lines[-2]


def test_without_tee_nothing_is_printed(capfd):
    pyo.SolverFactory('mpec_hybrid').solve(toy())
    assert capfd.readouterr() == ('', '')


def test_tee_goes_to_a_stream_too():
    stream = io.StringIO()
    SolverFactoryV2('mpec_hybrid').solve(toy(), tee=stream)
    assert 'certificate' in stream.getvalue()


def test_solution_is_loaded_only_when_asked():
    m = toy()
    results = SolverFactoryV2('mpec_hybrid').solve(m, load_solutions=False)
    assert (m.x.value, m.y.value) == (0.0, 0.0)
    results.solution_loader.load_solution()
    assert pyo.value(m.f) == pytest.approx(1)


def test_duals_are_those_of_the_branch():
    m = toy()
    m.k = pyo.Constraint(expr=m.x + m.y <= 0.5)
    m.dual = pyo.Suffix(direction=pyo.Suffix.IMPORT)
    pyo.SolverFactory('mpec_hybrid').solve(m)
    # f falls by 1 for each unit of the bound: d/dx (x - 1)^2 at 1/2
    assert m.dual[m.k] == pytest.approx(-1.0)


def test_same_model_can_be_solved_again_with_other_data():
    m = toy()
    m.goal = pyo.Param(initialize=1.0, mutable=True)
    m.del_component(m.f)
    m.f = pyo.Objective(expr=(m.x - m.goal) ** 2 + (m.y - 0.1) ** 2)
    solver = pyo.SolverFactory('mpec_hybrid')
    solver.solve(m)
    assert m.x.value == pytest.approx(1)
    m.goal = 3.0
    solver.solve(m)
    assert m.x.value == pytest.approx(3)
    assert set(m.component_map()) == {'x', 'y', 'c', 'goal', 'f'}


def test_infeasible_raises_in_the_new_interface_with_the_names():
    m = toy()
    m.k = pyo.Constraint(expr=m.x + m.y >= 1)
    m.e = pyo.Constraint(expr=m.x == m.y)
    with pytest.raises(NoOptimalSolutionError, match=r'infeasible.*largest violations: c'):
        SolverFactoryV2('mpec_hybrid').solve(m)


def test_time_limit_is_reported_and_nothing_is_left_behind():
    m = big_oscillator()
    names = set(m.component_map())
    results = pyo.SolverFactory('mpec_hybrid').solve(m, timelimit=0.01)
    assert results.solver.termination_condition == pyo.TerminationCondition.maxTimeLimit
    assert set(m.component_map()) == names


def test_iteration_limit_is_reported():
    results = pyo.SolverFactory('mpec_hybrid').solve(big_oscillator(), max_iterations=3, simulate_first=False)
    assert results.solver.termination_condition == pyo.TerminationCondition.maxIterations


@pytest.fixture
def attentive():
    """Ctrl-C has Python's handler, also where the tests run in the background of a shell, which lets its jobs ignore it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_ctrl_c_during_an_nlp_ends_with_a_result(monkeypatch, attentive):
    m = big_oscillator()
    names, iterations, ask = set(m.component_map()), itertools.count(), casadi_solvers._StopCallback.eval_buffer

    def press(watch, *buffers):
        if next(iterations) == 3:
            signal.raise_signal(signal.SIGINT)
        return ask(watch, *buffers)

    monkeypatch.setattr(casadi_solvers._StopCallback, 'eval_buffer', press)
    results = pyo.SolverFactory('mpec_hybrid').solve(m, simulate_first=False)
    assert results.solver.termination_condition == pyo.TerminationCondition.resourceInterrupt
    assert set(m.component_map()) == names


def once_certified(act):
    """A callback that calls ``act`` after the first outer iteration with a certified point."""

    def callback(progress):
        if progress.certified:
            act()

    return callback


@pytest.fixture
def ctrl_c():
    """Ctrl-C as in a terminal: a shell starts background processes, such as a CI job, with it ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures('ctrl_c')
@pytest.mark.parametrize('interface', [pyo.SolverFactory, SolverFactoryV2])
def test_ctrl_c_keeps_the_best_point(interface):
    m, best = small_mpccs.scholtes4()
    press = once_certified(lambda: os.kill(os.getpid(), signal.SIGINT))
    results = interface('mpec_hybrid').solve(m, callback=press, raise_exception_on_nonoptimal_result=False)
    info = results.solver if interface is pyo.SolverFactory else results.extra_info
    assert info.outcome == 'interrupted'
    assert info.stationarity == 'B'
    assert pyo.value(m.f) == pytest.approx(best, abs=1e-8)


def test_a_time_limit_keeps_the_best_point():
    m, best = small_mpccs.scholtes4()  # its homotopy goes on after the first certificate
    options = {'time_limit': 5, 'raise_exception_on_nonoptimal_result': False}
    results = SolverFactoryV2('mpec_hybrid').solve(m, callback=once_certified(lambda: time.sleep(5)), **options)
    assert results.termination_condition is TerminationCondition.maxTimeLimit
    assert results.solution_status is SolutionStatus.feasible
    assert pyo.value(m.f) == pytest.approx(best, abs=1e-8)


def iterations_to_the_first_certificate():
    steps = SolverFactoryV2('mpec_hybrid').solve(small_mpccs.scholtes4()[0]).extra_info.steps
    first = [step.kind for step in steps].index('certificate')
    return sum(step.iterations for step in steps[:first])


def test_an_iteration_limit_keeps_the_best_point():
    m, best = small_mpccs.scholtes4()
    # one more than it took to get there: the relaxation after it is the last
    options = {'max_iterations': iterations_to_the_first_certificate() + 1, 'raise_exception_on_nonoptimal_result': False}
    results = SolverFactoryV2('mpec_hybrid').solve(m, **options)
    assert results.termination_condition is TerminationCondition.iterationLimit
    assert results.solution_status is SolutionStatus.feasible
    assert pyo.value(m.f) == pytest.approx(best, abs=1e-8)


def test_a_branch_solution_at_the_iteration_limit_is_kept_and_certified():
    m, best = small_mpccs.scholtes4()
    options = {'max_iterations': iterations_to_the_first_certificate(), 'raise_exception_on_nonoptimal_result': False}
    results = SolverFactoryV2('mpec_hybrid').solve(m, **options)
    assert results.extra_info.nlp_iterations == options['max_iterations']
    assert results.solution_status in (SolutionStatus.feasible, SolutionStatus.optimal)
    assert results.extra_info.stationarity == 'B'
    assert pyo.value(m.f) == pytest.approx(best, abs=1e-8)


def at_a_minimum(m):
    """Whether the model stands at one of the two minima of ``small_mpccs.badly_scaled``."""
    return min(abs(m.x.value - 0.01) + abs(m.y.value), abs(m.x.value) + abs(m.y.value - 1)) < 1e-8


class LateBranch(io.StringIO):
    """The time runs out with the line of the first branch."""

    def write(self, text):
        if ' branch ' in text:
            time.sleep(3)
        return super().write(text)


@pytest.mark.parametrize('dual, stationarity', [(True, 'B'), (False, 'not certified')])
def test_a_branch_solution_at_the_time_limit_is_kept(monkeypatch, dual, stationarity):
    """Certified if weak duality is enough, uncertified if HiGHS would have needed time."""
    monkeypatch.setattr('pyomo_fesd.mpcc.subproblems.linear_program.ATTEMPTS', ())
    if not dual:
        monkeypatch.setattr('pyomo_fesd.mpcc.subproblems.descent.Descent.proved', lambda self, y: np.inf)
    m = small_mpccs.badly_scaled()[0]
    options = {'time_limit': 3, 'raise_exception_on_nonoptimal_result': False}
    results = SolverFactoryV2('mpec_hybrid').solve(m, tee=LateBranch(), **options)
    assert results.termination_condition is TerminationCondition.maxTimeLimit
    assert results.solution_status is SolutionStatus.feasible
    assert results.extra_info.stationarity == stationarity
    assert at_a_minimum(m)


def disjunction(m):
    m.d = Disjunction(expr=[[m.x <= 1], [m.x >= 2]])


def logic(m):
    m.b = pyo.BooleanVar([1, 2])
    m.logic = pyo.LogicalConstraint(expr=pyo.lor(m.b[1], m.b[2]))


def integer(m):
    m.n = pyo.Var(domain=pyo.Integers, initialize=1)
    m.k = pyo.Constraint(expr=m.n <= 3)


def sos(m):
    m.v = pyo.Var([1, 2], initialize=0)
    m.s = pyo.SOSConstraint(var=m.v, sos=1)


def second_objective(m):
    m.f2 = pyo.Objective(expr=m.x)


def three_bounds(m):
    m.c2 = Complementarity(expr=complements(pyo.inequality(0, m.x + m.y, 1), pyo.inequality(0, m.x - m.y, 1)))


@pytest.mark.parametrize(
    'spoil, name',
    [(disjunction, 'd'), (logic, 'logic'), (integer, 'n'), (sos, 's'), (second_objective, 'f2'), (three_bounds, 'c2')],
)
def test_what_is_no_mpcc_is_refused_by_name_and_left_as_it_was(spoil, name):
    m = toy()
    spoil(m)
    names = set(m.component_map())
    with pytest.raises(FesdError, match=rf'^{name}.*\n    Fix: '):
        pyo.SolverFactory('mpec_hybrid').solve(m)
    assert set(m.component_map()) == names
    assert m.c.active


@pytest.mark.parametrize(
    'condition',
    [
        lambda m: complements(m.x, m.y),
        lambda m: complements(m.x >= 0, m.y),
        lambda m: complements(m.x, m.y >= 0),
        lambda m: complements(0 <= m.x, 0 <= m.y),
        lambda m: complements(-m.x <= 0, m.y + 1 >= 1),
    ],
)
def test_conditions_as_people_write_them(condition):
    m = toy()
    m.del_component(m.c)
    m.c = Complementarity(expr=condition(m))
    pyo.SolverFactory('mpec_hybrid').solve(m)
    assert sorted((round(m.x.value, 6), round(m.y.value, 6))) == [0, 1]


def test_fixed_values_that_violate_a_constraint_are_called_infeasible_by_name():
    m = small_mpccs.pair(1.0, 1.0)
    m.f = pyo.Objective(expr=m.x)
    m.z = pyo.Var(initialize=1)
    m.z.fix()
    m.k = pyo.Constraint(expr=m.z >= 2)
    results = pyo.SolverFactory('mpec_hybrid').solve(m, load_solutions=False)
    assert results.solver.termination_condition == pyo.TerminationCondition.infeasible
    assert "'k'" in results.solver.reason


@pytest.mark.parametrize('start', [None, -1.0, 1.0])
def test_a_variable_that_stands_only_in_a_pair_is_free(start):
    m = pyo.ConcreteModel()
    m.x, m.y = pyo.Var(initialize=2), pyo.Var(initialize=start)
    m.c = Complementarity(expr=complements(m.x >= 0, m.y >= 0))
    m.f = pyo.Objective(expr=(m.x - 1) ** 2)
    results = pyo.SolverFactory('mpec_hybrid').solve(m)
    assert results.solver.stationarity == 'B'
    assert (m.x.value, m.y.value) == pytest.approx((1, 0))


def test_scaling_factors_change_neither_the_answer_nor_its_units():
    answers = []
    for factor in (None, 1e3):
        m = pyo.ConcreteModel()
        m.x, m.y = pyo.Var(initialize=1, bounds=(0, None)), pyo.Var(initialize=1, bounds=(0, None))
        m.k = pyo.Constraint(expr=m.x + m.y >= 0.5)
        m.c = Complementarity(expr=complements(m.x >= 0, m.y >= 0))
        m.f = pyo.Objective(expr=(m.x + 1) ** 2 + 2 * (m.y + 1) ** 2)
        m.dual = pyo.Suffix(direction=pyo.Suffix.IMPORT)
        if factor:
            m.scaling_factor = pyo.Suffix(direction=pyo.Suffix.EXPORT)
            m.scaling_factor[m.x], m.scaling_factor[m.k], m.scaling_factor[m.f] = factor, 1 / factor, 0.1
        results = pyo.SolverFactory('mpec_hybrid').solve(m)
        answers.append((m.x.value, m.y.value, pyo.value(m.f), m.dual[m.k], results.problem.upper_bound))
    assert answers[0] == pytest.approx((0.5, 0, 4.25, 3, 4.25), rel=1e-6, abs=1e-6)
    assert answers[1] == pytest.approx(answers[0], rel=1e-6, abs=1e-6)


def test_a_review_that_fails_costs_no_result(monkeypatch):
    def fail(*arguments):
        raise TypeError("no number")

    monkeypatch.setattr('pyomo_fesd.solvers.mpec_hybrid.diagnose', fail)
    m = small_mpccs.toy(0.3, 0.4)[0]
    results = SolverFactoryV2('mpec_hybrid').solve(m)
    assert results.extra_info.stationarity == 'B'
    assert 'TypeError: no number' in results.extra_info.warnings[0]
    monkeypatch.setattr('pyomo_fesd.solvers.plugin.structure', fail)
    m.k = pyo.Constraint(expr=m.x + m.y <= -1)
    results = SolverFactoryV2('mpec_hybrid').solve(m, raise_exception_on_nonoptimal_result=False)
    assert results.termination_condition is TerminationCondition.locallyInfeasible
