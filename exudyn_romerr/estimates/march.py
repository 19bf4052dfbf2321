"""March through the linearised equations of a mechanism with generalised-alpha, several right-hand sides at once.

    M e'' + D e' + K e + G^T l = f ,   C e = g      at every sample; e and e' may be moved on the way to it.

What the matrices of all steps need is made in batch and kept, so that passes with other right-hand sides are cheap.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np


@dataclass(frozen=True)
class Scheme:
    """Generalised-alpha: the parameters of the running solver."""

    alpha_m: float
    alpha_f: float
    beta: float
    gamma: float

    @classmethod
    def of_radius(cls, radius: float) -> Scheme:
        """Of a spectral radius at high frequencies (Chung and Hulbert 1993)."""
        alpha_m, alpha_f = (2 * radius - 1) / (radius + 1), radius / (radius + 1)
        gamma = 0.5 + alpha_f - alpha_m
        return cls(alpha_m, alpha_f, (gamma + 0.5) ** 2 / 4, gamma)

    def mass_and_damping(self, h: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Factors of M and D in the matrix of a step, beside K."""
        return (1 - self.alpha_m) / (self.beta * h**2 * (1 - self.alpha_f)), self.gamma / (h * self.beta)

    def ahead(self, h: np.ndarray) -> np.ndarray:
        """Map e, e', e'', algorithmic a to what of e, e', a is known of the next sample, (S, 3, 4)."""
        one, none = np.ones_like(h), np.zeros_like(h)
        a = np.outer(one, [0.0, 0.0, self.alpha_f, -self.alpha_m]) / (1 - self.alpha_m)
        e = np.stack([one, h, none, h**2 * (0.5 - self.beta)], axis=1) + (h**2 * self.beta)[:, None] * a
        e_t = np.stack([none, one, none, h * (1 - self.gamma)], axis=1) + (h * self.gamma)[:, None] * a
        return np.stack([e, e_t, a], axis=1)

    def next(self, h: np.ndarray) -> np.ndarray:
        """Map that and the increment z to e, e', e'' and a of the next sample, (S, 4, 4)."""
        mass, damping = self.mass_and_damping(h)
        found = np.zeros((len(h), 4, 4))
        found[:, 0, 0] = found[:, 1, 1] = found[:, 3, 2] = found[:, 0, 3] = 1.0
        found[:, 1, 3], found[:, 2, 3] = damping, mass
        found[:, 3, 3] = (1 - self.alpha_f) / (1 - self.alpha_m) * mass
        return found


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

    def write(self, wide: np.ndarray) -> None:
        """Write [[K, D, M, G^T], [C, 0, 0, 0]]."""
        _, k = self.G.shape
        wide[:] = 0.0
        wide[:k, :k], wide[:k, k : 2 * k], wide[:k, 2 * k : 3 * k], wide[:k, 3 * k :] = (
            self.K,
            self.D,
            self.M,
            self.G.T,
        )
        wide[k:, :k] = self.C


class Columns(NamedTuple):
    """Right-hand sides that are marched through steps together.

    moving : e, e', e'' and algorithmic a (4, k, columns) where the steps begin. force (S, k, columns), values g
    (S, c, columns) : 0 where None. kicks : two (S, k, columns), what moves e and e' on the way to a sample beside
    what the scheme does. held : numbers of the coordinates that each of the columns holds at zero; none, if empty.
    """

    moving: np.ndarray
    force: np.ndarray | None = None
    values: np.ndarray | None = None
    kicks: tuple[np.ndarray, np.ndarray] | None = None
    held: Sequence[np.ndarray] = ()


