"""View: an output in global axes, from rows in the axes of a moving frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .floating_frame import FrameRows, skew

if TYPE_CHECKING:
    from .floating_frame import FramePose


@dataclass(frozen=True)
class View:
    """Vectors C q of k places, seen in global axes: A C q, and A (C q' + w~ C q) of velocities.

    Values include what the frame itself moves the places: A C (x + u) + s r, less the same in the reference pose
    (displacement) or not (position).

    Attributes
    ----------
    axes : components (0, 1, 2) of each vector that the output shows. blind : whether all of its error is the frame's,
    of which nothing is known: bounds are inf.
    places : (k, 3) C x; shift : (k,) s, C of a unit translation. of : "displacement", "velocity", "position".
    """

    axes: tuple[int, ...]
    places: np.ndarray
    shift: np.ndarray
    of: str
    blind: bool = False

    def matrices(self, frame: np.ndarray) -> np.ndarray:
        """Return H (S, r, R) with output = H (rows in body axes); velocities see the displacement rows first."""
        rows, count = FrameRows.of(frame), len(self.places)
        parts = [rows.A @ skew(rows.w), rows.A] if self.of == "velocity" else [rows.A]
        wide = [np.einsum("kl,sij->skilj", np.eye(count), part[:, list(self.axes)]) for part in parts]
        return np.concatenate([part.reshape(len(frame), count * len(self.axes), 3 * count) for part in wide], axis=2)

    def values(self, base: np.ndarray, frame: np.ndarray, pose: FramePose) -> np.ndarray:
        """Return the output (S, r) of the base rows' values (S, R)."""
        rows = FrameRows.of(frame)
        turn, shift = {
            "displacement": (rows.A - pose.A, rows.r - pose.r),
            "position": (rows.A, rows.r),
            "velocity": (rows.A @ skew(rows.w), rows.r_t),
        }[self.of]
        carried = np.einsum("sij,kj->ski", turn, self.places) + self.shift[:, None] * shift[:, None]
        own = np.einsum("srk,sk->sr", self.matrices(frame), base)
        return own + carried[:, :, list(self.axes)].reshape(len(frame), -1)
