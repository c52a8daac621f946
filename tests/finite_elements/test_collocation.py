"""Collocation points and coefficients are right to machine precision, also where pyomo.dae's are not."""

import numpy as np
import pyomo.dae as dae
import pyomo.environ as pyo
import pytest

from pyomo_fesd.finite_elements.collocation import Collocation

SCHEMES = {'LAGRANGE-RADAU': -1, 'LAGRANGE-LEGENDRE': 0}


def constants(scheme, ncp, transformation):
    """What pyomo.dae keeps of the discretisation of one element."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 1))
    m.x = pyo.Var(m.t)
    m.dx = dae.DerivativeVar(m.x)
    transformation.apply_to(m, wrt=m.t, nfe=1, ncp=ncp, scheme=scheme)
    return m.t.get_discretization_info()


def quadrature(tau):
    """Weights that integrate polynomials over the points exactly."""
    powers = np.arange(len(tau))
    legendre = np.polynomial.legendre.legvander(2 * np.array(tau) - 1, len(tau) - 1)
    return np.linalg.solve(legendre.T, np.where(powers == 0, 1.0, 0.0))


@pytest.mark.parametrize('scheme', SCHEMES)
@pytest.mark.parametrize('ncp', range(1, 13))
def test_points_are_those_of_the_scheme(scheme, ncp):
    tau = constants(scheme, ncp, Collocation())['tau_points'][1:]
    weights, last = quadrature(tau), 2 * ncp - 1 + SCHEMES[scheme]
    shifted = np.polynomial.legendre.legvander(2 * np.array(tau) - 1, last)
    assert weights @ shifted == pytest.approx(np.eye(last + 1)[0], abs=1e-14)
    assert tau == sorted(tau)
    assert tau[-1] == pytest.approx(1.0, abs=0) or scheme == 'LAGRANGE-LEGENDRE'


@pytest.mark.parametrize('scheme', SCHEMES)
@pytest.mark.parametrize('ncp', range(1, 13))
def test_coefficients_differentiate_and_extrapolate_polynomials(scheme, ncp):
    info = constants(scheme, ncp, Collocation())
    tau = np.array(info['tau_points'])
    for degree in range(ncp + 1):
        values = tau**degree
        first = degree * tau ** max(0, degree - 1)
        second = degree * (degree - 1) * tau ** max(0, degree - 2)
        assert values @ np.array(info['adot']) == pytest.approx(first, abs=2e-12)
        assert values @ np.array(info['adotdot']) == pytest.approx(second, abs=1e-9)
        if scheme == 'LAGRANGE-LEGENDRE':
            assert values @ np.array(info['afinal']) == pytest.approx(1, abs=2e-13)


@pytest.mark.parametrize('scheme', SCHEMES)
@pytest.mark.parametrize('ncp', [1, 2, 3, 4])
def test_few_points_are_those_of_pyomo(scheme, ncp):
    ours, theirs = (constants(scheme, ncp, t) for t in (Collocation(), pyo.TransformationFactory('dae.collocation')))
    assert ours.keys() == theirs.keys()
    for name in ('tau_points', 'adot', 'adotdot', 'afinal'):
        if theirs.get(name) is not None:
            assert np.array(ours[name]) == pytest.approx(np.array(theirs[name]), abs=1e-11)


class Numbered(pyo.Var):
    """A Var that gives its data a value by itself."""

    def _getitem_when_not_present(self, index):
        found = super()._getitem_when_not_present(index)
        found.value = 10 * index
        return found


def over_time(transformation):
    """A model with variables that are declared in several ways, on two elements."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 1))
    m.plain, m.bounded = pyo.Var(m.t), pyo.Var(m.t, initialize=2, bounds=(0, 3), domain=pyo.NonNegativeReals)
    m.by_rule = pyo.Var(m.t, initialize=lambda m, t: t + 1, bounds=lambda m, t: (0, t + 5))
    m.by_dict = pyo.Var(m.t, initialize={0: 7, 1: 8})
    m.both, m.sparse = pyo.Var(m.t, [1, 2], initialize=4), pyo.Var(m.t, dense=False, initialize=5)
    m.own = type('Own', (Numbered, pyo.Var(m.t).__class__), {})(m.t)
    m.again = pyo.Reference(m.both[:, 1])
    m.rate = dae.DerivativeVar(m.plain)
    m.bounded[0].setub(9)
    m.bounded[0].fix(1)
    transformation.apply_to(m, wrt=m.t, nfe=2, ncp=3, scheme='LAGRANGE-RADAU')
    return m


def test_variables_at_new_points_are_those_of_pyomo():
    def variables(m):
        data = m.component_data_objects(pyo.Var)
        return {v.name: (v.value, v.lb, v.ub, v.domain, v.fixed, v.stale) for v in data}

    ours, theirs = (variables(over_time(t)) for t in (Collocation(), pyo.TransformationFactory('dae.collocation')))
    assert ours == theirs and len(ours) == 9 * 7
    assert ours['own[0.5]'][0] == 5
