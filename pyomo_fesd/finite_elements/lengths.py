"""Element lengths as variables (theory, eq. 9 and 10).

With pyomo.dae's equations the whole of (9) is: replace xdot by r_n xdot in the discretisation equation of element n, with the
dimensionless multiplier r_n = h_n/hbar_n (hbar_n the nominal length); a k-th derivative gets r_n**k.  The names of the
discretisation equations stay, as other tools look them up.

With a free final time, or free lengths of the control stages, a unit of the labels lasts sigma_k units of the plant's time in
control stage k: derivatives get r_n sigma_k, integrals and times too.
"""

from collections.abc import Iterator

from pyomo.common.collections import ComponentMap
from pyomo.core import Block, Constraint, Expression, RangeSet, Set, Var
from pyomo.core.expr.visitor import identify_variables
from pyomo.dae import ContinuousSet
from pyomo.mpec import Complementarity

from pyomo_fesd.core import (
    FesdError,
    MovingGrid,
    TimeIndex,
    derivatives,
    entries_of,
    exchanged,
    homotopy_hints,
    is_discretisation_equation,
    public_name,
    time_unit,
)

#: The least r_n of a solution: the shortest that tolerances distinguish from zero.
LEAST = 1e-6


def add_lengths(moving: MovingGrid, gamma: float, factors: list | None = None) -> None:
    """Declare r_n and the length of every control stage; sigma of each element if there are ``factors`` (by control stage).

    Leaves ``block.element`` (1..N), ``block.stage``, ``block.r`` and ``block.stage_length``: sum_n hbar_n r_n = nominal length of
    the control stage (eq. 10), in mean lengths.  In a control stage of one element r_n = 1 is fixed.

    The lower bound r_n >= LEAST keeps an element from collapsing into a point, where any multiplier is feasible.  The bounds
    1 - gamma <= r_n <= 1 + gamma distribute the elements evenly between the switches in the homotopy; they are guide bounds only,
    because they limit where a switch can be once the number of elements before it is settled: problems with free switches get false
    minima from the upper bound, and the lower bound excludes a switch close to another one, to the start or to a boundary of a
    control stage.
    """
    block, grid = moving.block, moving.grid
    block.element = RangeSet(len(grid.elements))
    block.stage = Set(initialize=list(grid.stages), ordered=True)
    block.r = moving.r = Var(block.element, bounds=(LEAST, None), initialize=1)
    homotopy_hints(block).guide_bounds[block.r] = (1 - gamma, 1 + gamma)
    if factors is not None:
        block.sigma = moving.sigma = Expression(block.element, initialize=dict(_by_element(grid, factors)))

    @block.Constraint(block.stage)
    def stage_length(b, stage):
        elements = grid.stages[stage]
        if len(elements) == 1:
            b.r[elements[0].n].fix(1)
            return Constraint.Skip
        # in mean lengths: tolerances do not know the unit of time
        mean = (elements[-1].right - elements[0].left) / len(elements)
        return sum(e.length / mean * b.r[e.n] for e in elements) == len(elements)


def _by_element(grid, factors):
    for factor, elements in zip(factors, grid.control_stages):
        yield from ((e.n, factor) for e in elements)


def discretisation_equations(model: Block, wrt: ContinuousSet) -> Iterator[tuple]:
    """Yield ``(derivative, order, its discretisation equations)`` for every DerivativeVar with respect to ``wrt``."""
    for derivative in derivatives(model, wrt):
        order = sum(1 for s in derivative.get_continuousset_list() if s is wrt)
        equations = derivative.parent_block().component(derivative.local_name + '_disc_eq')
        if equations is not None:
            yield derivative, order, equations


def check_orders(model: Block, wrt: ContinuousSet) -> None:
    """Refuse second derivatives that determine the motion, and those by BACKWARD differences, which join two elements.

    pyomo.dae differentiates the polynomial of an element twice: a value of its own for each element, without any condition that the
    rates of two elements meet.  As a result of a motion that other equations determine it is right.
    """
    found = ((derivative, order) for derivative, order, _ in discretisation_equations(model, wrt) if order > 1)
    higher = ComponentMap(found)
    for derivative in higher:
        if wrt.get_discretization_info()['scheme'] == 'BACKWARD Difference':
            raise FesdError(derivative, "a second BACKWARD difference joins two elements", "use collocation, or a rate as a state")
    for source, expr in _determining(model) if higher else ():
        for derivative in (v.parent_component() for v in identify_variables(expr, include_fixed=True)):
            if derivative in higher:
                x, where = derivative.get_state_var().local_name, public_name(TimeIndex(wrt).split(source)[1])
                raise FesdError(
                    derivative,
                    f"a derivative of order {higher[derivative]} with respect to '{wrt.name}' in the equation '{where}': pyomo.dae "
                    f"has no condition that the rates of '{x}' in two elements meet, so the solution would be wrong",
                    f"make the first derivative a state: v = Var(...), DerivativeVar({x}) == v, and DerivativeVar(v) in place of "
                    "the second derivative",
                )


def _determining(model) -> Iterator[tuple]:
    """The equations, and the sides of conditions, that are not pyomo.dae's own: ``(component, expression)``."""
    for equation in model.component_data_objects(Constraint, active=True, descend_into=Block):
        if equation.equality and not is_discretisation_equation(equation):
            yield equation, equation.expr
    for pair in model.component_data_objects(Complementarity, active=True, descend_into=Block):
        yield from ((pair, side) for side in pair._args or () if hasattr(side, 'is_expression_type'))


def multiply_derivatives(moving: MovingGrid) -> None:
    """Multiply the derivative in every discretisation equation by (r_n sigma)**k, and by the unit that pyomo.dae leaves out."""
    owner, times = moving.grid.element_of(), TimeIndex(moving.wrt)
    speeds = {element.n: moving.speed(element) for element in moving.grid.elements}
    for derivative, order, equations in discretisation_equations(moving.block.model(), moving.wrt):
        units = [time_unit(derivative.get_state_var()[index], derivative[index]) for index in list(equations)[:1]]
        for index, equation in entries_of(equations):
            rate = speeds[owner[times.time(equation)].n]
            xdot = derivative[index]
            scaled = rate * xdot if order == 1 else rate**order * xdot
            scaled = scaled if units == [None] else scaled * units[0]
            left, right = equation.expr.args
            if left is xdot:
                equation.set_value(scaled == right)
            else:
                # IDAES and others rescale the equation before: multiply the derivative wherever it occurs
                equation.set_value(exchanged(equation.expr, {id(xdot): scaled}))
