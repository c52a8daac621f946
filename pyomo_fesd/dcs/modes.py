"""Mode equations, brought to the explicit form v = f_i before they are blended (theory, eq. 7).

Blending residuals that carry different factors of v would change the sliding solution.  So every mode's equations are solved
for the variables that all modes define: the derivatives that appear, then the algebraic variables that make the system
solvable in every mode.  Where a variable cannot be isolated with a constant factor, the mode gets its own copy of it.
"""

from contextlib import contextmanager
from dataclasses import dataclass
from itertools import chain, combinations
from math import comb

import numpy as np
from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.core import value
from pyomo.core.expr.compare import compare_expressions
from pyomo.core.expr.visitor import identify_variables
from pyomo.repn import generate_standard_repn
from scipy.sparse import csr_array
from scipy.sparse.csgraph import maximum_bipartite_matching

from pyomo_fesd.dcs.shape import Swap
from pyomo_fesd.errors import FesdError

#: With more ways than this to choose the defined variables, only those that stand alone on a side are considered.
MOST_CHOICES = 5000


@dataclass(frozen=True)
class ModeEquations:
    """What the modes define.

    Attributes
    ----------
    defined : list of VarData
        the variables v_j, the same for every mode
    rhs : list of lists
        ``rhs[i][j]`` is f_i of v_j as an expression; None where mode i has no explicit form
    equations : list of lists of ConstraintData
        the equations of each mode, as the user wrote them
    used : list of lists of lists of ConstraintData
        ``used[i][j]``: the equations of mode i that define v_j
    alike : list of lists of lists of int
        ``alike[j]``: the modes by number, those together that give v_j the same right-hand side
    """

    defined: list
    rhs: list
    equations: list
    used: list
    alike: list

    def swapped(self, swap, equations):
        """The same for other variables, by a ``Swap``, and the ``equations`` that contain these."""
        others = Swap(chain(*self.equations), chain(*equations))
        return ModeEquations(
            [swap[v] for v in self.defined],
            [[f if f is None else swap.expression(f) for f in row] for row in self.rhs],
            equations,
            [[[others[con] for con in cons] for cons in row] for row in self.used],
            self.alike,
        )


def _alike(rhs, j):
    """The modes by number, those together that give v_j the same right-hand side."""
    groups = []
    for i, f in enumerate(rhs):
        group = next((g for g in groups if f[j] is not None and _same(rhs[g[0]][j], f[j])), None)
        if group is None:
            groups.append([i])
        else:
            group.append(i)
    return groups


def _same(a, b):
    if isinstance(a, (int, float)) and isinstance(b, (int, float)):
        return a == b
    return compare_expressions(a, b)


@dataclass(frozen=True)
class _Equation:
    """``sum coefficient*variable + rest == 0``, with the variables that stand alone on a side."""

    constraint: object
    linear: ComponentMap
    rest: object
    nonlinear: ComponentSet
    alone: ComponentSet

    def mentions(self, v):
        return v in self.linear or v in self.nonlinear


def read_equations(disjunction, disjuncts, equalities, is_derivative, is_state, cache):
    """Find the variables that the modes define and solve every mode's equations for them.

    Parameters
    ----------
    equalities : list of lists of ConstraintData
        the equality constraints of each disjunct
    is_derivative, is_state : callables VarData -> bool
    cache : dict
        the choice made before, by position and component; the same Disjunction at another time is tried with it first

    Raises
    ------
    FesdError
        naming the missing, surplus or ambiguous variable
    """
    modes = [[_read(con) for con in cons] for cons in equalities]
    _require_equal_counts(disjunction, disjuncts, modes, is_derivative)
    wanted = _derivatives(disjunction, disjuncts, modes, is_derivative)
    defined = wanted + _algebraic(disjunction, modes, wanted, is_state, cache)
    rhs, used = zip(*(_solve(equations, defined) for equations in modes))
    return ModeEquations(defined, list(rhs), equalities, list(used), [_alike(rhs, j) for j in range(len(defined))])


@contextmanager
def _all_free(variables):
    """Treat fixed variables as variables: an initial value fixed at t0 does not change what the equation means."""
    fixed = [v for v in variables if v.fixed]
    for v in fixed:
        v.fixed = False
    try:
        yield
    finally:
        for v in fixed:
            v.fixed = True


def _read(constraint):
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
    return _Equation(constraint, linear, rest, nonlinear, ComponentSet(alone))


def _names(variables):
    return ', '.join(sorted(v.name for v in variables)) or 'none'


def _require_equal_counts(disjunction, disjuncts, modes, is_derivative):
    longest, shortest = max(modes, key=len), min(modes, key=len)
    if not longest:
        raise FesdError(
            disjunction,
            "no disjunct defines anything: there is no equality constraint in them",
            "write what each mode defines, e.g. m.dx[t] == ..., beside its region",
        )
    if len(longest) == len(shortest):
        return
    full, lacking = (disjuncts[next(i for i, m in enumerate(modes) if m is which)] for which in (longest, shortest))
    candidates = [
        ComponentSet(v for e in mode for v in e.linear if is_derivative(v) or v in e.alone) for mode in (longest, shortest)
    ]
    missing = [v for v in candidates[0] if v not in candidates[1]]
    raise FesdError(
        lacking,
        f"this mode has {len(shortest)} equation(s) where '{full.name}' has {len(longest)}; "
        f"defined there and not here: {_names(missing)}",
        "let every disjunct of a Disjunction define the same variables",
    )


