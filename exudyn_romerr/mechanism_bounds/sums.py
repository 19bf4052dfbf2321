"""g: what a passive scheme lets grow of an error, from how a residual varies or from what damping takes of it."""

from __future__ import annotations

import numpy as np


class Sums:
    """Two sums, each of which bounds the storage (2 S)^1/2 of all bodies together: g, the smaller of both.

    g_n = min(g_n-1 + |f_n - f_n-1| + x_n, rough_n + |f_n|),
    rough_n = (rough_n-1^2 + h sum |f_b|^2/(2 beta_b))^1/2 + x_n,
    with forces f_n that steps feel, |.| in K^-1, and all else, x_n, that does work in the step.
    """

    def __init__(self) -> None:
        self.g = self.rough = 0.0

    def begin(self, start: float) -> None:
        """Begin with what accelerations of the start hold."""
        self.g = self.rough = start

    def take(self, variation: np.ndarray, extra: np.ndarray, work: np.ndarray, size: np.ndarray) -> np.ndarray:
        """Return g after each step (T,) of |f_n - f_n-1|, x_n, h sum |f_b|^2/(2 beta_b), |f_n|."""
        found, g, rough = np.zeros(len(size)), self.g, self.rough
        steps = np.stack([variation, extra, work, size], axis=1).tolist()
        for i, (df, x, by_damping, f) in enumerate(steps):
            rough = (rough * rough + by_damping) ** 0.5 + x
            g = min(g + df + x, rough + f)
            rough = min(rough, g + f)
            found[i] = g
        self.g, self.rough = g, rough
        return found
