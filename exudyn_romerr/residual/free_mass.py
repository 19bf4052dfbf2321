"""What accelerates a body at the start of a run, beside the reduced one, and what outputs see of that: mass norms."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
from scipy.linalg import block_diag, cholesky, solve_triangular

from ..linalg.blocked_products import by_columns
from ..linalg.symmetric_factor import SymmetricFactor
from ..model.admissible_space import RIGID_MODES, mean_motion, rigid_modes
from ..model.floating_frame import skew
from ..model.shared_body import made_once

if TYPE_CHECKING:
    from ..model.body import ElasticBody
    from .problem import Problem


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
        self._B = self._factor.half_solve(self._space.loads(self._by_rigid(self._carried.T).T))
        self._root = cholesky(np.eye(RIGID_MODES) - self._B.T @ self._B, lower=True)
        self._body = body

    @classmethod
    def of(cls, body: ElasticBody) -> FreeMass:
        """Return that of a body, made once."""
        return made_once(body, "free mass", (), lambda: cls(body))

    @cached_property
    def turning(self) -> float:
        """See turned_mass."""
        return turned_mass(self._body, self)

    def norms(self, columns: np.ndarray) -> np.ndarray:
        """Norms (k,) of columns (n_free, k) that see no rigid motion: balanced loads, or output rows transposed."""
        return np.linalg.norm(self._halves(columns), axis=0)

    def gram(self, rows: np.ndarray) -> np.ndarray:
        """C M^-1 C^T (r, r) of rows C (r, N) of all coordinates, which see rigid motions, too."""
        rigid = self._by_rigid((rows @ self._Rg).T)
        still = rows.T - self._carried @ solve_triangular(self._of_rigid.T, rigid)
        halves = np.vstack([self._halves(self._space.loads(still)), rigid])
        return halves.T @ halves

    def _by_rigid(self, x: np.ndarray) -> np.ndarray:
        return solve_triangular(self._of_rigid, x, lower=True)

    def _halves(self, columns: np.ndarray) -> np.ndarray:
        own = self._factor.half_solve(columns)
        return np.vstack([own, solve_triangular(self._root, self._B.T @ own, lower=True)])


class AtStart:
    """What only a start under a residual needs, made when one does, or by `prepare`.

    Attributes
    ----------
    factors : |C|_{M^-1} of output rows (R,), in the body's frame. shown : of outputs as shown (r,), in global axes,
    however the body is turned; 0 in its own.
    """

    def __init__(self, problem: Problem):
        self._residual, self._rows, self._outputs = problem.terms, problem.rows.C, problem.outputs
        self._views = problem.views

    def prepare(self) -> None:
        """Make what most runs need before the first one; of all mesh nodes, say, it would take long."""
        _ = self.factors, self.turning

    @property
    def damping(self) -> tuple[float, float] | None:
        """Rayleigh's alpha and beta; None: the damping is another one."""
        return self._residual.body.rayleigh

    @cached_property
    def _mass(self) -> FreeMass:
        return FreeMass.of(self._residual.body)

    @cached_property
    def factors(self) -> np.ndarray:
        """See the class."""
        return made_once(
            self._residual.body, "mass norms of rows", (self._rows,), lambda: self._mass.norms(self._rows.T)
        )

    @cached_property
    def shown(self) -> np.ndarray:
        """See the class."""
        found = []
        for out, view in zip(self._outputs, self._views, strict=True):
            rows = out.resolve(self._residual.body)
            if view is None:
                found.append(np.zeros(len(rows)))
                continue
            places = (self._mass.gram(place) for place in rows.reshape(-1, 3, rows.shape[1]))
            found += [np.full(len(view.axes), np.sqrt(np.linalg.eigvalsh(gram)[-1])) for gram in places]
        return np.concatenate([*found, np.zeros(0)])

    @property
    def turning(self) -> float:
        """See turned_mass."""
        return self._mass.turning

    def coordinates(self, *sample: np.ndarray) -> np.ndarray:
        """Return z (k,) of q, q', q'' (n,) and inputs (p,) as they are."""
        return self._residual.coordinates(*sample)

    def push(self, z: np.ndarray) -> float:
        """Return |R|_{M^-1} of the residual R = L z."""
        return float(self._mass.norms(self._residual.of(z)[:, None])[0])

    def terms(self, z: np.ndarray) -> float:
        """Return the sum of |.|_{M^-1} of the terms of R, one for each entry of z: what R may be rounding of."""
        return float(np.abs(z) @ self._sizes)

    @cached_property
    def _sizes(self) -> np.ndarray:
        """|.|_{M^-1} of the residual's columns (k,)."""
        columns = *self._residual.of_motion, self._residual.B
        return np.concatenate([self._norms(part) for part in columns])

    def _norms(self, columns: np.ndarray | sp.spmatrix) -> np.ndarray:
        return by_columns(lambda part: self._mass.norms(part)[None], columns, np.empty((1, columns.shape[1])))[0]


def free_velocity_norms(body: ElasticBody, C: np.ndarray) -> np.ndarray:
    """|c - (c Rg) (C_0 Rg)^-1 C_0|_{M^-1} of rows C (R, n_free) on the free body: as its frame sees velocities."""
    rows = body.space.extended(C)
    rows -= (rows @ rigid_modes(body.positions)) @ _frame_rows(body)
    return np.linalg.norm(SymmetricFactor(body.mass).half_solve(rows.T), axis=0)


def turned_mass(body: ElasticBody, mass: FreeMass) -> float:
    """|dM a|_{M^-1} over |a|_M at most, by a radian: of M where places are in global axes, the rest in the body's.

    Where it turns by t, an acceleration whose frame has c is another one by S c = (t x c_1, t x c_2 / 2) of places
    and Euler parameters (rotation vectors: none, they are in the body's axes in Exudyn). With momenta P of the body

        v^T dM a = P(v)^T S c(a) + c(v)^T S^T P(a) ,

    the same to second order in t. Of all three axes, one upon another, which is at least what any axis has.
    """
    Rg, none, one = rigid_modes(body.positions), np.zeros((RIGID_MODES, RIGID_MODES)), np.eye(RIGID_MODES)
    L = cholesky(Rg.T @ (body.mass @ Rg), lower=True)  # momenta times L^-1 have the Gram matrix 1, and no units
    gram = np.block([[L.T @ mass.gram(_frame_rows(body)) @ L, one], [one, one]])
    squares = 0.0 * gram
    for axis in np.eye(3):
        S = solve_triangular(L, block_diag(skew(axis), skew(axis) / 2).T @ L, lower=True).T
        form = np.block([[none, S.T], [S, none]])
        squares += form @ gram @ form
    return float(np.sqrt(np.linalg.eigvals(gram @ squares).real.max()))


def _frame_rows(body: ElasticBody) -> np.ndarray:
    """(C_0 Rg)^-1 C_0 (6, N): the motion of the frame in a motion of the body."""
    held = body.space.conditions
    if held is None:
        held = mean_motion(np.unique(body.space.fixed // 3)).rows(body.positions)
    return np.linalg.solve(held @ rigid_modes(body.positions), held)
