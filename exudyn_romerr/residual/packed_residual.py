"""Packing: the many residual columns of a turning frame as few (theory.md 6, 7).

R = L z with 2 n + 12 + 9 n + p columns. The 9 n columns M E_ij V carry S_ij q_k + 2 w~_ij q'_k, which is small: what
of them lies outside the span of all other columns is bounded column by column, the rest is exact in
y = [P^T R / omega, T z], where |R|_{K^-1} is the 2-norm.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import scipy.linalg as la

from ..linalg.blocked_products import row_norms, rows_times
from .modal_split import Split, without
from .problem import Problem

if TYPE_CHECKING:
    from collections.abc import Callable

    from .residual import Coordinates

ONE = 1.0
RANK = 1e-14  # of the largest scaled column: what is dropped is rounding


class Cut(NamedTuple):
    """What is cut off R in each segment of a block: bounds of its size and variation in the K^-1 norm, (S,)."""

    size: np.ndarray
    variation: np.ndarray

    @classmethod
    def between(cls, rows: np.ndarray) -> Cut | None:
        """Return what lies between consecutive samples of the cut columns' coordinates, scaled, (S + 1, c)."""
        if not rows.shape[1]:
            return None
        size = np.abs(rows).sum(axis=1)
        return cls(np.maximum(size[:-1], size[1:]), np.abs(np.diff(rows, axis=0)).sum(axis=1))


@dataclass(frozen=True)
class PackedCoordinates:
    """y (..., k) of reduced coordinates (..., n), packed inputs (..., k): T_q (q'' + alpha q', q + beta q') + u."""

    plain: Coordinates
    T_q: np.ndarray

    @property
    def n(self) -> int:
        """Number of reduced coordinates."""
        return self.plain.n

    @property
    def k(self) -> int:
        """Number of entries of y."""
        return len(self.T_q)

    @property
    def p(self) -> int:
        """Number of packed inputs."""
        return self.k

    def __call__(self, q: np.ndarray, q_t: np.ndarray, q_tt: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Return y."""
        none = np.zeros((*q.shape[:-1], 0))
        return rows_times(self.plain(q, q_t, q_tt, none), self.T_q.T) + u


@dataclass(frozen=True)
class Packing:
    """Inputs u (S, p) to packed ones (S, k) and the scaled coordinates of the cut columns (S, c)."""

    T_u: np.ndarray
    cut: slice
    lengths: np.ndarray

    def __call__(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the packed inputs and what is cut."""
        return rows_times(u, self.T_u.T), u[:, self.cut] * self.lengths


class PackedMap(NamedTuple):
    """Stands for ResidualMap."""

    coordinates: PackedCoordinates


@dataclass(frozen=True)
class ScaledNorm:
    """|factor y|_2 of the entries from `first` on."""

    factor: np.ndarray | float = 1.0
    first: int = 0

    def __call__(self, y: np.ndarray) -> np.ndarray:
        """Norms (...) of y (..., k)."""
        kept = y[..., self.first :]
        return row_norms(kept if self.factor is ONE else kept * self.factor)


class PackedSplit(Split):
    """The split of a packed problem: the modes' entries of y come first."""

    @cached_property
    def PL(self) -> np.ndarray:
        """P^T R = omega y on the modes' entries (m, k)."""
        return np.eye(len(self.omega), self._problem.map.coordinates.k) * self.omega[:, None]

    @cached_property
    def norm_K(self) -> Callable:
        """Return y -> |R_rest|_{K^-1}."""
        return ScaledNorm(ONE, len(self.omega))

    @cached_property
    def norm_static(self) -> Callable:
        """Return y -> a bound of |K^-1 R_rest|_M."""
        return ScaledNorm(1 / self.cut, len(self.omega))


class PackedProblem(Problem):
    """A problem in a turning frame whose estimators see R in the K^-1 norm only, and that starts in the span of V.

    cut : the inputs (a slice) whose columns may be cut. with_modes : whether auxiliary modes are carried.
    """

    def __init__(self, *args: Any, cut: slice, with_modes: bool, **options: Any):
        super().__init__(*args, **options)
        self.terms, plain = self.map, self.map.coordinates
        modes = self.split.modes_K if with_modes else np.zeros((len(self.V), 0))
        columns, states = super().Y_K, plain.k - plain.p
        frame = np.arange(states, plain.k)[cut]
        rest = without(modes, columns)
        basis = orthonormal(np.delete(rest, frame, axis=1))
        T = np.vstack([modes.T @ columns, basis.T @ rest])
        left = np.linalg.norm(without(basis, rest[:, frame]), axis=0)
        self.packing = Packing(T[:, states:], cut, left)
        self.map = PackedMap(PackedCoordinates(replace(plain, p=0), T[:, :states]))
        self._Y = np.hstack([modes, basis])
        omega = np.full(len(T), self.split.cut if with_modes else self.body.modes(1).omega[0])
        omega[: modes.shape[1]] = self.split.omega if with_modes else []
        self.norm_K, self.norm_static = ScaledNorm(), ScaledNorm(1 / omega)

    @property
    def Y_K(self) -> np.ndarray:
        """Orthonormal columns whose combinations y are R where |.|_{K^-1} is the 2-norm."""
        return self._Y

    @cached_property
    def split(self) -> PackedSplit:
        """Auxiliary modes and what is left above them."""
        return PackedSplit(self, self.auxiliary_modes)


def orthonormal(columns: np.ndarray) -> np.ndarray:
    """Return a basis of the range; columns scaled first, those that rounding alone tells apart dropped."""
    length = np.linalg.norm(columns, axis=0)
    Q, triangle, _ = la.qr(columns / np.where(length > 0, length, 1.0), mode="economic", pivoting=True)
    diagonal = np.abs(np.diag(triangle))
    return Q[:, diagonal > RANK * diagonal[0]]
