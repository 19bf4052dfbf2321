"""FrameInertia: inertia forces of an ObjectFFRFreducedOrder and their derivatives in closed form.

Acceleration of a node in the frame: a = b + al~ p + w~ w~ p + 2 w~ u' + u'', p = x + u, b = A^T r''; m a works on
velocities of nodes, A^T r' + w~ p + u' with w = G theta'. All follows from sums over the nodes that Exudyn keeps with
its modes: see object_terms in access/object_terms.py.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ...compiled.loops import loops
from ...model.floating_frame import skew
from ..access.euler_parameters import axes_of, rates_of
from ..access.mbs_items import FFRF, QUATERNIONS, dense

MANY = 25  # coordinates of a body: differences of its forces cost as much as closed forms
UNIT = np.eye(3)
TURNS = rates_of(np.eye(4))  # derivatives of G
# of A by Euler parameters, linear in these: of unit ones; of a polynomial of second degree differences are exact
TURNED = (axes_of(np.eye(4)[:, None] + np.eye(4)) - axes_of(np.eye(4)[:, None] - np.eye(4))).reshape(4, 36) / 2


class FrameInertia:
    """Of coordinates q (k,) of a body: three of its place, four Euler parameters, n of its modes.

    Attributes
    ----------
    number : of the body. columns : where its coordinates are among those of the mbs.
    """

    def __init__(self, item: dict[str, Any], node: dict[str, Any], number: int, columns: Sequence[int]):
        """Item and node as GetObject and GetNode give them."""
        self.number, self.columns = number, np.array(columns)
        self._reference = np.array(node["referenceCoordinates"], float)
        n = len(columns) - 7
        self.M, self.K, self.D = (dense(item[f"{name}MatrixReduced"], n) for name in ("mass", "stiffness", "damping"))
        self._mass, self._centre, self._inertia = (np.array(item[x]) for x in ("mass", "centerOfMass", "inertia"))
        self._pull = np.array(item["mPhitTPsi"])
        # sums of m u_k x u_l (n, 3, n), m x x u_l (3, n), m u~_k^T u~_l (n, n, 3, 3), m x~^T u~_l (n, 3, 3)
        self._cross = -np.reshape(item["mPsiTildePsi"], (n, 3, n))
        self._moments = -np.array(item["mXRefTildePsi"])
        self._twice = np.reshape(item["mPsiTildePsiTilde"], (n, 3, n, 3)).swapaxes(1, 2).reshape(n, 9 * n)
        self._once = np.reshape(item["mXRefTildePsiTilde"], (3, n, 3)).swapaxes(0, 1).reshape(9 * n)

    @classmethod
    def all_of(cls, mbs: Any, least: int | None = None) -> Iterator[FrameInertia]:
        """Make them of the bodies of an mbs with many modes, or with so many coordinates at least.

        Of fewer modes Exudyn's own differences cost no more. Not where forces are those of a user, or rotations no
        Euler parameters.
        """
        least = MANY if least is None else least
        for number in range(mbs.systemData.NumberOfObjects()):
            if len(mbs.systemData.GetObjectLTGODE2(number)) < least:
                continue
            item = mbs.GetObject(number)
            if item["objectType"] != FFRF or item["forceUserFunction"] or item["massMatrixUserFunction"]:
                continue
            node = mbs.GetNode(int(item["nodeNumbers"][0]))
            if node["nodeType"] == QUATERNIONS and item["computeFFRFterms"]:
                yield cls(item, node, number, mbs.systemData.GetObjectLTGODE2(number))

    def force(self, q: np.ndarray, q_t: np.ndarray, q_tt: np.ndarray) -> np.ndarray:
        """All forces of inertia, stiffness and damping (..., k): M q'' and the left-hand side of the body."""
        return self.force_and_masses(q, q_t, q_tt)[0]

    def force_and_masses(self, q: np.ndarray, q_t: np.ndarray, q_tt: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return these forces, and the diagonal of M, both (..., k)."""
        if loops is not None:
            found, n = np.empty((2, *q.shape)), len(self.M)
            states = np.array([x.reshape(-1, n + 7) for x in (q, q_t, q_tt)], order="C")
            loops.inertia(states.shape[1], n, states, self._constants, np.empty(15 * n), found)
            return found[0], found[1]
        x = self._here(q)
        place, turn, modes = self._loads(x, self._moving(x, q_t, q_tt))
        masses = np.full(q.shape, self._mass)
        masses[..., 3:7], masses[..., 7:] = (x.G * (x.theta @ x.G)).sum(axis=-2), np.diag(self.M)
        place = self._mass * q_tt[..., :3] + _times(x.A, place)
        return np.concatenate([place, _times(x.G.swapaxes(-1, -2), turn), modes], axis=-1), masses

    @cached_property
    def _constants(self) -> np.ndarray:
        """What the compiled loop goes through."""
        matrices = (self.M.T, self.D.T, self.K.T)
        sums = self._pull, self._moments, self._once, self._cross, self._twice, *matrices
        body = self._reference[3:7], self._mass, self._centre, self._inertia
        return np.concatenate([np.ravel(x).astype(float) for x in (*body, *sums)])

    def mass(self, q: np.ndarray) -> np.ndarray:
        """M (k, k)."""
        return self._mass_of(self._here(q))

    def _mass_of(self, x: Here) -> np.ndarray:
        k = 7 + len(x.u)
        M = np.zeros((k, k))
        M[:3, :3], M[:3, 3:7], M[:3, 7:] = self._mass * UNIT, -x.A @ skew(x.chi) @ x.G, x.A @ self._pull
        M[3:7, 3:7], M[3:7, 7:], M[7:, 7:] = x.G.T @ x.theta @ x.G, x.G.T @ x.gamma, self.M
        M[3:, :3], M[7:, 3:7] = M[:3, 3:].T, M[3:7, 7:].T
        return M

    def mass_changes(self, q: np.ndarray) -> np.ndarray:
        """Derivatives (k, k, k) of M by the coordinates; the first index is theirs."""
        x = self._here(q)
        n, k, chi = len(x.u), 7 + len(x.u), skew(x.chi)
        dM = np.zeros((k, k, k))
        dM[3:7, :3, 3:7] = -(x.by_p @ chi @ x.G + x.A @ chi @ TURNS)
        dM[3:7, :3, 7:] = x.by_p @ self._pull
        of_turns = TURNS.swapaxes(1, 2) @ x.theta @ x.G
        dM[3:7, 3:7, 3:7] = of_turns + of_turns.swapaxes(1, 2)
        dM[3:7, 3:7, 7:] = TURNS.swapaxes(1, 2) @ x.gamma
        dM[7:, :3, 3:7] = -x.A @ skew(self._pull.T) @ x.G
        of_modes = x.G.T @ x.H @ x.G
        dM[7:, 3:7, 3:7] = of_modes + of_modes.swapaxes(1, 2)
        dM[7:, 3:7, 7:] = (x.G.T @ self._cross.swapaxes(0, 1).reshape(3, n * n)).reshape(4, n, n).swapaxes(0, 1)
        dM[:, 3:7, :3], dM[:, 7:, :3] = dM[:, :3, 3:7].swapaxes(1, 2), dM[:, :3, 7:].swapaxes(1, 2)
        dM[:, 7:, 3:7] = dM[:, 3:7, 7:].swapaxes(1, 2)
        return dM

    def tangent(self, q: np.ndarray, q_t: np.ndarray, q_tt: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """M, and derivatives D, K (k, k) of `force` by rates and coordinates."""
        x = self._here(q)
        y = self._moving(x, q_t, q_tt)
        place, turn, _ = self._loads(x, y)
        n, w, W, chi = len(x.u), y.w, skew(y.w), skew(x.chi)
        both = x.H + x.H.swapaxes(1, 2)
        by_w = (
            -skew(W @ x.chi) - W @ chi - 2 * skew(self._pull @ y.u_t),
            W @ x.theta - skew(x.theta @ w) + 2 * y.H,
            2 * y.cross.T - both @ w,
        )
        by_w = np.vstack([x.A @ by_w[0], x.G.T @ by_w[1], by_w[2]])
        by_al = np.vstack([-x.A @ chi, x.G.T @ x.theta, x.gamma.T])
        by_b = np.vstack([x.G.T @ chi, self._pull.T])
        K, D = np.zeros((2, 7 + n, 7 + n))
        D[:, 3:7] = by_w @ x.G
        D[:3, 7:], D[3:7, 7:] = 2 * x.A @ W @ self._pull, 2 * x.G.T @ (x.H @ w).T
        D[7:, 7:] = self.D + 2 * (self._cross.swapaxes(1, 2) @ w).T
        K[:, 3:7] = by_w @ (TURNS @ q_t[3:7]).T + by_al @ (TURNS @ q_tt[3:7]).T
        K[3:, 3:7] += by_b @ (q_tt[:3] @ x.by_p).T
        K[:3, 3:7] += (x.by_p @ place).T
        K[3:7, 3:7] += (TURNS.swapaxes(1, 2) @ turn).T
        S, twice = skew(y.al) + W @ W, self._twice.reshape(n, n, 9)
        K[:3, 7:] = x.A @ S @ self._pull
        moved = 2 * (y.u_t @ self._twice).reshape(n, 3, 3).swapaxes(1, 2)
        of_turn = both @ y.al + (both @ w) @ W.T + moved @ w + y.u_tt @ self._cross.swapaxes(1, 2)
        K[3:7, 7:] = x.G.T @ (of_turn.T - skew(y.b) @ self._pull)
        K[7:, 7:] = self.K + (self._cross.swapaxes(1, 2) @ y.al - twice @ np.outer(w, w).ravel()).T
        return self._mass_of(x), D, K

    def _loads(self, x: Here, y: Moving) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Forces on place, turn and modes, in body axes; without m r''."""
        W, w, turned = skew(y.w), y.w, (y.w[..., :, None] * y.w[..., None, :]).reshape(*y.w.shape[:-1], 9)
        place = _times(skew(y.al) + W @ W, x.chi) + y.u_tt @ self._pull.T + 2 * _times(W, y.u_t @ self._pull.T)
        turn = _times(skew(x.chi), y.b) + _times(x.theta, y.al) + _times(W, _times(x.theta, w))
        turn = turn + _times(x.gamma, y.u_tt) + 2 * _times(y.H, w)
        modes = y.b @ self._pull + _times(x.gamma.swapaxes(-1, -2), y.al) + 2 * _times(y.cross.swapaxes(-1, -2), w)
        modes = modes - _times(x.H.reshape(*x.H.shape[:-2], 9), turned)
        return place, turn, modes + y.u_tt @ self.M.T + y.u_t @ self.D.T + x.u @ self.K.T

    def _here(self, q: np.ndarray) -> Here:
        p, u, n = self._reference[3:] + q[..., 3:7], q[..., 7:], len(self.M)
        H = (self._once + u @ self._twice).reshape(*u.shape, 3, 3)
        theta = self._inertia + _summed(u, self._once.reshape(n, 3, 3)) + _summed(u, H).swapaxes(-1, -2)
        chi, gamma = self._mass * self._centre + u @ self._pull.T, self._moments + _summed(u, self._cross)
        return Here(axes_of(p), (p @ TURNED).reshape(*p.shape, 3, 3), rates_of(p), u, chi, gamma, H, theta)

    def _moving(self, x: Here, q_t: np.ndarray, q_tt: np.ndarray) -> Moving:
        u_t = q_t[..., 7:]
        sums = _summed(u_t, x.H), _summed(u_t, self._cross)
        b, w, al = (
            _times(x.A.swapaxes(-1, -2), q_tt[..., :3]),
            _times(x.G, q_t[..., 3:7]),
            _times(x.G, q_tt[..., 3:7]),
        )
        return Moving(b, w, al, u_t, q_tt[..., 7:], *sums)


def _times(of: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Matrices (..., i, j) times x (..., j)."""
    return (of @ x[..., None])[..., 0]


def _summed(u: np.ndarray, of: np.ndarray) -> np.ndarray:
    """Sum u_k of_k (..., i, j) of u (..., k) and (..., k, i, j)."""
    flat = of.reshape(*of.shape[:-2], of.shape[-2] * of.shape[-1])
    return (u[..., None, :] @ flat).reshape(*u.shape[:-1], *of.shape[-2:])


class Here(NamedTuple):
    """Where a body is, and its sums there; in several states, these are the first axes of all.

    A, by_p : axes (3, 3) and their derivatives (4, 3, 3). G (3, 4). u (n,) : modal coordinates. chi (3,) : m p.
    gamma (3, n) : m p x u_l. H (n, 3, 3) : m p~^T u~_l. theta (3, 3) : m p~^T p~.
    """

    A: np.ndarray
    by_p: np.ndarray
    G: np.ndarray
    u: np.ndarray
    chi: np.ndarray
    gamma: np.ndarray
    H: np.ndarray
    theta: np.ndarray


class Moving(NamedTuple):
    """How it moves: b = A^T r'', w, al (3,) in body axes, rates of modal coordinates u_t, u_tt (n,).

    H (3, 3), cross (3, n) : sums m p~^T u'~ and m u' x u_l.
    """

    b: np.ndarray
    w: np.ndarray
    al: np.ndarray
    u_t: np.ndarray
    u_tt: np.ndarray
    H: np.ndarray
    cross: np.ndarray
