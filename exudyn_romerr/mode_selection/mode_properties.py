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
    missing (k, 2) : numbers of modes of the full body that the basis lacks, with the share of their mass; the
    frequencies of these (k,). missed : (number, rad/s, share of the strain energy missed in a run), largest first.
    """

    reduced: np.ndarray
    full: np.ndarray
    zeta: np.ndarray | None
    off: np.ndarray
    within: np.ndarray
    mainly: np.ndarray
    missing: np.ndarray
    missing_omega: np.ndarray
    missed: Sequence[tuple[int, float, float]] = ()


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
    else:
        inverse, shapes = (np.real(x) for x in la.eig(M, K))
    order = np.argsort(-inverse)
    shapes, reduced = shapes[:, order], 1 / np.sqrt(np.maximum(inverse[order], TINY))
    n = len(reduced)
    modes = body.modes(min(n + MORE, body.free.size))
    full, X, factor = modes.omega, modes.shapes, body.stiffness_factor
    left = np.linalg.norm(factor.half_solve(body.K @ X - (body.M @ X) * full**2), axis=0)
    within = (left / np.linalg.norm(factor.half_multiply(X), axis=0))[:n]
    energy = np.abs(shapes * (K @ shapes))
    zeta = None
    if D is not None:
        m, d = (np.einsum("ik,ij,jk->k", shapes, x, shapes) for x in (M, D))
        zeta = d / (2 * reduced * m)
    size = np.sqrt(np.einsum("ij,ij->j", V, body.M @ V))
    gram, seen = V.T @ (body.M @ V) / size / size[:, None], (V / size).T @ (body.M @ X)
    lacks = 1 - np.einsum("ik,ik->k", seen, la.solve(gram, seen, assume_a="pos"))
    missing = np.flatnonzero(lacks > MISSING)
    found = np.stack([missing, lacks[missing]], axis=1)
    off = reduced / full[:n] - 1
    return Frequencies(reduced, full[:n], zeta, off, within, energy.argmax(axis=0), found, full[missing])


def missed_modes(body: ElasticBody, count: int, P: np.ndarray, squares: np.ndarray) -> list[tuple[int, float, float]]:
    """Return (number, rad/s, share) of the lowest modes by their share of the strain energy of an error P x.

    P (n_free, m) : vectors beside the modes of the basis. squares (m, m) : sum of x x^T over the run.
    """
    modes = body.modes(min(count, body.free.size))
    seen = modes.shapes.T @ (body.M @ P)
    energy = modes.omega**2 * np.einsum("ki,ij,kj->k", seen, squares, seen)
    total = np.einsum("ij,ij->", P.T @ (body.K @ P), squares)
    order = np.argsort(-energy)
    return [(int(k), float(modes.omega[k]), float(energy[k] / total)) for k in order if energy[k] > LITTLE * total]
