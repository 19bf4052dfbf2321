"""Orthonormal bases: of a range, in the mass norm, of what lies outside a span."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from ..errors import InputError
from .blocked_products import by_columns

ROUNDED_AWAY = 1e-14  # of the largest scaled column: what is dropped is rounding
ROWS = 4096  # of a tall matrix that are multiplied at once
DEFLATION = 1e-10  # share of a Krylov vector that must be new; less is rounding of what is already spanned


def orthonormal(columns: np.ndarray) -> np.ndarray:
    """Return a basis of the range; columns scaled first, those that rounding alone tells apart dropped."""
    length = np.linalg.norm(columns, axis=0)
    Q, triangle, _ = la.qr(columns / np.where(length > 0, length, 1.0), mode="economic", pivoting=True)
    diagonal = np.abs(np.diag(triangle))
    return Q[:, diagonal > ROUNDED_AWAY * diagonal.max(initial=0.0)]


def without(modes: np.ndarray, Y: np.ndarray) -> np.ndarray:
    """Return Y less its part in the span of the orthonormal modes."""
    return take_out(modes, np.array(Y))


def take_out(modes: np.ndarray, Y: np.ndarray) -> np.ndarray:
    """Take the part in the span of the orthonormal modes out of Y, in place; return Y."""

    def left(part: np.ndarray) -> np.ndarray:
        for _ in range(2):  # twice: what rounding leaves of the first pass is taken out by the second
            part = part - modes @ (modes.T @ part)
        return part

    return by_columns(left, Y, out=Y)


def m_orthonormal(M: sp.csc_matrix, columns: np.ndarray) -> np.ndarray:
    """Return an M-orthonormal basis of the columns' span (Gram-Schmidt twice, deflating what is not new)."""
    kept: list[np.ndarray] = []
    for column in columns.T:
        new = m_orthonormalised(M, kept, column)
        if new is not None:
            kept.append(new)
    if not kept:
        raise InputError("no column is left after deflation: the inputs do not move the free coordinates")
    return np.column_stack(kept)


def m_orthonormalised(M: sp.csc_matrix, kept: list[np.ndarray], vector: np.ndarray) -> np.ndarray | None:
    """Return the part of a vector that is M-orthogonal to those kept, of M-norm 1; None if it is not new."""
    size = np.sqrt(vector @ (M @ vector))
    if size == 0:
        return None
    vector = vector / size
    if kept:
        Q = np.column_stack(kept)
        for _ in range(2):
            vector = vector - Q @ (Q.T @ (M @ vector))
    left = np.sqrt(vector @ (M @ vector))
    return vector / left if left > DEFLATION else None
