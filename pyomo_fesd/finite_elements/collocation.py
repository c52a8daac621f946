"""pyomo.dae's collocation, with points and coefficients to machine precision.

pyomo.dae finds the points as roots of a polynomial by its coefficients, and expands Lagrange's polynomials into powers.  That
costs a digit or more for each point beyond 4: coefficients of Gauss with 10 points are off by 8e-10, relative, and so are
solutions.  Here the points come from scipy, and the coefficients from the barycentric form:

    w_i = 1/prod_j (tau_i - tau_j),   L_i'(tau_j) = w_i/w_j / (tau_j - tau_i),   sum_i L_i'(tau_j) = 0.

pyomo.dae rounds the labels of collocation points to 6 decimals, which is too coarse for short elements; here the number is given.
It searches all points for the element of each equation; here each point knows its element.

Takes: the arguments of pyomo.dae's ``dae.collocation``, and the number of decimals of the labels.
Leaves: the same equations.
Does not apply: to models that were discretised before.
"""

from functools import cache

import numpy as np
from pyomo.core import Var
from pyomo.dae import ContinuousSet, DerivativeVar
from pyomo.dae.misc import generate_finite_elements
from pyomo.dae.plugins.colloc import Collocation_Discretization_Transformation
from scipy.special import roots_jacobi, roots_legendre

from pyomo_fesd.core import add_copies, stored_index, weighted_sum


@cache
def radau_points(ncp: int) -> tuple[float, ...]:
    """Return 0 and the Radau points of [0, 1]."""
    roots = roots_jacobi(ncp - 1, 1, 0)[0] if ncp > 1 else np.array([])
    return 0.0, *((roots + 1) / 2).tolist(), 1.0


@cache
def legendre_points(ncp: int) -> tuple[float, ...]:
    """Return 0 and the Gauss-Legendre points of [0, 1]."""
    return 0.0, *((roots_legendre(ncp)[0] + 1) / 2).tolist()


class Collocation(Collocation_Discretization_Transformation):
    """``dae.collocation`` with accurate points and coefficients, and labels of ``decimals`` decimals."""

    def __init__(self, decimals: int = 6):
        super().__init__()
        self._decimals = decimals

    def _get_radau_constants(self, currentds):
        self._set(currentds, radau_points(self._ncp[currentds]))

    def _get_legendre_constants(self, currentds):
        tau = legendre_points(self._ncp[currentds])
        self._set(currentds, tau)
        shares = _barycentric_weights(tau) / (1 - np.array(tau))
        self._afinal[currentds] = (shares / shares.sum()).tolist()

    def _transformBlock(self, block, currentds):
        # pyomo.dae places no points where tau is empty
        wrt = next(s for s in block.component_objects(ContinuousSet, descend_into=True) if s.name == currentds)
        generate_finite_elements(wrt, self._nfe[currentds])
        elements, tau = list(wrt), self._tau[currentds]
        self._place_points(wrt, elements, tau)
        rates = self._adot[currentds], self._adotdot[currentds]
        _read_states_directly(block, wrt)
        _make_variables(block, wrt)
        self._scheme = [_Scheme(wrt, elements, order, rate) for order, rate in enumerate(rates, start=1)]
        self._tau[currentds] = []
        super()._transformBlock(block, currentds)
        wrt.get_discretization_info().update(nfe=len(elements) - 1, tau_points=tau)

    def place(self, wrt: ContinuousSet, boundaries: list[float], ncp: int) -> None:
        """Place Radau points between ``boundaries``, and describe the scheme in ``wrt`` as pyomo.dae does."""
        key = wrt.name
        self._ncp[key] = ncp
        self._get_radau_constants(key)
        self._place_points(wrt, boundaries, self._tau[key])
        wrt._fe = boundaries
        wrt.get_discretization_info().update(
            nfe=len(boundaries) - 1,
            ncp=ncp,
            tau_points=self._tau[key],
            adot=self._adot[key],
            adotdot=self._adotdot[key],
            afinal=None,
            scheme='LAGRANGE-RADAU',
        )

    def _place_points(self, wrt, elements, tau):
        inner = [c for c in tau if 0 < c < 1]
        for left, right in zip(elements, elements[1:]):
            for c in inner:
                wrt.add(round(left + c * (right - left), self._decimals))

    def _set(self, wrt, tau):
        self._tau[wrt], self._afinal[wrt] = list(tau), None
        # row i: polynomial i; lists of its own, since the ContinuousSet keeps them
        self._adot[wrt], self._adotdot[wrt] = (rates.T.tolist() for rates in _first_and_second(tau))


