"""The reduced mechanism in the coordinates of the mbs, and its equations frozen in the middle of steps."""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial

import numpy as np

from ..mechanism.rows import Samples
from ..mechanism.tangents import Block
from ..mechanism.unknowns import Unknowns
from .factors import bordered_inverses

ORDER = 4  # samples of a cubic


@dataclass
class ReducedSystem(Samples):
    """Tangents at rows: M, D, K (T, n_q, n_q), G, C (T, c, n_q), the last constraints those of Euler parameters."""

    M: np.ndarray
    D: np.ndarray
    K: np.ndarray
    G: np.ndarray
    C: np.ndarray

    @classmethod
    def of(cls, block: Block, unknowns: Unknowns) -> ReducedSystem:
        """Turn the tangents of a block, without vectors, into coordinates of the mbs."""
        u, rows, own = unknowns, block.rows, unknowns.own
        H, H1, H2 = (x[:, own] for x in u.inverses(rows.q, rows.v, rows.a))
        M, D, K = (x[:, own][:, :, own] for x in (block.M, block.D, block.K))
        unit = np.zeros((len(rows), len(u.nodes), u.n_q))
        for k, node in enumerate(u.nodes):
            unit[:, k, node.own[3:]] = node.parameters(rows.q)
        C, G = (np.concatenate([x[:, :, own] @ H, unit], axis=1) for x in (block.C, block.G))
        H_t = H.swapaxes(1, 2)
        return cls(H_t @ M @ H, H_t @ (D @ H + 2 * M @ H1), H_t @ (K @ H + D @ H1 + M @ H2), G, C)


def saddle_inverses(M: np.ndarray, G: np.ndarray, C: np.ndarray) -> np.ndarray:
    """Return inverses (T, n + c, n + c) of [[M, G^T], [C, 0]]; M is scaled to the size of one first."""
    n = M.shape[1]
    scale = np.trace(M, axis1=1, axis2=2)[:, None, None] / n
    found = bordered_inverses(M / scale, G, C)
    found[:, :n, :n] /= scale
    found[:, n:, n:] *= scale
    return found


