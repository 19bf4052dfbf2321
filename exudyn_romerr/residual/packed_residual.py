"""Packing: the many residual columns of a turning frame as few (theory.md 6, 7).

R = L z with 2 n + 12 + 9 n + p columns. The 9 n columns M E_ij V carry S_ij q_k + 2 w~_ij q'_k, which is small: what
of them lies outside the span of all other columns is bounded column by column, the rest is exact in
y = [P^T R / omega, T z], where |R|_{K^-1} is the 2-norm.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import scipy.linalg as la

from ..linalg.bezier import hermite_rows
from ..linalg.blocked_products import polygon_lengths, row_norms, rows_times
from ..linalg.orthogonalise import ROUNDED_AWAY, orthonormal, sharpened, take_out
from .dual_norms import OutputNorms
from .modal_split import Split
from .problem import Problem
from .turning_columns import TurningColumns

if TYPE_CHECKING:
    from collections.abc import Callable

    from .residual import Coordinates

ONE = 1.0
# columns of a frame that turns fast are not small: so many directions of theirs are kept, but those that are smaller,
# of the largest, or rounding of a column. Without, 94 % of the energy of a rotor's bound was what is cut
KEPT, SMALL, ROUNDING = 200, 1e-4, 1e-9


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

    def between(self, h: np.ndarray, samples: tuple, controls: np.ndarray | None) -> np.ndarray:
        """Return control points (S, 6, k) between samples (q, q_t, q_tt, u), see hermite_rows."""
        return hermite_rows(self, self.plain.rayleigh, self.T_q, h, samples, controls)


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


@dataclass(frozen=True, eq=False)
class ScaledNorm:
    """|factor y|_2 of the entries from `first` on."""

    factor: np.ndarray | float = 1.0
    first: int = 0

    def __call__(self, y: np.ndarray) -> np.ndarray:
        """Norms (...) of y (..., k)."""
        kept = y[..., self.first :]
        return row_norms(kept if self.factor is ONE else kept * self.factor)

    def lengths(self, c: np.ndarray) -> np.ndarray:
        """Lengths (S,) of polygons with corners y, c (S, d + 1, k)."""
        if self.factor is not ONE:
            return self(np.diff(c, axis=1)).sum(axis=1)
        return polygon_lengths(c, first=self.first)


@dataclass(frozen=True)
class PackedNorms:
    """Stands for DualNorms: y (k,) are combinations of orthonormal columns Y_K where |.|_{K^-1} is the 2-norm."""

    Y_K: np.ndarray
    norm_static: ScaledNorm
    norm_K: ScaledNorm = field(default_factory=ScaledNorm)
    start_norms: None = None

    @property
    def k(self) -> int:
        """Number of entries of y."""
        return self.Y_K.shape[1]


class PackedSplit(Split):
    """The split of a packed problem: the modes' entries of y come first."""

    @cached_property
    def PL(self) -> np.ndarray:
        """P^T R = omega y on the modes' entries (m, k)."""
        return np.eye(len(self.modes.omega), self._dual.k) * self.modes.omega[:, None]

    @cached_property
    def start_norms(self) -> None:
        """None: the run starts in the span of V."""
        return None

    @cached_property
    def norm_K(self) -> Callable:
        """Return y -> |R_rest|_{K^-1}."""
        return ScaledNorm(ONE, len(self.modes.omega))

    @cached_property
    def norm_static(self) -> Callable:
        """Return y -> a bound of |K^-1 R_rest|_M."""
        return ScaledNorm(1 / self.modes.cut, len(self.modes.omega))


class PackedProblem(Problem):
    """A problem in a turning frame whose estimators see R in the K^-1 norm only, and that starts in the span of V.

    cut : the inputs (a slice) whose columns may be cut. with_modes : whether auxiliary modes are carried.
    turns_fast : whether what the inputs' columns have most of is kept, each direction as an entry of y.
    """

    def __init__(self, *args: Any, cut: slice, with_modes: bool, turns_fast: bool = False, **options: Any):
        super().__init__(*args, **options)
        plain = self.map.coordinates
        auxiliary = self._auxiliary_modes() if with_modes else None
        modes = np.zeros((len(self.V), 0)) if auxiliary is None else auxiliary.Y_K
        states, minor = plain.k - plain.p, np.zeros(plain.k, dtype=bool)
        minor[states + cut.start : states + cut.stop] = True
        others = self.dual.columns_K(np.flatnonzero(~minor[states:]))
        in_modes, sizes = modes.T @ others, np.linalg.norm(others, axis=0)
        rest = take_out(modes, others)
        # what modes hold but for rounding has any direction, that of modes as well
        basis = orthonormal(rest[:, np.linalg.norm(rest, axis=0) > ROUNDED_AWAY * sizes])
        basis = basis if auxiliary is None else sharpened(take_out(modes, basis))
        in_basis, held = basis.T @ rest, np.hstack([modes, basis])
        del others, rest, basis  # of a large body every one of them counts
        columns = TurningColumns(self.body.stiffness_factor.half_solve, self.B, cut, held)
        turning = self._turning(columns) if turns_fast else held[:, :0]
        in_turning, lengths = columns.taken_by(turning)
        T = np.zeros((held.shape[1] + turning.shape[1], plain.k))
        T[: held.shape[1], ~minor] = np.vstack([in_modes, in_basis])
        T[:, minor] = np.vstack([columns.in_held, in_turning])
        T_q, T_u = (np.ascontiguousarray(part) for part in np.split(T, [states], axis=1))  # or each product copies it
        self.packing = Packing(T_u, cut, lengths)
        self.map = PackedMap(PackedCoordinates(replace(plain, p=0), T_q))
        omega = np.full(len(T), self.body.modes(1).omega[0] if auxiliary is None else auxiliary.cut)
        omega[: modes.shape[1]] = [] if auxiliary is None else auxiliary.omega
        self.dual = PackedNorms(np.hstack([held, turning]), ScaledNorm(1 / omega))
        self.rows = OutputNorms(self.body, self.rows.C, self.rows.velocity_rows, self.dual)
        if auxiliary is not None:
            self.split = PackedSplit(auxiliary, self.dual)

    def _turning(self, columns: TurningColumns) -> np.ndarray:
        """Orthonormal directions (n_free, r) that columns M E_ij V have most of."""
        squares = (np.sum(X * (of @ X), axis=0) for X, of in ((self.V, self.body.M), (self.V, self.body.K)))
        weights, gram = np.sqrt(np.divide(*squares)), columns.gram()  # slow shapes answer more
        weights = np.tile(weights, len(gram) // len(weights))
        sizes = np.sqrt(np.diag(gram) + np.sum(columns.in_held**2, axis=0))  # with what others hold
        most = [max(0, len(gram) - KEPT - 1), len(gram) - 1]  # with the largest of those that are too many
        squares, turn = la.eigh(gram * np.outer(weights, weights), subset_by_index=most)  # ascending
        noise = ROUNDING * np.max(sizes * weights, initial=0.0)
        kept = squares > max(SMALL**2 * squares[-1:].max(initial=0.0), noise**2, squares[:-KEPT].max(initial=0.0))
        return columns.combined(weights[:, None] * turn[:, kept] / np.sqrt(squares[kept]))
