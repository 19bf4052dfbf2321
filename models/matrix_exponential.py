"""Norms in any weight G and the matrix exponential: the paper's reference, for study only.

Everything else in the package works in the mass norm and avoids this: it costs minutes where kernels.py needs
microseconds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.linalg as la

from exudyn_romerr.checks import check_array, check_choice
from exudyn_romerr.errors import AssumptionError, InputError
from exudyn_romerr.linear.residual.residual import RESIDUALS, ResidualMap, make_norm
from exudyn_romerr.model.matrix_checks import checked_inputs

if TYPE_CHECKING:
    from collections.abc import Callable

    from exudyn_romerr.basis.basis import Basis
    from exudyn_romerr.linear.residual.residual import Coordinates
    from exudyn_romerr.model.body import ElasticBody

LIMIT = 500  # coordinates: a 1000 x 1000 exponential and four singular value problems per instant


@dataclass(frozen=True)
class FundamentalMatrixNorms:
    """Induced norms at times t (T,): the blocks Phi11, Phi12 (s), Phi21 (1/s), Phi22 and the whole Phi, each (T,)."""

    t: np.ndarray
    Phi11: np.ndarray
    Phi12: np.ndarray
    Phi21: np.ndarray
    Phi22: np.ndarray
    Phi: np.ndarray


def fundamental_matrix_norms(body: ElasticBody, t: Any, G: Any = None) -> FundamentalMatrixNorms:
    """Return the G-norms of Phi(t) = exp(A t) and of its blocks, A = [[0, I], [-M^-1 K, -M^-1 D]] (paper, 18).

    Parameters
    ----------
    t : (T,)
        Times in s, t >= 0.
    G : ndarray, (n_free, n_free), optional
        Symmetric positive definite weight on the free coordinates; default M. Both halves of the state use it.

    Raises
    ------
    InputError
        G not symmetric positive definite or of the wrong shape; negative times.
    AssumptionError
        More than 500 free coordinates.
    """
    n = body.free.size
    if n > LIMIT:
        raise AssumptionError(f"the matrix exponential of {n} coordinates was asked for; allowed up to {LIMIT}")
    t = check_array("t", t, (None,))
    if np.any(t < 0):
        raise InputError(f"t contains {t.min():g}; allowed: t >= 0")
    R = la.block_diag(*[weight_factor(body, G)] * 2)
    A = R @ _state_matrix(body) @ np.linalg.inv(R)  # in the coordinates where the G-norm is the 2-norm
    rows = np.array([_block_norms(la.expm(A * time), n) for time in t])
    return FundamentalMatrixNorms(t, *rows.T)


def residual_norm(
    body: ElasticBody, basis: Basis, inputs: Any, residual: str = "direct", G: Any = None
) -> tuple[Coordinates, Callable]:
    """Return the layout of z and the function z -> |Rt|_G, Rt = -M^-1 R (paper, 15, 33-35).

    Parameters
    ----------
    inputs : ndarray, (N, p), or None
    residual : {"direct", "expanded", "orthonormal"}
        Method 1, Method 2, or the orthonormal factor.
    G : ndarray, (n_free, n_free), optional
        Symmetric positive definite weight on the free coordinates; default M.

    Raises
    ------
    InputError
        G not symmetric positive definite or of the wrong shape; unknown way.
    """
    check_choice("residual", residual, RESIDUALS)
    V, B = basis.restricted_to(body)[0], body.space.loads(checked_inputs(inputs, body.N))
    map_ = ResidualMap(body, V, B, merged=residual != "expanded")
    return map_.coordinates, make_norm(residual, weight_factor(body, G) @ body.mass_factor.solve(map_.L))


def weight_factor(body: ElasticBody, G: Any = None) -> np.ndarray:
    """Return the upper triangle R of G = R^T R (default G = M), so that |z|_G = |R z|_2."""
    G = body.M.toarray() if G is None else check_array("G", G, body.M.shape)
    if np.abs(G - G.T).max() > 1e-12 * np.abs(G).max():
        raise InputError("G is not symmetric; norms need a symmetric positive definite weight")
    try:
        return la.cholesky(G)
    except la.LinAlgError as error:
        raise InputError("G is not positive definite; norms need a symmetric positive definite weight") from error


def _state_matrix(body: ElasticBody) -> np.ndarray:
    n = body.free.size
    D = np.zeros((n, n)) if body.D is None else body.D.toarray()
    lower = -body.mass_factor.solve(np.hstack([body.K.toarray(), D]))
    return np.vstack([np.hstack([np.zeros((n, n)), np.eye(n)]), lower])


def _block_norms(Phi: np.ndarray, n: int) -> list[float]:
    blocks = (Phi[:n, :n], Phi[:n, n:], Phi[n:, :n], Phi[n:, n:], Phi)
    return [float(np.linalg.norm(block, 2)) for block in blocks]
