"""Auxiliary vectors of a body in a mechanism: what its modes miss of responses to inertia and loads (theory.md 7).

Eigenmodes leave much of it; K^-1 times the columns of the residual leave nothing but the inertia of these vectors
themselves. They do not move the interfaces: joints and springs do not see them, wrenches do no work on them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy.linalg as la

from ..errors import AssumptionError
from ..linalg.orthogonalise import orthonormal, without

if TYPE_CHECKING:
    from ..model.body import ElasticBody

NEW_SHARE = 1e-8  # of the largest response: what is smaller is rounding of what V and P hold already
MISSED = 1e-6  # of a static mode: less is rounding of what V holds of it already
# smallest cosine of static modes and V that take motion of interfaces out of P; at 3e-6 P grew 200 times
INDEPENDENT = 1e-5


class Enrichment:
    """Vectors P beside the modes V of a body, orthonormal in M, without motion of the interfaces.

    Parameters
    ----------
    V : ndarray, (n_free, n)
    inertia : ndarray, (n_free, i)
        M times rigid motions and their like, of unit mass norm.
    loads : ndarray, (n_free, p)
        Columns of known loads.
    wrenches : ndarray, (n_free, w)
        Unit wrenches at the interfaces; their transpose takes the interfaces' motion.
    m : int
        Number of vectors beside static modes that V misses (RBE2).

    Attributes
    ----------
    P : (n_free, count). omega : (count,) rad/s, their Ritz frequencies among themselves.

    Raises
    ------
    AssumptionError
        V cannot move the interfaces one by one: static modes are missing.
    """

    def __init__(self, body: ElasticBody, V: np.ndarray, inertia, loads, wrenches, m: int):
        self._factor, self._V = body.stiffness_factor, V
        omega, shapes = la.eigh(V.T @ (body.K @ V), V.T @ (body.M @ V))
        omega = np.sqrt(omega)
        # forces that move the body by a unit acceleration move its modes by (omega_1/omega)^2: that is their weight
        modal = body.M @ (V @ shapes) * (omega[0] / omega) ** 2
        columns = np.hstack([omega[0] * inertia, omega[0] * modal, self._of_unit_energy(loads)])
        wrenches = self._of_unit_energy(wrenches)
        P = self._static(wrenches)
        m = min(P.shape[1] + m, len(V) - V.shape[1])
        while P.shape[1] < m and columns.shape[1]:
            new = self._responses(columns, P, m - P.shape[1])
            P, columns = np.hstack([P, new]), body.M @ new
        P = P - V @ self._moved(wrenches, P)
        P = P @ _independent(self._factor.half_multiply(P))
        squares, turn = la.eigh(P.T @ (body.M @ P))  # 1/omega^2
        kept = np.flatnonzero(squares > NEW_SHARE**2 * squares.max(initial=0.0))[::-1]
        self.P, self.omega = P @ (turn[:, kept] / np.sqrt(squares[kept])), 1 / np.sqrt(squares[kept])

    def _of_unit_energy(self, forces: np.ndarray) -> np.ndarray:
        """Forces scaled to unit norm in K^-1; those that do no work are left out."""
        if not forces.size:
            return forces
        size = np.linalg.norm(self._factor.half_solve(forces), axis=0)
        return forces[:, size > 0] / size[size > 0]

    def _static(self, wrenches: np.ndarray) -> np.ndarray:
        """What V misses of the static modes of the interfaces (all of them where V makes interfaces rigid)."""
        none = np.zeros((len(self._V), 0))
        if not wrenches.shape[1]:
            return none
        left = np.linalg.norm(without(self._held(none), self._factor.half_solve(wrenches)), axis=0)
        return self._left_of(wrenches[:, left > MISSED], none)

    def _responses(self, columns: np.ndarray, P: np.ndarray, m: int) -> np.ndarray:
        """The m largest responses K^-1 columns, in energy, of what V and P leave of them."""
        energies = self._factor.half_solve(columns)
        _, size, combined = la.svd(without(self._held(P), energies), full_matrices=False)
        m = min(m, int(np.sum(size > NEW_SHARE * np.linalg.norm(energies, axis=0).max())))
        return self._left_of(columns @ (combined[:m].T / size[:m]), P)

    def _held(self, P: np.ndarray) -> np.ndarray:
        """Orthonormal basis of V and P where |.|_K is the 2-norm."""
        return orthonormal(self._factor.half_multiply(np.hstack([self._V, P])))

    def _left_of(self, forces: np.ndarray, P: np.ndarray) -> np.ndarray:
        """K^-1 forces, K-orthogonal to V and P."""
        if not forces.shape[1]:
            return forces
        known = np.hstack([self._V, P])
        energies, responses = self._factor.half_multiply(known), self._factor.solve(forces)
        for _ in range(2):  # twice: what rounding leaves of the first pass is taken out by the second
            responses = responses - known @ la.lstsq(energies, self._factor.half_multiply(responses))[0]
        return responses

    def _moved(self, wrenches: np.ndarray, P: np.ndarray) -> np.ndarray:
        """Combinations of V that move the interfaces as P does; wrenches: of unit energy."""
        if not wrenches.shape[1]:
            return np.zeros((self._V.shape[1], P.shape[1]))
        size = np.linalg.norm(self._factor.half_multiply(self._V), axis=0)
        of_V = wrenches.T @ (self._V / size)  # cosines between static modes and V
        values = la.svd(of_V, compute_uv=False)
        if len(values) < len(of_V) or values[-1] < INDEPENDENT:
            raise AssumptionError(
                "the modes cannot move every interface in every direction: joints need interfaces with static modes "
                "(Craig-Bampton)"
            )
        return la.pinv(of_V) @ (wrenches.T @ P) / size[:, None]


def _independent(columns: np.ndarray) -> np.ndarray:
    """Combinations of columns (n_free, m) that are orthonormal; what rounding alone tells apart is left out."""
    if not columns.shape[1]:
        return np.eye(0)
    length = np.linalg.norm(columns, axis=0)
    _, size, turn = la.svd(columns / length, full_matrices=False)
    kept = size > NEW_SHARE * size[0]
    return turn[kept].T / size[kept] / length[:, None]
