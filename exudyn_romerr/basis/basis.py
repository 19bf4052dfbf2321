"""Basis: matrices V and W of a projection, the user's own, of modes, of Krylov vectors, of a Gramian."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from numpy.typing import ArrayLike

from ..checks import check_array, check_count, check_type
from ..errors import AssumptionError, InputError
from ..linalg.eigenmodes import count_below
from ..linalg.free_mass_matrix import damping_of, explicit
from ..linalg.orthogonalise import DEFLATION, m_orthonormal
from ..linalg.symmetric_factor import SymmetricFactor, solve_with
from ..model.body import ElasticBody
from ..model.matrix_checks import checked_inputs

DEPENDENT = 1e-10  # columns of unit length closer than this to the others' span carry mostly rounding
PER_INTERVAL = 16  # quadrature nodes from the middle between two resonances to one of them
RESONANCES = 60  # at most so many are looked for in a band; higher ones are narrow for the nodes between them


class Basis:
    """A reduction q ~ V qr with test space W (Galerkin: W = V); any full-rank matrices will do.

    Parameters
    ----------
    V : ndarray, (N, n)
        Exudyn's Craig-Bampton matrix is just a V. Rows of fixed coordinates must be zero.
    W : ndarray, (N, n), optional
        Petrov-Galerkin test matrix; W^T V must be invertible.
    note : str
        One line on how the basis was made; the report repeats it.

    Raises
    ------
    InputError
        Shapes, nan or inf, V or W of less than full column rank, W^T V singular.
    """

    def __init__(self, V: Any, W: Any = None, note: str = "user's own"):
        self.V = check_array("V", V, (None, None))
        _check_rank("V", self.V)
        self.note = note
        self.is_galerkin = W is None
        self.W = self.V
        if W is not None:
            self.W = check_array("W", W, self.V.shape)
            _check_rank("W", self.W)
            product = (self.W / np.linalg.norm(self.W, axis=0)).T @ (self.V / np.linalg.norm(self.V, axis=0))
            if np.linalg.svd(product, compute_uv=False)[-1] < DEPENDENT:
                raise InputError("W^T V is singular: some column of W sees nothing of V; choose another W")

    @property
    def n(self) -> int:
        """Number of reduced coordinates."""
        return self.V.shape[1]

    def restricted_to(self, body: ElasticBody) -> tuple[np.ndarray, np.ndarray]:
        """Return V and W on the body's free coordinates, or raise InputError if they do not fit the body."""
        if self.V.shape[0] != body.N:
            raise InputError(
                f"V has {self.V.shape[0]} rows; the body has N = {body.N} coordinates, fixed ones included"
            )
        V = body.space.coordinates("V", self.V)
        return V, V if self.is_galerkin else body.space.coordinates("W", self.W)


def modal_basis(body: ElasticBody, n: int) -> Basis:
    """Return the n lowest undamped modes, M-orthonormal.

    Raises
    ------
    InputError
        n out of range.
    """
    check_type("body", body, ElasticBody)
    return Basis(body.expand(body.modes(n).shapes), note=f"modal, {n} modes")


def krylov_basis(body: ElasticBody, inputs: Any, n: int, shifts: ArrayLike = (0.0,)) -> Basis:
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
    return m_orthonormal(body.M, factor.solve(B), lambda v: factor.solve(body.M @ v), n)


def _companion_chain(body: ElasticBody, B: np.ndarray, shift: float, n: int) -> np.ndarray:
    size = body.free.size
    solve = solve_with(body.K + shift * body.D + shift**2 * body.M)
    slope = 2 * shift * body.M + body.D

    def step(v):
        return np.concatenate([-solve(slope @ v[:size] + body.M @ v[size:]), v[:size]])

    start = np.vstack([solve(B), np.zeros_like(B)])
    return m_orthonormal(sp.block_diag([body.M, body.M]), start, step, n)[:size]


