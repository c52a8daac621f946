"""Solving again without compiling: same answers as anew, and nothing that has changed goes unnoticed."""

import numpy as np
import pyomo.environ as pyo
import pytest
from problems import small_mpccs, stages
from pyomo.contrib.solver.common.factory import SolverFactory as SolverFactoryV2
from pyomo.mpec import Complementarity, complements

from pyomo_fesd import FesdError

GOALS = np.linspace(0.2, 1.5, 20)


def parametric():
    """Parameters in the objective, a row, a range, a side, a mixed condition and a bound; one of them a fixed variable."""
    m = small_mpccs.pair(1.0, 0.0)
    m.goal = pyo.Param(initialize=1.0, mutable=True)
    m.p = pyo.Param(['low', 'high', 'side'], initialize={'low': -1.0, 'high': 5.0, 'side': 0.0}, mutable=True)
    m.fixed = pyo.Var(initialize=1.0)
    m.fixed.fix()
    m.z = pyo.Var([1, 2], initialize=0.5, bounds=(m.p['low'], None))
    m.weighted = pyo.Expression(expr=m.goal * m.z[1])
    m.f = pyo.Objective(expr=(m.x - m.goal) ** 2 + (m.y + 1) ** 2 + (m.z[1] - 2) ** 2 + m.z[2] ** 2)
    m.row = pyo.Constraint(expr=m.weighted + m.x <= 3 * m.fixed)
    m.range = pyo.Constraint(expr=(m.p['low'], m.x + m.z[2], m.p['high']))
    m.only_parameters = pyo.Constraint(expr=m.p['low'] <= m.fixed)
    m.shifted = Complementarity(expr=complements(m.z[2] >= m.p['side'], m.z[1] + m.goal >= 0))
    m.mixed = Complementarity(expr=complements(pyo.inequality(m.p['low'], m.z[1], m.p['high']), m.z[1] - m.goal * m.fixed))
    return m


def set_parameters(m, goal):
    m.goal = goal
    m.p['low'], m.p['high'], m.p['side'] = -goal, 2 * goal, 0.1 * goal
    m.fixed.fix(1 + goal)


def values(m):
    return [v.value for v in m.component_data_objects(pyo.Var)]


def names(m):
    return {c.name for c in m.component_objects()}


@pytest.fixture(params=[pyo.SolverFactory, SolverFactoryV2], ids=['legacy', 'new'])
def solver(request):
    return request.param('mpec_hybrid')


def phases(results):
    timer = results.timing_info['timer'] if isinstance(results.timing_info, dict) else results.timing_info.timer
    return set(timer.timers)


@pytest.mark.parametrize('relaxation', ['auto', 'elastic', 'penalty'])
def test_a_sweep_gives_the_answers_of_fresh_solves_and_compiles_once(solver, relaxation):
    kept, before = parametric(), names(parametric())
    solver.set_instance(kept, parameters=[kept.goal, kept.p, kept.fixed])
    for goal in GOALS:
        fresh = parametric()
        start = parametric()
        for m in (fresh, kept):
            set_parameters(m, goal)
        for v, v0 in zip(kept.component_data_objects(pyo.Var), start.component_data_objects(pyo.Var)):
            if not v.fixed:
                v.set_value(v0.value)
        results = solver.solve(kept, relaxation=relaxation)
        SolverFactoryV2('mpec_hybrid').solve(fresh, relaxation=relaxation)
        assert 'compile' not in phases(results) and 'refresh' in phases(results)
        np.testing.assert_allclose(values(kept), values(fresh), rtol=1e-7, atol=1e-7)
    assert names(kept) == before
    assert kept.fixed.fixed and kept.row.active and kept.range.active and kept.f.active


def test_nlp_solvers_are_built_once_and_anew_for_other_options():
    m, solver = parametric(), SolverFactoryV2('mpec_hybrid')
    solver.set_instance(m, parameters=[m.goal])
    m.goal = 1.2

    def built():
        return {name: id(nlp) for name, nlp in solver._persistent.cache.nlps.items()}

    solver.solve(m)
    first = built()
    m.goal = 1.1
    solver.solve(m)
    assert {name: built()[name] for name in first} == first
    solver.solve(m, branch_tol=1e-8)
    assert built()['branch'] != first['branch']


