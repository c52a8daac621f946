"""Solve equations without time before the simulation, such as an area that follows from a diameter.

Takes: equations without time; the present values of its other variables without time are given.
Leaves: values of the variables that these equations determine.
Does not apply: to equations that hold already, and to equations that contain a variable over time.
"""

from pyomo.common.collections import ComponentSet
from pyomo.contrib.solver.common.factory import SolverFactory
from pyomo.contrib.solver.common.results import SolutionStatus
from pyomo.core import value
from pyomo.core.base.constraint import ConstraintData
from pyomo.core.expr.visitor import identify_variables
from pyomo.util.subsystems import create_subsystem_block

from pyomo_fesd.core import FesdError, TimeIndex

#: An equation holds if its residual is smaller, relative to max(1, |body|).
HOLDS = 1e-10


def solve_static_equations(equations: list[ConstraintData], times: TimeIndex) -> None:
    """Solve those of the timeless ``equations`` that contain no variable over time, if they do not hold.

    Raises
    ------
    FesdError
        naming an equation that cannot be solved
    """
    rows = [c for c in equations if _is_static(c, times)]
    unknowns = ComponentSet(v for c in rows for v in identify_variables(c.body, include_fixed=False))
    if all(map(_holds, rows)):
        return
    solver = SolverFactory('casadi_ipopt', raise_exception_on_nonoptimal_result=False, load_solutions=False)
    block = create_subsystem_block(rows, list(unknowns))
    results = solver.solve(block, solver_options={'tol': 1e-10})
    if results.solution_status is not SolutionStatus.optimal:
        raise FesdError(
            next(c for c in rows if not _holds(c)),
            f"simulate: this equation without time does not hold, and cannot be solved: {results.extra_info.solver_message}",
            "give variables without time consistent values, or better starts",
        )
    results.solution_loader.load_vars()


def _is_static(equation, times):
    variables = list(identify_variables(equation.body, include_fixed=True))
    return all(times.time(v) is None for v in variables) and any(not v.fixed for v in variables)


def _holds(equation):
    body = value(equation.body, exception=False)
    return body is not None and abs(body - value(equation.upper)) <= HOLDS * max(1.0, abs(body))