def cubics(t: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return of cubics around steps `at` their first rows (T,), and matrices (T, 4, 4) from samples to coefficients.

    Coefficients are those of powers of s = (t - t_j) / h over step j, from row j to j + 1.
    """
    S, m = len(t), min(ORDER, len(t))
    first = np.clip(at - 1, 0, S - m)
    h = t[at + 1] - t[at]
    s = (t[first[:, None] + np.arange(m)] - t[at, None]) / h[:, None]
    return first, np.linalg.inv(s[:, :, None] ** np.arange(m))


@dataclass
class FrozenSteps(Samples):
    """Equations frozen in the middle of T steps: d'' = a21 d + a22 d' + loads, of the coordinates.

    b21, b22 : multipliers of d, d'. C, C1, W (T, c, n) twice, (T, n, c) : at the ends of steps, constraints, their
    rates, what takes violations out without moving what is stiff. masses (T, n) : the diagonal of M.
    """

    a21: np.ndarray
    a22: np.ndarray
    b21: np.ndarray
    b22: np.ndarray
    C: np.ndarray
    C1: np.ndarray
    W: np.ndarray
    masses: np.ndarray

    @classmethod
    def of(cls, system: ReducedSystem, inverses: np.ndarray, t: np.ndarray, at: np.ndarray) -> FrozenSteps:
        """Freeze steps from rows `at` to the next; inverses : of [[M, G^T], [C, 0]] at all rows."""
        D, K, X = ((x[at] + x[at + 1]) / 2 for x in (system.D, system.K, inverses))
        first, weights = cubics(t, at)
        h, n = (t[at + 1] - t[at])[:, None, None], K.shape[1]
        around = system.C[first[:, None] + np.arange(weights.shape[2])]
        powers = np.einsum("tpk,tkcn->ptcn", weights, around)
        C1, C2 = (_derivative(powers, 0.5, order) / h**order for order in (1, 2))
        A1, A2, B1, B2 = X[:, :n, :n], X[:, :n, n:], X[:, n:, :n], X[:, n:, n:]
        M, K_end, C = system.M[at + 1], system.K[at + 1], system.C[at + 1]
        stiff = M + h**2 * np.maximum(np.diagonal(K_end, axis1=1, axis2=2), 0)[:, None] * np.eye(n)
        W = saddle_inverses(stiff, C, C)[:, :n, n:]  # bordered: Euler parameters have no mass along themselves
        by_q, by_v = K, D
        return cls(
            *(-(A1 @ by_q + A2 @ C2), -(A1 @ by_v + 2 * A2 @ C1)),
            *(-(B1 @ by_q + B2 @ C2), -(B1 @ by_v + 2 * B2 @ C1)),
            *(C, _derivative(powers, 1.0, 1) / h, W, np.maximum(np.einsum("tii->ti", M), 0.0)),
        )

    def between(self, count: int) -> list[np.ndarray]:
        """Return a21, a22, b21, b22 at the rows where the first `count` steps and the next ones join: their means."""
        after = np.minimum(np.arange(count) + 1, len(self.a21) - 1)
        return [(x[:count] + x[after]) / 2 for x in (self.a21, self.a22, self.b21, self.b22)]

    def projected(self, x: np.ndarray, w: np.ndarray, i: int) -> tuple[np.ndarray, np.ndarray]:
        """Return errors x (n, columns) and their rates w that obey the constraints at the end of step i."""
        x = x - self.W[i] @ (self.C[i] @ x)
        return x, w - self.W[i] @ (self.C[i] @ w + self.C1[i] @ x)

    def eigenvalues(self, h: np.ndarray) -> np.ndarray:
        """Return lambda h of first, middle, last step."""
        n, found = self.a21.shape[1], []
        for i in sorted({0, len(h) // 2, len(h) - 1}):
            whole = np.block([[np.zeros((n, n)), np.eye(n)], [h[i] ** 2 * self.a21[i], h[i] * self.a22[i]]])
            found.append(np.linalg.eigvals(whole))
        return np.concatenate(found)


def _derivative(powers: np.ndarray, s: float, order: int) -> np.ndarray:
    """Derivative by s of sum powers[p] s^p."""
    of = [factorial(p) / factorial(p - order) * s ** (p - order) for p in range(order, len(powers))]
    return np.tensordot(of, powers[order:], 1)


def consistent_rates(
    t: np.ndarray, q: np.ndarray, v: np.ndarray, a: np.ndarray, C: np.ndarray, A2: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return rates and accelerations (T, n) that obey the constraints C; A2 (T, n, c) takes violations out.

    What v and a are off the rates of q and v, by quadrature over steps, is put back where constraints see it.
    """
    h = np.diff(t)
    one = h[:, None]
    d = q[1:] - q[:-1] - one / 2 * (v[1:] + v[:-1]) + one**2 / 12 * (a[1:] - a[:-1])
    middle = (a[1:] + a[:-1]) / 2
    if len(a) > 3:
        middle[1:-1] = (9 * (a[1:-2] + a[2:-1]) - a[:-3] - a[3:]) / 16
        middle[0], middle[-1] = (x @ np.array([5, 15, -5, 1]) / 16 for x in (a[:4].T, a[-1:-5:-1].T))
    b = v[1:] - v[:-1] - one / 6 * (a[1:] + 4 * middle + a[:-1])
    d, b = d / one, b / one
    off_v, off_a, change = np.zeros_like(q), np.zeros_like(q), np.zeros_like(q)
    for of_rows, of_steps in ((off_v, d), (off_a, b)):
        of_rows[1:-1] = (of_steps[1:] + of_steps[:-1]) / 2
        of_rows[0], of_rows[-1] = of_steps[0], of_steps[-1]
    change[1:-1] = (d[1:] - d[:-1]) / ((h[1:] + h[:-1]) / 2)[:, None]
    put_back = A2 @ np.stack([(C @ x[..., None])[..., 0] for x in (off_v, off_a + change)], axis=-1)
    return v + put_back[..., 0], a + put_back[..., 1]
