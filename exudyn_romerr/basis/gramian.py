"""gramian_basis: dominant directions of the frequency-limited position Gramian."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from ..checks import check_array, check_count, check_type
from ..errors import AssumptionError, InputError
from ..linalg.eigenmodes import count_below
from ..linalg.free_mass_matrix import damping_of, explicit
from ..linalg.orthogonalise import DEFLATION, m_orthonormal
from ..linalg.symmetric_factor import solve_with
from ..model.body import ElasticBody
from ..model.matrix_checks import checked_inputs
from .basis import Basis

PER_INTERVAL = 16  # quadrature nodes from the middle between two resonances to one of them
RESONANCES = 60  # at most so many are looked for in a band; higher ones are narrow for the nodes between them


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
    inside = min(count_below(body.M, body.K, hi, body.stiffness_factor.order), RESONANCES)
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
