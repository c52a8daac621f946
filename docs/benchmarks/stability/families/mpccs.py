"""Families of MPCCs without time, from the problems of the tests; smoothing is the Fischer-Burmeister function here."""

import math
from dataclasses import dataclass

import numpy as np
import pyomo.environ as pyo
from benchmarks.stability.cases import Case
from benchmarks.stability.methods import WIDTH, outcome_of
from problems import mpcc_collection, small_mpccs
from pyomo.mpec import Complementarity

from pyomo_fesd.core import read_complementarity


@dataclass(frozen=True)
class Static(Case):
    """A small MPCC from random initial values; ``answer`` is its best objective, None if it has no feasible point."""

    build: object = None
    answer: float = None

    @property
    def without_answer(self):
        return self.answer is None

    def methods(self):
        return ['mpec_hybrid', 'smoothing']

    def run(self, method, limit):
        m = self.build()
        draw = np.random.default_rng([self.seed, *map(ord, self.name)])
        for v in m.component_data_objects(pyo.Var, descend_into=True):
            if self.seed and not v.fixed:
                v.set_value(_inside(v, draw.normal(0.5, 1.0)), skip_validation=True)
        pairs = [read_complementarity(c) for c in _conditions(m)]
        if method == 'smoothing':
            _smooth(m, pairs)
        solver = pyo.SolverFactory('mpec_hybrid')
        return outcome_of(lambda: solver.solve(m, time_limit=limit), lambda: [pyo.value(m.f), _gap(m, pairs)])

    def error(self, values):
        f, gap = values
        return max(abs(f - self.answer) / max(1.0, abs(self.answer)), gap)


def _inside(v, number):
    low, high = v.bounds
    return min(max(number, -math.inf if low is None else low), math.inf if high is None else high)


def _conditions(m):
    return [c for c in m.component_data_objects(Complementarity, active=True, descend_into=True)]


def _smooth(m, pairs):
    """Replace each pair by G + H = sqrt(G^2 + H^2 + 2 w^2)."""
    for c in _conditions(m):
        c.parent_component().deactivate()
    m.smooth = pyo.ConstraintList()
    for G, H in pairs:
        m.smooth.add(G + H == pyo.sqrt(G**2 + H**2 + 2 * WIDTH**2))


def _gap(m, pairs):
    """Largest violation of a pair or a constraint."""
    gaps = [max(-pyo.value(G), -pyo.value(H), min(pyo.value(G), pyo.value(H))) for G, H in pairs]
    rows = [c for c in m.component_data_objects(pyo.Constraint, active=True, descend_into=True) if not c.name.startswith('smooth')]
    for c in rows:
        body = pyo.value(c.body)
        gaps += [pyo.value(c.lower) - body] if c.has_lb() else []
        gaps += [body - pyo.value(c.upper)] if c.has_ub() else []
    return max([0.0, *gaps])


#: name -> builder, best objective
STATIC = {
    'toy MPEC': (lambda: small_mpccs.toy()[0], 1.0),
    'M- not S-stationary': (lambda: small_mpccs.m_not_s_stationary()[0], -0.5),
    'scaling': (lambda: small_mpccs.badly_scaled()[0], 1.0),
    'ralph2, unbounded penalty': (lambda: small_mpccs.ralph2()[0], 0.0),
    'ralph1, no multipliers': (lambda: small_mpccs.ralph1()[0], 0.0),
    'scholtes4, no MPCC-LICQ': (lambda: small_mpccs.scholtes4()[0], 0.0),
    'infeasible': (mpcc_collection.infeasible, None),
    'infeasible by rows': (mpcc_collection.infeasible_by_rows, None),
}


def statics(starts=50):
    """All small MPCCs."""
    for name, (build, answer) in STATIC.items():
        for seed in range(starts if answer is not None else 3):
            family = 'MPCC without time' if answer is not None else 'infeasible MPCC'
            yield Static(family, name, seed, None, build=build, answer=answer, looks=lambda v: 'a spurious stationary point')
