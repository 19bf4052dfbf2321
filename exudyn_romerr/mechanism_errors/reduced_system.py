"""The reduced mechanism in the coordinates of the mbs, and its equations frozen in the middle of steps."""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial

import numpy as np

from ..mechanism.rotations import global_rates
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
        u, rows = unknowns, block.rows
        M, D, K, G, C = (u.by_coordinates(x, rows.q) for x in (block.M, block.D, block.K, block.G, block.C))
        unit = np.zeros((len(rows), len(u.nodes), u.n_q))
        for k, node in enumerate(u.nodes):
            own, turns = node.own[3:], node.shifts_and_turns[1]
            unit[:, k, own] = node.parameters(rows.q)
            H1, H2 = global_rates(rows.v[:, own]), global_rates(rows.a[:, own])
            D[..., own] += 2 * block.M[..., turns] @ H1
            K[..., own] += block.D[..., turns] @ H1 + block.M[..., turns] @ H2
        M, D, K = (u.by_coordinates(x.swapaxes(1, 2), rows.q).swapaxes(1, 2) for x in (M, D, K))
        return cls(M, D, K, *(np.concatenate([x, unit], axis=1) for x in (G, C)))


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
    """Equations frozen in the middle of T steps: d'' = A (d, d') + loads, of the coordinates.

    A (T, n, 2 n). B (T, c, 2 n) : multipliers of (d, d'). C, C1, W (T, c, n) twice, (T, n, c) : at the ends of steps,
    constraints, their rates, what takes violations out without moving what is stiff. masses (T, n) : the diagonal
    of M.
    """

    A: np.ndarray
    B: np.ndarray
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
        rates = X @ -np.block([[K, D], [C2, 2 * C1]])
        M, K_end, C = system.M[at + 1], system.K[at + 1], system.C[at + 1]
        stiff = M + h**2 * np.maximum(np.diagonal(K_end, axis1=1, axis2=2), 0)[:, None] * np.eye(n)
        W = saddle_inverses(stiff, C, C)[:, :n, n:]  # bordered: Euler parameters have no mass along themselves
        masses = np.maximum(np.einsum("tii->ti", M), 0.0)
        return cls(rates[:, :n], rates[:, n:], C, _derivative(powers, 1.0, 1) / h, W, masses)

    def between(self, count: int) -> list[np.ndarray]:
        """Return A, B at the rows where the first `count` steps and the next ones join: their means."""
        after = np.minimum(np.arange(count) + 1, len(self.A) - 1)
        return [(x[:count] + x[after]) / 2 for x in (self.A, self.B)]

    def projected(self, x: np.ndarray, w: np.ndarray, i: int) -> tuple[np.ndarray, np.ndarray]:
        """Return errors x (n, columns) and their rates w that obey the constraints at the end of step i."""
        x = x - self.W[i] @ (self.C[i] @ x)
        return x, w - self.W[i] @ (self.C[i] @ w + self.C1[i] @ x)

    def eigenvalues(self, h: np.ndarray) -> np.ndarray:
        """Return lambda h of first, middle, last step."""
        n, found = self.A.shape[1], []
        for i in sorted({0, len(h) // 2, len(h) - 1}):
            whole = np.block([[np.zeros((n, n)), np.eye(n)], [h[i] ** 2 * self.A[i, :, :n], h[i] * self.A[i, :, n:]]])
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
