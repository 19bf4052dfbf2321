"""Products of many short rows with one small matrix, kept on one core, norms of rows, and recurrences over rows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import prod

import numpy as np
import scipy.sparse as sp

from ..compiled.loops import loops

# Multiplications of one product. BLAS libraries start threads above a few 1e5; for blocks of steps these cost more
# than they give, and on cores that are shared with a simulation they wait for one another.
ONE_THREAD = 250_000
OF_A_VECTOR = 9_000  # the same, where the matrix is a vector
# of a tall matrix at once: what is made on the way to a result stays small beside it; of very tall ones fewer
COLUMNS, FEWEST, NUMBERS = 64, 16, 6_400_000
FEW = 32  # rows: products of fewer take long, and are left to what is compiled
SMALLEST_SQUARE = 1e-280  # well above the numbers that lose digits by underflow


def rows_times(rows: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Return rows @ matrix for rows (..., k) and matrix (k, m)."""
    k, m = matrix.shape
    flat = rows.reshape(prod(rows.shape[:-1]), k)
    count = max(1, (ONE_THREAD if m > 1 else OF_A_VECTOR) // max(k * m, 1))
    result = np.empty((len(flat), m))
    if loops is not None and count < min(FEW, len(flat)):
        loops.rows_times(len(flat), k, m, *(np.ascontiguousarray(x, dtype=float) for x in (flat, matrix.T)), result)
        return result.reshape(*rows.shape[:-1], m)
    for first in range(0, len(flat), count):
        np.matmul(flat[first : first + count], matrix, out=result[first : first + count])
    return result.reshape(*rows.shape[:-1], m)


def combined(matrix: np.ndarray, arrays: list[np.ndarray]) -> np.ndarray:
    """Return the sums (j, ...) of matrix (j, k) times k arrays of one shape; j and k are few."""
    columns = np.stack(arrays).reshape(len(arrays), -1)
    result = np.empty((len(matrix), columns.shape[1]))
    count = max(1, ONE_THREAD // matrix.size)
    for first in range(0, columns.shape[1], count):
        part = np.s_[:, first : first + count]
        np.matmul(matrix, columns[part], out=result[part])
    return result.reshape(len(matrix), *arrays[0].shape)


def by_columns(
    function: Callable[[np.ndarray], np.ndarray], columns: np.ndarray | sp.spmatrix, out: np.ndarray | None = None
) -> np.ndarray:
    """Return function(columns) (n, k), a linear function of columns (n, k), computed of a few at a time.

    out : where to put it; may be `columns` itself.
    """
    result = np.empty(columns.shape, order="F") if out is None else out
    width = max(FEWEST, min(COLUMNS, NUMBERS // max(len(result), 1)))
    for first in range(0, columns.shape[1], width):
        part = np.s_[:, first : first + width]
        result[part] = function(columns[part].toarray(order="F") if sp.issparse(columns) else columns[part])
    return result


def norms_times(rows: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Return the 2-norms (...) of rows @ matrix for rows (..., k) and matrix (k, m)."""
    if loops is not None:
        square = np.empty(rows.shape[:-1])
        of, columns = (np.ascontiguousarray(x, dtype=float) for x in (rows, matrix.T))
        loops.squares(square.size, *matrix.shape, of, columns, square)
        if _is_ordinary(square):
            return np.sqrt(square)
    return row_norms(rows_times(rows, matrix))


def polygon_lengths(c: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Return the sums (S,) of the 2-norms of (c_j+1 - c_j) @ matrix for corners c (S, d + 1, k).

    matrix : (k, m).
    """
    if loops is not None:
        columns = np.ascontiguousarray(matrix.T, dtype=float)
        S, points, k = c.shape
        lengths = np.empty(S)
        if loops.lengths(S, points - 1, k, len(columns), np.ascontiguousarray(c, dtype=float), columns, lengths):
            return lengths
    return norms_times(np.diff(c, axis=1), matrix).sum(axis=1)


def largest_sizes(rows: np.ndarray) -> np.ndarray:
    """Return the largest size (k,) of every entry of rows (S, k), S > 0."""
    if loops is None:
        return np.maximum(rows.max(axis=0), -rows.min(axis=0))  # no array of sizes: three times as fast
    largest = np.empty(rows.shape[1])
    loops.largest_sizes(*rows.shape, np.ascontiguousarray(rows, dtype=float), largest)
    return largest


def row_norms(rows: np.ndarray) -> np.ndarray:
    """Return the 2-norms (...) of rows (..., m); scaled first where squares would overflow or vanish."""
    square = np.einsum("...j,...j->...", rows, rows)
    if _is_ordinary(square):
        return np.sqrt(square)
    largest = np.max(np.abs(rows), initial=0.0)
    if not 0 < largest < np.inf:
        return np.full(rows.shape[:-1], largest)
    scaled = rows / largest
    return largest * np.sqrt(np.einsum("...j,...j->...", scaled, scaled))


def _is_ordinary(square: np.ndarray) -> bool:
    """Whether no square lost digits or overflowed."""
    return square.size == 0 or bool(square.min() > SMALLEST_SQUARE and square.max() < np.inf)


def decaying_sums(decays: np.ndarray, added: np.ndarray, starts: Sequence[float]) -> np.ndarray:
    """Return x (rows, S) of x_k = decay_k x_{k-1} + added_k, x_{-1} = start; inf from the first inf or nan on."""
    sums, x = np.empty_like(added, dtype=float), np.array(starts, dtype=float)
    if loops is not None:
        loops.decaying_sums(*added.shape, decays, added, x, sums)
        return sums
    with np.errstate(over="ignore", invalid="ignore"):  # 0 inf, too
        for k, (decay, more) in enumerate(zip(decays.T, added.T, strict=True)):
            x = decay * x + more
            x[~np.isfinite(x)] = np.inf
            sums[:, k] = x
    return sums


def consecutive(numbers: np.ndarray) -> np.ndarray | slice:
    """Return numbers of columns as a slice, which copies nothing, if each is the one after the one before."""
    if len(numbers) and (np.diff(numbers) == 1).all():
        return slice(int(numbers[0]), int(numbers[-1]) + 1)
    return numbers
