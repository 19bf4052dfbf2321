"""What linear equations miss of forces that are no bodies' own: Exudyn's under q + e beside them.

Bodies are nonlinear in the correction; joints, springs and user functions are there to first order: that is looked at
in few rows. Where a force is not smooth, as that of a stop, first order says nothing, and no reading of tangents
tells: rows in which errors change what user functions give are all looked at.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ..mechanism.mechanism import Mechanism
from ..mechanism.rotations import times
from ..mechanism.rows import Rows
from ..mechanism.tangents import Block

ROUGH = 10.0  # times the median of a block, accelerations that bend more are looked at, and neighbours
DOUBTFUL = 16  # of a block, rows where readings of tangents do not join
LEAST = 1e-2  # of the largest forces that errors make along the run: where they make less nothing is compared


class Linearity:
    """Looks at rows of every block: where errors are largest, accelerations bend most, tangents may be off.

    share : what forces and constraints are off, over the forces and the motion that the errors make in the same row.
    """

    def __init__(self, of: Mechanism):
        self._of, self._looks = of, []

    @property
    def share(self) -> float:
        """See the class; 0 where there are no errors."""
        if not self._looks:
            return 0.0
        sizes = np.array(self._looks)
        return float(largest_shares(sizes, sizes[:, 1].max(axis=0)).max())

    def take(self, block: Block, first: int, e: np.ndarray, lam: np.ndarray, unmoved: UnmovedForces) -> None:
        """Look at rows of a block, which begins with number `first` of the run.

        e (T, 3, n_a) in global axes, lam (T, c) : what all errors together move.
        """
        at = self._rows(block, first, e, unmoved)
        if len(at):
            part = block[at]
            left, g = nonlinear_forces(self._of, part, e[at], lam[at], unmoved(at))
            self._looks += [*missed_sizes(self._of, part, e[at], left, g)]

    def _rows(self, block: Block, first: int, e: np.ndarray, unmoved: UnmovedForces) -> np.ndarray:
        """Numbers of rows of a block that are looked at, where there are errors e (T, 3, n_a)."""
        has_errors, by_users = e.any(axis=(1, 2)), rows_by_users(self._of, block, e, unmoved)
        masses = np.einsum("tii->ti", block.M)
        doubtful = sorted(i - first for i in self._of.readings.doubtful if 0 <= i - first < len(block))
        doubtful = doubtful[:: 1 + len(doubtful) // DOUBTFUL]
        rows = _rows(block.rows.a, e[:, 0], masses) | {*doubtful, *by_users.tolist()}
        return np.array([i for i in sorted(rows) if has_errors[i]], int)


def rows_by_users(of: Mechanism, block: Block, e: np.ndarray, unmoved: UnmovedForces) -> np.ndarray:
    """Return numbers of rows in which errors e (T, 3, n_a) change what user functions give.

    These need not be smooth, and few rows do not tell: all rows with errors, where they are of joints and springs.
    """
    has_errors = e.any(axis=(1, 2))
    if not of.has_forces_by_users:
        if not of.equations.loads_know_motion:
            return np.zeros(0, int)
        t, *state, _ = vars(block.rows).values()
        moved = of.unknowns.moved(state, [*np.moveaxis(e, 1, 0)])
        loads = of.equations.loads(t, moved, e[:, :, of.unknowns.kept])
        has_errors &= np.any(loads != unmoved.loads, axis=1)
    return np.flatnonzero(has_errors)


def missed_sizes(of: Mechanism, block: Block, e: np.ndarray, left: np.ndarray, g: np.ndarray) -> np.ndarray:
    """Return sizes (T, 2, 2): of forces left (T, n_a) and constraints g (T, c) that are missed, of what errors make.

    e (T, 3, n_a) : errors. Of forces |.|_{M^-1} but for vectors, of constraints the motion by which they are off,
    both with the diagonal of M.
    """
    own, masses = of.unknowns.own, np.einsum("tii->ti", block.M)
    masses = np.maximum(masses, masses.max(axis=1, keepdims=True) * np.finfo(float).eps)
    whole = [times(X, e[:, k]) for X, k in ((block.M, 2), (block.D, 1), (block.K, 0))]
    off, *forces = (_size(x[:, own], masses[:, own]) for x in (left, *whole))  # on vectors whatever is stiff is large
    motion = np.sqrt((e[:, 0] ** 2 * masses).sum(axis=1))
    reach = np.linalg.norm(block.C / np.sqrt(masses)[:, None], axis=2)
    bent = np.abs(g / np.where(reach > 0, reach, 1.0)).max(axis=1, initial=0.0)
    return np.stack([[off, bent], [np.max(forces, axis=0), motion]]).transpose(2, 0, 1)


def largest_shares(sizes: np.ndarray, most: np.ndarray) -> np.ndarray:
    """Return the largest shares (2,) of sizes (T, 2, 2) as missed_sizes has them.

    most (2,) : what errors make at most along the run; a row where they make little of that tells nothing.
    """
    off, whole = sizes.swapaxes(0, 1)
    whole = np.maximum(whole, LEAST * most)
    return (off / np.where(whole > 0, whole, np.inf)).max(axis=0)


def _rows(a: np.ndarray, e: np.ndarray, masses: np.ndarray) -> set[int]:
    """Where errors e (T, n_a) are largest, and accelerations a (T, n_q) bend most, if that stands out."""
    rows = {int(np.argmax((e**2 * masses).sum(axis=1)))}
    if len(a) > 2:
        bend = np.abs(np.diff(a, n=2, axis=0))
        bend = (bend / np.maximum(bend.max(axis=0), np.finfo(float).tiny)).sum(axis=1)
        i = 1 + int(np.argmax(bend))
        rows |= {i - 1, i, i + 1} if bend[i - 1] > ROUGH * np.median(bend) else set()
    return rows


class UnmovedForces:
    """What Exudyn says of rows as they are: other errors are asked about in the same ones, and it is asked once."""

    def __init__(self, of: Mechanism, rows: Rows):
        self._of, self._rows, self._is_known = of, rows, np.zeros(len(rows), bool)
        self._found = np.zeros((len(rows), of.unknowns.n_a)), np.zeros(rows.multipliers.shape)

    @cached_property
    def loads(self) -> np.ndarray:
        """What user functions of loads give there that may know more than the time, (T, .)."""
        t, *state, _ = vars(self._rows).values()
        return self._of.equations.loads(t, state, np.zeros((len(t), 3, len(self._of.unknowns.kept))))

    def __call__(self, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return M a - f + G^T lam (T, n_a), in axes of bodies, and g (T, all) at rows of these numbers."""
        new = at[~self._is_known[at]]
        if len(new):
            t, q, v, a, forces = vars(self._rows[new]).values()
            kept = np.zeros((len(new), 3, len(self._of.unknowns.kept)))
            found = self._of.equations.moved_forces(t, (q, v, a), kept, forces)
            for known, x in zip(self._found, found, strict=True):
                known[new] = x
            self._is_known[new] = True
        return tuple(x[at] for x in self._found)


def nonlinear_forces(
    of: Mechanism, block: Block, e: np.ndarray, lam: np.ndarray, unmoved: tuple[np.ndarray, np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Return what linear equations miss at rows: of forces (T, n_a), in global axes, and of constraints (T, c).

    e (T, 3, n_a), lam (T, c) : errors there. unmoved : what UnmovedForces say of these rows.
    """
    u, others, (t, q, v, a, forces), (here, g) = of.unknowns, of.equations, vars(block.rows).values(), unmoved
    errors, kept, more = [*np.moveaxis(e, 1, 0)], e[:, :, u.kept], np.zeros_like(forces)
    more[:, others.independent] = lam
    there, moved_g = others.moved_forces(t, u.moved((q, v, a), errors), kept, forces + more)
    linear = sum(times(X, x) for X, x in zip(block.rest, errors[::-1], strict=True))
    left = u.in_global_axes(there - here, q) - linear - times(block.G.swapaxes(1, 2), lam)
    return left, (moved_g - g)[:, others.independent] - times(block.C, errors[0])


def _size(forces: np.ndarray, masses: np.ndarray) -> np.ndarray:
    """|f|_{M^-1} (T,) with the diagonal of M."""
    return np.sqrt((forces**2 / masses).sum(axis=1))
