"""Basis: matrices V and W of a projection, the user's own or of modes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.linalg as la

from ..checks import check_array, check_type
from ..errors import InputError
from ..model.body import ElasticBody

if TYPE_CHECKING:
    pass

DEPENDENT = 1e-10  # columns of unit length closer than this to the others' span carry mostly rounding


class Basis:
    """A reduction q ~ V qr with test space W (Galerkin: W = V); any full-rank matrices will do.

    Parameters
    ----------
    V : ndarray, (N, n)
        Exudyn's Craig-Bampton matrix is just a V. Rows of fixed coordinates must be zero.
    W : ndarray, (N, n), optional
        Petrov-Galerkin test matrix; W^T V must be invertible.
    note : str
        One line on how the basis was made; the report repeats it.

    Raises
    ------
    InputError
        Shapes, nan or inf, V or W of less than full column rank, W^T V singular.
    """

    def __init__(self, V: Any, W: Any = None, note: str = "user's own"):
        self.V = check_array("V", V, (None, None))
        _check_rank("V", self.V)
        self.note = note
        self.is_galerkin = W is None
        self.W = self.V
        if W is not None:
            self.W = check_array("W", W, self.V.shape)
            _check_rank("W", self.W)
            product = (self.W / np.linalg.norm(self.W, axis=0)).T @ (self.V / np.linalg.norm(self.V, axis=0))
            if np.linalg.svd(product, compute_uv=False)[-1] < DEPENDENT:
                raise InputError("W^T V is singular: some column of W sees nothing of V; choose another W")

    @property
    def n(self) -> int:
        """Number of reduced coordinates."""
        return self.V.shape[1]

    def restricted_to(self, body: ElasticBody) -> tuple[np.ndarray, np.ndarray]:
        """Return V and W on the body's free coordinates, or raise InputError if they do not fit the body."""
        if self.V.shape[0] != body.N:
            raise InputError(
                f"V has {self.V.shape[0]} rows; the body has N = {body.N} coordinates, fixed ones included"
            )
        V = body.space.coordinates("V", self.V)
        return V, V if self.is_galerkin else body.space.coordinates("W", self.W)


def modal_basis(body: ElasticBody, n: int) -> Basis:
    """Return the n lowest undamped modes, M-orthonormal.

    Raises
    ------
    InputError
        n out of range.
    """
    check_type("body", body, ElasticBody)
    return Basis(body.expand(body.modes(n).shapes), note=f"modal, {n} modes")


def _check_rank(name: str, matrix: np.ndarray) -> None:
    if matrix.shape[1] == 0 or matrix.shape[1] > matrix.shape[0]:
        raise InputError(f"{name} has shape {matrix.shape}; needed: at least one column, no more than rows")
    length = np.linalg.norm(matrix, axis=0)
    if np.any(length == 0):
        raise InputError(f"{name} has a zero column ({int(np.argmin(length))}); remove it")
    triangle = np.abs(np.diag(la.qr(matrix / length, mode="r", pivoting=True)[0]))
    if triangle[-1] < DEPENDENT * triangle[0]:
        rank = int(np.sum(triangle >= DEPENDENT * triangle[0]))
        raise InputError(
            f"{name} of shape {matrix.shape} has rank {rank}, but {matrix.shape[1]} columns; remove the dependent "
            "ones. Its rows are the N coordinates of the body, fixed ones included"
        )
