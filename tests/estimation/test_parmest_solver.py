"""Estimates of pyomo.contrib.parmest through a switch."""

import numpy as np
import pyomo.environ as pyo
import pytest
from pyomo.contrib.parmest import parmest
from pyomo.contrib.parmest.experiment import Experiment

from pyomo_fesd import FesdError, at, parmest_solver
from tests.estimation.test_at import ramp

TIMES, NOISE = np.array([0.2, 0.4, 0.6, 0.9, 1.3, 1.8]), 0.02
DATA = np.minimum(-2 + 3 * TIMES, TIMES - 2 / 3) + NOISE * np.random.default_rng(2).normal(size=TIMES.size)


class Run(Experiment):
    """One run of the ramp with its measurements."""

    def get_labeled_model(self):
        """Return the model with the suffixes that parmest reads."""
        m, rows = ramp(nfe=4), range(len(TIMES))
        m.slope.unfix(), m.surface.unfix()
        m.y = pyo.Var(rows, initialize=dict(enumerate(DATA)))
        m.measured = pyo.Constraint(rows, rule=lambda m, i: m.y[i] == at(m.x, float(TIMES[i])))
        for name in ('experiment_outputs', 'measurement_error', 'unknown_parameters'):
            m.add_component(name, pyo.Suffix(direction=pyo.Suffix.LOCAL))
        m.experiment_outputs.update((m.y[i], DATA[i]) for i in rows)
        m.measurement_error.update((m.y[i], NOISE) for i in rows)
        m.unknown_parameters.update((v, pyo.ComponentUID(v)) for v in (m.slope, m.surface))
        return m


def test_estimates_are_those_of_the_package():
    m = ramp(nfe=4)
    m.slope.unfix(), m.surface.unfix()
    m.misfit = pyo.Objective(expr=sum((at(m.x, float(t)) - x) ** 2 for t, x in zip(TIMES, DATA)))
    pyo.SolverFactory('mpec_hybrid').solve(m)
    factory = parmest.SolverFactory
    estimator = parmest.Estimator([Run()], obj_function='SSE')
    with parmest_solver('mpec_hybrid'):
        misfit, theta = estimator.theta_est()
    assert parmest.SolverFactory is factory
    assert misfit == pytest.approx(pyo.value(m.misfit), rel=1e-5)
    assert [theta['slope'], theta['surface']] == pytest.approx([m.slope.value, m.surface.value], abs=1e-4)


def test_unknown_solver():
    with pytest.raises(FesdError, match='does not find'), parmest_solver('no_such_solver'):
        pass
