"""Rows of a model as ``RowFunctions``: nonlinear parts of equal form become one class, all others one function together.

Takes: lists of ``Row`` whose sum is one function each.
Leaves: ``RowFunctions``.
"""

from collections import defaultdict
from itertools import chain

import casadi as ca
import numpy as np
from scipy import sparse

from pyomo_fesd.mpcc.compile.nonlinear_parts import NonlinearParts, Unsupported
from pyomo_fesd.mpcc.compile.row_classes import RowClass
from pyomo_fesd.mpcc.compile.row_functions import RowFunctions

#: Parts of equal form that are worth a class of their own.
ALIKE = 8


def grouped_rows(functions: list, column: dict, free: int, parts: NonlinearParts) -> RowFunctions:
    """Return the functions; ``column`` is by the id of a variable, ``free`` of them are not parameters.

    Raises
    ------
    Unsupported
        for functions and numbers that cannot be evaluated
    """
    rows = [(i, row) for i, terms in enumerate(functions) for row in terms]
    constants = np.bincount(
        np.array([i for i, _ in rows], dtype=int), np.array([row.constant for _, row in rows], dtype=float), len(functions)
    )
    nonlinear = [(i, row) for i, row in rows if row.nonlinear]
    classes = _classes(nonlinear, column, free, parts) if nonlinear else []
    linear = _linear(rows, (len(functions), len(column)), column)
    if not all(np.isfinite(numbers).all() for numbers in (constants, linear.data, *(k.constants for k in classes))):
        raise Unsupported("a number that is not finite")
    return RowFunctions(linear, constants, classes, free)


def _linear(rows, shape, column):
    """The linear terms of all (row, Row), which are in the order of the rows, as csr."""
    counts = np.bincount([i for i, _ in rows], [len(row.linear) for _, row in rows], shape[0]) if rows else np.zeros(shape[0])
    data = np.array(list(chain.from_iterable(row.linear.values() for _, row in rows)), dtype=float)
    of = np.fromiter((column[k] for _, row in rows for k in row.linear), int, len(data))
    matrix = sparse.csr_matrix((data, of, np.concatenate([[0], np.cumsum(counts)]).astype(int)), shape)
    matrix.sum_duplicates()
    matrix.eliminate_zeros()
    return matrix


def _classes(rows, column, free, parts):
    """The classes of all (row, Row)."""
    alike, others = defaultdict(list), []
    for i, row in rows:
        found = parts.canonical(*row.nonlinear)
        if found is None:
            others.append((i, row))
            continue
        columns = [column[k] for k in found.variables]
        key = found.form, tuple([j < free for j in columns]) if len(column) > free else ()
        alike[key].append((i, row, columns, found.constants))
    classes = []
    for (form, _), instances in alike.items():
        if len(instances) < ALIKE:
            others += [instance[:2] for instance in instances]
        else:
            classes.append(_class(form, instances, free, parts))
    return [*classes, _of_others(others, column, free, parts)] if others else classes


def _class(form, instances, free, parts):
    at, _, columns, constants = zip(*instances)
    columns, constants = np.array(columns, dtype=int).T, np.array(constants, dtype=float).reshape(len(at), -1).T
    s, c = ca.SX.sym('s', len(columns)), ca.SX.sym('c', len(constants))
    function = ca.Function('row', [s, c], [parts.of_form(form, ca.vertsplit(s), ca.vertsplit(c) if len(constants) else [])])
    return RowClass(function, np.array(at, dtype=int)[None, :], columns, constants, columns[:, 0] < free)


def _of_others(rows, column, free, parts):
    """One instance of one function, with the parts of all ``rows`` as its values."""
    used = sorted(parts.variables(row.nonlinear for _, row in rows), key=column.__getitem__)
    s = ca.SX.sym('s', len(used))
    known = dict(zip(used, ca.vertsplit(s)))
    values = [parts.value(*row.nonlinear, known) for _, row in rows]
    columns = np.array([[column[k]] for k in used], dtype=int)
    at = np.array([[i] for i, _ in rows], dtype=int)
    function = ca.Function('rows', [s, ca.SX.sym('c', 0)], [ca.vertcat(*values)])
    return RowClass(function, at, columns, np.zeros((0, 1)), columns[:, 0] < free)
