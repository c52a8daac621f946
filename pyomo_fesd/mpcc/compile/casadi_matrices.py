"""casadi's matrices: conversion to scipy, selection, products with arrays."""

import casadi as ca
import numpy as np
from scipy import sparse


def csr(J):
    """casadi DM to scipy csr."""
    colptr, row = np.array(J.sparsity().colind()), np.array(J.sparsity().row())
    return sparse.csc_matrix((np.array(J.nonzeros(), dtype=float), row, colptr), shape=J.shape).tocsr()


def csr_pattern(J):
    """Ones where casadi's J has entries, as scipy csr."""
    return csr(ca.DM(J.sparsity(), 1.0))


def dm(matrix):
    """scipy to casadi DM; lists are much faster than arrays here."""
    matrix = matrix.tocsc()
    matrix.sort_indices()
    sparsity = ca.Sparsity(*matrix.shape, matrix.indptr.tolist(), matrix.indices.tolist())
    return ca.DM(sparsity, matrix.data.tolist())


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
