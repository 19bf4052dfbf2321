"""RigidMarch: what auxiliary vectors would add if all interfaces stayed as rigid as the modes make them (RBE2)."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...estimates.mechanism_feedback import Feedback

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from ...estimates.mechanism_feedback import Scheme, Tangent
    from .enriched_body import EnrichedBody


class RigidMarch:
    """The march of the linearised mechanism without the vectors that deform interfaces which the modes make rigid.

    What the march with all vectors has above it is what rigid interfaces stiffen: their part of the estimate.

    Parameters
    ----------
    parts : sequence of (EnrichedBody, slice)
        Bodies, and where their vectors are among the coordinates.
    size : int
        Number k of coordinates of mechanism and vectors.
    """

    def __init__(self, scheme: Scheme, parts: Sequence[tuple[EnrichedBody, slice]], size: int):
        kept = np.ones(size, dtype=bool)
        for body, own in parts:
            kept[own] = body.keeps
        self._size, self._kept, self._feedback = size, np.flatnonzero(kept), Feedback(scheme)

    @classmethod
    def of(cls, scheme: Scheme, parts: Sequence[tuple[EnrichedBody, slice]], size: int) -> RigidMarch | None:
        """Return the march; None if no vector deforms an interface that the modes make rigid."""
        return None if all(body.keeps.all() for body, _ in parts) else cls(scheme, parts, size)

    def start(self, tangent: Tangent, force: np.ndarray, rest: np.ndarray | None, t: float) -> None:
        """Begin as Feedback does, with what it takes of all coordinates: force, rest (k,)."""
        rest = None if rest is None else rest[self._kept]
        self._feedback.start(self._without(tangent), force[self._kept], rest, t)

    def go_on(self, before: RigidMarch | None) -> None:
        """Go on from another solve's march."""
        if before is not None:
            self._feedback = before._feedback

    @property
    def state(self) -> np.ndarray:
        """e, e', e'' now, (3, k): zero at vectors that are left out."""
        return self._whole(self._feedback.state)

    def advance(
        self, t: np.ndarray, force: np.ndarray, times: np.ndarray, tangent: Callable[[int], Tangent]
    ) -> np.ndarray:
        """Go on as Feedback does; return e, e', e'' (3, S, k), zero at vectors that are left out."""
        made: dict[int, Tangent] = {}

        def narrow(j: int) -> Tangent:
            if j not in made:
                for i in [i for i in made if i != j - 1]:
                    del made[i]
                made[j] = self._without(tangent(j))
            return made[j]

        return self._whole(self._feedback.advance(t, force[:, self._kept], times, narrow)[0])

    def _whole(self, e: np.ndarray) -> np.ndarray:
        whole = np.zeros((*e.shape[:-1], self._size))
        whole[..., self._kept] = e
        return whole

    def _without(self, tangent: Tangent) -> Tangent:
        """The tangent without the vectors left out."""
        kept, square = self._kept, np.ix_(self._kept, self._kept)
        rate = None if tangent.rate is None else self._without(tangent.rate)
        M, D, K = (matrix[square] for matrix in (tangent.M, tangent.D, tangent.K))
        return replace(tangent, M=M, D=D, K=K, G=tangent.G[:, kept], C=tangent.C[:, kept], rate=rate)
