"""Forecast: what bounds or estimates of a run would be with other modes, from the modal content of its error.

The corrected trajectory x of a run is close to that of the full model. Galerkin's with the modes v_1 .. v_n,
K-orthonormal, is close to sum_j v_j a_j, a_j = v_j^T K x: exactly so for static solutions, and for eigenmodes that
are orthogonal in M and K. One mode more takes C v_j a_j from the error of an output C.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy.linalg as la

from ..errors import InputError
from ..linear.run.record import Internal
from ..model.outputs import InternalOutput, stacked_rows

if TYPE_CHECKING:
    from collections.abc import Sequence

    import scipy.sparse as sp

    from ..model.body import ElasticBody
    from ..model.outputs import Output
    from ..report.report import BoundReport, OutputReport

CONTENT, RATE = "(modal content)", "(rate of the modal content)"
BOUND, ESTIMATE = BY = ("bound", "estimate")  # what decides
TINY = np.finfo(float).tiny
NO_BOUND = (
    "output {!r} has an estimate of its error and no bound (print(report.plan) says why): decide by='estimate', take "
    "an output in the body's frame, or attach with scope='inputs frozen'"
)


class Ladder:
    """The modes that a body may have, K-orthonormal, in the order in which it takes them.

    Attributes
    ----------
    modes : (N, k). always : how many of them it has with n = 0.
    """

    def __init__(self, V: np.ndarray, K: sp.spmatrix, n: int):
        length = np.sqrt(np.einsum("ij,ij->j", V, K @ V))
        if V.shape[1] < n or not np.all(length > 0):
            raise InputError(f"a body of build({n}) has {V.shape[1]} modes, {np.sum(length > 0)} of which deform it")
        V = V / length
        try:
            self.modes = la.solve_triangular(la.cholesky(V.T @ (K @ V)), V.T, trans="T").T
        except la.LinAlgError as error:
            raise InputError(f"modes of build({n}) are linearly dependent; ask for fewer with most=") from error
        self.always = V.shape[1] - n
        self._rows = np.ascontiguousarray((K @ self.modes).T)

    def internal_outputs(self, outputs: Sequence[Output]) -> list[Output]:
        """Return outputs that tell a_j, and a_j' where outputs ask for velocities."""
        rates = (
            [InternalOutput(RATE, self._rows, of="velocity")] if any(out.of == "velocity" for out in outputs) else []
        )
        return [InternalOutput(CONTENT, self._rows), *rates]


@dataclass(frozen=True)
class Forecast:
    """One output (T, r) of a run, and what it would be with other modes.

    modes : of the run. known : (T, r) error that auxiliary vectors tell, or the estimate. slack : (T, r), what the
    bound has above it, or the estimate's half width. parts : (most, T, r) of every mode.
    """

    modes: tuple[int, ...]
    known: np.ndarray
    slack: np.ndarray
    parts: np.ndarray

    def left(self, modes: Sequence[int]) -> np.ndarray:
        """Return the error (T, r) there would be with these modes: a mode more takes its part from it."""
        added, dropped = (sorted(set(a) - set(b)) for a, b in ((modes, self.modes), (self.modes, modes)))
        return self.known - self.parts[added].sum(axis=0) + self.parts[dropped].sum(axis=0)

    def bound(self, modes: Sequence[int]) -> float:
        """Return the largest bound, or estimate with its half width, there would be with these modes."""
        return float(np.max(np.abs(self.left(modes)) + self.slack))

    @property
    def largest_slack(self) -> float:
        """What no modes take away."""
        return max(float(np.max(self.slack)), 0.0)


def forecasts(
    report: BoundReport, found: Internal, body: ElasticBody, ladder: Ladder, modes: Sequence[int], by: str = BOUND
) -> dict[str, Forecast]:
    """Return output -> Forecast from a run with internal_outputs, of its bounds or (by=ESTIMATE) its estimates."""
    if found.corrected[CONTENT] is None:
        raise InputError("build attaches without estimator 'auxiliary', which alone tells what modes are missing")
    modes_y = body.space.coordinates("modes", ladder.modes[:, ladder.always :])
    forecast = {}
    for asked, view in zip(found.outputs, found.views, strict=True):
        if (out := report.outputs.get(asked.name)) is None:
            continue
        C, velocity, _ = stacked_rows([asked], body)
        amounts = {name: x[:, ladder.always :] for name, x in found.corrected.items()}
        parts = _parts(C @ modes_y, velocity, amounts, None if view is None else view.matrices(found.frames))
        forecast[asked.name] = Forecast(tuple(modes), *_known_and_slack(out, by), parts)
    return forecast


def _known_and_slack(out: OutputReport, by: str) -> tuple[np.ndarray, np.ndarray]:
    if by == BOUND:
        if out.corrected is None and out.estimate is not None:
            raise InputError(NO_BOUND.format(out.name))
        known = out.corrected - out.value
        return known, out.bound["best"] - np.abs(known)
    if out.estimate is None:
        raise InputError(f"output {out.name!r} has no estimate of its error; let its bound decide: by={BOUND!r}")
    return out.estimate, out.uncertainty


def _parts(CV: np.ndarray, velocity: np.ndarray, amounts: dict, shown: np.ndarray | None) -> np.ndarray:
    """C v_j a_j (most, T, r), as the output shows it."""
    a = amounts[CONTENT].T[:, :, None]
    if velocity.any():
        a = np.where(velocity, amounts[RATE].T[:, :, None], a)
    parts = a * CV.T[:, None]
    return parts if shown is None else np.einsum("srk,jsk->jsr", shown, parts)


def fewest_modes(forecast: dict[str, Forecast], tolerance: dict[str, float]) -> tuple[int, ...] | None:
    """Return few modes that are forecast to be enough, whichever they are; None if all are not.

    One by one, each time the mode that takes most from the largest bound over its tolerance; then those that later
    ones made needless are dropped.
    """

    def excess(modes: Sequence[int]) -> float:
        return max(forecast[name].bound(modes) / max(limit, TINY) for name, limit in tolerance.items())

    taken: list[int] = []
    rest = list(range(len(next(iter(forecast.values())).parts)))
    while excess(taken) > 1 and rest:
        best = min(rest, key=lambda j: excess([*taken, j]))
        rest.remove(best)
        taken.append(best)
    if excess(taken) > 1:
        return None
    for j in list(taken):
        without = [k for k in taken if k != j]
        taken = without if excess(without) <= 1 else taken
    return tuple(sorted(taken))
