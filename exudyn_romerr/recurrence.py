"""Scalar recurrences over the steps of a block: sums that forget."""

from __future__ import annotations

from itertools import accumulate

import numpy as np
from scipy.signal import lfilter

EQUAL_STEPS = 1e-9  # decays this close are taken as their largest: still an upper bound, and one filter call


def decaying_sum(decay: np.ndarray, added: np.ndarray, start: float) -> np.ndarray:
    """Return x (S,) of x_k = decay_k x_{k-1} + added_k, x_{-1} = start; entries of decay lie in [0, 1]."""
    if not (np.isfinite(start) and np.isfinite(added).all()):  # from the first inf on the sum is inf, 0 inf too
        spoilt = np.cumsum(~np.isfinite(added)) > 0 if np.isfinite(start) else np.ones(len(added), dtype=bool)
        return np.where(
            spoilt, np.inf, decaying_sum(decay, np.where(spoilt, 0.0, added), 0.0 if spoilt[0] else start)
        )
    largest = decay.max()
    if largest - decay.min() <= EQUAL_STEPS:
        return lfilter([1.0], [1.0, -largest], added, zi=[largest * start])[0]
    pairs = zip(decay.tolist(), added.tolist(), strict=True)
    return np.array(list(accumulate(pairs, lambda x, pair: pair[0] * x + pair[1], initial=start))[1:])
