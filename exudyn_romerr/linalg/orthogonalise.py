"""Orthonormal bases: of a range, in the mass norm, of what lies outside a span."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

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

    def left(part: np.ndarray) -> np.ndarray:
        for _ in range(2):  # twice: what rounding leaves of the first pass is taken out by the second
            part = part - modes @ (modes.T @ part)
        return part

    return by_columns(left, Y)


def m_orthonormal(
    M: sp.csc_matrix, columns: np.ndarray, step: Callable | None = None, most: int | None = None
) -> np.ndarray:
    """Return an M-orthonormal basis of the columns' span (Gram-Schmidt twice, deflating what is not new).

    step : of Arnoldi's method: step(v) of every vector v that was new is a column, too, behind those that wait.
    most : columns of the basis; None: all.
    """
    kept: list[np.ndarray] = []
    waiting = deque(columns.T)
    while waiting and len(kept) != most:
        vector = waiting.popleft()
        size = np.sqrt(vector @ (M @ vector))
        if size == 0:
            continue
        vector = vector / size
        for _ in range(2 if kept else 0):
            Q = np.column_stack(kept)
            vector = vector - Q @ (Q.T @ (M @ vector))
        left = np.sqrt(vector @ (M @ vector))
        if left > DEFLATION:
            kept.append(vector / left)
            waiting.extend([] if step is None else [step(kept[-1])])
    if not kept:
        raise InputError("inputs do not move the free coordinates: every column of B is zero there")
    return np.column_stack(kept)
