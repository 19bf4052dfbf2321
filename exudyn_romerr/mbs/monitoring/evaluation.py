"""Evaluation: monitored bodies of an mbs, each by itself, fed with blocks of accepted steps."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np

    from .body_monitor import Watch


class Evaluation:
    """All watches of one solve, none of which needs another one or a tangent of the mbs."""

    tangents = None

    def __init__(self, watches: Sequence[Watch]):
        self._watches = watches

    def evaluate(self, mbs: Any, *rows: np.ndarray) -> None:
        """Evaluate accepted steps: t (S,) and q, q_t, q_tt, multipliers (S, ...)."""
        self.take(*rows[:-1])

    def take(self, *rows: np.ndarray) -> None:
        """Evaluate accepted steps: t (S,) and q, q_t, q_tt (S, all coordinates of the mbs)."""
        for watch in self._watches:
            watch.receive(*rows)
            watch.open()
            watch.admit()
            watch.segment()
            watch.advance()
            watch.settle()
            watch.forget_block()
