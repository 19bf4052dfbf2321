"""Auxiliary vectors of a body in a mechanism: what its modes miss of responses to inertia and loads (theory.md 7).

Eigenmodes leave much of it; K^-1 times the columns of the residual leave nothing but the inertia of these vectors
themselves. They do not move the interfaces: joints and springs do not see them, wrenches do no work on them.
Where V makes interfaces rigid (RBE2), every response has two K-orthogonal parts: that of the body with rigid
interfaces, and what their deformation adds. Vectors are made of one part each, so that the second may be left out.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from ..errors import AssumptionError
from ..linalg.orthogonalise import orthonormal, without
from ..linalg.symmetric_factor import SubspaceFactor, SymmetricFactor
from ..model.body import ElasticBody

NEW_SHARE = 1e-8  # of the largest response: what is smaller is rounding of what V and P hold already
MISSED = 1e-6  # of a static mode: less is rounding of what V holds of it already
DEPENDENT = 1e-7  # sine of the angle to other vectors: less is rounding of what they hold already
# smallest cosine of static modes and V that take motion of interfaces out of P; at 3e-6 P grew 200 times
INDEPENDENT = 1e-5
# so many static responses first, or half of all, for what is slow; then, in rounds of so many, responses to the
# inertia of those before, for what rings: of a hinged bar under sudden gravity 20 alone missed 39 % of the error, 26
# with 13 for its interface miss 2 %
STATIC, ROUND = 20, 6
DEFORMING = 2  # one vector that deforms rigid interfaces to so many others, beside the static modes that V misses
FEWER = 2 / 3  # of the vectors: what these alone predict tells how far the prediction can be trusted


class Enrichment:
    """Vectors P beside the modes V of a body, without motion of the interfaces.

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
    rigid : SubspaceFactor, optional
        Of K on all displacements with the interfaces as rigid as V makes them; None: V makes none rigid.

    Attributes
    ----------
    P : (n_free, count), orthonormal in M; where V makes interfaces rigid, vectors that keep them so among themselves,
    and vectors that deform them; blocks of P are Ritz vectors. keeps : (count,) bool,
    those that leave the interfaces rigid that V makes rigid. first : (count,) bool, those that a share FEWER of the
    vectors of either kind would be, and static modes.

    Raises
    ------
    AssumptionError
        V cannot move the interfaces one by one: static modes are missing.
    """

    def __init__(
        self, body: ElasticBody, V: np.ndarray, inertia, loads, wrenches, m: int, rigid: SubspaceFactor | None = None
    ):
        self._factor, self._V = body.stiffness_factor, V
        self._energies = self._factor.half_multiply(V)
        omega, shapes = la.eigh(V.T @ (body.K @ V), V.T @ (body.M @ V))
        # forces that move the body by a unit acceleration move its modes by (omega_1/omega)^2: that is their weight
        modal = body.M @ (V @ shapes) * omega[0] / omega
        columns = np.hstack([np.sqrt(omega[0]) * np.hstack([inertia, modal]), self._of_unit_energy(loads)])
        wrenches = self._of_unit_energy(wrenches)
        both = (False,) if rigid is None else (False, True)
        parts = [_Responses(self._factor, V, self._energies, rigid, deforms) for deforms in both]
        found = []
        for i, part in enumerate(parts):
            part.add_static(wrenches)
            static, room = part.count, len(V) - V.shape[1] - sum(part.count for part in parts)
            part.add_responses(columns, min(-(-m // DEFORMING) if i else m, room), body.M)
            border = static + round(FEWER * (part.count - static))
            before = np.zeros((len(V), 0))
            for own in (slice(0, border), slice(border, None)):
                P = part.P[:, own] - V @ self._moved(wrenches, part.P[:, own])
                P = _ritz(body, P @ _independent(self._factor.half_multiply(P)), before)
                found.append((P, i == 0, own.start == 0))
                before = np.hstack([before, P])
        # blocks know V, not one another
        P = np.hstack([block for block, *_ in found])
        kept = independent_beside(self._energies, self._factor.half_multiply(P))
        count = [block.shape[1] for block, *_ in found]
        self.keeps, self.first = (np.repeat([block[k] for block in found], count)[kept] for k in (1, 2))
        self.P = P[:, kept]

    def _of_unit_energy(self, forces: np.ndarray) -> np.ndarray:
        """Forces scaled to unit norm in K^-1; those that do no work are left out."""
        if not forces.size:
            return forces
        size = np.linalg.norm(self._factor.half_solve(forces), axis=0)
        return forces[:, size > 0] / size[size > 0]

    def _moved(self, wrenches: np.ndarray, P: np.ndarray) -> np.ndarray:
        """Combinations of V that move the interfaces as P does; wrenches: of unit energy."""
        if not wrenches.shape[1]:
            return np.zeros((self._V.shape[1], P.shape[1]))
        size = np.linalg.norm(self._energies, axis=0)
        of_V = wrenches.T @ (self._V / size)  # cosines between static modes and V
        values = la.svd(of_V, compute_uv=False)
        if len(values) < len(of_V) or values[-1] < INDEPENDENT:
            raise AssumptionError(
                "the modes cannot move every interface in every direction: joints need interfaces with static modes "
                "(Craig-Bampton)"
            )
        return la.pinv(of_V) @ (wrenches.T @ P) / size[:, None]


def independent_beside(V: np.ndarray, P: np.ndarray) -> np.ndarray:
    """Return which columns of P (n_free, m) are independent of V and of those before them (m,), by angles."""
    held, kept = orthonormal(V), np.zeros(P.shape[1], dtype=bool)
    for i, column in enumerate(P.T / np.linalg.norm(P, axis=0)[:, None]):
        left = without(held, column[:, None])
        size = np.linalg.norm(left)
        if size > DEPENDENT:
            held, kept[i] = np.hstack([held, left / size]), True
    return kept


class _Responses:
    """Vectors taken so far from static responses of the body, or from one K-orthogonal part of these.

    rigid : of the part with rigid interfaces; deforms : the other part is taken, what their deformation adds.
    P : (n_free, count), K-orthogonal to V and to one another.
    """

    def __init__(
        self,
        factor: SymmetricFactor,
        V: np.ndarray,
        energies: np.ndarray,
        rigid: SubspaceFactor | None,
        deforms: bool,
    ):
        self._factor, self._V, self._rigid, self._deforms = factor, V, rigid, deforms
        self.P = np.zeros((len(V), 0))
        self._energies = energies  # of V and P, where |.|_K is the 2-norm

    @property
    def count(self) -> int:
        """Number of vectors."""
        return self.P.shape[1]

    def add_static(self, wrenches: np.ndarray) -> None:
        """Take what V misses of the static modes of the interfaces (all of them where V makes interfaces rigid)."""
        if wrenches.shape[1]:
            missed, _ = self.missed(wrenches)
            self._add(wrenches[:, np.linalg.norm(missed, axis=0) > MISSED])

    def add_responses(self, columns: np.ndarray, m: int, mass: sp.spmatrix) -> None:
        """Take m responses: the largest to columns, in energy, then to the inertia of those before."""
        enough, most = self.count + m, max(STATIC, m // 2)
        while self.count < enough and columns.shape[1]:
            missed, largest = self.missed(columns)
            _, size, combined = la.svd(missed, full_matrices=False)
            count = min(enough - self.count, most, int(np.sum(size > NEW_SHARE * largest)))
            columns, most = mass @ self._add(columns @ (combined[:count].T / size[:count])), ROUND

    def missed(self, forces: np.ndarray) -> tuple[np.ndarray, float]:
        """What V and P leave of the responses, where |.|_K is the 2-norm, and the largest norm of whole responses.

        Of the whole ones: where interfaces that are rigid change nothing, the second part is rounding.
        """
        energies = whole = self._factor.half_solve(forces)
        if self._rigid is not None:
            energies = self._own(whole, self._factor.half_multiply(self._rigid.solve(forces)))
        return without(orthonormal(self._energies), energies), np.linalg.norm(whole, axis=0).max()

    def _own(self, whole: np.ndarray, rigid: np.ndarray) -> np.ndarray:
        return whole - rigid if self._deforms else rigid

    def _add(self, forces: np.ndarray) -> np.ndarray:
        """Take responses, K-orthogonal to V and P."""
        if not forces.shape[1]:
            return forces
        known, responses = np.hstack([self._V, self.P]), self._factor.solve(forces)
        if self._rigid is not None:
            responses = self._own(responses, self._rigid.solve(forces))
        for _ in range(2):  # twice: what rounding leaves of the first pass is taken out by the second
            energies = self._factor.half_multiply(responses)
            held = la.lstsq(self._energies, energies)[0]
            responses = responses - known @ held
        self.P = np.hstack([self.P, responses])
        self._energies = np.hstack([self._energies, energies - self._energies @ held])
        return responses


def _ritz(body: ElasticBody, P: np.ndarray, before: np.ndarray) -> np.ndarray:
    """Ritz vectors of what is new in P beside the M-orthonormal columns before it, the lowest first."""
    for _ in range(2):  # as in `without`
        P = P - before @ (before.T @ (body.M @ P))
    squares, turn = la.eigh(P.T @ (body.M @ P), P.T @ (body.K @ P))  # 1/omega^2
    kept = np.flatnonzero(squares > NEW_SHARE**2 * squares.max(initial=0.0))[::-1]
    return P @ (turn[:, kept] / np.sqrt(squares[kept]))


def _independent(columns: np.ndarray) -> np.ndarray:
    """Combinations of columns (n_free, m) that are orthonormal; what rounding alone tells apart is left out."""
    if not columns.shape[1]:
        return np.eye(0)
    length = np.linalg.norm(columns, axis=0)
    _, size, turn = la.svd(columns / length, full_matrices=False)
    kept = size > NEW_SHARE * size[0]
    return turn[kept].T / size[kept] / length[:, None]
