"""``time_limit`` bounds the whole call: compilation, all elements of a simulation, all rounds of a refinement."""

import math
import time

import pyomo.environ as pyo
import pytest
from problems.running import transform
from pyomo.contrib.solver.common.factory import SolverFactory as SolverFactoryV2
from pyomo.contrib.solver.common.results import SolutionStatus, TerminationCondition

import pyomo_fesd
from pyomo_fesd import FesdError
from pyomo_fesd.mpcc.compile import compile as compilation
from pyomo_fesd.refinement import round_solver
from tests.models import dcs, signum, snapshot


def model():
    m = signum()
    m.y[0].fix(1.0)
    m.rest = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == -m.y[t])
    return m


def slow(function, seconds):
    def call(*args, **kwds):
        time.sleep(seconds)
        return function(*args, **kwds)

    return call


@pytest.mark.parametrize('solver', ['mpec_hybrid', 'casadi_ipopt'])
def test_a_compilation_ends_between_its_steps(solver, monkeypatch):
    monkeypatch.setattr(compilation, 'model_rows', slow(compilation.model_rows, 0.2))
    monkeypatch.setattr(compilation, 'assemble', lambda *args: pytest.fail("too late"))
    m = pyo.ConcreteModel()
    m.x = pyo.Var(initialize=1.0)
    m.c = pyo.Constraint(expr=m.x**2 == 2)
    results = SolverFactoryV2(solver).solve(m, time_limit=0.1, raise_exception_on_nonoptimal_result=False, load_solutions=False)
    assert results.termination_condition is TerminationCondition.maxTimeLimit
    assert results.solution_status in (SolutionStatus.noSolution, SolutionStatus.unknown)
    assert m.x.value == 1.0


def test_a_simulation_says_how_far_it_came(monkeypatch):
    m = transform(model(), 6, 2)
    element = pyomo_fesd.simulation.element_solver.ElementSolver
    monkeypatch.setattr(element, '_read', slow(element._read, 0.3))
    with pytest.raises(FesdError, match=r"(?s)the time limit is reached at time [\d.]+.*Fix: .*time_limit") as error:
        pyomo_fesd.simulate(m, time_limit=1.0)
    until = float(str(error.value).split('at time ')[1].split()[0])
    assert 0 < until < 2


def test_a_refinement_keeps_the_last_round_in_time(monkeypatch, caplog):
    monkeypatch.setattr(round_solver, 'simulate', slow(pyomo_fesd.simulate, 1.0))
    m = dcs(model())
    began = time.perf_counter()
    found = pyomo_fesd.refine(m, 1e-12, time_limit=4.0)
    assert time.perf_counter() - began < 4.0 * 1.2 + 1
    assert not found.reached and 'time limit' in caplog.text
    assert m.y[2].value == pytest.approx(math.exp(-2), abs=1e-4)


def test_a_refinement_without_any_round_leaves_the_model_as_it_was():
    m = dcs(model())
    before = snapshot(m)
    with pytest.raises(FesdError, match="time limit"):
        pyomo_fesd.refine(m, 1e-6, time_limit=1e-3)
    assert snapshot(m) == before


def test_a_round_that_fails_after_a_good_one_costs_no_other_solve(monkeypatch):
    calls = []

    def second_fails(*args, **kwds):
        calls.append(args)
        if len(calls) == 2:
            raise FesdError('t', "simulate: it cannot go on", "take another model")
        return pyomo_fesd.simulate(*args, **kwds)

    monkeypatch.setattr(round_solver, 'simulate', second_fails)
    m = dcs(model())
    found = pyomo_fesd.refine(m, 1e-12, max_rounds=2)
    assert not found.reached and len(calls) == 2
    assert list(found.table['elements'])[0] == len(m.t.get_finite_elements()) - 1
    assert m.y[2].value == pytest.approx(math.exp(-2), abs=1e-4)
    assert [s.time for s in pyomo_fesd.switches(m, m.t)] == pytest.approx([2 / 3], abs=1e-6)
