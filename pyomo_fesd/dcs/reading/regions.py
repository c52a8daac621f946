"""Regions: switching functions and the sign matrix S, read off the inequalities of the disjuncts (theory, eq. 4).

Two inequalities state the same switching function when they are proportional, however they are written (``x <= 1``,
``2 - 2*x >= 0``, ``1 >= x``); ``sampled_functions.py`` decides that for any arrangement of any smooth expression.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import chain

from pyomo.common.numeric_types import native_numeric_types

from pyomo_fesd.core import FesdError, known_sign
from pyomo_fesd.dcs.reading.disjunction_tree import active_constraints
from pyomo_fesd.dcs.reading.sampled_functions import SMALLEST_MARGIN, DistinctFunctions, sample
from pyomo_fesd.dcs.reading.sign_patterns import SignPatterns, Stated, read_sign_patterns


@dataclass(frozen=True)
class Regions:
    """The partition of the state space that the modes of one Disjunction make.

    Attributes
    ----------
    functions : list of expressions
        the switching functions c_k, in the order in which they were met; c_1 >= 0 is the first mode's first condition
    geometry : SignPatterns
    """

    functions: list
    geometry: SignPatterns

    def conditions(self) -> list:
        """Return for each mode ``(k, S_ik c_k)`` of the functions whose sign it states."""
        return [
            [(k, c if sign > 0 else -c) for k, (sign, c) in enumerate(zip(row, self.functions)) if sign]
            for row in self.geometry.signs
        ]


def conditions(inequality) -> list:
    """Return the expressions ``c`` with ``c >= 0`` that an inequality constraint states (two for a ranged one)."""
    body, found = inequality.body, []
    if inequality.lower is not None:
        found.append(body if _is_zero(inequality.lower) else body - inequality.lower)
    if inequality.upper is not None:
        found.append(-body if _is_zero(inequality.upper) else inequality.upper - body)
    return found


def _is_zero(bound):
    """Whether a bound is the constant 0; a mutable Param that is 0 now may change."""
    return bound.__class__ in native_numeric_types and bound == 0


def read_regions(disjunction, modes, inequalities, cache) -> Regions:
    """Return the switching functions and sign patterns of the modes of ``disjunction``.

    Parameters
    ----------
    inequalities : list of lists of ConstraintData
        the inequalities of each mode
    cache : dict
        sign patterns found before; the same Disjunction at another time has the same ones

    Raises
    ------
    FesdError
        for several modes without a condition, and for regions that overlap or leave a gap
    """
    stated = [[c for con in cons for c in conditions(con)] for cons in inequalities]
    _refuse_several_without_condition(disjunction, modes, stated)
    functions, distinct, signs = _sign_matrix(disjunction, modes, stated)
    dependence = distinct.dependence()
    yields = tuple(tuple(_yields(mode, other) for other in modes) for mode in modes)
    known = Stated(tuple(signs), yields, tuple(map(known_sign, functions)))
    key = (known, dependence.key)
    if key not in cache:
        cache[key] = read_sign_patterns(disjunction, modes, functions, dependence, known)
    return Regions(functions, cache[key])


def _refuse_several_without_condition(disjunction, modes, stated):
    without = [mode for mode, cs in zip(modes, stated) if not cs]
    if len(without) > 1:
        raise FesdError(
            without[-1],
            f"this mode of Disjunction '{disjunction.name}' has no region condition, and is not the only one",
            "add the inequality on the states that holds where the mode is active; one mode may go without, and takes the rest",
        )


def _yields(mode, other):
    """Whether ``mode`` takes what ``other`` leaves: the disjuncts with which they part have an inequality in ``other`` only."""
    mine = next((d for d in mode.disjuncts if d not in other), None)
    theirs = next((d for d in other.disjuncts if d not in mode), None)
    return mine is not None and theirs is not None and _has_inequality(theirs) and not _has_inequality(mine)


def _has_inequality(disjunct):
    return any(not con.equality for con in active_constraints(disjunct))


def _sign_matrix(disjunction, modes, stated):
    """The distinct switching functions and S: S_ik = +-1 where mode i needs that sign of c_k, 0 where it leaves it open."""
    sampled = iter(sample(disjunction, [c for cs in stated for c in cs]))
    functions, distinct, rows = [], DistinctFunctions(), []
    for mode, cs in zip(modes, stated):
        row = {}
        for c in cs:
            k, sign = distinct.find_or_add(next(sampled))
            if k == len(functions):
                functions.append(c)
            if row.setdefault(k, sign) != sign:
                raise FesdError(
                    mode,
                    f"the region is empty: it requires both signs of '{functions[k]}'",
                    "correct the inequalities of this disjunct",
                )
        rows.append(row)
    return functions, distinct, [tuple(row.get(k, 0) for k in range(len(functions))) for row in rows]


def compatibility(constraint, regions, cache) -> Callable[[dict], bool]:
    """Return a test whether modes of several Disjunctions can be active at one point: ``{position: mode number}`` -> bool.

    Parameters
    ----------
    constraint : LogicalConstraintData
        for messages
    regions : list of Regions
        None where a Disjunction has one mode only, which has no regions
    cache : dict
        results found before
    """
    known = [(position, r) for position, r in enumerate(regions) if r is not None]
    functions = [c for _, r in known for c in r.functions]
    distinct = DistinctFunctions()
    numbers = [distinct.find_or_add(F) for F in sample(constraint, functions)]
    dependence = distinct.dependence()
    relations = dependence.key

    def possible(chosen):
        stated = chain(*(_row(r, chosen.get(position)) for position, r in known))
        signs = [0] * len(distinct.values)
        for (k, factor), sign in zip(numbers, stated):
            if sign * factor * signs[k] < 0:
                return False
            signs[k] = sign * factor or signs[k]
        key = (tuple(signs), relations)
        if key not in cache:
            cache[key] = dependence.margin(signs) > SMALLEST_MARGIN
        return cache[key]

    return possible


def _row(regions, mode):
    """The signs that a mode requires; zeros where no mode is chosen."""
    return [0] * len(regions.functions) if mode is None else regions.geometry.signs[mode]