class Steps:
    """Consecutive steps, ready to be marched through; sums of steps are steps, too.

    h (S,) : step sizes. wide, inverses : of each step, [[K, D, A], [C, 0, ...]] at the sample, where A is
    [[mass M + damping D + K, G^T], [C, 0]], and nearly A^-1; they hold until Track makes the next ones.
    once (S,) : where these are so near that what is found need not be corrected.
    """

    def __init__(
        self,
        scheme: Scheme | None,
        h: np.ndarray,
        wide: Sequence[np.ndarray],
        inverses: Sequence[np.ndarray],
        once: np.ndarray,
    ):
        self.scheme, self.h, self.wide, self.inverses, self.once = scheme, h, wide, inverses, once

    @classmethod
    def none(cls) -> Steps:
        """No steps: where a sum begins."""
        return cls(None, np.zeros(0), [], [], np.zeros(0, dtype=bool))

    def __len__(self) -> int:
        return len(self.h)

    def __add__(self, other: Steps) -> Steps:
        h, once = (np.concatenate(pair) for pair in ((self.h, other.h), (self.once, other.once)))
        return Steps(other.scheme, h, [*self.wide, *other.wide], [*self.inverses, *other.inverses], once)

    def __getitem__(self, part: slice) -> Steps:
        return Steps(self.scheme, self.h[part], self.wide[part], self.inverses[part], self.once[part])

    def kept(self) -> Steps:
        """The same for longer."""
        wide, inverses = ([X.copy() for X in of] for of in (self.wide, self.inverses))
        return Steps(self.scheme, self.h, wide, inverses, self.once)

    def speed(self, e_t: np.ndarray) -> np.ndarray:
        """Mass norm (S,) of velocities (S, k) at the samples."""
        _, k = e_t.shape
        mass, damping = self.scheme.mass_and_damping(self.h)
        apart = np.concatenate([-e_t, -damping[:, None] * e_t, e_t], axis=1)  # K, D and A to mass M
        momentum = np.matmul(np.asarray(self.wide)[:, :k, : 3 * k], apart[..., None])[..., 0]
        return np.sqrt(np.maximum(np.einsum("sk,sk->s", e_t, momentum) / mass, 0.0))

    def pushed(self, force: np.ndarray) -> np.ndarray:
        """What forces (k, columns) accelerate (k, columns), where the steps begin."""
        k, Q = len(force), self.wide[0]
        mass, damping = (factor[0] for factor in self.scheme.mass_and_damping(self.h))
        whole = Q[:, 2 * k :].copy()
        whole[:k, :k] = (whole[:k, :k] - damping * Q[:k, k : 2 * k] - Q[:k, :k]) / mass
        scale = np.abs(np.diag(whole)).max()
        whole[:k, k:] *= scale
        whole[k:, :k] *= scale
        return np.linalg.solve(whole, np.vstack([force, np.zeros((len(Q) - k, force.shape[1]))]))[:k]

    def march(self, *parts: Columns, multipliers: bool = False) -> list:
        """Go on from where the columns are; return e, e', e'' and algorithmic a (S, 4, k, columns) of each part.

        multipliers : whether l (S, c, columns) of the equations at the samples are returned beside them, in pairs.
        """
        S, k = len(self), parts[0].moving.shape[1]
        ends = np.cumsum([part.moving.shape[2] for part in parts])
        right = np.zeros((S, len(self.wide[0]) if S else k, ends[-1]))
        kicks = np.zeros((S, 2, k, ends[-1])) if any(part.kicks is not None for part in parts) else None
        holds = []
        for part, end in zip(parts, ends, strict=True):
            own = slice(end - part.moving.shape[2], end)
            if part.force is not None:
                right[:, :k, own] = part.force
            if part.values is not None:
                right[:, k:, own] = part.values
            if part.kicks is not None:
                kicks[:, 0, :, own], kicks[:, 1, :, own] = part.kicks
            holds += [self._hold(column, J) for column, J in enumerate(part.held, own.start) if J.size]
        moving = np.concatenate([part.moving for part in parts], axis=2)
        found, z = self._marched(moving, right, kicks, holds)
        all_found = np.split(found, ends[:-1], axis=3)
        if not multipliers:
            return all_found
        return list(zip(all_found, np.split(z[:, k:], ends[:-1], axis=2), strict=True))

    def _hold(self, column: int, J: np.ndarray) -> tuple[int, np.ndarray | slice, np.ndarray]:
        """What holds coordinates J of a column at zero: their number, they, (S, k + c, J).

        Forces of constraints. With z = A^-1 r the increment of a step and B = A^-1: z - B_:J (B_JJ)^-1 z_J, whose
        residual has entries in the rows J only.
        """
        if J[-1] - J[0] == len(J) - 1:
            J = slice(int(J[0]), int(J[-1]) + 1)  # faster
        B = np.asarray(self.inverses)[:, :, J]
        return column, J, B @ np.linalg.inv(B[:, J])

    def _marched(
        self, moving: np.ndarray, right: np.ndarray, kicks: np.ndarray | None, holds: list
    ) -> tuple[np.ndarray, np.ndarray]:
        """March under right-hand sides (S, k + c, columns) and kicks (S, 2, k, columns).

        Return what is found, and the solutions z (S, k + c, columns): increments, and l in their last rows.
        """
        (S, n, columns), k, dot, subtract = right.shape, moving.shape[1], np.dot, np.subtract
        ahead, onward = self.scheme.ahead(self.h), self.scheme.next(self.h)
        ahead[1:] = ahead[1:] @ onward[:-1]
        # what is known of e, e', a, then z: increments, and l behind them
        found = np.empty((S, 3 * k + n, columns))
        states = found[:, : 4 * k].reshape(S, 4, k * columns)
        known, solutions = found[:, : 2 * k], found[:, 3 * k :]
        kicked = None if kicks is None else kicks.reshape(known.shape)
        last, before = moving.reshape(4, -1), np.empty((n, columns))
        steps = zip(ahead, right, self.wide, self.inverses, self.once.tolist(), strict=True)
        for i, (step, r, Q, inverse, once) in enumerate(steps):
            now, e, z = states[i], known[i], solutions[i]
            dot(step, last, out=now[:3])
            if kicked is not None:
                e += kicked[i]
            dot(Q[:, : 2 * k], e, out=before)
            subtract(r, before, out=r)
            dot(inverse, r, out=z)
            for column, J, hold in holds:
                z[:, column] -= dot(hold[i], z[J, column])
                z[J, column] = 0.0  # but for rounding they are
            if not once:
                r -= dot(Q[:, 2 * k :], z)
                more = dot(inverse, r)
                for column, J, hold in holds:
                    more[:, column] -= dot(hold[i], more[J, column])
                    more[J, column] = 0.0
                z += more
            last = now
        return (onward @ states).reshape(S, 4, k, columns), solutions
