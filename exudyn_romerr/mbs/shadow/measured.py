"""Measured: what linear equations leave out of a block of steps, and what a prediction may lack for it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...report.scope import Reason

# what may be left, in sizes of r: looked at now and then it came out down to 0.17 of what it is, looked at everywhere
# within 2 %; the rest is for what is of third order, and for motion outside the span of the vectors
SAMPLED, LOOKED = 8.0, 2.0
# of the prediction: above it, what linear equations leave out has an error of its own that bounds do not have; with
# 0.22 an error was 1.05 times its bound, a corrected one 1.22 times. Random mechanisms have less than 0.04
NOT_LINEAR = 0.1
OF_THIRD_ORDER = Reason.THIRD_ORDER.doubt(f"{100 * NOT_LINEAR:g}")


class Measured(NamedTuple):
    """What was found at the rows of a block: r and the part of it that was added to the prediction, (3, S, k).

    times : (S,), SAMPLED or LOOKED.
    """

    r: np.ndarray
    added: np.ndarray
    times: np.ndarray

    def left(self) -> list[np.ndarray]:
        """What the prediction may still lack, the sum of the sizes of these: so many times what was not added."""
        return [self.times[:, None] * (self.r - self.added), self.added][: 1 + self.added.any()]


def joined(parts: Sequence[Measured]) -> Measured:
    """Return what was found in several blocks as one."""
    r, added, times = zip(*parts, strict=True)
    return Measured(np.concatenate(r, axis=1), np.concatenate(added, axis=1), np.concatenate(times))
