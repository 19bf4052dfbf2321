"""Forecast: what the bounds of a run would be with more or fewer modes, from the modal content of its error.

The corrected trajectory x of a run is close to that of the full model. Galerkin's with the modes v_1 .. v_n,
K-orthonormal, is close to sum_j v_j a_j, a_j = v_j^T K x: exactly so for static solutions, and for eigenmodes that
are orthogonal in M and K. One mode more takes C v_j a_j from the error of an output C.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy.linalg as la

from .errors import InputError
from .outputs import Onlooker, stacked_rows

if TYPE_CHECKING:
    from collections.abc import Sequence

    import scipy.sparse as sp

    from .body import ElasticBody
    from .online import Run
    from .outputs import Output
    from .report import BoundReport, OutputReport

CONTENT, RATE = "modal content", "rate of the modal content"


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

    def onlookers(self, outputs: Sequence[Output]) -> list[Output]:
        """Return outputs that tell a_j, and a_j' where outputs ask for velocities."""
        rates = [Onlooker(RATE, self._rows, of="velocity")] if any(out.of == "velocity" for out in outputs) else []
        return [Onlooker(CONTENT, self._rows), *rates]


@dataclass(frozen=True)
class Forecast:
    """Of one output of a run with n modes.

    bound : (most + 1,) its largest bound if the basis had 0 .. most modes; bound[n] is that of the run.
    slack : what the largest bound has above the known error, which no modes of the ladder take away.
    """

    n: int
    bound: np.ndarray
    slack: float


def forecasts(report: BoundReport, run: Run, body: ElasticBody, ladder: Ladder, n: int) -> dict[str, Forecast]:
    """Return output -> Forecast from a run with onlookers, which are taken out of its report."""
    found = {name: report.outputs.pop(name).corrected for name in (CONTENT, RATE) if name in report.outputs}
    if found[CONTENT] is None:
        raise InputError("build attaches without estimator 'auxiliary', which alone tells what modes are missing")
    frames, parts = run.samples()[3], zip(run.offline.outputs, run.offline.views, strict=True)
    forecast = {}
    for out, view in parts:
        if out.name not in report.outputs:
            continue
        C, velocity, _ = stacked_rows([out], body)
        shown = None if view is None else view.matrices(frames)
        CV = C @ body.space.coordinates("modes", ladder.modes)
        forecast[out.name] = _forecast(report.outputs[out.name], (CV, velocity, shown), found, ladder.always, n)
    return forecast


def _forecast(out: OutputReport, rows: tuple, found: dict[str, np.ndarray], always: int, n: int) -> Forecast:
    """A step up the ladder takes a mode's part from the known error, a step down adds it; the rest stays."""
    known = out.corrected - out.value
    slack = np.maximum(out.bound["best"] - np.abs(known), 0.0)
    most = len(rows[0].T) - always
    bound = np.zeros(most + 1)
    bound[n] = np.max(out.bound["best"])
    for steps, sign in ((range(n, most), -1.0), (range(n - 1, -1, -1), 1.0)):
        left = known.copy()
        for j in steps:
            left += sign * _part(rows, found, always + j)
            bound[j + (sign < 0)] = np.max(np.abs(left) + slack)
    return Forecast(n, bound, float(np.max(slack)))


def _part(rows: tuple, found: dict[str, np.ndarray], j: int) -> np.ndarray:
    """C v_j a_j (T, r), as the output shows it."""
    CV, velocity, shown = rows
    amounts = found[CONTENT][:, j, None]
    if velocity.any():
        amounts = np.where(velocity, found[RATE][:, j, None], amounts)
    part = amounts * CV[:, j]
    return part if shown is None else np.einsum("srk,sk->sr", shown, part)
