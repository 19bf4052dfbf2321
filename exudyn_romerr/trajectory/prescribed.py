"""Prescribed: a function of time that nobody knows more of than its values, with its first two derivatives."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

if TYPE_CHECKING:
    from collections.abc import Callable

EPS = np.finfo(float).eps
DEGREE = 16
LOW = 4  # degree of panels that do not resolve the function: one of high degree would overshoot at a kink
RESOLVED = 1e-9  # of the second derivative
SAME = 1e-6  # of first derivatives on both sides of a joint of two panels
LONG = 8  # times the shortest: nodes of longer panels are further apart than the shortest, so f is looked at between
MISSED = 8  # times the last coefficients: what a polynomial that resolves f may differ from it by
CUT = 0.4871  # where a panel is cut: kinks are often at halves


class Derivatives(NamedTuple):
    """Values, first and second derivatives (T, k) at some times; off (T, k): estimated error of the second ones."""

    f: np.ndarray
    f_t: np.ndarray
    f_tt: np.ndarray
    off: np.ndarray


@dataclass(frozen=True)
class Panel:
    """A polynomial on [start, end]: Chebyshev coefficients (degree + 1, k), estimated error (k,) of f''."""

    start: float
    end: float
    coefficients: np.ndarray
    off: np.ndarray

    def __call__(self, t: np.ndarray) -> Derivatives:
        """Return what the polynomial gives at times t (T,)."""
        scale = 2 / (self.end - self.start)
        x, c = (t - self.start) * scale - 1, self.coefficients
        parts = [chebyshev.chebval(x, chebyshev.chebder(c, m) * scale**m).T for m in range(3)]
        return Derivatives(*parts, np.broadcast_to(self.off, (len(t), len(self.off))))


@dataclass(frozen=True)
class Panels:
    """Panels one after another; each counts from its edge (P,) on."""

    edges: tuple[float, ...]
    panels: tuple[Panel, ...]

    def __call__(self, t: np.ndarray) -> Derivatives:
        """Return values and derivatives at times t (T,) inside."""
        which = np.searchsorted(self.edges[1:], t, side="right")
        found = np.zeros((4, len(t), self.panels[0].coefficients.shape[1]))
        for i in np.unique(which).tolist():
            found[:, which == i] = self.panels[i](t[which == i])
        return Derivatives(*found)


def resolved(f: Callable[[np.ndarray], np.ndarray], start: float, end: float, shortest: float) -> Panels:
    """Return polynomials through f on [start, end] that are cut in two until they resolve it, or are `shortest`.

    f takes times (T,) and returns (T, k). A panel resolves f where the last two of its coefficients would change its
    second derivative by less than RESOLVED of it, or are rounding, and where it meets f between its nodes too: what f
    does for longer than `shortest` is not missed. Where the shortest does not, a polynomial of low degree is taken,
    and all that its second derivative changes by is its estimated error. So it is about a joint of two panels whose
    first derivatives differ: f has a kink there.
    """
    found = _cut(f, start, end, shortest)
    edges, panels = [start], found[:1]
    for before, after in pairwise(found):
        joint, half = np.array([after.start]), shortest / 2
        if _has_kink(before(joint), after(joint), shortest):
            low = _low(f, max(joint[0] - half, start), min(joint[0] + half, end))
            edges, panels = [*edges, low.start, low.end], [*panels, low, after]
        else:
            edges, panels = [*edges, after.start], [*panels, after]
    return Panels(tuple(np.maximum.accumulate(edges).tolist()), tuple(panels))


def has_kink(f: Callable[[np.ndarray], np.ndarray], t: float, short: float) -> bool:
    """Whether the first derivative of f jumps at t, seen from a short time before and after."""
    at = np.array([t])
    return _has_kink(_panel(f, t - short, t, LOW)(at), _panel(f, t, t + short, LOW)(at), short)


def _has_kink(before: Derivatives, after: Derivatives, length: float) -> bool:
    unsure = (before.off + after.off) * length
    return bool(
        np.any(np.abs(after.f_t - before.f_t) > SAME * np.maximum(np.abs(before.f_t), np.abs(after.f_t)) + unsure)
    )


def _cut(f: Callable, start: float, end: float, shortest: float) -> list[Panel]:
    panel = _panel(f, start, end, DEGREE)
    if _is_resolved(panel) and not _misses(panel, f, shortest):
        return [panel]
    if end - start <= shortest:
        return [_low(f, start, end)]
    middle = start + CUT * (end - start)
    return _cut(f, start, middle, shortest) + _cut(f, middle, end, shortest)


def _panel(f: Callable, start: float, end: float, degree: int) -> Panel:
    x = chebyshev.chebpts1(degree + 1)
    values = f(start + (x + 1) / 2 * (end - start))
    coefficients = np.linalg.solve(chebyshev.chebvander(x, degree), values)
    size = np.abs(values).max(axis=0)
    tail = np.maximum(np.abs(coefficients[-2:]).max(axis=0), EPS * size)
    return Panel(start, end, coefficients, tail * _bend(degree, end - start))


def _bend(degree: int, length: float) -> float:
    """Largest second derivative of the Chebyshev polynomial of a degree on an interval of some length."""
    return degree**2 * (degree**2 - 1) / 3 * (2 / length) ** 2


def _is_resolved(panel: Panel) -> bool:
    length, c = panel.end - panel.start, panel.coefficients
    f_tt = np.abs(panel(np.linspace(panel.start, panel.end, DEGREE)).f_tt).max(axis=0)
    rounding = 8 * EPS * np.abs(c).sum(axis=0) * _bend(DEGREE, length)
    return bool(np.all(panel.off <= np.maximum(RESOLVED * f_tt, rounding)))


def _misses(panel: Panel, f: Callable, shortest: float) -> bool:
    """Whether f differs from a long panel at times that are `shortest` apart: a pulse may lie between its nodes."""
    length, c = panel.end - panel.start, panel.coefficients
    if length <= LONG * shortest:
        return False
    t = np.linspace(panel.start, panel.end, int(np.ceil(length / shortest)) + 1)
    tail = np.maximum(np.abs(c[-2:]).max(axis=0), EPS * np.abs(c).sum(axis=0))
    return bool(np.any(np.abs(panel(t).f - f(t)) > MISSED * tail))


def _low(f: Callable, start: float, end: float) -> Panel:
    panel = _panel(f, start, end, LOW)
    spread = np.ptp(panel(np.linspace(start, end, DEGREE)).f_tt, axis=0)
    return Panel(start, end, panel.coefficients, spread)
