"""The MPCC of a problem with Disjunctions has its solutions, and the study finds out where it has not."""

import pyomo.environ as pyo
import pytest
from benchmarks.gdp.problems import PROBLEMS
from benchmarks.gdp.run import by_highs, by_pairs, judged, violation
from benchmarks.gdp.vanishing import as_mpcc


@pytest.mark.parametrize(
    ('name', 'known'),
    [('three jobs', 11), ('logic (Pyomo)', 8), ('three discs', 1.1715729), ('two choices', 4.4603657), ('nested (Pyomo)', 2**0.5)],
)
def test_small_problems_have_their_published_optimum(name, known):
    objective, violated, pairs, status = by_pairs()(PROBLEMS[name][0]())
    assert objective == pytest.approx(known, rel=1e-6) and violated <= 1e-8 and pairs > 0
    assert status == 'B-stationary, local'


def test_the_original_stays_and_highs_agrees():
    m = PROBLEMS['three jobs'][0]()
    as_mpcc(m)
    assert by_highs('gdp.hull')(m)[0] == pytest.approx(11)


def test_a_violated_disjunction_and_violated_logic_are_seen():
    for name, spoil in (('three discs', lambda m: m.x.set_value(7)), ('logic (Pyomo)', lambda m: m.x.set_value(2.5))):
        m = PROBLEMS[name][0]()
        mpcc = as_mpcc(m)
        pyo.SolverFactory('mpec_hybrid').solve(mpcc)
        assert violation(m, mpcc) <= 1e-8
        spoil(mpcc)
        assert violation(m, mpcc) > 0.1


def test_a_point_without_an_objective_is_no_answer_and_the_best_one_is_the_reference():
    rows = [
        {'sign': -1, 'objective': 3.0, 'violation': 0.0},
        {'sign': -1, 'objective': 2.0, 'violation': 0.0},
        {'sign': -1, 'objective': 9.0, 'violation': 1.0},
        {'sign': -1, 'status': 'infeasible'},
    ]
    assert [row['verdict'] for row in judged(rows)] == ['best', 'worse', 'violated', 'no answer']
    assert {row['reference'] for row in rows} == {3.0}
