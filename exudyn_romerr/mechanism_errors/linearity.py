"""What linear equations miss of forces that are no bodies' own: Exudyn's under q + e beside them, in few rows.

Bodies are nonlinear in the correction; joints, springs, contact and user functions are there to first order. Where a
force is not smooth, as that of a stop, first order says nothing, and no reading of tangents tells.
"""

from __future__ import annotations

import numpy as np

from ..mechanism.mechanism import Mechanism
from ..mechanism.tangents import Block

ROUGH = 10.0  # times the median of a part, accelerations that bend more are looked at, and neighbours
DOUBTFUL = 16  # of a block, rows where readings of tangents do not join
PART = 128  # rows, of which each has its looks
LEAST = 1e-2  # of the largest forces that errors make along the run: where they make less nothing is compared


class Linearity:
    """Looks at rows of every part of a block: where errors are largest, accelerations bend most, tangents may be off.

    share : what forces and constraints are off, over the forces and the motion that the errors make in the same row.
    """

    def __init__(self, of: Mechanism):
        self._of, self._looks = of, []

    @property
    def share(self) -> float:
        """See the class; 0 where there are no errors."""
        if not self._looks:
            return 0.0
        off, whole = np.array(self._looks).swapaxes(0, 1)
        whole = np.maximum(whole, LEAST * whole.max(axis=0))
        return float((off / np.where(whole > 0, whole, np.inf)).max())

    def take(self, block: Block, first: int, e: np.ndarray, lam: np.ndarray) -> None:
        """Look at rows of a block, which begins with number `first` of the run.

        e (T, 3, n_a) in global axes, lam (T, c) : what all errors together move.
        """
        masses = np.einsum("tii->ti", block.M)
        masses = np.maximum(masses, masses.max(axis=1, keepdims=True) * np.finfo(float).eps)
        doubtful = sorted(i - first for i in self._of.readings.doubtful if 0 <= i - first < len(block))
        doubtful = doubtful[:: 1 + len(doubtful) // DOUBTFUL]
        rows = {
            a + i
            for a in range(0, len(block), PART)
            for i in _rows(*(x[a : a + PART] for x in (block.rows.a, e[:, 0], masses)))
        }
        for i in sorted(rows | set(doubtful)):
            if e[i].any():
                self._looks.append(self._look(block, i, e[i], lam[i], masses[i]))

    def _look(self, block: Block, i: int, x: np.ndarray, lam: np.ndarray, masses: np.ndarray) -> tuple:
        """Forces and constraints that are off (2,); forces and motion that the errors make (2,)."""
        left, bent = nonlinear_forces(self._of, block, i, x, lam)
        whole, own = (
            [X[i] @ y for X, y in zip((block.M, block.D, block.K), x[::-1], strict=True)],
            self._of.unknowns.own,
        )
        bent = in_motion(block.C[i], masses, bent)
        motion = np.sqrt((x[0] ** 2 * masses).sum())
        off, *forces = (_size(y[own], masses[own]) for y in (left, *whole))  # on vectors whatever is stiff is large
        return (off, bent), (max(forces), motion)


def _rows(a: np.ndarray, e: np.ndarray, masses: np.ndarray) -> set[int]:
    """Where errors e (T, n_a) are largest, and accelerations a (T, n_q) bend most, if that stands out."""
    rows = {int(np.argmax((e**2 * masses).sum(axis=1)))}
    if len(a) > 2:
        bend = np.abs(np.diff(a, n=2, axis=0))
        bend = (bend / np.maximum(bend.max(axis=0), np.finfo(float).tiny)).sum(axis=1)
        i = 1 + int(np.argmax(bend))
        rows |= {i - 1, i, i + 1} if bend[i - 1] > ROUGH * np.median(bend) else set()
    return rows


def nonlinear_forces(
    of: Mechanism, block: Block, i: int, x: np.ndarray, lam: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return what linear equations miss in row i of forces (n_a,), in global axes, and of constraints (c,).

    x (3, n_a), lam (c,) : errors there.
    """
    u, others = of.unknowns, of.equations
    t, q, v, a, forces = block.rows.row(i)
    J, z = u.jacobians(q, v, a), u.in_body_axes(x, q)
    moved = (
        u.moved(q, x[0]),
        v + J[0] @ z[1] + J[1] @ z[0],
        a + J[0] @ z[2] + 2 * J[1] @ z[1] + J[2] @ z[0],
    )
    more = np.zeros_like(forces)
    more[others.independent] = lam
    here, g = others.moved_forces(t, (q, v, a), 0 * z[:, u.kept], forces)
    there, moved_g = others.moved_forces(t, moved, z[:, u.kept], forces + more)
    terms = [X[i] @ y for X, y in zip(block.rest, x[::-1], strict=True)]
    left = u.in_global_axes(there - here, q) - sum(terms) - lam @ block.G[i]
    return left, (moved_g - g)[others.independent] - block.C[i] @ x[0]


def in_motion(C: np.ndarray, masses: np.ndarray, g: np.ndarray) -> float:
    """Return the largest of constraints g (c,) as the least motion, by masses (n_a,), that C (c, n_a) sees so."""
    reach = np.linalg.norm(C / np.sqrt(masses), axis=1)
    return float(np.abs(g / np.where(reach > 0, reach, 1.0)).max(initial=0.0))


def _size(forces: np.ndarray, masses: np.ndarray) -> float:
    """|f|_{M^-1} with the diagonal of M."""
    return float(np.sqrt((forces**2 / masses).sum()))
