"""The stability study with pyomo_fesd only and a few starts of each family: the result is right, or refused."""

import pytest
from benchmarks.stability.cases import NEARLY, REFUSED, RIGHT, WRONG, Ambiguous, Case, judge
from benchmarks.stability.families import all_cases
from benchmarks.stability.families.smooth_dynamics import VAN_DER_POL, van_der_pol
from benchmarks.stability.methods import Outcome
from benchmarks.stability.reference import filippov, genes
from benchmarks.stability.systems import System, one

#: Seconds; none of the cases here needs nearly as long.
LIMIT = 60
#: Families -> starts that are run here; all are right.
QUICK = {
    'crossing': (0, 7),
    'entering a slide': (0, 7),
    'non-uniqueness': (0,),
    'simultaneous switches': (0, 7, 13),
    'sensitivity': (3,),
    'false minima': (0, 1),
    'x0 free': (0, 1),
    'two switches in one element': (4, 12, 18),
    'many switches': (4,),
    'grazing contact': (4, 22),
    'start in a slide': (2, 3),
    'chattering control': (1,),
    'slide on a curved surface': (2,),
    'bad scaling': (5, 41),
    'horizon 1e-3 to 1e5': (1, 40),
    'oscillator': (2,),
    'stiff mode, Radau': (1, 26),
    # the first switch ends a layer of a thousandth of an element
    'Van der Pol with dry friction': (14,),
    'gene network': (3,),
    'MPCC without time': (0, 1),
    'infeasible MPCC': (1,),
    'hysteresis (thermostat)': (1,),
    'state jump (bouncing ball)': (0,),
}
#: Switches nearer to a stage boundary or to the start than the nominal least element length.
NARROW = {'switch on a stage boundary': (0, 7, 10, 12, 13, 27, 31), 'switch at t0': (0, 5, 12, 24)}


def chosen(table):
    """``(case, method)`` of every start in a table."""
    for case in all_cases():
        if case.seed in table.get(case.family, ()):
            # simulate is faster where both apply
            method = 'simulate' if 'simulate' in case.methods() and case.seed % 2 else 'mpec_hybrid'
            yield pytest.param(case, method, id=f'{case.family}, {case.name}, {case.seed}, {method}')


@pytest.mark.parametrize('case, method', [*chosen(QUICK), *chosen(NARROW)])
def test_right(case, method):
    outcome = case.run(method, LIMIT)
    verdict, error, looks = judge(case, outcome)
    assert verdict == RIGHT, (error, looks, outcome.said)


@pytest.mark.parametrize('nfe', [5, 10])
def test_a_contact_between_collocation_points_is_found_or_reported(nfe):
    """Depth 1e-6 shifts the end by 2e-3: only the post-solve diagnostics can detect it."""
    case = next(c for c in all_cases() if c.family == 'grazing contact' and 'd = 1e-06' in c.name)
    outcome = Case(case.family, case.name, 0, case.system, nfe, 3).run('mpec_hybrid', LIMIT)
    assert judge(case, outcome)[0] in (RIGHT, REFUSED), outcome


# The classification


LINE = System((0.0,), 1.0, one(lambda x, f: x[0] + 1, lambda x, u, f: [1.0], lambda x, u, f: [1.0]), (1.0,))


@pytest.mark.parametrize(
    'solved, value, warned, expected',
    [
        (True, 1.0, False, RIGHT),
        (True, 1.0, True, RIGHT),
        (True, 1.0009, False, RIGHT),
        (True, 1.005, False, NEARLY),
        (True, 1.5, False, WRONG),
        (True, 1.5, True, REFUSED),
        (True, float('nan'), False, WRONG),
        (False, 1.0, False, REFUSED),
        (False, 1.5, False, REFUSED),
        (False, None, True, REFUSED),
    ],
)
def test_classes(solved, value, warned, expected):
    outcome = Outcome(solved, None if value is None else [value], '', warned)
    assert judge(Case('family', 'name', 0, LINE), outcome)[0] == expected


@pytest.mark.parametrize('warned, expected', [(True, RIGHT), (False, WRONG)])
def test_of_several_solutions_one_is_right_with_a_warning(warned, expected):
    assert judge(Ambiguous('family', 'name', 0, LINE), Outcome(True, [0.0], '', warned))[0] == expected


def test_references_agree_with_closed_forms():
    oscillator = next(c.system for c in all_cases() if c.family == 'oscillator')
    assert filippov(oscillator) == pytest.approx(oscillator.answer, abs=1e-8)
    slide = next(c.system for c in all_cases() if c.family == 'slide on a curved surface')
    assert filippov(slide) == pytest.approx(slide.answer, abs=1e-9)
    assert genes((10, 3), 0.6) == pytest.approx((8, 8))
    assert filippov(van_der_pol(10.0, 0.3)) == pytest.approx(VAN_DER_POL[10.0, 0.3], abs=1e-8)
