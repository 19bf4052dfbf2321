"""First-order linear recurrences over the steps of a block: x_i = a_i x_(i-1) + b_i."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compiled.loops import loops

if TYPE_CHECKING:
    from collections.abc import Sequence


def decaying_sums(decays: np.ndarray, added: np.ndarray, starts: Sequence[float]) -> np.ndarray:
    """Return x (rows, S) of x_k = decay_k x_{k-1} + added_k, x_{-1} = start; inf from the first inf or nan on."""
    sums, x = np.empty_like(added, dtype=float), np.array(starts, dtype=float)
    if loops is not None:
        loops.decaying_sums(*added.shape, decays, added, x, sums)
        return sums
    with np.errstate(over="ignore", invalid="ignore"):  # 0 inf, too
        for k, (decay, more) in enumerate(zip(decays.T, added.T, strict=True)):
            x = decay * x + more
            x[~np.isfinite(x)] = np.inf
            sums[:, k] = x
    return sums
