"""Solve the equations of one mode for the variables that it defines, where these appear linearly with constant factors."""

from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.core import value
from pyomo.core.expr.visitor import identify_variables
from pyomo.repn import generate_standard_repn
from scipy.sparse import csr_array
from scipy.sparse.csgraph import maximum_bipartite_matching


@dataclass(frozen=True)
class LinearEquation:
    """``sum coefficient*variable + rest == 0``.

    Attributes
    ----------
    constraint : ConstraintData
    linear : ComponentMap VarData -> coefficient
    rest : expression
        with the variables in ``nonlinear``
    nonlinear : ComponentSet
    alone : ComponentSet
        variables that are one side of the equation
    """

    constraint: Any
    linear: ComponentMap
    rest: Any
    nonlinear: ComponentSet
    alone: ComponentSet

    def variables(self):
        """Yield all variables, the linear ones first."""
        yield from self.linear
        yield from self.nonlinear

    def solved(self, defined, factor):
        """Return ``-(all terms without the defined variables)/factor``."""
        terms = [(-c / factor) * v for v, c in self.linear.items() if v not in defined]
        if not terms:
            return -self.rest / factor
        if not isinstance(self.rest, (int, float)):
            return sum(terms) - self.rest / factor
        constant = -self.rest / factor
        return sum(terms) if isinstance(constant, float) and constant == 0 else sum(terms) + constant


@contextmanager
def _all_free(variables):
    """Treat fixed variables as variables: an initial value fixed at t0 does not change the meaning of the equation."""
    fixed = [v for v in variables if v.fixed]
    for v in fixed:
        v.fixed = False
    try:
        yield
    finally:
        for v in fixed:
            v.fixed = True


def read_equation(constraint) -> LinearEquation:
    """Separate the linear terms of an equality constraint."""
    body = constraint.body - constraint.upper
    with _all_free(list(identify_variables(body, include_fixed=True))):
        repn = generate_standard_repn(body, compute_values=False, quadratic=False)
    rest = repn.constant if repn.nonlinear_expr is None else repn.constant + repn.nonlinear_expr
    sides = getattr(constraint.expr, 'args', ())
    alone = (s for s in sides if getattr(s, 'is_variable_type', lambda: False)())
    nonlinear = ComponentSet(repn.nonlinear_vars)
    linear = ComponentMap()
    for v, c in zip(repn.linear_vars, repn.linear_coefs):
        if v in nonlinear:
            rest = rest + c * v
        else:
            linear[v] = c
    return LinearEquation(constraint, linear, rest, nonlinear, ComponentSet(alone))


def _rows(equations, defined):
    return [[value(e.linear.get(v, 0)) for v in defined] for e in equations]


def _have_one_each(rows):
    """Whether each row has one entry that is not zero, in a column of its own: the usual case, without a decomposition."""
    places = [[k for k, factor in enumerate(row) if factor] for row in rows]
    return all(len(some) == 1 for some in places) and len({k for (k,) in places}) == len(rows)


def solvable(equations, defined) -> bool:
    """Whether the equations are linear in ``defined`` with a constant, nonsingular matrix."""
    if any(v in e.nonlinear for e in equations for v in defined):
        return False
    rows = _rows(equations, defined)
    return _have_one_each(rows) or bool(np.linalg.matrix_rank(np.array(rows, dtype=float)) == len(defined))


def matching(equations, defined) -> bool:
    """Whether every equation can be paired with one of the variables (structural nonsingularity)."""
    mentioned = [ComponentSet(e.variables()) for e in equations]
    incidence = csr_array([[v in of_equation for v in defined] for of_equation in mentioned])
    return bool((maximum_bipartite_matching(incidence) >= 0).all())


def solve(equations, defined) -> tuple[list, list]:
    """Return the right-hand side of every defined variable, and the equations behind each.

    The right-hand sides are None where the mode has no explicit form.
    """
    if solvable(equations, defined):
        rows = _rows(equations, defined)
        if _have_one_each(rows):
            # one variable an equation: the factor may be a mutable Param, so it stays an expression
            order = [next(e for e, factor in zip(equations, column) if factor) for column in zip(*rows)]
            known = ComponentSet(defined)
            return [e.solved(known, e.linear[v]) for e, v in zip(order, defined)], [[e.constraint] for e in order]
        if _have_constant_factors(equations, defined):
            return _solve_together(equations, defined, np.linalg.inv(np.array(rows, dtype=float)))
    return [None] * len(defined), [[e.constraint for e in equations] for _ in defined]


def _have_constant_factors(equations, defined):
    return all(isinstance(e.linear.get(v, 0), (int, float)) for e in equations for v in defined)


def _solve_together(equations, defined, inverse):
    known = ComponentSet(defined)
    solved = [e.solved(known, 1) for e in equations]
    return (
        [sum(float(c) * f for c, f in zip(row, solved) if c) for row in inverse],
        [[e.constraint for c, e in zip(row, equations) if c] for row in inverse],
    )
