"""Estimator: the contract between a run and what bounds its error."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    import numpy as np

    from ..residual.segments import Block, Start
    from .bounds import Bounds


class Estimator(Protocol):
    """Bounds of the error of one trajectory, segment by segment.

    1. It is made from a Problem, once: full-size work is done there, small arrays are kept.
    2. The one that was made is never run: each stream of a run starts a copy.copy of it. What changes along a run is
       hence replaced, not changed in place, or __copy__ says what else is to be copied.
    3. start comes first, then advance with blocks that follow one another without a gap, the first from Start.t on. A
       run that goes on from another takes a copy of its estimator, and no start.
    4. Start and Block are complete when they come: turn is set where the scene has such. They
       belong to all estimators and are not changed.
    5. Bounds hold at the ends of segments, and are never nan: inf where there is no bound. They are those of exact
       arithmetic; a run adds what rounding of its input may do. An estimator adds the rounding of its own sums.
    6. instant and bounds_at serve other outputs at one instant, as at every mesh node: the instant of one estimator
       is given to another, made from the same problem with other displacements as outputs. It is asked for once after
       start and each advance, is small, and no view of what was made for a block: that is let go with the block.

    Attributes
    ----------
    assumes : what must hold of body and mechanism, for reports. inside : the largest |e|_M and |e'|_M (2, S) within
    the segments of the last block, if the estimator knows them, else None; asked for where the frame turns.
    """

    assumes: str
    inside: tuple[np.ndarray, np.ndarray] | None

    def start(self, start: Start) -> Bounds:
        """Begin a run; return the bounds at its first instant."""

    def advance(self, block: Block) -> Bounds:
        """Go on by one block; return the bounds at the ends of its segments."""

    def instant(self, i: int) -> tuple:
        """Return what bounds displacements at entry i of the bounds returned last."""

    def bounds_at(self, instant: tuple) -> Bounds:
        """Return the bounds (1, R) of displacement outputs at an instant of an estimator with other outputs."""
