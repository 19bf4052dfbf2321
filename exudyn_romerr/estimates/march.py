"""March through the linearised equations of a mechanism with generalised-alpha, several right-hand sides at once.

    M e'' + D e' + K e + G^T l = f ,   C e = g      at every sample; e and e' may be moved on the way to it.

What the matrices of all steps need is made in batch and kept, so that passes with other right-hand sides are cheap.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..compiled.loops import loops
from ..linalg.blocked_products import consecutive
from ..trajectory.scheme import Scheme
from .columns import Columns, at_all, distinct, side_by_side


@dataclass(frozen=True)
class Tangent:
    """The linearised equations at time t: M, D, K (k, k), G and C (c, k) of independent constraints; their rates.

    Forces of constraints are G^T l, what they keep zero is C e. C is G but for what the simulation takes it for.
    """

    t: float
    M: np.ndarray
    D: np.ndarray
    K: np.ndarray
    G: np.ndarray
    C: np.ndarray
    rate: Tangent | None = None

    def write(self, row: np.ndarray) -> None:
        """Write [[K, D], [C, 0]] and, behind it, [[M, G^T], [C, 0]]."""
        moved, whole = parted(row, *self.G.shape)
        k = self.G.shape[1]
        row[:] = 0.0
        moved[:k, :k], moved[:k, k:], moved[k:, :k] = self.K, self.D, self.C
        whole[:k, :k], whole[:k, k:], whole[k:, :k] = self.M, self.G.T, self.C


def parted(rows: np.ndarray, c: int, k: int) -> tuple[np.ndarray, np.ndarray]:
    """Return views (..., k + c, 2 k) and (..., k + c, k + c) of rows that hold such matrices one behind the other.

    Apart, for products with a part of a wider matrix take twice the time.
    """
    n = k + c
    moved, whole = rows[..., : n * 2 * k], rows[..., n * 2 * k :]
    return moved.reshape(*rows.shape[:-1], n, 2 * k), whole.reshape(*rows.shape[:-1], n, n)


class Steps:
    """Consecutive steps, ready to be marched through; sums of steps are steps, too.

    h (S,) : step sizes. moved, whole, inverses : (S, ...) of each step, [[K, D], [C, 0]] at the sample, A =
    [[mass M + damping D + K, G^T], [C, 0]], and nearly A^-1; they hold until Track makes the next ones.
    once (S,) : where these are so near that nothing is corrected; A is made elsewhere, and of the first step.
    maps : Scheme.ahead and next of h; made, if None.
    """

    def __init__(
        self,
        scheme: Scheme,
        h: np.ndarray,
        moved: np.ndarray,
        whole: np.ndarray,
        inverses: np.ndarray,
        once: np.ndarray,
        maps: tuple[np.ndarray, np.ndarray] | None = None,
    ):
        self.scheme, self.h, self.once = scheme, h, once
        self.moved, self.whole, self.inverses = moved, whole, inverses
        self._maps = (scheme.ahead(h), scheme.next(h)) if maps is None else maps

    @property
    def _matrices(self) -> tuple[np.ndarray, ...]:
        return self.moved, self.whole, self.inverses

    def _of(self, work: Callable[[Sequence[np.ndarray]], np.ndarray], *others: Steps) -> Steps:
        """Steps with what work makes of their arrays."""
        all_of = [(steps.h, *steps._matrices, steps.once, *steps._maps) for steps in (self, *others)]
        *arrays, ahead, onward = (work(of) for of in zip(*all_of, strict=True))
        return Steps(self.scheme, *arrays, (ahead, onward))

    def __len__(self) -> int:
        return len(self.h)

    def __add__(self, other: Steps) -> Steps:
        return self._of(np.concatenate, other)

    def __getitem__(self, part: slice) -> Steps:
        return self._of(lambda of: of[0][part])

    def kept(self) -> Steps:
        """The same for longer."""
        return self._of(lambda of: of[0].copy())

    def pushed(self, force: np.ndarray) -> np.ndarray:
        """What forces (k, columns) accelerate (k, columns), where the steps begin."""
        k, Q, whole = len(force), self.moved[0], self.whole[0].copy()
        mass, damping = (factor[0] for factor in self.scheme.mass_and_damping(self.h))
        whole[:k, :k] = (whole[:k, :k] - damping * Q[:k, k:] - Q[:k, :k]) / mass
        scale = np.abs(np.diag(whole)).max()
        whole[:k, k:] *= scale
        whole[k:, :k] *= scale
        return np.linalg.solve(whole, np.vstack([force, np.zeros((len(Q) - k, force.shape[1]))]))[:k]

    def march(self, *parts: Columns, multipliers: bool = False) -> list:
        """Go on from where the columns are; return e, e', e'' and algorithmic a (S, 4, k, columns) of each part.

        multipliers : whether l (S, c, columns) of the equations at the samples are returned beside them, in pairs.
        """
        given, ends = side_by_side(parts, len(self), self.moved.shape[1])
        starts = (end - part.moving.shape[2] for part, end in zip(parts, ends, strict=True))
        held = ((j, J) for part, start in zip(parts, starts, strict=True) for j, J in enumerate(part.held, start))
        marched = self._marched_apart if loops is None else self._marched_at_once
        found, forces = marched(*given, held={j: J for j, J in held if J.size})
        all_found = np.split(found.transpose(0, 2, 3, 1), ends[:-1], axis=3)
        if not multipliers:
            return all_found
        return list(zip(all_found, np.split(forces.transpose(0, 2, 1), ends[:-1], axis=2), strict=True))

    def _hold(self, J: np.ndarray) -> tuple[np.ndarray | slice, np.ndarray]:
        """What holds coordinates J of a column at zero: they, (S, k + c, J).

        Forces of constraints. With z = A^-1 r the increment of a step and B = A^-1: z - B_:J (B_JJ)^-1 z_J, whose
        residual has entries in the rows J only.
        """
        J = consecutive(J)  # faster
        B = self.inverses[:, :, J]
        return J, B @ np.linalg.inv(B[:, J])

    def _marched_apart(self, *given: np.ndarray, held: dict[int, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """March (columns, 4, k) under right-hand sides (columns, S, k + c) and kicks (columns, S, 2, k).

        held : of columns, coordinates (J,) that are held at zero.
        Return what is found (S, columns, 4, k), and l (S, columns, c).
        """
        kept, place = distinct(given, held)
        holds = [(kept.index(j), J) for j, J in held.items() if j in kept]  # others are 0 all the same
        found, z = (at_all(x, place) for x in self._marched(*(x[kept] for x in given), held=holds))
        return found, z[..., given[0].shape[2] :]

    def _marched(
        self, moving: np.ndarray, right: np.ndarray, kicks: np.ndarray | None = None, *, held: list
    ) -> tuple[np.ndarray, np.ndarray]:
        """The same of columns that differ, with increments before l: solutions z (S, columns, k + c).

        held : pairs, number of a column and its coordinates. Column by column, for products with vectors are faster
        than those with a few columns.
        """
        (columns, S, n), k, dot, subtract = right.shape, moving.shape[2], np.dot, np.subtract
        holds = [(j, *self._hold(J)) for j, J in held]
        ahead, onward = self._maps
        ahead = np.concatenate([ahead[:1], ahead[1:] @ onward[:-1]])
        # what is known of e, e', a, then z: increments, and l behind them
        found = np.empty((S, columns, 3 * k + n))
        states = found[..., : 4 * k].reshape(S, columns, 4, k)
        known, solutions = found[..., : 2 * k], found[..., 3 * k :]
        kicked = None if kicks is None else kicks.reshape(columns, S, 2 * k)
        last, before, numbers = moving, np.empty(n), range(columns)
        steps = zip(ahead, states, known, solutions, self.moved, self.inverses, self.once.tolist(), strict=True)
        for i, (step, now, e, all_z, Q, inverse, once) in enumerate(steps):
            for j in numbers:
                x, z, r = e[j], all_z[j], right[j, i]
                dot(step, last[j], out=now[j, :3])
                if kicked is not None:
                    x += kicked[j, i]
                dot(Q, x, out=before)
                subtract(r, before, out=r)
                dot(inverse, r, out=z)
            for j, J, hold in holds:
                _let_go(all_z[j], J, hold[i])
            if not once:
                self._correct(i, right[:, i], all_z, holds)
            last = now
        return onward[:, None] @ states, solutions

    def _marched_at_once(
        self, moving: np.ndarray, right: np.ndarray, kicks: np.ndarray | None = None, *, held: dict[int, np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray]:
        """What _marched_apart does, compiled: all columns at once."""
        (columns, S, n), k = right.shape, moving.shape[2]
        states, forces = np.empty((S, columns, 4, k)), np.empty((S, columns, n - k))
        given = moving, right, kicks, *self._maps, *self._matrices, self.once
        holds = [(j, J.astype(np.int64)) for j, J in held.items()]
        if not loops.march(columns, S, k, n, *given, states, forces, holds):
            raise np.linalg.LinAlgError("Singular matrix")  # as _hold does
        return states, forces

    def _correct(self, i: int, right: np.ndarray, found: np.ndarray, holds: list) -> None:
        """Solve step i once more for what solutions (columns, k + c) leave of right-hand sides."""
        more = np.zeros(found.shape)
        for r, z, correction in zip(right, found, more, strict=True):
            np.dot(self.inverses[i], r - self.whole[i] @ z, out=correction)
        for j, J, hold in holds:
            _let_go(more[j], J, hold[i])
        found += more


def _let_go(z: np.ndarray, J: np.ndarray | slice, hold: np.ndarray) -> None:
    z -= hold @ z[J]
    z[J] = 0.0  # but for rounding they are
