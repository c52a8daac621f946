"""More even solutions are sought once from each solution."""

from types import SimpleNamespace

import numpy as np
import pytest

from pyomo_fesd.mpcc.algorithm.evenness import Evenness
from pyomo_fesd.mpcc.algorithm.state import Point
from pyomo_fesd.mpcc.nlp import NlpResult


def solution(extent, inside):
    """A certified point of two variables, the extent of a part and a value inside it."""
    nlp = NlpResult(np.array([extent, inside]), 1.0, 'Solve_Succeeded', 0, np.zeros(0), np.zeros(0))
    return Point(nlp, 1.0, SimpleNamespace(certified=True))


@pytest.mark.parametrize('again, number', [(solution(2.0, 9.0), 1), (solution(3.0, 0.0), 2)])
def test_from_a_solution_with_the_same_motion_nothing_is_sought_again(again, number):
    # an order of the more even one may lead back to it, with other values where these are not determined
    compiled = SimpleNamespace(guided=np.array([True, False]), guide_ubx=np.ones(2))
    run = SimpleNamespace(point=solution(2.0, 0.0), counts=SimpleNamespace(iterations=0))
    subsolves = SimpleNamespace(compiled=compiled, tolerances=None, run=run, parts=SimpleNamespace(motion=[0]))
    evenness, sought = Evenness(subsolves, None, None), []
    evenness._neighbour = lambda point, tried, most: sought.append(point)
    evenness.improve()
    run.point = again
    evenness.improve()
    assert len(sought) == number
