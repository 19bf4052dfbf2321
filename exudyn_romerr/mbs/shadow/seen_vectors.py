"""What controllers that look at a mechanism make of motions that its modes lack: derivatives by auxiliary vectors."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..derivatives.reader import CENTRAL
from .shadow_mbs import Shadow

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..derivatives.linearisation import Tangents
    from ..mechanism.extended_tangents import Seen
    from .shadow_mbs import Parts


def seen_vectors(mbs: Any, parts: Parts, tangents: Tangents) -> Seen | None:
    """Return what gives parts of D and K by vectors, of a time and a state; None: no controller looks at the mbs.

    Raises
    ------
    RunError
        As Shadow: where functions look at another mbs than the one that they are given, too.
    """
    return _SeenVectors(mbs, parts, tangents).at if tangents.functions_look else None


class _SeenVectors:
    """Derivatives of forces by auxiliary vectors, but for those of the bodies themselves, see Shadow."""

    def __init__(self, mbs: Any, parts: Parts, tangents: Tangents):
        Shadow(mbs, parts, tangents)  # compared with the mbs, with all that bodies have
        self._hollow, self._first = Shadow(mbs, parts, tangents, hollow=True), tangents.size

    def at(self, t: float, state: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Return parts (k, m) of D and K, by m vectors, in a state q, q_t, ... (n,) in which these do not move."""
        with self._hollow.functions_kept():
            return self._by(t, state, 1), self._by(t, state, 0)

    def _by(self, t: float, state: Sequence[np.ndarray], order: int) -> np.ndarray:
        """By vectors, or by their rates: order 1."""
        k, n = self._hollow.size, self._first
        found, wide = np.zeros((k, k - n)), np.zeros((3, k))
        wide[:2, :n] = state[:2]
        for j in range(k - n):
            for side in (CENTRAL, -CENTRAL):
                wide[order, n + j] = side
                found[:, j] -= self._hollow.forces(t, wide) / (2 * side)
            wide[order, n + j] = 0.0
        return found
