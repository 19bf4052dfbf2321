"""Symmetric matrices to which somebody added a triangle that was there already."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

SAME = 1e-6  # of the largest entry: files have 7 digits at least
TWICE = "twice what they should be: a triangle was added twice"
KEEP = "Keep the other: sparse.{0}(A) + sparse.{0}(A, {1}).T"


def triangle_twice(matrix: sp.spmatrix) -> str:
    """Return in words that terms on one side of the diagonal are twice those on the other, and the cure; or ""."""
    lower, upper = sp.csr_matrix(sp.tril(matrix, -1)), sp.csr_matrix(sp.triu(matrix, 1).T)
    size = max(abs(lower).max(), abs(upper).max()) if matrix.shape[0] > 1 else 0.0
    if size == 0:
        return ""
    for side, more, less, keep in (("below", lower, upper, ("triu", 1)), ("above", upper, lower, ("tril", -1))):
        if abs(more - 2 * less).max() <= SAME * size:
            return f"its off-diagonal terms {side} the diagonal are {TWICE}. {KEEP.format(*keep)}"
    return ""


def forces(stiffness: sp.spmatrix, motions: np.ndarray, rows: np.ndarray | slice = slice(None)) -> float:
    """Return the forces in some rows that motions (N, m) need, relative to the size of their terms."""
    part = sp.csr_matrix(stiffness)[rows]
    terms = np.linalg.norm(abs(part) @ np.abs(motions), axis=0)
    return float(np.max(np.linalg.norm(part @ motions, axis=0) / np.where(terms > 0, terms, 1.0), initial=0.0))


def doubled(stiffness: sp.spmatrix, motions: np.ndarray, rows: np.ndarray | slice = slice(None)) -> str:
    """Return in words which terms of a stiffness matrix are twice what they should be, and the cure; or "".

    motions : (N, m), rigid. They need forces by the matrix as it is, and none with half of those terms.
    rows : those that are asked; of others something that is not in the matrix holds the body.
    """
    if forces(stiffness, motions, rows) <= SAME:
        return ""
    half = sp.diags(stiffness.diagonal() / 2)
    if forces(stiffness / 2 + half, motions, rows) <= SAME:
        return f"its off-diagonal terms are {TWICE}. Halve them: (A + sparse.diags(A.diagonal())) / 2"
    if forces(stiffness - half, motions, rows) <= SAME:
        return (
            "its diagonal terms are twice what they should be: the diagonal was added twice, with a triangle and its "
            "transpose. Halve them: A - sparse.diags(A.diagonal()) / 2"
        )
    return ""
