"""The residual columns that turn with a frame, where |.|_{K^-1} is the 2-norm; of a large body some at a time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..linalg.blocked_products import COLUMNS
from ..linalg.orthogonalise import sharpened, take_out

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    import scipy.sparse as sp

ROOM = 250e6  # bytes that may be taken by columns of full size; above, they are made anew whenever they are needed
GROUP = 200  # columns that are there at once all the same: fewer would be made anew too often


class TurningColumns:
    """The columns -half_solve(B_i), i in `cut`, less what orthonormal columns hold: (n_free, c).

    Parameters
    ----------
    half_solve : of K. B : sparse or dense, (n_free, p). held : (n_free, h).

    Attributes
    ----------
    in_held : (h, c), what is held.
    """

    def __init__(self, half_solve: Callable, B: np.ndarray | sp.spmatrix, cut: slice, held: np.ndarray):
        self._half_solve, self._B, self._held = half_solve, B, held
        self._first, self._count = cut.start, cut.stop - cut.start
        self.in_held, self._seen = np.empty((held.shape[1], self._count)), np.zeros(self._count, dtype=bool)
        self._group = max(GROUP, int(ROOM // (held.itemsize * max(len(held), 1))))
        self._all: np.ndarray | None = None

    def gram(self) -> np.ndarray:
        """Return the products of all columns with one another, (c, c)."""
        G, whole = np.zeros((self._count, self._count)), slice(0, self._count)
        for own in _pieces(whole, self._group):
            X = self._left(own)
            G[own, own] = X.T @ X
            for other in _pieces(slice(own.stop, self._count), COLUMNS):
                G[other, own] = self._left(other).T @ X
                G[own, other] = G[other, own].T
        return G

    def combined(self, matrix: np.ndarray) -> np.ndarray:
        """Return orthonormal columns (n_free, r), combinations by a matrix (c, r) that gives them but for rounding.

        Rounding of columns that are held nearly whole is not small beside what is left of them: what of it lies in
        the held columns is taken out once more.
        """
        found = np.zeros((len(self._held), matrix.shape[1]), order="F")
        for own in _pieces(slice(0, self._count), COLUMNS):
            X = self._left(own)
            for part in _pieces(slice(0, matrix.shape[1]), COLUMNS):
                found[:, part] += X @ matrix[own, part]
        return sharpened(take_out(self._held, found))

    def taken_by(self, basis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return what an orthonormal basis (n_free, r) holds of the columns, (r, c), and lengths (c,) of the rest."""
        taken, lengths = np.empty((basis.shape[1], self._count)), np.empty(self._count)
        for own in _pieces(slice(0, self._count), COLUMNS):
            X = self._left(own)
            taken[:, own] = basis.T @ X
            lengths[own] = np.linalg.norm(X - basis @ taken[:, own], axis=0)
        return taken, lengths

    def _left(self, part: slice) -> np.ndarray:
        """The columns of a part (n_free, k); all are kept once they are made if there is room for them."""
        if self._all is not None:
            return self._all[:, part]
        if self._count <= self._group:
            self._all = self._made(slice(0, self._count))
            return self._all[:, part]
        return self._made(part)

    def _made(self, part: slice) -> np.ndarray:
        columns = np.empty((len(self._held), part.stop - part.start), order="F")
        for own in _pieces(part, COLUMNS):
            X = -self._half_solve(self._B[:, self._first + own.start : self._first + own.stop])
            if not self._seen[own].all():
                first = self._held.T @ X
                X -= self._held @ first
                # twice: what rounding leaves of the first pass is taken out by the second
                self.in_held[:, own], self._seen[own] = first + self._held.T @ X, True
                X -= self._held @ (self.in_held[:, own] - first)
            else:
                X -= self._held @ self.in_held[:, own]
            columns[:, own.start - part.start : own.stop - part.start] = X
        return columns


def _pieces(part: slice, width: int) -> Iterator[slice]:
    return (slice(first, min(first + width, part.stop)) for first in range(part.start, part.stop, width))