def gramian_basis(body: ElasticBody, inputs: Any, n: int, band: tuple[float, float]) -> Basis:
    """Return the n dominant directions of the frequency-limited position Gramian, M-orthonormal.

    P = (1/pi) int_band Re(X X^H) d omega, X = (K + i omega D - omega^2 M)^-1 B, by Gauss quadrature.

    Parameters
    ----------
    inputs : ndarray, (N, p)
    band : (float, float)
        (w_lo, w_hi) in rad/s, 0 <= w_lo < w_hi.

    Raises
    ------
    InputError
        band or n out of range; fewer than n directions respond in the band.
    AssumptionError
        An undamped body with a resonance inside the band.
    """
    check_type("body", body, ElasticBody)
    n = check_count("n", n, body.free.size, "free coordinates")
    B = body.space.loads(checked_inputs(inputs, body.N))
    lo, hi = check_array("band", band, (2,))
    if not 0 <= lo < hi:
        raise InputError(f"band={tuple(band)!r}; needed: 0 <= w_lo < w_hi in rad/s")
    snapshots = [np.sqrt(w) * _frequency_response(body, B, f) for f, w in _quadrature(body, float(lo), float(hi), n)]
    Z = np.hstack([part for X in snapshots for part in (X.real, X.imag)])
    V = m_orthonormal(body.M, Z)
    directions, size, _ = np.linalg.svd(V.T @ (body.M @ Z), full_matrices=False)
    responding = int(np.sum(size > DEFLATION * size[0]))
    if not 1 <= n <= responding:
        raise InputError(f"n={n} columns asked; {responding} directions respond in the band {band}: widen it")
    return Basis(body.expand(V @ directions[:, :n]), note=f"Gramian, {n} columns, band {lo:g}..{hi:g} rad/s")


def _quadrature(body: ElasticBody, lo: float, hi: float, n: int) -> list[tuple[float, float]]:
    """Frequencies and weights: Gauss nodes between resonances, drawn towards these (at least n/2 in all)."""
    if body.modal is not None:
        raise AssumptionError("gramian_basis takes no ratios by mode; take the body with rayleigh= alone")
    inside = min(count_below(body.M, body.K, hi), RESONANCES)
    omega = body.modes(inside).omega if inside else np.zeros(0)
    if body.D is None and np.any(omega >= lo):
        raise AssumptionError(
            f"the undamped body is in resonance at {omega[omega >= lo][0]:g} rad/s, inside the band: its Gramian is "
            "infinite: shift the band, or give the body damping"
        )
    edges = np.unique([lo, *omega[omega > lo], hi])
    x, weights = np.polynomial.legendre.leggauss(max(PER_INTERVAL, n // (2 * len(edges))))
    angle = np.pi / 4 * (x + 1)
    # over half an interval, from its middle to the resonance: distance (1 - sin)^2 resolves a peak of any width
    near, slope = (1 - np.sin(angle)) ** 2, np.pi / 2 * (1 - np.sin(angle)) * np.cos(angle)
    found = []
    for a, b in pairwise(edges.tolist()):
        half = (b - a) / 2
        found += [
            (end, half * w)
            for y, w in zip(near, slope * weights, strict=True)
            for end in (a + half * y, b - half * y)
        ]
    return found


def _frequency_response(body: ElasticBody, B: np.ndarray, frequency: float) -> np.ndarray:
    M = explicit(body.M)
    dynamic = (body.K - frequency**2 * M).astype(complex)
    if body.D is not None:
        D = body.D if body.rayleigh is None else damping_of(M, body.K, *body.rayleigh)
        dynamic = dynamic + 1j * frequency * D
    return solve_with(dynamic)(B.astype(complex))


def _check_rank(name: str, matrix: np.ndarray) -> None:
    if matrix.shape[1] == 0 or matrix.shape[1] > matrix.shape[0]:
        raise InputError(f"{name} has shape {matrix.shape}; needed: at least one column, no more than rows")
    length = np.linalg.norm(matrix, axis=0)
    if np.any(length == 0):
        raise InputError(f"{name} has a zero column ({int(np.argmin(length))}); remove it")
    triangle = np.abs(np.diag(la.qr(matrix / length, mode="r", pivoting=True)[0]))
    if triangle[-1] < DEPENDENT * triangle[0]:
        rank = int(np.sum(triangle >= DEPENDENT * triangle[0]))
        raise InputError(
            f"{name} of shape {matrix.shape} has rank {rank}, but {matrix.shape[1]} columns; remove the dependent "
            "ones. Its rows are the N coordinates of the body, fixed ones included"
        )
