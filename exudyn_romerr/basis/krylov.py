"""krylov_basis: moments of the transfer function matched at real shifts."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from ..checks import check_array, check_count, check_type
from ..errors import InputError
from ..linalg.free_mass_matrix import explicit
from ..linalg.orthogonalise import m_orthonormal, m_orthonormalised
from ..linalg.symmetric_factor import SymmetricFactor, solve_with
from ..model.body import ElasticBody
from ..model.matrix_checks import checked_inputs
from .basis import Basis

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence


def krylov_basis(body: ElasticBody, inputs: Any, n: int, shifts: Sequence[float] = (0.0,)) -> Basis:
    """Return an M-orthonormal basis that matches moments of the transfer function at real shifts.

    Parameters
    ----------
    inputs : ndarray, (N, p)
        Input matrix B.
    n : int
        Columns wanted; fewer come back where the Krylov space ends (the basis' note tells how many deflated).
    shifts : sequence of float
        Real expansion points s >= 0 in 1/s, taken in turn; 0 matches the static response.

    Raises
    ------
    InputError
        n or shifts out of range, or nothing left after deflation.

    Notes
    -----
    Rayleigh or no damping: the undamped Krylov space of K + sigma M, sigma = (s^2 + alpha s)/(1 + beta s), which
    matches the damped moments too (not those of ratios by mode). General damping: Arnoldi on the companion form,
    positions kept.
    """
    check_type("body", body, ElasticBody)
    B = body.space.loads(checked_inputs(inputs, body.N))
    n = check_count("n", n, body.free.size, "free coordinates")
    shifts = check_array("shifts", shifts, (None,)).tolist()
    if not shifts or min(shifts) < 0:
        raise InputError(f"shifts={shifts!r}; needed: one or more real numbers >= 0 in 1/s")
    shares = [n // len(shifts) + (k < n % len(shifts)) for k in range(len(shifts))]
    chain = _companion_chain if body.proportional is None else _undamped_chain
    columns = [chain(body, B, s, share) for s, share in zip(shifts, shares, strict=True) if share]
    V = m_orthonormal(body.M, np.hstack(columns))[:, :n]
    deflated = n - V.shape[1]
    note = f"Krylov, {V.shape[1]} columns, shifts {tuple(shifts)} 1/s"
    return Basis(body.expand(V), note=note + (f", {deflated} of {n} deflated" if deflated else ""))


def _undamped_chain(body: ElasticBody, B: np.ndarray, shift: float, n: int) -> np.ndarray:
    alpha, beta = body.proportional
    sigma = (shift**2 + alpha * shift) / (1 + beta * shift)
    factor = body.stiffness_factor if sigma == 0 else SymmetricFactor(body.K + sigma * explicit(body.M))
    return _arnoldi(body.M, factor.solve(B), lambda v: factor.solve(body.M @ v), n)


def _companion_chain(body: ElasticBody, B: np.ndarray, shift: float, n: int) -> np.ndarray:
    size = body.free.size
    solve = solve_with(body.K + shift * body.D + shift**2 * body.M)
    slope = 2 * shift * body.M + body.D

    def step(v):
        return np.concatenate([-solve(slope @ v[:size] + body.M @ v[size:]), v[:size]])

    start = np.vstack([solve(B), np.zeros_like(B)])
    return _arnoldi(sp.block_diag([body.M, body.M]), start, step, n)[:size]


def _arnoldi(M, start: np.ndarray, step: Callable, n: int) -> np.ndarray:
    """Return up to n M-orthonormal vectors spanning start, step(start), step(step(start)), ..."""
    kept: list[np.ndarray] = []
    queue = list(start.T)
    while queue and len(kept) < n:
        new = m_orthonormalised(M, kept, queue.pop(0))
        if new is not None:
            kept.append(new)
            queue.append(step(new))
    if not kept:
        raise InputError("inputs do not move the free coordinates: every column of B is zero there")
    return np.column_stack(kept)
