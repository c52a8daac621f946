"""Entries of sparse matrices by rows."""

import numpy as np
from scipy import sparse

from pyomo_fesd.mpcc.compile.sparse_entries import largest_entries, major_index, with_entries

A = sparse.csr_matrix(np.array([[0.0, -3.0, 2.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]))


def test_largest_entries_are_absolute_and_0_in_an_empty_row():
    np.testing.assert_array_equal(largest_entries(A), [3.0, 0.0, 1.0])


def test_a_row_with_nan_has_no_largest_entry():
    assert np.isnan(largest_entries(with_entries(A, np.array([np.nan, 2.0, 1.0])))[0])


def test_rows_of_entries():
    np.testing.assert_array_equal(major_index(A), A.tocoo().row)
    np.testing.assert_array_equal(major_index(A.tocsc()), A.tocsc().tocoo().col)


def test_other_entries_leave_the_matrix_as_it_was():
    before = A.toarray()
    np.testing.assert_array_equal(with_entries(A, 2 * A.data).toarray(), 2 * before)
    np.testing.assert_array_equal(A.toarray(), before)