def test_a_discretised_model_is_swept_and_a_warm_start_needs_less_work():
    m, solver = stages.build(), SolverFactoryV2('mpec_hybrid')
    solver.set_instance(m, parameters=[m.goal, m.x[0]])
    solver.solve(m)
    work = dict.fromkeys((False, True), 0)
    for goal, start in zip(np.linspace(1.0, 1.5, 5), np.linspace(-1.0, -1.2, 5)):
        fresh = stages.build(goal, start)
        SolverFactoryV2('mpec_hybrid').solve(fresh)
        for warm in work:
            m.goal = goal
            m.x[0].fix(start)
            results = solver.solve(m, warm_start=warm)
            work[warm] += results.extra_info.nlp_iterations
            assert results.extra_info.stationarity == 'B'
            assert pyo.value(m.cost) == pytest.approx(pyo.value(fresh.cost), rel=1e-8)
    assert work[True] < 0.5 * work[False]


def test_a_warm_start_stays_at_the_solution_next_to_it_and_goes_on_where_there_is_none():
    m = small_mpccs.toy(0.0, 0.9)[0]
    results = pyo.SolverFactory('mpec_hybrid').solve(m, warm_start=True)
    assert (m.x.value, m.y.value) == pytest.approx((0, 1))
    assert {step.kind for step in results.solver.steps} == {'branch', 'certificate'}
    m.no = pyo.Constraint(expr=m.x >= 0.5)
    results = pyo.SolverFactory('mpec_hybrid').solve(m, warm_start=True)
    assert results.solver.stationarity == 'B'
    assert (m.x.value, m.y.value) == pytest.approx((1, 0))


def test_multipliers_of_a_range_with_parameters_are_those_of_the_constraint():
    m, solver = small_mpccs.toy(1.0, 0.0)[0], pyo.SolverFactory('mpec_hybrid')
    m.p = pyo.Param(initialize=0.5, mutable=True)
    m.k = pyo.Constraint(expr=(-m.p, m.x, m.p))
    m.dual = pyo.Suffix(direction=pyo.Suffix.IMPORT)
    solver.set_instance(m, parameters=[m.p])
    m.p = 0.25
    solver.solve(m)
    assert m.x.value == pytest.approx(0.25) or m.y.value == pytest.approx(1)
    m.y.fix(0)
    solver.solve(m)
    assert m.x.value == pytest.approx(0.25)
    assert m.dual[m.k] == pytest.approx(-1.5)


def test_bounds_and_fixed_variables_are_read_again():
    m, solver = small_mpccs.toy(1.0, 0.0)[0], pyo.SolverFactory('mpec_hybrid')
    solver.set_instance(m)
    m.x.setub(0.75)
    m.x.setlb(0.5)
    solver.solve(m)
    assert (m.x.value, m.y.value) == pytest.approx((0.75, 0))
    m.x.fix(0.6)
    solver.solve(m)
    assert (m.x.value, m.y.value) == pytest.approx((0.6, 0))
    m.x.fix(0.0)
    solver.solve(m)
    assert (m.x.value, m.y.value) == pytest.approx((0, 1))
    m.x.unfix()
    m.x.setlb(0)
    m.y.fix(0)
    solver.solve(m)
    assert (m.x.value, m.y.value) == pytest.approx((0.75, 0))


def test_bounds_that_cross_end_as_infeasible_by_name():
    m, solver = small_mpccs.toy()[0], pyo.SolverFactory('mpec_hybrid')
    solver.set_instance(m)
    m.x.fix(-1)
    results = solver.solve(m, load_solutions=False)
    assert results.solver.termination_condition == pyo.TerminationCondition.infeasible
    assert "'x'" in results.solver.reason


@pytest.mark.parametrize('value', [0.0, 2.0])
def test_a_side_that_is_a_parameter(value):
    m, solver = small_mpccs.pair(1.0, 1.0), pyo.SolverFactory('mpec_hybrid')
    m.p = pyo.Param(initialize=1.0, mutable=True)
    m.q = pyo.Var(initialize=1.0)
    m.q.fix()
    m.f = pyo.Objective(expr=(m.x - 1) ** 2 + (m.y - 2) ** 2)
    m.by_param = Complementarity(expr=complements(m.p >= 0, m.x >= 0))
    m.by_variable = Complementarity(expr=complements(m.y >= 0, m.q >= 0))
    solver.set_instance(m, parameters=[m.p, m.q])
    m.p = value
    m.q.fix(2.0 - value)
    solver.solve(m)
    assert (m.x.value, m.y.value) == pytest.approx((0, 2) if value else (1, 0))


