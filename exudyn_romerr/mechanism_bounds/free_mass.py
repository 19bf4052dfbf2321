"""What accelerates a body at the start of a run, beside the reduced one, and what outputs see of that: mass norms."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
from scipy.linalg import cholesky, solve_triangular

from ..linalg.symmetric_factor import SymmetricFactor
from ..model.admissible_space import RIGID_MODES, mean_motion, rigid_modes
from ..model.shared_body import made_once
from .passive_steps import Means

if TYPE_CHECKING:
    from ..model.body import ElasticBody

ROUNDING = 1e-13  # of squares: interfaces that move alike
FEW_ROWS = 64  # of outputs; of all nodes of a mesh it would take two more solves each


class FreeMass:
    """|.|_{M^-1} over all motions x = Z y + Rg r of the free body, Z y the admissible ones of the held body.

    What sees no rigid motion is the same number on all Z y + Rg r, and M takes the least of these where no momentum
    is left: with M_h = Z^T M Z and B = Z^T M Rg (Rg^T M Rg)^-1/2 the mass is M_h - B B^T there, and

        |b|^2 = b^T M_h^-1 b + |(I - B^T M_h^-1 B)^-1/2 B^T M_h^-1 b|^2       (Woodbury; nothing cancels) .

    Over motions that joints admit, of rigid bodies too, the norm is no larger.
    """

    def __init__(self, body: ElasticBody):
        self._factor, self._space = body.mass_factor, body.space
        self._Rg = rigid_modes(body.positions - body.positions.mean(axis=0))
        self._carried = body.mass @ self._Rg
        self._of_rigid = cholesky(self._Rg.T @ self._carried, lower=True)
        self._B = self._factor.half_solve(self.pull)
        self._root = cholesky(np.eye(RIGID_MODES) - self._B.T @ self._B, lower=True)
        self._body = body

    @classmethod
    def of(cls, body: ElasticBody) -> FreeMass:
        """Return that of a body, made once."""
        return made_once(body, "free mass", (), lambda: cls(body))

    def norms(self, columns: np.ndarray) -> np.ndarray:
        """Norms (k,) of columns (n_free, k) that see no rigid motion: balanced loads, or output rows transposed."""
        return np.linalg.norm(self._halves(columns), axis=0)

    def means(self, columns: np.ndarray, norms: np.ndarray) -> Means:
        """Means of what columns (n_free, R) see, output rows transposed, of which `norms` are."""
        stiff = self._body.stiffness_factor
        moved = stiff.solve(columns)
        size = np.maximum(np.einsum("ij,ij->j", columns, moved), np.finfo(float).tiny)
        if len(norms) > FEW_ROWS:
            return Means(norms**2 / size)
        pushed = self._body.M @ moved - self.pull @ (self.pull.T @ moved)
        inverse = np.maximum(np.einsum("ij,ij->j", moved, pushed), np.finfo(float).tiny)
        squares = np.maximum(np.sum(stiff.half_solve(pushed) ** 2, axis=0), np.finfo(float).tiny)
        return Means(norms**2 / size, inverse / size, squares / size)

    def response(self, columns: np.ndarray) -> np.ndarray:
        """Admissible part y (n_free, k) of what balanced columns accelerate, Z y + Rg r = M^-1 columns."""
        rigid = solve_triangular(self._root.T, self._halves(columns)[-RIGID_MODES:])
        return self._factor.solve(columns + self.pull @ rigid)

    @cached_property
    def pull(self) -> np.ndarray:
        """Z^T M Rg (n_free, 6), Rg M-orthonormal: what accelerations of the frame do to the held body."""
        return self._space.loads(self._by_rigid(self._carried.T).T)

    def _by_rigid(self, x: np.ndarray) -> np.ndarray:
        return solve_triangular(self._of_rigid, x, lower=True)

    def _halves(self, columns: np.ndarray) -> np.ndarray:
        own = self._factor.half_solve(columns)
        return np.vstack([own, solve_triangular(self._root, self._B.T @ own, lower=True)])


class FreeInterfaces:
    """|a|_K of accelerations that a residual and any forces at the interfaces make together.

    M a = -R - F w, F the wrenches of all interfaces, that by which the body is held included. Joints choose w such
    that |M a|_{M^-1} over all bodies is no more than without: a = a_0 - M^-1 F y, with a_0 of the part of R that is
    M^-1-orthogonal to F, and |F y|_{M^-1} no more than that of the other part. So |a|_K <= |a_0|_K + steepest |F y|.
    """

    def __init__(self, body: ElasticBody, mass: FreeMass, wrenches: np.ndarray | sp.spmatrix):
        columns = wrenches.toarray() if sp.issparse(wrenches) else np.asarray(wrenches)
        columns = np.hstack([columns, -mass.pull])  # the last six: forces on the frame, beside those on it itself
        responses, on_frame = mass.response(columns), np.diag(np.append(np.zeros(columns.shape[1] - 6), np.ones(6)))
        values, X = np.linalg.eigh(columns.T @ responses + on_frame)
        X = X[:, values > ROUNDING * values[-1]] / np.sqrt(values[values > ROUNDING * values[-1]])
        self._columns, self._responses = columns @ X, responses @ X
        self._mass, self._K = mass, body.K
        stiff = self._responses.T @ (body.K @ self._responses)
        self.steepest = float(np.sqrt(np.linalg.eigvalsh(stiff)[-1]))  # largest |M^-1 F y|_K, in rad/s

    def split(self, R: np.ndarray) -> tuple[float, float]:
        """Return |a_0|_K, and |.|_{M^-1} of the part of a balanced R (n_free,) that interfaces may change."""
        a = self._mass.response(R[:, None])[:, 0]
        y = self._columns.T @ a
        a = a - self._responses @ y
        return float(np.sqrt(a @ (self._K @ a))), float(np.linalg.norm(y))


def free_velocity_norms(body: ElasticBody, C: np.ndarray) -> np.ndarray:
    """|c - (c Rg) (C_0 Rg)^-1 C_0|_{M^-1} of rows C (R, n_free) on the free body: as its frame sees velocities."""
    rows = body.space.extended(C)
    rows -= (rows @ rigid_modes(body.positions)) @ _frame_rows(body)
    return np.linalg.norm(SymmetricFactor(body.mass).half_solve(rows.T), axis=0)


def _frame_rows(body: ElasticBody) -> np.ndarray:
    """(C_0 Rg)^-1 C_0 (6, N): the motion of the frame in a motion of the body."""
    held = body.space.conditions
    if held is None:
        held = mean_motion(np.unique(body.space.fixed // 3)).rows(body.positions)
    return np.linalg.solve(held @ rigid_modes(body.positions), held)
