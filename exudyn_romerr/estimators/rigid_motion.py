"""What bounds the motion of frames and rigid bodies in a mechanism (theory.md 8, "positions in global axes").

Of the error e that auxiliary vectors leave, the energy bounds deformations u: |u|_K <= 2 g. Rigid coordinates follow
them, G_f and C_f being what constraints know of these:

    e_f = Z zeta + H u ,   C_f Z = 0 ,   C_f H + C_u = 0 ,   Y^T M [H; I] = 0 ,   G_f Y = 0 ,

and zeta, the mechanism's own freedoms, is driven by deformations through all that turns (geometric, gyroscopic terms)
and by springs. With a = Y^T M, p = a e' + (Y^T D - a') e and E = [H; I]

    zeta' = m^-1 (p - (a Z' + Y^T D Z - a' Z) zeta + (2 a' - Y^T D) E u) ,    m = a Z ,
    p'    = -(Y^T K - (Y^T D)' + a'') (Z zeta + E u) + Y^T F ,

linear in zeta, p (x' = A x + B u): an output c x is at most sqrt(tau c W c^T), W' = A W + W A^T + 2 g B K^-1 B^T and
tau' = 2 g (Cauchy and Schwarz); impulses of the force F, |F|_{M^-1}, likewise.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.linalg import block_diag, expm

from ..model.floating_frame import inertia_columns
from ..model.outputs import stacked_rows

if TYPE_CHECKING:
    from collections.abc import Sequence

    import scipy.sparse as sp

    from ..model.body import ElasticBody
    from ..model.outputs import Output

SINGULAR = 1e-9  # of the largest singular value of constraints: less, and one follows from others
SHORT = 0.1  # |A| h of what is integrated at once
SIMPSON = np.array([1.0, 4.0, 1.0]) / 6.0


class Equations(NamedTuple):
    """Rows of the linearised equations at an instant, values and two derivatives in time.

    M, D, K : (3, r, k) rows of rigid coordinates. G, C : (3, c, k) constraints: of forces, and what is kept zero.
    """

    M: np.ndarray
    D: np.ndarray
    K: np.ndarray
    G: np.ndarray
    C: np.ndarray


def cubic(y: np.ndarray, z: np.ndarray, y_t: np.ndarray, z_t: np.ndarray, h: float, after: float) -> np.ndarray:
    """Value and two derivatives (3, ...) a time after y of the cubic to z with these rates; straight if h is 0."""
    if h == 0:
        return np.array([y + after * y_t, y_t, np.zeros_like(y)])
    s, change, slope = after / h, z - y, h * y_t
    bend = h * (y_t + z_t) - 2 * change
    square = change - slope - bend
    value, rate = y + s * (slope + s * (square + s * bend)), slope + s * (2 * square + 3 * s * bend)
    return np.array([value, rate / h, (2 * square + 6 * s * bend) / h**2])


class Deformations(NamedTuple):
    """What rows of a body's deformations can be at most, where their energy is bounded.

    flexibility : (k, k) of modes and vectors V, (k + 12, k + 12) beside what others do to M e_j, M E_ij x (INERTIA).
    rest : (R + 12, R + 12), what others do to output rows C, and to these: |c u|^2 <= (c V flexibility_k V^T c^T +
    c rest c^T) |u|_K^2.
    """

    flexibility: np.ndarray
    rest: np.ndarray

    @classmethod
    def of(cls, body: ElasticBody, V: np.ndarray, outputs: Sequence[Output], mass: sp.spmatrix) -> Deformations:
        """Make it of V (N, k) and outputs of a body with this mass matrix (N, N)."""
        inertia = inertia_columns(mass, body.positions, np.zeros((len(V), 0)))
        V, C, inertia = (
            body.space.coordinates("V", V),
            stacked_rows(outputs, body).C,
            body.space.loads(inertia.toarray()),
        )
        factor = body.stiffness_factor
        modes = np.linalg.qr(factor.half_multiply(V))
        other = factor.half_solve(np.hstack([C.T, inertia]))
        for _ in range(2):  # once more, for what rounding left
            other = other - modes.Q @ (modes.Q.T @ other)
        root, rest = np.linalg.inv(modes.R), other.T @ other
        return cls(block_diag(root @ root.T, rest[len(C) :, len(C) :]), rest)


class RigidMotion:
    """Bounds of what rigid coordinates of a mechanism are off by.

    Parameters
    ----------
    rigid, elastic : numbers (r,), (k - r,) of the coordinates of frames and rigid bodies, and of the others.
    flexibility : (k - r, k - r), inverse of the stiffness of the others: |b u| <= sqrt(b flexibility b^T) |u|_K.

    Attributes
    ----------
    follows : (r, k - r) H. freedoms : number of freedoms.
    """

    def __init__(self, rigid: np.ndarray, elastic: np.ndarray, flexibility: np.ndarray):
        self._rigid, self._elastic, self._flexibility = rigid, elastic, flexibility

    def start(self, at: Equations, g: float, rests: bool) -> bool:
        """Begin with the energy g: without error, or at rest where the error of a static solution is.

        Return whether forces of constraints and what they keep zero leave as many freedoms; else nothing begins.
        """
        here = Instant(at, self._rigid, self._elastic)
        self._Z, self._Y = _basis(here.of_C.free), _basis(here.of_G.free)
        self.freedoms = self._Z.shape[1]
        if self._Y.shape[1] != self.freedoms:
            return False
        self._W, self._tau = np.zeros((2, 2 * self.freedoms, 2 * self.freedoms)), np.zeros(2)
        self.follows = here.follows(self._Z, self._Y)
        if rests:  # of A x + B u = 0 the second row, p = 0 but for what is constant there
            A, B = here.system(self._Z, self._Y)[:2]
            still = -np.linalg.pinv(A[self.freedoms :, : self.freedoms], rcond=SINGULAR) @ B[self.freedoms :]
            self._tau[0] = 2 * g
            self._W[0, : self.freedoms, : self.freedoms] = 2 * g * still @ self._flexibility @ still.T
        return True

    def advance(self, h: float, ends: tuple[Equations | None, Equations], g: float, impulse: float) -> bool:
        """Go on by a time h between two instants; return whether there are the same freedoms.

        ends : None for the first is the last of before. g, impulse : the largest energy, and the integral of
        |F|_{M^-1}, in this time.
        """
        first = self._here if ends[0] is None else Instant(ends[0], self._rigid, self._elastic)
        last = self._here = Instant(ends[1], self._rigid, self._elastic)
        counts = {round(np.trace(of.free)) for at in (first, last) for of in (at.of_G, at.of_C)}
        if counts != {self.freedoms}:
            return False
        systems = [at.system(self._Z, self._Y) for at in (first, last)]
        A = (systems[0][0] + systems[1][0]) / 2
        through = sum(B @ self._flexibility @ B.T for _, B, _ in systems) / 2
        struck = sum(strike for *_, strike in systems) / 2
        rates = np.array([2 * g * through, impulse / h * struck])
        self._W = _advanced(self._W, A, rates, h)
        self._tau = self._tau + np.array([2 * g * h, impulse])
        self._turn(last)
        self.follows = last.follows(self._Z, self._Y)
        return True

    def _turn(self, at: Instant) -> None:
        """Go over to orthonormal Z and Y, which have turned."""
        Z, Y = (_basis(of.free) for of in (at.of_C, at.of_G))
        of_Z, of_Y = Z.T @ at.of_C.free @ self._Z, Y.T @ at.of_G.free @ self._Y
        f, T = self.freedoms, np.zeros_like(self._W[0])
        T[:f, :f], T[f:, f:] = of_Z, np.linalg.inv(of_Y).T
        self._Z, self._Y, self._W = Z, Y, T @ self._W @ T.T

    def sizes(self, rows: np.ndarray) -> np.ndarray:
        """Bounds (R,) of rows (R, r) of what the freedoms move rigid coordinates by."""
        x = rows @ self._Z
        f = self.freedoms
        squares = np.sum((x @ self._W[:, :f, :f]) * x, axis=2)
        return np.sqrt(np.maximum(squares, 0.0) * self._tau[:, None]).sum(axis=0)


class _Projector(NamedTuple):
    """Of constraints C (c, r): their pseudo-inverse; I - C^+ C, what they leave free, and its two derivatives."""

    inverse: np.ndarray
    free: np.ndarray
    rate: np.ndarray
    second: np.ndarray

    @classmethod
    def of(cls, C: np.ndarray, C_t: np.ndarray, C_tt: np.ndarray) -> _Projector:
        inverse = np.linalg.pinv(C, rcond=SINGULAR)
        free = np.eye(C.shape[1]) - inverse @ C
        turned = inverse @ C_t @ free
        rate = -(turned + turned.T)
        # of the inverse, where the number of independent rows stays
        inverse_t = -inverse @ C_t @ inverse + free @ C_t.T @ (inverse.T @ inverse)
        turned = inverse_t @ C_t @ free + inverse @ (C_tt @ free + C_t @ rate)
        return cls(inverse, free, rate, -(turned + turned.T))


class Instant:
    """The equations at an instant, and what their constraints leave free."""

    def __init__(self, at: Equations, rigid: np.ndarray, elastic: np.ndarray):
        self._at, self._rigid, self._elastic = at, rigid, elastic
        self.of_C = _Projector.of(*at.C[:, :, rigid])
        self.of_G = self.of_C if np.array_equal(at.G, at.C) else _Projector.of(*at.G[:, :, rigid])

    def follows(self, Z0: np.ndarray, Y0: np.ndarray) -> np.ndarray:
        """H (r, e)."""
        Z, a = self.of_C.free @ Z0, (self.of_G.free @ Y0).T @ self._at.M[0]
        H = -self.of_C.inverse @ self._at.C[0][:, self._elastic]
        seen = a[:, self._elastic] + a[:, self._rigid] @ H
        return H - Z @ np.linalg.solve(a[:, self._rigid] @ Z, seen)

    def system(self, Z0: np.ndarray, Y0: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """A (2 f, 2 f), B (2 f, e) of zeta and p, and Y^T M Y where p is struck (2 f, 2 f)."""
        (M, M_t, M_tt), (D, D_t, _), K, rigid = self._at.M, self._at.D, self._at.K[0], self._rigid
        Z, Z_t = self.of_C.free @ Z0, self.of_C.rate @ Z0
        Y, Y_t, Y_tt = ((X @ Y0).T for X in (self.of_G.free, self.of_G.rate, self.of_G.second))
        a, a_t, a_tt = Y @ M, Y_t @ M + Y @ M_t, Y_tt @ M + 2 * Y_t @ M_t + Y @ M_tt
        d, k = Y @ D, Y @ K - (Y_t @ D + Y @ D_t) + a_tt
        m_inverse, H = np.linalg.inv(a[:, rigid] @ Z), self.follows(Z0, Y0)
        kept = m_inverse @ (a[:, rigid] @ Z_t + (d - a_t)[:, rigid] @ Z)
        A = np.block([[-kept, m_inverse], [-k[:, rigid] @ Z, np.zeros_like(kept)]])
        B = np.vstack([m_inverse @ self._followed(2 * a_t - d, H), -self._followed(k, H)])
        strike = np.zeros_like(A)
        strike[len(Y) :, len(Y) :] = a[:, rigid] @ Y.T
        return A, B, strike

    def _followed(self, rows: np.ndarray, H: np.ndarray) -> np.ndarray:
        return rows[:, self._elastic] + rows[:, self._rigid] @ H


def _basis(free: np.ndarray) -> np.ndarray:
    """Orthonormal columns that span the range of a projector."""
    values, vectors = np.linalg.eigh((free + free.T) / 2)
    return vectors[:, values > 0.5]


def _advanced(W: np.ndarray, A: np.ndarray, rates: np.ndarray, h: float) -> np.ndarray:
    """W (n, k, k) after a time h of W' = A W + W A^T + rates."""
    doublings = max(0, int(np.ceil(np.log2(max(np.linalg.norm(A, 1) * h / SHORT, 1.0)))))
    step = h / 2**doublings
    half = expm(A * step / 2)
    moved = half @ half
    added = step * sum(w * X @ rates @ X.T for w, X in zip(SIMPSON, (np.eye(len(A)), half, moved), strict=True))
    for _ in range(doublings):
        added, moved = added + moved @ added @ moved.T, moved @ moved
    return moved @ W @ moved.T + added
