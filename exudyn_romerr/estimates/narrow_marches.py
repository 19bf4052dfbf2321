"""NarrowMarches: the march through the linearised mechanism with some of its coordinates held at zero."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from .columns import Columns
from .mechanism_feedback import held, solved

if TYPE_CHECKING:
    from .march import Steps, Tangent


class NarrowMarches:
    """Several marches beside that of Feedback, through its steps: each as if some coordinates did not exist.

    Parameters
    ----------
    left_out : sequence of ndarray of bool, (k,)
        Coordinates of each march that are held.

    Attributes
    ----------
    multipliers : l (marches, S, c) at the samples of the last call of start, go_on or found.
    """

    def __init__(self, left_out: Sequence[np.ndarray]):
        self._left_out = left_out
        self._held = [np.flatnonzero(left) for left in left_out]

    def start(self, tangent: Tangent, force: np.ndarray, rest: np.ndarray | None) -> None:
        """Begin as Feedback does."""
        k = len(force)
        self._moving = np.zeros((4, k, len(self._left_out)))
        self.multipliers = np.zeros((len(self._left_out), 1, len(tangent.G)))
        for i, left in enumerate(self._left_out):
            kept = np.flatnonzero(~left)
            part = _part(tangent, kept)
            e = np.zeros(kept.size) if rest is None else held(part.K, part, rest[kept])
            self._moving[0, kept, i] = e
            self._moving[2:, kept, i], self.multipliers[i, 0] = solved(part.M, part, force[kept] - part.K @ e)

    def go_on(self, before: NarrowMarches, tangent: Tangent, force: np.ndarray) -> None:
        """Go on from the state of others, with accelerations as Feedback begins anew."""
        self._moving, self.multipliers = before._moving, before.multipliers[:, -1:].copy()
        for i, left in enumerate(self._left_out):
            kept = np.flatnonzero(~left)
            part, (e, e_t) = _part(tangent, kept), self._moving[:2, kept, i]
            found, self.multipliers[i, 0] = solved(part.M, part, force[kept] - part.D @ e_t - part.K @ e)
            self._moving[2:, kept, i] = found

    @property
    def states(self) -> np.ndarray:
        """e, e', e'' of each march now, (marches, 3, k)."""
        return np.moveaxis(self._moving[:3], 2, 0)

    def begin(self, force: np.ndarray) -> None:
        """Steps under forces (S, k) follow."""
        shape = len(self._left_out), len(force)
        self._force, self._count = force, 0
        self._found = np.empty((shape[0], 3, *force.shape))
        self.multipliers = np.empty((*shape, self.multipliers.shape[2]))

    def columns(self, steps: Steps) -> Columns:
        """Right-hand sides in the next of the steps."""
        force = self._force[self._count : self._count + len(steps), :, None]
        return Columns(self._moving, force, held=self._held)

    def take(self, steps: Steps, found: np.ndarray, multipliers: np.ndarray) -> None:
        """Take states (S, 4, k, marches) and multipliers (S, c, marches) at the samples."""
        part = slice(self._count, self._count + len(found))
        self._found[:, :, part] = found[:, :3].transpose(3, 1, 0, 2)
        self.multipliers[:, part] = multipliers.transpose(2, 0, 1)
        self._moving, self._count = found[-1].copy(), part.stop

    def found(self) -> np.ndarray:
        """Return e, e', e'' of each march at all steps since `begin`, (marches, 3, S, k)."""
        return self._found


def _part(tangent: Tangent, kept: np.ndarray) -> Tangent:
    """The equations of some of the coordinates."""
    square = np.ix_(kept, kept)
    M, D, K = (matrix[square] for matrix in (tangent.M, tangent.D, tangent.K))
    return replace(tangent, M=M, D=D, K=K, G=tangent.G[:, kept], C=tangent.C[:, kept], rate=None)
