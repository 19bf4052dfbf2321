"""NarrowMarches: the march through the linearised mechanism with some of its coordinates held at zero."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from .mechanism_feedback import held

if TYPE_CHECKING:
    from .march import Steps, Tangent


class NarrowMarches:
    """Several marches beside that of Feedback, through its steps: each as if some coordinates did not exist.

    What these are held by are forces of constraints. With z = A^-1 r the increment of a step, B = A^-1, J what is
    held: z - B_:J (B_JJ)^-1 z_J, whose residual has entries in the rows J only.

    Parameters
    ----------
    left_out : sequence of ndarray of bool, (k,)
        Coordinates of each march that are held.
    """

    def __init__(self, left_out: Sequence[np.ndarray]):
        self._left_out = left_out
        self._columns = [np.flatnonzero(left) for left in left_out]

    def start(self, tangent: Tangent, force: np.ndarray, rest: np.ndarray | None) -> None:
        """Begin as Feedback does."""
        k = len(force)
        self._moving = np.zeros((4, k, len(self._left_out)))
        for i, left in enumerate(self._left_out):
            kept = np.flatnonzero(~left)
            part = _part(tangent, kept)
            e = np.zeros(kept.size) if rest is None else held(part.K, part, rest[kept])
            self._moving[0, kept, i] = e
            self._moving[2:, kept, i] = held(part.M, part, force[kept] - part.K @ e)

    def go_on(self, before: NarrowMarches) -> None:
        """Go on from the state of others."""
        self._moving = before._moving

    @property
    def states(self) -> np.ndarray:
        """e, e', e'' of each march now, (marches, 3, k)."""
        return np.moveaxis(self._moving[:3], 2, 0)

    def begin(self, force: np.ndarray) -> None:
        """Steps under forces (S, k) follow."""
        self._force, self._found = force, []

    def go(self, steps: Steps) -> None:
        """Go through the next steps."""
        count = sum(len(found) for found in self._found)
        force = self._force[count : count + len(steps)]
        self._found.append(self._marched(force, steps))
        self._moving = self._found[-1][-1]

    def found(self) -> np.ndarray:
        """Return e, e', e'' of each march at all steps since `begin`, (marches, 3, S, k)."""
        return np.moveaxis(np.concatenate(self._found)[:, :3], 3, 0).swapaxes(1, 2)

    def _marched(self, force: np.ndarray, steps: Steps) -> np.ndarray:
        """States (S, 4, k, marches) under forces (S, k)."""
        (S, k), columns = force.shape, self._moving.shape[2]
        ahead, onward = steps.scheme.ahead(steps.h), steps.scheme.next(steps.h)
        mass, damping = steps.scheme.mass_and_damping(steps.h)
        inverses = np.array(steps.inverses)
        holds = [inverses[:, :, J] @ np.linalg.inv(inverses[:, J[:, None], J]) for J in self._columns]
        found, last, tried = (
            np.empty((S, 4, k, columns)),
            self._moving,
            np.empty((inverses.shape[1] + 2 * k, columns)),
        )
        r, tried = (np.zeros((inverses.shape[1] + more, columns)) for more in (0, 2 * k))
        for i, (Q, inverse) in enumerate(zip(steps.wide, inverses, strict=True)):
            known = (ahead[i] @ last.reshape(4, -1)).reshape(3, k, columns)
            r[:], r[:k] = 0.0, force[i, :, None]
            r -= Q[:, : 2 * k] @ known[:2].reshape(2 * k, columns)
            z = self._held(inverse @ r, holds, i)
            tried[:k], tried[k : 2 * k], tried[2 * k : 3 * k] = z[:k], damping[i] * z[:k], mass[i] * z[:k]
            tried[3 * k :] = z[k:]
            z += self._held(inverse @ (r - Q @ tried), holds, i)
            now = np.concatenate([known, z[None, :k]]).reshape(4, -1)
            last = found[i] = (onward[i] @ now).reshape(4, k, columns)
        return found

    def _held(self, z: np.ndarray, holds: Sequence[np.ndarray], i: int) -> np.ndarray:
        """Increments (rows, marches) with the forces of step i that hold what is left out."""
        for column, (J, hold) in enumerate(zip(self._columns, holds, strict=True)):
            z[:, column] -= hold[i] @ z[J, column]
            z[J, column] = 0.0  # but for rounding they are
        return z


def _part(tangent: Tangent, kept: np.ndarray) -> Tangent:
    """The equations of some of the coordinates."""
    square = np.ix_(kept, kept)
    M, D, K = (matrix[square] for matrix in (tangent.M, tangent.D, tangent.K))
    return replace(tangent, M=M, D=D, K=K, G=tangent.G[:, kept], C=tangent.C[:, kept], rate=None)
