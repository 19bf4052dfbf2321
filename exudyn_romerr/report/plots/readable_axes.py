"""Limits that axes need to be read: what would leave nothing else to be seen leaves them, and the legend says so."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..wording import rounded_up, with_unit

# times what is shown beside it: a band that is wider is cut off. Bounds are shown up to ten times what the output
# changes by; half widths, which are no promise, up to three times of all that
OF_BOUND, OF_HALF_WIDTH = 10.0, 3.0
MARGIN = 0.1  # of what is shown, on both sides
USELESS = 1e3  # times output, estimate and error: three decades are read with ease, a larger bound tells nothing
DEEP = 1e-4  # of the lowest curve's largest value: what is lower, at first instants say, is not worth an axis
Band = tuple[np.ndarray, np.ndarray]


def limits_of_signal(
    lines: Sequence[np.ndarray], bands: Sequence[tuple[Band, float]]
) -> tuple[tuple[float, float] | None, list[bool]]:
    """Return limits of an axis on which lines can be read, and which of the bands leave it; None: none does.

    bands : (low, high), and how many times as wide as what is shown so far a band may be.
    """
    low, high = min(map(np.min, lines)), max(map(np.max, lines))
    leaves = []
    for (below, above), factor in bands:
        known = np.isfinite(below) & np.isfinite(above)
        least, most = (f(x, where=known, initial=of) for f, x, of in ((np.min, below, low), (np.max, above, high)))
        leaves.append(bool(most - least > factor * (high - low) > 0))
        low, high = (low, high) if leaves[-1] else (least, most)
    margin = MARGIN * (high - low)
    return ((low - margin, high + margin) if any(leaves) else None), leaves


def limits_of_errors(bounds: dict[str, np.ndarray], others: Sequence[np.ndarray], size: float) -> tuple | None:
    """Return limits of a logarithmic axis of bounds (T,), and others, estimate and error, of an output of that size.

    None: nothing is to be drawn. Bounds whose largest finite value is above them leave the axis.
    """
    most = {name: largest(x) for name, x in bounds.items()}
    reads = [x for x in map(largest, others) if x > 0]
    known = [x for x in most.values() if x > 0]
    if not reads and not known:
        return None
    top = USELESS * max([size, *reads]) if reads else max(USELESS * size, min(known))
    shown = [*reads, *(x for x in known if x <= top)]
    drawn = np.concatenate([x[np.isfinite(x) & (x > 0)] for x in (*bounds.values(), *others)])
    lowest = max(float(drawn.min()), DEEP * min(shown))
    return lowest / 2, 2 * max(shown)


def largest(x: np.ndarray) -> float:
    """Return the largest finite value; 0: there is none."""
    return float(np.max(x, where=np.isfinite(x), initial=0.0))


def largest_in_words(bound: np.ndarray, unit: str, words: str) -> str:
    """Return the largest bound in words; half widths of estimates, and bounds not certified, are "up to"."""
    finite = bound[np.isfinite(bound)]
    largest = f"{words} {with_unit(rounded_up(np.max(finite), 2), unit)}" if finite.size else "nowhere finite"
    return largest if finite.size in (0, bound.size) else f"{largest} where finite"


def above(limits: tuple | None, x: np.ndarray, unit: str) -> str:
    """Return how large what leaves the axes at their upper edge gets; empty: it does not."""
    leaves = limits is not None and largest(x) > limits[1]
    return f"above the axis, {largest_in_words(x, unit, 'up to')}" if leaves else ""


def infinite(t: np.ndarray, bound: np.ndarray, by: str, axis: tuple[str, str]) -> str:
    """Return that, and when, a bound is infinite; empty: nowhere. by : " by 'energy'"; axis : name and unit of t."""
    at = np.flatnonzero(~np.isfinite(bound))
    if at.size in (0, len(t)):
        return f"no finite bound{by}" if at.size else ""
    name, unit = axis
    first, last = t[at[0]], t[at[-1]]
    when = f"{name} = {first:.4g}" + (f" to {last:.4g}" if last > first else "") + f" {unit}".rstrip()
    return f"bound{by} infinite at {when}{'' if at[-1] - at[0] < at.size else ', not throughout'}"
