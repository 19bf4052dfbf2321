"""What is known of the coordinates of a reduced body without any run: frequencies, effective masses, damping."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg as la

from ..model.body import ElasticBody

MISSING = 0.1  # of a mode's mass: one of which the basis lacks more is told to be missing
MORE = 6  # modes of the full body that are looked at beside as many as the basis has
LITTLE = 0.01  # of the strain energy that is missed: less is not told
TINY = np.finfo(float).tiny
Share = tuple[int, float, float]  # number of a mode from 0, rad/s, share


@dataclass(frozen=True)
class Coordinates:
    """Each of n coordinates alone: omega (n,) rad/s, zeta (n,), None: not known; mass (n, 3) by direction.

    mass : effective, as shares of the body's, of what a coordinate adds to those before it; None: not known.
    """

    omega: np.ndarray
    zeta: np.ndarray | None
    mass: np.ndarray | None


@dataclass(frozen=True)
class Frequencies:
    """Modes of the reduced body beside those of the full one, both as they are held in the frame, lowest first.

    reduced, full (n,) rad/s; zeta (n,) or None. off (n,) : reduced / full - 1; within (n,) : how far off that may be.
    mainly (n,) : the coordinate with the largest share of the mode's strain energy.
    missing : (number, rad/s, share of it) of modes of the full body that the basis lacks, lowest first.
    missed : (number, rad/s, share of the strain energy missed in a run), largest first.
    """

    reduced: np.ndarray
    full: np.ndarray
    zeta: np.ndarray | None
    off: np.ndarray
    within: np.ndarray
    mainly: np.ndarray
    missing: Sequence[Share]
    missed: Sequence[Share] = ()


def coordinates_of(
    V: np.ndarray, mass: Any, stiffness: Any, D: np.ndarray | None, directions: np.ndarray | None
) -> Coordinates:
    """Return what is known of coordinates, V (N, n).

    Parameters
    ----------
    mass, stiffness : (N, N)
    D : (n, n), of the reduced body; None: not known
    directions : (N, 3), unit translations; None: not known
    """
    carried = mass @ V
    m, k = (np.einsum("ij,ij->j", V, x) for x in (carried, stiffness @ V))
    omega = np.sqrt(np.maximum(k, 0.0) / m)
    zeta = None if D is None else np.diag(D) / np.maximum(2 * omega * m, TINY)
    share = None
    if directions is not None:
        size = np.sqrt(m)
        lower = la.cholesky(V.T @ carried / size / size[:, None], lower=True)
        total = np.einsum("ij,ij->j", directions, mass @ directions)
        share = la.solve_triangular(lower, (carried / size).T @ directions, lower=True) ** 2 / total
    return Coordinates(omega, zeta, share)


def frequencies_of(body: ElasticBody, V: np.ndarray, W: np.ndarray, D: np.ndarray | None) -> Frequencies:
    """Return frequencies of the body, held, and of its reduction by V, W (n_free, n).

    The full ones are proved: Sylvester's law of inertia finds none missed, and of a pair with theta = omega^2 there
    is an eigenvalue with |theta / lambda - 1| <= |K x - theta M x|_{K^-1} / |x|_K (Bauer and Fike's theorem for the
    symmetric K^-1/2 M K^-1/2).

    Raises
    ------
    AssumptionError
        A mode was missed.
    """
    M, K = W.T @ (body.M @ V), W.T @ (body.K @ V)
    if W is V:
        inverse, shapes = la.eigh(M, K)
        left = shapes
    else:
        inverse, left, shapes = (np.real(x) for x in la.eig(M, K, left=True))
    order = np.argsort(-inverse)
    left, shapes, reduced = left[:, order], shapes[:, order], 1 / np.sqrt(np.maximum(inverse[order], TINY))
    n = len(reduced)
    modes = body.modes(min(n + MORE, body.free.size))
    full, X = modes.omega, modes.shapes
    within = residual_share(body, X, full)[:n]
    energy = np.abs(shapes * (K @ shapes))
    zeta = None
    if D is not None:
        m, d = (np.einsum("ik,ij,jk->k", left, x, shapes) for x in (M, D))
        zeta = d / (2 * reduced * m)
    size = np.sqrt(np.einsum("ij,ij->j", V, body.M @ V))
    gram, seen = V.T @ (body.M @ V) / size / size[:, None], (V / size).T @ (body.M @ X)
    lacks = 1 - np.einsum("ik,ik->k", seen, la.solve(gram, seen, assume_a="pos"))
    missing = [(int(k), float(full[k]), float(lacks[k])) for k in np.flatnonzero(lacks > MISSING)]
    return Frequencies(reduced, full[:n], zeta, reduced / full[:n] - 1, within, energy.argmax(axis=0), missing)


def residual_share(body: ElasticBody, X: np.ndarray, omega: np.ndarray) -> np.ndarray:
    """Return |K x - omega^2 M x|_{K^-1} / |x|_K of columns of X (n_free, k)."""
    factor = body.stiffness_factor
    left = factor.half_solve(body.K @ X - (body.M @ X) * omega**2)
    return np.linalg.norm(left, axis=0) / np.linalg.norm(factor.half_multiply(X), axis=0)


def missed_modes(body: ElasticBody, count: int, P: np.ndarray, squares: np.ndarray) -> list[Share]:
    """Return (number, rad/s, share) of the lowest modes by their share of the strain energy of an error P x.

    P (n_free, m) : vectors beside the modes of the basis. squares (m, m) : sum of x x^T over the run.
    """
    modes = body.modes(min(count, body.free.size))
    seen = modes.shapes.T @ (body.M @ P)
    energy = modes.omega**2 * np.einsum("ki,ij,kj->k", seen, squares, seen)
    total = np.einsum("ij,ij->", P.T @ (body.K @ P), squares)
    order = np.argsort(-energy)
    return [(int(k), float(modes.omega[k]), float(energy[k] / total)) for k in order if energy[k] > LITTLE * total]
