"""Exact motion under a sin(W t) from rest of bodies too large for the dense, extended precision of models/exact.py.

The forced motion of the full body is one sparse complex solve and holds all modes. Only the free motion that begins
with it is summed over modes; what is left out where not all of them are taken is bounded.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg, sparse
from scipy.sparse.linalg import splu

import exudyn_romerr as romerr
from exudyn_romerr.linalg import oscillator
from models.exact import ForcedModes


@dataclass(frozen=True)
class OutputMotion:
    """Outputs C q of a body that the load sin(W t) sets in motion from rest.

    free : free motion, rows (r, N) : C, forced (r,) : complex amplitudes of C q, remainder (r,) : bound of what the
    modes left out would add to the free motion.
    """

    free: ForcedModes
    rows: np.ndarray
    forced: np.ndarray
    remainder: np.ndarray

    def __call__(self, t: np.ndarray) -> np.ndarray:
        """Return C q at times t >= 0 (T,), as (T, r)."""
        return self.free.output(self.rows, t) + np.outer(np.exp(1j * self.free.W * t), self.forced).imag


def full_outputs(
    body: romerr.ElasticBody, inputs: np.ndarray, rows: np.ndarray, W: float, modes: int | None = None
) -> OutputMotion:
    """Return the exact outputs of the full body.

    Parameters
    ----------
    body : ElasticBody
        Rayleigh damping.
    inputs : ndarray, (N, 1)
    rows : ndarray, (r, N)
    W : float
        Angular frequency in rad/s, below that of the last mode taken.
    modes : int, optional
        Modes of the free motion; default: all, by a dense eigenproblem.

    Returns
    -------
    OutputMotion
    """
    found = body.modes(body.free.size if modes is None else modes)
    B, C = body.space.loads(inputs)[:, 0], body.space.rows(rows)
    load, zeta = found.shapes.T @ B, body.damping_ratios(found.omega)
    dynamic = sparse.csc_matrix(body.K - W**2 * body.M + 1j * W * body.D)
    modal = load / (found.omega**2 - W**2 + 2j * zeta * found.omega * W)
    shapes = body.expand(found.shapes)
    free = ForcedModes(found.omega, zeta, 0 * load, shapes, W, start=-modal.imag, start_t=-W * modal.real)
    return OutputMotion(free, rows, C @ splu(dynamic).solve(B.astype(complex)), _remainder(body, B, C, found, W))


def reduced_motion(body: romerr.ElasticBody, basis: romerr.Basis, inputs: np.ndarray, W: float) -> ForcedModes:
    """Return the exact solution of the reduced body, in reduced coordinates; basis: Galerkin, inputs (N, 1)."""
    V = basis.V[body.free]
    compliance, shapes = linalg.eigh(V.T @ (body.M @ V), V.T @ (body.K @ V))
    omega, shapes = 1 / np.sqrt(compliance), shapes / np.sqrt(compliance)
    zeta = oscillator.damping_ratios(omega, *body.require_rayleigh("closed-form solutions"))
    load = shapes.T @ (basis.V.T @ inputs[:, 0])
    return ForcedModes(omega, zeta, load, shapes, W, start=np.zeros(omega.size), start_t=np.zeros(omega.size))


def _remainder(body: romerr.ElasticBody, B: np.ndarray, C: np.ndarray, found, W: float) -> np.ndarray:
    """Bound (r,) of the free motion of the modes above those found.

    Each moves by at most its start displacement and its start velocity over omega, both shares of c_i b_i/omega_i^2;
    the sum of these follows from C K^-1 C^T and B^T K^-1 B less the parts of the modes found.
    """
    if found.omega.size == body.free.size:
        return np.zeros(len(C))
    solve, shapes = body.stiffness_factor.solve, found.shapes / found.omega
    left_B = B @ solve(B) - np.sum((shapes.T @ B) ** 2)
    left_C = np.sum(C * solve(C.T).T, axis=1) - np.sum((C @ shapes) ** 2, axis=1)
    alpha, beta = body.rayleigh
    far = 1 - (W / found.cut) ** 2
    share = W * (alpha / found.cut**2 + beta) / far**2 + W / found.cut / far
    return share * np.sqrt(np.maximum(left_B * left_C, 0.0))