def _read_states_directly(block, wrt):
    """Let derivatives read their states by the index that Pyomo stores: pyomo.dae gives a tuple, for which Pyomo searches."""
    for derivative in block.component_objects(DerivativeVar, descend_into=True):
        over = derivative.get_continuousset_list()
        if len(over) == 1 and over[0] is wrt:
            x = derivative.get_state_var()
            by_time = x.index_set() is wrt
            derivative.set_derivative_expression(x.__getitem__ if by_time else lambda *index, x=x: x[stored_index(index)])


def _make_variables(block, wrt):
    """Make the variables at the new points, in the order of pyomo.dae, which calls their rules for each of them."""
    for variable in block.component_objects((Var, DerivativeVar), descend_into=True):
        if variable.index_set() is wrt and not variable.is_reference() and _is_alike_everywhere(variable):
            add_copies(variable, set(wrt) - set(variable._data))


def _is_alike_everywhere(variable):
    """Whether the data of a Var are made alike: rules that are functions may need components that are not expanded yet."""
    rules = (variable._rule_init, variable._rule_bounds, variable._rule_domain)
    by_pyomo = type(variable)._getitem_when_not_present is Var._getitem_when_not_present
    return by_pyomo and all(rule is None or rule.constant() for rule in rules)


class _Scheme:
    """The derivative of some order at a collocation point, as pyomo.dae calls a scheme: ``scheme(f, wrt)(label)``.

    Parameters
    ----------
    wrt : ContinuousSet
        with its collocation points
    elements : list of float
        the boundaries
    order : int
    rates : list of lists
        the derivative of polynomial j at point k, for elements of length 1
    """

    def __init__(self, wrt: ContinuousSet, elements: list[float], order: int, rates: list):
        labels, first, self._terms = list(wrt), 0, {}
        for left, right in zip(elements, elements[1:]):
            points = labels[first : first + len(rates)]
            factor = (1.0 / (right - left)) ** order
            for k, label in enumerate(points[1:], start=1):
                self._terms[label] = [(t, rates[j][k] * factor) for j, t in enumerate(points)]
            first = labels.index(right, first + len(rates) - 1)

    def __call__(self, f, wrt):
        return lambda label: self._at(f, label)

    def _at(self, f, label):
        """The sum; pyomo.dae takes an IndexError for a label without an equation."""
        if label not in self._terms:
            raise IndexError(label)
        return weighted_sum([(weight, f(t)) for t, weight in self._terms[label]])


def _differences(tau):
    """tau_i - tau_j, with ones on the diagonal."""
    return np.subtract.outer(tau, tau) + np.eye(len(tau))


def _barycentric_weights(tau):
    return 1 / _differences(tau).prod(axis=1)


@cache
def _first_and_second(tau):
    """The matrices of the first and the second derivative, of the few schemes that there are."""
    rates = derivatives(tau)
    return rates, rates @ rates


def derivatives(tau: list[float]) -> np.ndarray:
    """Return the matrix that maps values at ``tau`` to derivatives there."""
    w = _barycentric_weights(tau)
    rates = w / w[:, None] / _differences(tau)
    np.fill_diagonal(rates, 0)
    np.fill_diagonal(rates, -rates.sum(axis=1))
    return rates
