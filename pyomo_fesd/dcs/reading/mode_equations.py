"""Bring mode equations to the explicit form v = f_i before they are blended (theory, eq. 7).

Blending residuals that carry different factors of v would change the sliding solution.  So every mode's equations are solved
for the variables that all modes define.  Where a variable cannot be isolated with a constant factor, the mode gets its own copy
of it.
"""

from dataclasses import dataclass
from itertools import chain

from pyomo.core.expr.compare import compare_expressions

from pyomo_fesd.core import Stamp
from pyomo_fesd.dcs.reading.defined_variables import find_defined_variables
from pyomo_fesd.dcs.reading.linear_equations import read_equation, solve


@dataclass(frozen=True)
class ModeEquations:
    """The variables that the modes of one Disjunction define, and their right-hand sides.

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

    @classmethod
    def none(cls, equations: list) -> 'ModeEquations':
        """Return those of modes that state regions alone, as they may at the first time: which mode begins."""
        return cls([], [[] for _ in equations], equations, [[] for _ in equations], [])

    def is_implicit(self, mode: int) -> bool:
        """Return whether a mode has no explicit form."""
        # Pyomo compares expressions with None at length
        return any(f is None for f in self.rhs[mode])

    def stamped(self, stamp: Stamp, parts: list, equations: list) -> 'ModeEquations':
        """Return the same for other ``parts``, and the ``equations`` that contain these."""
        others = {id(con): other for con, other in zip(chain(*self.equations), chain(*equations))}
        return ModeEquations(
            [parts[stamp.place(v)] for v in self.defined],
            [[f if f is None else stamp.expression(f, parts) for f in row] for row in self.rhs],
            equations,
            [[[others[id(con)] for con in cons] for cons in row] for row in self.used],
            self.alike,
        )


def read_equations(disjunction, disjuncts, equalities, variables, cache) -> ModeEquations:
    """Find the variables that the modes define and solve every mode's equations for them.

    Parameters
    ----------
    equalities : list of lists of ConstraintData
        the equality constraints of each disjunct
    variables : TimeVariables
    cache : dict
        the choice made before, by position and component; the same Disjunction at another time is tried with it first

    Raises
    ------
    FesdError
        naming the missing, surplus or ambiguous variable
    """
    modes = [[read_equation(con) for con in cons] for cons in equalities]
    defined = find_defined_variables(disjunction, disjuncts, modes, variables, cache)
    rhs, used = zip(*(solve(equations, defined) for equations in modes))
    return ModeEquations(defined, list(rhs), equalities, list(used), [_alike(column) for column in zip(*rhs)])


def _alike(column):
    """The modes by number, those together that have the same right-hand side."""
    groups = []
    for i, f in enumerate(column):
        group = next((g for g in groups if f is not None and _same(column[g[0]], f)), None)
        if group is None:
            groups.append([i])
        else:
            group.append(i)
    return groups


def _same(a, b):
    if isinstance(a, (int, float)) and isinstance(b, (int, float)):
        return a == b
    return compare_expressions(a, b)
