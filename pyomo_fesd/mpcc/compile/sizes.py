"""Sizes of variables and rows, for problems whose numbers are far from 1.

Tolerances are absolute in the solver's scale, so a state of size 1e-9, or a rate in a process that takes a year, would be lost in
them.  The size of a variable is, in this order,

* the inverse of its factor, where the user gives one;
* its largest start value, or that of the variables ``alike`` (the same quantity at other places), unless that is small: what is
  zero at a solution starts at any small number in the next solve;
* by its rows: s_j = max_i max(b_i, max_k |J_ik| s_k)/|J_ij| over the rows i with terms of known size; first by those rows
  in which no other variable is without a size.  Not by the weighted rows of drifts (theory, 22), whose slopes are shares of 1:
  the smaller ones are 1e-28 at a solution.

Variables of a mild size keep the factor 1, and so do rows whose largest gradient entry is mild; others get the inverse, as a power
of 2, which no rounding follows.

Takes: the Jacobian J and the sizes b of the constants of all rows and sides at the start.
Leaves: factors.
Does not apply: to the objective.
"""

from collections.abc import Sequence

import numpy as np

from pyomo_fesd.mpcc.compile.round_off import EXACT

#: Sizes of variables, and largest gradient entries of rows, that need no factor.
MILD_SIZES, MILD_ROWS = (1e-3, 2e6), (1e-3, 1e6)
#: Sizes beyond these are start values without a meaning.
SIZES = (1e-30, 1e30)
#: Relative distance of a point beside the start.
NEAR = 1e-2
#: Sweeps through the rows.
SWEEPS = 20


def without_small(start: np.ndarray) -> np.ndarray:
    """Return start values with 0 in place of those that may be zero."""
    return np.where(np.abs(start) < MILD_SIZES[0], 0.0, start)


def certain_constants(constants: np.ndarray, found: np.ndarray, terms: np.ndarray) -> np.ndarray:
    """Return sizes of ``constants`` of linearised rows, with 0 for rounding errors.

    Parameters
    ----------
    found : array
        the values of the rows without their linear terms
    terms : array
        the sizes of these, added up
    """
    return np.where(constants > EXACT * (terms + np.abs(found)), constants, 0.0)


def variable_factors(
    slopes: tuple, constants: Sequence, start: np.ndarray, bounds: tuple, given: np.ndarray, alike: Sequence
) -> np.ndarray:
    """Return the factors of the variables.

    Parameters
    ----------
    slopes : (int array, int array, array)
        rows, columns and numbers of the entries of J
    constants : list of arrays (rows)
        sizes of the constants of the linearised rows; the later ones count for variables without a size by the earlier ones
    start : array (n)
    bounds : (array, array)
        which are mild where a variable may have any value between them
    given : array (n)
        the user's factors; 1 where there is none
    alike : list of int arrays
        positions of variables that have one size
    """
    group = np.arange(start.size)
    for positions in alike:
        group[positions] = positions[0]
    sizes = _largest_of_group(np.abs(without_small(start)), group)
    sizes[given != 1.0] = 1.0 / given[given != 1.0]
    bounded = np.maximum(np.abs(bounds[0]), np.abs(bounds[1]))
    mild = (sizes == 0) & (bounded >= MILD_SIZES[0]) & (bounded <= MILD_SIZES[1])
    sizes[mild] = bounded[mild]
    i, j, numbers = slopes
    used = np.isfinite(numbers) & (numbers != 0)
    entries = i[used], j[used], np.abs(numbers[used])
    for b in constants:
        sizes = _spread(entries, b, sizes, group)
    sizes = np.minimum(sizes, np.where(bounded > 0, bounded, np.inf))
    sizes = np.where(sizes > 0, np.maximum(sizes, _largest_of_group(np.abs(start), group)), 0.0)
    return np.where(given != 1.0, given, _factors(sizes, MILD_SIZES))


def beside(start: np.ndarray) -> np.ndarray:
    """Return a point beside the start, by 1 % of each variable, in directions that are always the same."""
    return start * (1 + NEAR * np.random.default_rng(0).uniform(-1, 1, start.size))


def row_factors(largest: Sequence[np.ndarray], given: np.ndarray) -> np.ndarray:
    """Return the factors of rows; one of the user (not 1) is kept.

    A row whose gradient is large at one of the points only is near a singularity there, such as a logarithmic mean of equal
    numbers.  With the factor 1/gradient nothing would be left of it: the least of the largest entries counts.

    Parameters
    ----------
    largest : list of arrays (rows)
        the largest slope by scaled variables, at points near one another; rows that have none at a point are judged by the others
    given : array (rows)
    """
    least = np.fmin.reduce([np.where(np.isfinite(g), g, np.nan) for g in largest])
    return np.where(given != 1.0, given, _factors(least, MILD_ROWS))


def _factors(sizes, mild):
    """1/size as a power of 2; 1 for mild sizes, for those that are unknown, and where it would be infinite."""
    extreme = np.isfinite(sizes) & (sizes >= np.finfo(float).tiny) & ((sizes < mild[0]) | (sizes > mild[1]))
    return np.where(extreme, np.exp2(-np.round(np.log2(np.where(extreme, sizes, 1.0)))), 1.0)


def _largest_of_group(values, group):
    values = np.where((values >= SIZES[0]) & (values <= SIZES[1]), values, 0.0)
    largest = np.zeros(values.size)
    np.maximum.at(largest, group, values)
    return largest[group]


def _spread(entries, b, sizes, group):
    """Give variables of size 0 that of the terms beside them: by rows with one of them first, as by the others it is half a guess.

    A state that begins at 1e-9 with a rate of 1 is not of the size 1e-9.
    """
    b = np.where(np.isfinite(b), b, 0.0)
    for _ in range(SWEEPS):
        if sizes.all():
            break
        new = _by_rows_with_one(entries, b, sizes, group)
        if not (new > 0).any():
            new = _by_rows(entries, b, sizes, group)
        if not (new > 0).any():
            break
        sizes = np.where(sizes == 0, new, sizes)
    return sizes


def _by_rows_with_one(entries, b, sizes, group):
    """Sizes of variables by the rows in which no other one is without a size."""
    i, j, _ = entries
    without = sizes[j] == 0
    # each row and group once, as one number
    pairs = np.unique(i[without] * sizes.size + group[j[without]])
    single = np.bincount(pairs // max(1, sizes.size), minlength=b.size) == 1
    return _by_rows([part[single[i]] for part in entries], b, sizes, group)


def _by_rows(entries, b, sizes, group):
    """Sizes of variables by rows; 0 where they show none."""
    i, j, coefficients = entries
    terms = b.copy()
    np.maximum.at(terms, i, coefficients * sizes[j])
    open_ = (sizes[j] == 0) & (terms[i] > 0)
    found = terms[i[open_]] / coefficients[open_]
    largest = np.zeros(sizes.size)
    np.maximum.at(largest, group[j[open_]], found)
    return largest[group]