def test_models_without_pairs_and_without_objective():
    m, solver = pyo.ConcreteModel(), pyo.SolverFactory('mpec_hybrid')
    m.x = pyo.Var(initialize=3)
    m.p = pyo.Param(initialize=1.0, mutable=True)
    m.k = pyo.Constraint(expr=m.x**3 == m.p)
    solver.set_instance(m, parameters=[m.p])
    for now in (8.0, 27.0):
        m.p = now
        assert solver.solve(m).solver.stationarity == 'B'
        assert m.x.value**3 == pytest.approx(now)


def test_another_model_is_compiled_as_ever():
    m, other, solver = small_mpccs.toy()[0], small_mpccs.kth2()[0], SolverFactoryV2('mpec_hybrid')
    solver.set_instance(m)
    assert 'compile' in phases(solver.solve(other))
    assert 'compile' not in phases(solver.solve(m))


def unlisted_param(m):
    m.goal = 7.0


def unlisted_fixed_variable(m):
    m.fixed.fix(7.0)


def unfixed(m):
    m.fixed.unfix()


def deactivated(m):
    m.row.deactivate()


def added(m):
    m.new = pyo.Constraint(expr=m.x <= 1)


def changed(m):
    m.row.set_value(m.x <= 1)


def expression(m):
    m.weighted.set_value(m.z[1])


def pair_deactivated(m):
    m.c.deactivate()


def sense(m):
    m.f.sense = pyo.maximize


CHANGES = [
    (unlisted_param, 'goal'),
    (unlisted_fixed_variable, 'fixed'),
    (unfixed, 'fixed'),
    (deactivated, 'row'),
    (added, 'new'),
    (changed, 'row'),
    (expression, 'weighted'),
    (pair_deactivated, 'c'),
    (sense, 'f'),
]


@pytest.mark.parametrize('change, name', CHANGES)
def test_what_the_compiled_model_cannot_follow_is_named(change, name):
    m, solver = parametric(), pyo.SolverFactory('mpec_hybrid')
    solver.set_instance(m, parameters=[m.p])
    change(m)
    with pytest.raises(FesdError, match=rf'^{name}: .*\n    Fix: .*set_instance'):
        solver.solve(m)
    solver.set_instance(m, parameters=[m.p])
    solver.solve(m)


def test_a_bound_that_makes_a_bare_variable_a_side_must_stay():
    m, solver = small_mpccs.pair(1.0, 0.0), pyo.SolverFactory('mpec_hybrid')
    m.bare = Complementarity(expr=complements(m.x, m.y))
    solver.set_instance(m)
    m.x.setlb(1)
    with pytest.raises(FesdError, match='^x: the bounds'):
        solver.solve(m)


@pytest.mark.parametrize('wrong', [lambda m: m.x, lambda m: m.plain, lambda m: m.z, lambda m: 3.0, lambda m: m.row])
def test_what_is_no_parameter_is_refused(wrong):
    m = parametric()
    m.plain = pyo.Param(initialize=1.0)
    with pytest.raises(FesdError, match='not a parameter'):
        pyo.SolverFactory('mpec_hybrid').set_instance(m, parameters=[wrong(m)])


def test_a_parameter_without_value_is_named():
    m, solver = parametric(), pyo.SolverFactory('mpec_hybrid')
    solver.set_instance(m, parameters=[m.fixed])
    m.fixed.set_value(None)
    with pytest.raises(FesdError, match='^fixed: .*no value'):
        solver.solve(m)


def test_fixed_values_that_contradict_are_reported_at_once():
    m = parametric()
    m.no = pyo.Constraint(expr=m.fixed >= 3)
    with pytest.raises(FesdError, match=r"fixed values alone.*'no'"):
        pyo.SolverFactory('mpec_hybrid').set_instance(m, parameters=[m.p])
    pyo.SolverFactory('mpec_hybrid').set_instance(m, parameters=[m.fixed])
