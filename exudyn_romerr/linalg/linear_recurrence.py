"""First-order linear recurrences over the steps of a block: x_i = a_i x_(i-1) + b_i."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg.blas import dtbsv

from ..compiled.loops import loops

if TYPE_CHECKING:
    from collections.abc import Sequence


def decaying_sum(decay: np.ndarray, added: np.ndarray, start: float) -> np.ndarray:
    """Return x (S,) of x_k = decay_k x_{k-1} + added_k, x_{-1} = start; inf from the first inf on."""
    if not (np.isfinite(start) and np.isfinite(added).all()):
        spoilt = np.cumsum(~np.isfinite(added)) > 0 if np.isfinite(start) else np.ones(len(added), dtype=bool)
        return np.where(
            spoilt, np.inf, decaying_sum(decay, np.where(spoilt, 0.0, added), 0.0 if spoilt[0] else start)
        )
    # bidiagonal equations, solved forwards: as fast as scipy.signal's filter, which takes half a second to import
    bands, x = np.zeros((2, len(added)), order="F"), added.astype(float)
    bands[1, :-1] = -decay[1:]
    x[0] += decay[0] * start
    x = dtbsv(1, bands, x, lower=1, diag=1, overwrite_x=1)
    finite = np.isfinite(x)
    return x if finite.all() else np.where(np.cumsum(~finite) > 0, np.inf, x)


def decaying_sums(decays: np.ndarray, added: np.ndarray, starts: Sequence[float]) -> np.ndarray:
    """Return decaying_sum of several (rows, S) at once."""
    sums = np.empty_like(added)
    if loops is None:
        for i, row in enumerate(zip(decays, added, starts, strict=True)):
            sums[i] = decaying_sum(*row)
    else:
        loops.decaying_sums(*added.shape, decays, added, np.array(starts, dtype=float), sums)
    return sums
