"""casadi functions of numpy arrays: casadi's own calls convert every argument, which takes longer than a short function.

Takes: a casadi Function.
Leaves: a callable from arrays to new arrays.  One call at a time.
"""

import numpy as np


class NumericFunction:
    """Calls ``function`` (casadi, arguments dense) with arrays; its results are the nonzeros of its outputs."""

    def __init__(self, function):
        self._function, (self._buffer, self._run) = function, function.buffer()
        self._lengths = [function.nnz_out(k) for k in range(function.n_out())]

    def __call__(self, *arrays) -> list[np.ndarray]:
        """Return one array for each output."""
        given = [np.ascontiguousarray(numbers, dtype=float).ravel() for numbers in arrays]
        results = [np.empty(length) for length in self._lengths]
        for k, numbers in enumerate(given):
            if len(numbers) != self._function.nnz_in(k):
                raise ValueError(f"argument {k} has {len(numbers)} elements, not {self._function.nnz_in(k)}")
            self._buffer.set_arg(k, memoryview(numbers))
        for k, numbers in enumerate(results):
            self._buffer.set_res(k, memoryview(numbers))
        self._run()
        if self._buffer.ret():
            raise RuntimeError(f"casadi could not evaluate {self._function.name()}")
        return results
