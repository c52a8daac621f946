"""Element lengths as variables (theory, eq. 9 and 10).

With pyomo.dae's equations the whole of (9) is: replace xdot by r_n xdot in the discretisation equation of element n, with the
dimensionless multiplier r_n = h_n/hbar_n (hbar_n the nominal length); a k-th derivative gets r_n**k.  The names of the
discretisation equations stay, as other tools look them up.

With a free final time, or free lengths of the control stages, a unit of the labels lasts sigma_k units of the plant's time in stage
k: derivatives get r_n sigma_k, integrals and times too.
"""

from pyomo.core import Constraint, Expression, RangeSet, Set, Var
from pyomo.core.expr.visitor import replace_expressions

from pyomo_fesd.errors import FesdError
from pyomo_fesd.marks import ARTIFICIAL, mark
from pyomo_fesd.timeindex import TimeIndex, derivatives

#: The least r_n of a solution: as short as tolerances let one be told from none.
LEAST = 1e-6


def add_lengths(block, grid, gamma, factors=None):
    """Declare r_n and the length of every control stage; sigma of each element if there are ``factors`` (by stage).

    Leaves ``block.element`` (1..N), ``block.stage``, ``block.r`` and ``block.stage_length``: sum_n hbar_n r_n = nominal length of
    the stage (eq. 10).  A stage of one element has no freedom.

    The lower bound r_n >= LEAST keeps an element from collapsing into a point, where any multiplier would do.  The bounds
    1 - gamma <= r_n <= 1 + gamma share the elements out evenly between the switches while the homotopy decides; they are marked
    for that only, because once the number of elements before a switch is settled they limit where the switch can be: problems with
    free switches get false minima from the upper one, and a switch close to another one, to the start or to a boundary of a stage
    is out of reach of the lower one.
    """
    block.element = RangeSet(len(grid.elements))
    block.stage = Set(initialize=list(grid.stages), ordered=True)
    block.r = Var(block.element, bounds=(LEAST, None), initialize=1)
    mark(block, ARTIFICIAL, block.r, (1 - gamma, 1 + gamma))
    if factors is not None:
        block.sigma = Expression(block.element, initialize={e.n: factors[e.stage - 1] for e in grid.elements})

    @block.Constraint(block.stage)
    def stage_length(b, stage):
        elements = grid.stages[stage]
        if len(elements) == 1:
            b.r[elements[0].n].fix(1)
            return Constraint.Skip
        total = elements[-1].right - elements[0].left
        return sum(e.length * b.r[e.n] for e in elements) == total


def discretisation_equations(model, wrt):
    """``(derivative, order, its discretisation equations)`` for every DerivativeVar with respect to ``wrt``."""
    for derivative in derivatives(model, wrt):
        order = sum(1 for s in derivative.get_continuousset_list() if s is wrt)
        equations = derivative.parent_block().component(derivative.local_name + '_disc_eq')
        if equations is not None:
            yield derivative, order, equations


def check_orders(model, wrt):
    """A second BACKWARD difference reaches over two elements; collocation stays inside one."""
    for derivative, order, _ in discretisation_equations(model, wrt):
        if order > 1 and wrt.get_discretization_info()['scheme'] == 'BACKWARD Difference':
            raise FesdError(derivative, "a second BACKWARD difference joins two elements", "use collocation, or a rate as a state")


def multiply_derivatives(model, wrt, block, grid):
    """Write (r_n sigma)**k in front of the derivative in every discretisation equation."""
    owner = grid.element_of()
    times = TimeIndex(wrt)
    for derivative, order, equations in discretisation_equations(model, wrt):
        for index, equation in equations.items():
            rate = speed(block, owner[times.time(equation)])
            xdot = derivative[index]
            scaled = rate * xdot if order == 1 else rate**order * xdot
            left, right = equation.expr.args
            if left is xdot:
                equation.set_value(scaled == right)
            else:
                # IDAES and others rescale the equation before: put the factor wherever the derivative stands
                equation.set_value(replace_expressions(equation.expr, {id(xdot): scaled}))


def element_length(block, element):
    """h_n as an expression, in labels of the ContinuousSet."""
    return element.length * block.r[element.n]


def speed(block, element):
    """Time of the plant in one unit of the labels, inside an element: r_n, or r_n sigma."""
    sigma = block.component('sigma')
    return block.r[element.n] if sigma is None else block.r[element.n] * sigma[element.n]


def duration(block, element):
    """h_n as an expression, in time of the plant."""
    return element.length * speed(block, element)