def _derivatives(disjunction, disjuncts, modes, is_derivative):
    """The derivatives that the modes define; each mode must mention each of them."""
    found = ComponentMap()
    for equations in modes:
        for e in equations:
            for v in chain(e.linear, e.nonlinear):
                if is_derivative(v):
                    found[v] = None
    for disjunct, equations in zip(disjuncts, modes):
        for v in found:
            if not any(e.mentions(v) for e in equations):
                raise FesdError(
                    disjunct,
                    f"this mode does not define '{v.name}', which other modes of '{disjunction.name}' do",
                    f"add the equation for '{v.name}' (for a frozen state: == 0), or take it out of the other disjuncts",
                )
    if len(found) > len(modes[0]):
        raise FesdError(
            disjunction,
            f"{len(modes[0])} equation(s) a mode cannot define {len(found)} derivatives: {_names(found)}",
            "give every derivative its own equation in every disjunct",
        )
    return list(found)


def _algebraic(disjunction, modes, derivatives, is_state, cache):
    """The algebraic variables that make up the rest: those for which every mode's equations can be solved."""
    number = len(modes[0]) - len(derivatives)
    if number == 0:
        return []
    candidates = _candidates(modes, derivatives, is_state)
    usual = [v for k, home in cache.get('chosen', ()) for v in candidates[k : k + 1] if v.parent_component() is home]
    if len(usual) == number and all(_solvable(eqs, [*derivatives, *usual]) for eqs in modes):
        return usual
    considered = candidates
    if comb(len(candidates), number) > MOST_CHOICES:
        considered = [v for v in candidates if any(v in e.alone for eqs in modes for e in eqs)]
    choices = list(combinations(considered, number))
    for fits in (_solvable, _matching):
        group = [c for c in choices if all(fits(eqs, [*derivatives, *c]) for eqs in modes)]
        if group:
            chosen = _preferred(disjunction, modes, group)
            order = ComponentMap((v, k) for k, v in enumerate(candidates))
            cache['chosen'] = [(order[v], v.parent_component()) for v in chosen] if fits is _solvable else ()
            return list(chosen)
    raise FesdError(
        disjunction,
        "the modes do not define the same variables: no choice of "
        f"{number} of the variables that all of them mention ({_names(candidates)}) can be solved for in every disjunct",
        "let every disjunct define the same variables, one equation each",
    )


def _candidates(modes, derivatives, is_state):
    """Algebraic variables that every mode mentions, in order of appearance."""
    known = ComponentSet(derivatives)
    mentioned = [ComponentSet(v for e in eqs for v in chain(e.linear, e.nonlinear)) for eqs in modes]
    return [v for v in mentioned[0] if v not in known and not is_state(v) and all(v in others for others in mentioned[1:])]


def _preferred(disjunction, modes, choices):
    """Among possible choices, the variables that stand alone on a side, as people write what they define."""

    def score(choice):
        return sum(any(v in e.alone for e in equations) for equations in modes for v in choice)

    best = max(map(score, choices))
    top = [c for c in choices if score(c) == best]
    if len(top) > 1:
        raise FesdError(
            disjunction,
            "it cannot be told which variable the mode equations define: " + ' or '.join(_names(c) for c in top),
            "put the defined variable alone on one side, e.g. m.F[t] == 0.1*(m.P[t] - 1)",
        )
    return top[0]


def _matrix(equations, defined):
    return np.array([[value(e.linear.get(v, 0)) for v in defined] for e in equations], dtype=float)


def _solvable(equations, defined):
    """Whether the equations are linear in ``defined`` with a constant, nonsingular matrix."""
    if any(v in e.nonlinear for e in equations for v in defined):
        return False
    A = _matrix(equations, defined)
    if np.count_nonzero(A) == len(defined):
        # the usual case, one variable an equation, without a decomposition
        return bool(A.any(axis=0).all() and A.any(axis=1).all())
    return np.linalg.matrix_rank(A) == len(defined)


def _matching(equations, defined):
    """Whether every equation can be paired with one of the variables (structural nonsingularity)."""
    mentions = csr_array([[e.mentions(v) for v in defined] for e in equations])
    return bool((maximum_bipartite_matching(mentions) >= 0).all())


def _solve(equations, defined):
    """f of every defined variable (None for all of them where the mode has no explicit form), and the equations behind each."""
    everything = [[e.constraint for e in equations] for _ in defined]
    if not _solvable(equations, defined):
        return [None] * len(defined), everything
    A = _matrix(equations, defined)
    known = ComponentSet(defined)
    if np.count_nonzero(A) == len(defined):
        # one variable an equation: the factor may be a mutable Param, so it stays an expression
        order = [equations[int(np.flatnonzero(A[:, j])[0])] for j in range(len(defined))]
        return [_scaled(e, known, e.linear[v]) for e, v in zip(order, defined)], [[e.constraint] for e in order]
    if any(not isinstance(e.linear[v], (int, float)) for e in equations for v in defined if v in e.linear):
        return [None] * len(defined), everything
    inverse = np.linalg.inv(A)
    rests = [_scaled(e, known, 1) for e in equations]
    return (
        [sum(float(c) * r for c, r in zip(row, rests) if c) for row in inverse],
        [[e.constraint for c, e in zip(row, equations) if c] for row in inverse],
    )


def _scaled(equation, defined, factor):
    """``-(everything but the defined variables)/factor``."""
    terms = [(-c / factor) * v for v, c in equation.linear.items() if v not in defined]
    rest = equation.rest
    if isinstance(rest, (int, float)):
        constant = -rest / factor
        if not terms:
            return constant
        return sum(terms) if isinstance(constant, float) and constant == 0 else sum(terms) + constant
    return sum(terms) - rest / factor if terms else -rest / factor
