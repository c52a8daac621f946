"""Without an objective a start that holds as far as round-off lets it is the answer, whatever the size of its rows."""

import numpy as np
import pyomo.environ as pyo
import pytest
from pyomo.mpec import Complementarity, complements

ENERGY = 3.0e7  # J, in which a float has no digit below 3.7e-9


def plant(off):
    """A large term on both sides of a row, which miss each other by ``off`` units of the last digit, and a pair."""
    m = pyo.ConcreteModel()
    m.a, m.b, m.c = (pyo.Var(initialize=ENERGY) for _ in range(3))
    m.b.value = ENERGY + off * np.spacing(ENERGY)
    m.p, m.q = pyo.Var(initialize=0, bounds=(0, None)), pyo.Var(initialize=1, bounds=(0, None))
    m.given = pyo.Constraint(expr=m.a == ENERGY)
    m.balance = pyo.Constraint(expr=m.a - m.b == 0)
    m.third = pyo.Constraint(expr=m.b - m.c + m.p == 0)
    m.law = pyo.Constraint(expr=m.q + m.p == 1)
    m.pair = Complementarity(expr=complements(m.p >= 0, m.q >= 0))
    return m


def solved(m):
    return pyo.SolverFactory('mpec_hybrid').solve(m, warm_start=True, natural_units='user').solver


@pytest.mark.parametrize('off', [0, 1, -2])
def test_round_off_of_large_terms_needs_no_nlp(off):
    m = plant(off)
    answer = solved(m)
    assert answer.stationarity == 'B' and answer.nlps == 0 and m.b.value == ENERGY + off * np.spacing(ENERGY)


def test_what_is_no_round_off_is_reduced_by_the_branch():
    m = plant(0)
    m.b.value += 1e-3
    answer = solved(m)
    assert answer.stationarity == 'B' and answer.nlps > 0 and m.b.value == pytest.approx(ENERGY, abs=1e-6)


def test_a_pair_that_is_open_is_no_answer():
    m = plant(0)
    m.p.value = m.q.value = 0.5
    answer = solved(m)
    assert answer.stationarity == 'B' and answer.nlps > 0 and min(abs(m.p.value), abs(m.q.value)) <= 1e-9
