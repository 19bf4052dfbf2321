"""MeasuredRemainder: what a mechanism's linear equations leave out of their prediction, by its shadow."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import RunError
from ...estimates.remainder import Measured, Remainder
from ...linalg.blocked_products import row_norms
from .shadow import Shadow

if TYPE_CHECKING:
    from ...estimates.march import Steps, Tangent
    from ..access.linearisation import Tangents
    from .enriched_body import EnrichedBody

    Parts = Sequence[tuple[EnrichedBody, slice]]

INCREMENTS = "rotations of Lie group nodes are increments"
LEFT_OUT = "what linear equations leave out is taken for 1 % of what they predict, not measured: {}"


class MeasuredRemainder:
    """The remainder along a run; what fails ends the measurement, and nothing else.

    Attributes
    ----------
    found : what was measured at the rows of the last call of open, go_on or finish; None: nothing. notes : why, once.
    """

    def __init__(self, tangents: Tangents, parts: Parts, size: int):
        self._tangents, self._parts, self._size = tangents, parts, size
        self._shadow: Shadow | None = None
        self._remainder = Remainder(size, len(parts) + 1, self._sizes)
        self._failure = ""
        self.found: Measured | None = None
        self.notes: list[str] = []

    def open(self, mbs: Any, tangent: Tangent, rows: Sequence[np.ndarray], e: np.ndarray) -> None:
        """Begin at the first of rows t (1,), q, q_t, q_tt (1, n), where e (3, 1, k) is predicted."""
        self._try(self._make, mbs)
        if not self._failure:
            self._try(self._remainder.start, tangent, self._wide(rows), e, self._residuals)
        self.found = None if self._failure else self._remainder.at_start

    def go_on(self, mbs: Any, before: MeasuredRemainder) -> None:
        """Go on from another run's."""
        self._remainder.go_on(before._remainder)
        self._try(self._make, mbs)
        self.found = None if self._failure else self._remainder.at_start

    @property
    def state(self) -> np.ndarray:
        """What is added to e, e', e'' now, (3, k)."""
        return self._remainder.state

    def share(self, i: int) -> float | None:
        """Size of what is left out of the deformation of body i over that of the prediction; None: not known."""
        return None if self._failure else float(self._remainder.shares[i])

    def begin(self, mbs: Any, rows: Sequence[np.ndarray]) -> None:
        """Steps to rows t (S,), q, q_t, q_tt (S, n) follow."""
        if not self._failure:
            self._try(self._shadow.compare, mbs)
        self._remainder.begin(self._wide(rows), self._residuals)

    def follow(self, steps: Steps, part: slice, e: np.ndarray) -> np.ndarray | None:
        """Return what is added to e, e', e'' (3, S, k) in some of the steps; None: nothing."""
        if self._failure and not self._remainder.adds:
            return None
        return self._remainder.follow(steps, part, e)

    def finish(self) -> None:
        """All steps were gone through."""
        self.found = None if self._failure else self._remainder.found()

    def _make(self, mbs: Any) -> None:
        """Make the shadow of this solve."""
        if not self._tangents.differentiable.all():
            raise RunError(INCREMENTS)
        self._shadow = Shadow(mbs, self._parts, self._tangents)

    def _residuals(self, rows: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray] | None:
        """Those of the shadow, or None from where they are not to be had."""
        found: list = []
        if not self._failure:
            self._try(lambda: found.extend(self._shadow.residuals(rows)))
        return tuple(found) or None

    def _try(self, work: Callable, *arguments: Any) -> None:
        """What fails ends the measurement, and nothing else."""
        try:
            work(*arguments)
        except Exception as failure:
            self._failure = str(failure)
            self.notes.append(LEFT_OUT.format(failure))

    def _wide(self, rows: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Rows whose states have vectors, too, which do not move in the run."""
        t, *states = rows
        return [t, *(np.hstack([x, np.zeros((len(t), self._size - x.shape[1]))]) for x in states)]

    def _sizes(self, x: np.ndarray) -> np.ndarray:
        """Sizes (S, bodies + 1) of changes (3, S, k): of deformations in the mass norm, of all motion about so."""
        masses = self._tangents.readings[-1].masses
        whole = row_norms(x[0][:, : len(masses)] * np.sqrt(masses))
        parts = (
            (body.offline.mass_root, np.hstack([x[0][:, body.modal], x[0][:, own]])) for body, own in self._parts
        )
        return np.column_stack([*(row_norms(y @ root.T) for root, y in parts), whole])
