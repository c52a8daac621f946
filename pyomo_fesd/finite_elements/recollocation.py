"""More collocation points in the elements of a model that is discretised and initialised already.

    (x_n - x_{n-1})/h_n = xdot_n    becomes    sum_j L_j'(tau_i) x_{n,j}/h_n = xdot_{n,i},   i = 1..K

BACKWARD differences are Radau collocation with one point, of order 1; K points have the order 2K - 1.

Takes: a model with one point in each element; its values, fixed variables, active equations and scaling factors.
Leaves: the same elements with Radau points inside; all components at the new times, values by interpolation in each element.
Does not apply: once elements are movable; to elements with more points; to a derivative with respect to time and space at once.
"""

import logging
from collections.abc import Iterator

from pyomo.core import Block
from pyomo.dae import ContinuousSet, DerivativeVar
from pyomo.dae.misc import create_access_function, create_partial_expression, expand_components

from pyomo_fesd.core import (
    ONE_ELEMENT_SCHEMES,
    TRANSFORMATION,
    FesdError,
    MovingGrid,
    all_switched_systems,
    derivatives,
    discretised,
    find_continuous_set,
    label_decimals,
    moving_grids,
    read_grid,
    restored_on_error,
)
from pyomo_fesd.finite_elements.collocation import Collocation
from pyomo_fesd.finite_elements.expansion import call_rules_again, hybrid_expansion
from pyomo_fesd.finite_elements.inner_points import InnerPoints
from pyomo_fesd.finite_elements.options import points
from pyomo_fesd.finite_elements.quadrature import integrals

logger = logging.getLogger('pyomo_fesd')

RADAU = 'LAGRANGE-RADAU'
FIRST = "call recollocate before fesd.dcs and fesd.finite_elements, on the model as it was discretised"


def recollocate(model: Block, wrt: ContinuousSet | None = None, ncp: int = 3) -> None:
    """Give each element of a model discretised with BACKWARD differences ``ncp`` Radau points; values are interpolated.

    Elements, values and names stay.  States and algebraic variables are interpolated linearly between the ends of an element; what
    is fixed at its end, deactivated there, bounded or scaled, is so at the new points.  Inputs are held at the value of the end, as
    the differences do.  Equations at new times are those of their rules: one that was changed in place is not changed there.

    Parameters
    ----------
    model : Block
        discretised with one point in each element; ``Disjunction`` and ``Complementarity`` may be there
    wrt : ContinuousSet, optional
    ncp : int
        K, 1 to 12

    Raises
    ------
    FesdError
        if there is no such grid, or rules fail at a new time; the model is then unchanged
    """
    wrt = find_continuous_set(model, wrt, 'recollocate')
    ncp = _number(ncp, wrt)
    _check(wrt, ncp)
    if ncp == 1:
        return
    root, boundaries = wrt.model(), list(wrt.get_finite_elements())
    found = list(_first_derivatives(root, wrt))
    expressions = [(d, d.get_derivative_expression()) for d in found]
    with TRANSFORMATION, restored_on_error(root, wrt):
        values = InnerPoints(root, wrt)
        try:
            _place(wrt, boundaries, ncp)
            with hybrid_expansion(root, wrt):
                expand_components(root)
                call_rules_again(root, wrt)
            for derivative in found:
                _collocate(derivative, wrt)
            _integrate_again(root, wrt)
        except (KeyError, ValueError) as error:
            _restore(expressions)
            raise FesdError(wrt, f"recollocate: a rule failed at a new time: {error}", "give its data for all times") from error
        except BaseException:
            _restore(expressions)
            raise
        values.complete()
    wrt.set_changed(False)


def warn_of_order_one(moving: MovingGrid) -> None:
    """Warn where elements that look for switches have one point at their end: boundaries find the switches of that solution."""
    if moving.grid.tau == (1.0,):
        logger.warning(
            "%s: it is discretised with one point in each element, as BACKWARD differences do. These elements find the switches of "
            "a solution of order 1, whose error is that of the time steps. For order 5 on the same elements call "
            "pyomo_fesd.recollocate(m, m.%s, ncp=3) before fesd.dcs.",
            moving.wrt.name,
            moving.wrt.name,
        )


def _number(ncp, wrt):
    try:
        return points(ncp)
    except ValueError as error:
        raise FesdError(wrt, f"recollocate: ncp={ncp!r}: {error}", "give a number of collocation points, as ncp=3") from None


def _check(wrt, ncp):
    """Refuse grids that are none, movable, or finer."""
    if wrt in moving_grids(wrt):
        raise FesdError(wrt, "recollocate: its elements are movable already", FIRST)
    if any(writer.wrt is wrt for writer in all_switched_systems(wrt.model()).writers):
        raise FesdError(wrt, "recollocate: fesd.dcs or fesd.smooth_to_complementarity was applied already", FIRST)
    if not discretised(wrt):
        raise FesdError(wrt, "recollocate: it is not discretised", f"apply fesd.finite_elements with ncp={ncp}, which discretises")
    scheme = wrt.get_discretization_info()['scheme']
    if scheme not in ONE_ELEMENT_SCHEMES or read_grid(wrt, [wrt.first(), wrt.last()]).tau != (1.0,):
        raise FesdError(
            wrt,
            f"recollocate: it is discretised with '{scheme}', not with one point at the end of each element",
            f"take BACKWARD differences, or apply fesd.finite_elements with ncp={ncp} in place of the discretisation, and "
            "pyomo_fesd.start_from for the values",
        )


def _first_derivatives(model, wrt) -> Iterator[DerivativeVar]:
    """The derivatives with respect to ``wrt``."""
    for derivative in derivatives(model, wrt):
        if len(derivative.get_continuousset_list()) > 1:
            raise FesdError(
                derivative, "recollocate: a derivative of higher order", "make the first derivative a state with a derivative"
            )
        yield derivative


def _place(wrt, boundaries, ncp):
    """Add the points, and describe the scheme as pyomo.dae does."""
    Collocation(label_decimals(wrt, [1] * (len(wrt) - 1), ncp)).place(wrt, boundaries, ncp)
    wrt.set_changed(True)


def _collocate(derivative, wrt):
    """Write the equations of all points into the present discretisation equations, which keep their names."""
    state = derivative.get_state_var()
    transform = Collocation().all_schemes[RADAU][0]
    derivative.set_derivative_expression(
        create_partial_expression(transform, create_access_function(state), wrt, state._contset[wrt])
    )
    equations = derivative.parent_block().component(derivative.local_name + '_disc_eq')
    for index, equation in equations.items():
        arguments = index if isinstance(index, tuple) else (index,)
        equation.set_value(derivative[index] == derivative.get_derivative_expression()(*arguments))


def _integrate_again(model, wrt):
    """Integrals by pyomo.dae's rule at all points."""
    for integral in integrals(model, wrt):
        for index, data in integral.items():
            data.set_value(integral._rule(integral.parent_block(), index))


def _restore(expressions):
    for derivative, expression in expressions:
        derivative.set_derivative_expression(expression)
