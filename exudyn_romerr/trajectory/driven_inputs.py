"""DrivenInputs: the inputs of a body whose frame moves as a function of time says, also between samples."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..linalg.bezier import AT_CHECKS, AT_INNER, FROM_NODES, INNER
from ..model.floating_frame import FrameRows, Turn
from .segments import Cut

if TYPE_CHECKING:
    from collections.abc import Callable

    from ..residual.packed_residual import Packing

SAFETY = 6.0  # as between the checks of any input function, see reconstruct.py


class Inputs(NamedTuple):
    """Inputs u (S, p) and frame (S, 21) at some times; off (S, p): what errors of derivatives move u by."""

    u: np.ndarray
    frame: np.ndarray
    off: np.ndarray


class Between(NamedTuple):
    """What lies between samples: see Block."""

    controls: np.ndarray
    unresolved: np.ndarray
    variation: np.ndarray
    turn: Turn | None
    cut: Cut | None


@dataclass(frozen=True)
class DrivenInputs:
    """values : (t, q, q_t, start, end, step) -> Inputs. packing : of the inputs, None if they are as they are."""

    values: Callable[..., Inputs]
    packing: Packing | None

    def at(self, t: np.ndarray, q: np.ndarray, q_t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the inputs (S, k), what is cut off them (S, c), and the frame (S, 21) at samples."""
        u, frame, _ = self.values(t, q, q_t, t[0], t[-1], np.diff(t).min(initial=np.inf))
        return *self._packed(u), frame

    def between(self, t: np.ndarray, q: np.ndarray, q_t: np.ndarray) -> Between:
        """Return the inputs along curves with control points q, q_t (S, 6, n) between samples at t (S + 1,).

        They are interpolated at the nodes of every step, all products included; what that misses is looked at half
        way between, with the same safety as any input function.
        """
        h = np.diff(t)
        times = t[:-1, None] + h[:, None] * INNER
        times[:, -1] = t[1:]
        curves = ((AT_INNER @ c).reshape(-1, c.shape[2]) for c in (q, q_t))
        u, frame, off = self.values(times.ravel(), *curves, t[0], t[-1], h.min())
        packed, cut = (x.reshape(*times.shape, -1) for x in self._packed(u))
        off_packed, off_cut = (x.reshape(*times.shape, -1).max(axis=1) for x in self._packed(off, sizes=True))
        controls, miss = _interpolated(packed)
        unresolved = SAFETY * miss.max(axis=1) + off_packed
        variation = SAFETY * 2 * miss.sum(axis=1) + 2 * off_packed
        turn = _turn(FrameRows.of(frame), times.shape)
        return Between(controls, unresolved, variation, turn, _cut(cut, off_cut) if cut.shape[2] else None)

    def _packed(self, u: np.ndarray, sizes: bool = False) -> tuple[np.ndarray, np.ndarray]:
        if self.packing is None:
            return u, np.zeros((len(u), 0))
        packed, cut = self.packing(u)
        return (u @ np.abs(self.packing.T_u.T) if sizes else packed), cut


def _interpolated(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Control points (S, 6, k) through values (S, 11, k) at nodes; what they miss at checks (S, 5, k)."""
    controls = FROM_NODES @ values[:, 0::2]
    controls[:, 0], controls[:, -1] = values[:, 0], values[:, -1]
    return controls, np.abs(values[:, 1::2] - AT_CHECKS @ controls)


def _turn(rows: FrameRows, shape: tuple) -> Turn | None:
    sizes = []
    for x in (rows.w, rows.al):
        controls, miss = _interpolated(x.reshape(*shape, 3))
        sizes.append(np.linalg.norm(controls, axis=2).max(axis=1) + SAFETY * np.linalg.norm(miss, axis=2).max(axis=1))
    w, al = sizes
    return Turn(w, al, al + w**2, np.zeros_like(w)) if w.any() or al.any() else None


def _cut(values: np.ndarray, off: np.ndarray) -> Cut:
    controls, miss = _interpolated(values)
    size = np.abs(controls).sum(axis=2).max(axis=1) + (SAFETY * miss.max(axis=1) + off).sum(axis=1)
    varied = np.abs(np.diff(controls, axis=1)).sum(axis=(1, 2))
    return Cut(size, varied + (SAFETY * 2 * miss.sum(axis=1) + 2 * off).sum(axis=1))
