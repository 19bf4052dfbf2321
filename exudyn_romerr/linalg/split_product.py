"""Products of a sparse matrix with columns whose leading digits cancel, right to the last digit."""

import numpy as np
import scipy.sparse as sp

DIGITS = 53  # bits of a double
SMALLEST = 1e-200  # largest entry of a column that is split: of smaller ones the last bits would vanish


class SplitMatrix:
    """A = first + rest (n, n), entries of size 1 at most: products with `first` are exact.

    Forces A x of smooth displacements are what large terms leave of one another. A and x are split into first parts
    of few bits, whose products and sums are exact, and the rest (Ozaki et al., Numer. Algorithms 59, 2012).
    """

    def __init__(self, A: sp.csr_matrix):
        terms = int(np.ceil(np.log2(max(abs(A).sum(axis=1).max(), 1.0)))) + 1
        self._bits = (DIGITS - terms) // 2
        self._first = A.copy()
        self._first.data = _leading(A.data, 1.0, self._bits)
        self._rest = A - self._first

    def times(self, X: np.ndarray) -> np.ndarray:
        """Return A X (n, k)."""
        largest = np.maximum(np.max(np.abs(X), axis=0, initial=0.0), SMALLEST)
        X_first = _leading(X, 2.0 ** np.ceil(np.log2(largest)), self._bits)
        return self._first @ X_first + (self._first @ (X - X_first) + self._rest @ X)


def _leading(x: np.ndarray, unit: float | np.ndarray, bits: int) -> np.ndarray:
    """Return x rounded to multiples of unit / 2^bits; unit: powers of two, not below |x|."""
    step = unit * 2.0**-bits
    return np.round(x / step) * step
