"""casadi's matrices: conversion to scipy, selection, products with arrays."""

import casadi as ca
import numpy as np
from scipy import sparse


def csr(J):
    """casadi DM to scipy csr."""
    # the columns of the transpose are the rows; scipy's own conversion takes longer
    T = J.T
    pattern = T.sparsity()
    return sparse.csr_matrix((np.array(T.nonzeros(), dtype=float), pattern.row(), pattern.colind()), shape=J.shape)


def csr_pattern(J):
    """Ones where casadi's J has entries, as scipy csr."""
    return csr(ca.DM(J.sparsity(), 1.0))


def dm(matrix):
    """scipy csr, with sorted indices, to casadi DM; lists are much faster than arrays here."""
    m, n = matrix.shape
    return ca.DM(ca.Sparsity(n, m, matrix.indptr.tolist(), matrix.indices.tolist()), matrix.data.tolist()).T


def take(column, positions):
    """The elements of a casadi column at ``positions``, as a column; for casadi an empty selection of one element is a row."""
    return column[[int(k) for k in positions]] if len(positions) else type(column)(0, 1)


def between(column, first, end):
    """The elements from ``first`` to before ``end``, as a column."""
    return column[first:end] if end > first else type(column)(0, 1)


def entries(matrix):
    """Rows and columns of the nonzeros, as arrays."""
    return tuple(np.array(part, dtype=int) for part in matrix.sparsity().get_triplet())


def times(factors, matrix):
    """``matrix`` with each nonzero times one of ``factors`` (array); itself if all of them are 1."""
    if np.all(factors == 1.0):
        return matrix
    return type(matrix)(matrix.sparsity(), ca.DM(np.asarray(factors, dtype=float).tolist()) * ca.vec(matrix.nz[:]))
