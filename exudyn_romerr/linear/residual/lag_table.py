"""LagTable: a kernel's maximum over any lag interval, by table look-up."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...errors import AssumptionError

if TYPE_CHECKING:
    from .kernels import Kernel

CELLS_PER_RADIAN = 32  # of the first mode: rounding a lag interval outwards costs about 1/32 of the kernel's peak
MOST_CELLS = 2**20  # 20 levels of them take 170 MB, twice that while they grow


class LagTable:
    """Maxima of |Phi12| over cells of equal length and over runs of 2^j cells; grows with the lags asked for."""

    def __init__(self, kernel: Kernel):
        self.kernel = kernel
        self.cell = 1 / (CELLS_PER_RADIAN * kernel.omega_1)
        self.levels = [np.zeros(0)]
        self.stack = np.zeros((1, 0))

    def __call__(self, lo: np.ndarray, hi: np.ndarray) -> np.ndarray:
        """Upper bounds of max |Phi12| over [lo, hi] (any shape), never below it."""
        # the interval is widened by rounding of the division, then outwards to whole cells
        first = np.floor(lo / self.cell * (1 - 1e-14)).astype(int)
        last = np.floor(hi / self.cell * (1 + 1e-14)).astype(int)
        self._grow(int(last.max()) + 1)
        level = np.floor(np.log2(last - first + 1)).astype(int)
        # row j of the stack is padded at its end; both runs of 2^j cells lie inside [first, last]
        return np.maximum(self.stack[level, first], self.stack[level, last - 2**level + 1])

    def _grow(self, cells: int) -> None:
        have = self.levels[0].size
        if cells <= have:
            return
        if cells > MOST_CELLS:
            longest = MOST_CELLS * self.cell
            raise AssumptionError(
                "sums over all steps before ('convolution' of kernels without exponentials) were asked for in a run "
                f"of more than {longest:.4g} s, {MOST_CELLS // CELLS_PER_RADIAN} rad of the first mode: take "
                "'auxiliary' or 'energy', or kernels='certified'"
            )
        edges = self.cell * np.arange(have, max(cells, 2 * have) + 1)
        self.levels = [np.concatenate([self.levels[0], self.kernel.phi12_on(edges[:-1], edges[1:])])]
        while 2 ** len(self.levels) <= self.levels[0].size:
            half, below = 2 ** (len(self.levels) - 1), self.levels[-1]
            self.levels.append(np.maximum(below[:-half], below[half:]))
        size = self.levels[0].size
        self.stack = np.array([np.pad(level, (0, size - level.size)) for level in self.levels])
