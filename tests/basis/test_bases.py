"""Bases: modes, moment matching, the frequency-limited Gramian, the user's own."""

import numpy as np
import pytest
import scipy.linalg as la

from exudyn_romerr import AssumptionError, ElasticBody, InputError, gramian_basis, krylov_basis, modal_basis
from tests.helpers import tolerances as tol
from tests.helpers.bodies import model


def inputs_of(full, p=1, seed=0):
    return np.random.default_rng(seed).standard_normal((full.N, p))


def moments(M, D, K, B, shift, count):
    """Taylor coefficients X_j of (K + s D + s^2 M)^-1 B about s = shift."""
    factor = la.lu_factor(K + shift * D + shift**2 * M)
    found = [la.lu_solve(factor, B)]
    for _ in range(1, count):
        older = M @ found[-2] if len(found) > 1 else 0
        found.append(-la.lu_solve(factor, (2 * shift * M + D) @ found[-1] + older))
    return found


def gram(full, V):
    return V.T @ full.M @ V


MAKERS = {
    "modal": lambda full, B, n: modal_basis(full.body, n),
    "krylov": lambda full, B, n: krylov_basis(full.body, B, n, shifts=(0.0, 20.0)),
    "gramian": lambda full, B, n: gramian_basis(full.body, B, n, band=(0.0, 60.0)),
}


@pytest.mark.parametrize(
    ("maker", "damping"),
    [
        *((maker, damping) for maker in MAKERS for damping in ("under", "stiff", "matrix", "gyroscopic")),
        *((maker, "none") for maker in ("modal", "krylov")),
    ],
)
def test_columns_are_m_orthonormal(maker, damping):
    """V^T M V = I to rounding, also where Gram-Schmidt once would lose it."""
    full = model("pencil", damping, 0)
    basis = MAKERS[maker](full, inputs_of(full, 2), 6)
    assert basis.V.shape == (full.N, 6)
    assert np.max(np.abs(gram(full, basis.V) - np.eye(6))) < tol.ORTHONORMAL


@pytest.mark.parametrize("p", [1, 2])
@pytest.mark.parametrize("shifts", [(0.0,), (15.0,), (0.0, 30.0)])
@pytest.mark.parametrize("damping", ["none", "under", "overdamped", "matrix", "gyroscopic"])
def test_krylov_matches_moments(damping, shifts, p):
    """V times the reduced moments are the full ones: n / (p shifts) of them at every shift."""
    full = model("pencil", damping, 3)
    B, count = inputs_of(full, p), 2
    V = krylov_basis(full.body, B, count * p * len(shifts), shifts=shifts).V
    reduced = [V.T @ A @ V for A in (full.M, full.D, full.K)]
    for shift in shifts:
        wanted = moments(full.M, full.D, full.K, B, shift, count)
        for j, X in enumerate(moments(*reduced, V.T @ B, shift, count)):
            assert np.max(np.abs(V @ X - wanted[j])) <= tol.MOMENT * np.max(np.abs(wanted[j]))
    if damping == "gyroscopic":  # symmetric systems match twice as many seen from the input itself
        later = moments(full.M, full.D, full.K, B, shifts[0], 4)[3]
        missed = V @ moments(*reduced, V.T @ B, shifts[0], 4)[3] - later
        assert np.max(np.abs(missed)) > 1e3 * tol.MOMENT * np.max(np.abs(later))


@pytest.mark.parametrize("damping", ["none", "under"])
def test_krylov_notes_deflation(damping):
    """A load on two modes spans two columns; the note says how many were deflated."""
    full = model("pencil", damping, 5)
    shapes = full.modes[1]
    basis = krylov_basis(full.body, full.M @ (shapes[:, :1] + shapes[:, 1:2]), 5)
    assert basis.n == 2
    assert "3 of 5 deflated" in basis.note
    outside = basis.V - shapes[:, :2] @ (shapes[:, :2].T @ full.M @ basis.V)
    assert np.max(np.abs(outside)) < tol.DEFLATED
    assert "deflated" not in krylov_basis(full.body, inputs_of(full), 5).note


@pytest.mark.parametrize(
    ("band", "damping"),
    [
        *(((0.0, 2.5), damping) for damping in ("under", "critical", "stiff", "matrix", "gyroscopic")),
        *(((10.0, 70.0), damping) for damping in ("overdamped", "stiff")),
        *(((10.0, 70.0), damping) for damping in ("under", "matrix", "gyroscopic")),
    ],
)
def test_gramian_against_brute_force(band, damping):
    """The dominant directions of a Gramian summed over 20000 frequencies span the same space."""
    full = model("pencil", damping, 6)
    B, L = inputs_of(full, 2), la.cholesky(full.M, lower=True)
    values, vectors = la.eigh(L.T @ brute_force_gramian(full, B, band) @ L)
    gaps = values[-4:] / values[-5:-1]  # of 4, 3, 2, 1 directions: where it is wide, the space is well defined
    n = 4 - int(np.argmax(gaps))
    V = gramian_basis(full.body, B, n, band=band).V
    assert gaps.max() > 2
    assert np.max(la.subspace_angles(L.T @ V, vectors[:, -n:])) < tol.QUADRATURE


def brute_force_gramian(full, B, band):
    """(1/pi) int_band Re(X X^H) d omega by the midpoint rule."""
    step = (band[1] - band[0]) / 20000
    omega = (band[0] + step * (np.arange(20000) + 0.5))[:, None, None]
    X = np.linalg.solve(full.K + 1j * omega * full.D - omega**2 * full.M, B.astype(complex)[None])
    return np.einsum("wip,wjp->ij", X, X.conj()).real * step / np.pi


def test_gramian_refuses_more_directions_than_respond():
    """A load on two modes has two directions."""
    full = model("pencil", "under", 7)
    B = full.M @ full.modes[1][:, :2].sum(axis=1, keepdims=True)
    assert gramian_basis(full.body, B, 2, band=(0.0, 20.0)).n == 2
    with pytest.raises(InputError, match="widen"):
        gramian_basis(full.body, B, 5, band=(0.0, 20.0))


def test_gramian_in_resonance_is_refused():
    """An undamped body's Gramian is infinite over a band with a resonance; below and between them it is not."""
    body = ElasticBody(np.eye(2), np.diag([16.0, 400.0]))
    with pytest.raises(AssumptionError, match=r"resonance at 4 rad/s.*shift the band"):
        gramian_basis(body, np.ones((2, 1)), 1, band=(0.0, 10.0))
    for band in ((0.0, 3.0), (5.0, 15.0), (25.0, 30.0)):
        assert gramian_basis(body, np.ones((2, 1)), 2, band=band).n == 2


def test_bases_vanish_at_fixed_coordinates():
    """N rows, fixed ones zero, and the same columns as on the restricted body."""
    full = model("chain", "under", 9)
    M, K = (np.pad(A, (2, 0)) + np.diag([1.0] * 2 + [0.0] * full.N) for A in (full.M, full.K))
    body = ElasticBody(M, K, rayleigh=full.rayleigh, fixed=(0, 1))
    B = inputs_of(full)
    found = krylov_basis(body, np.vstack([np.ones((2, 1)), B]), 3).V
    assert np.all(found[:2] == 0)
    assert found[2:] == pytest.approx(krylov_basis(full.body, B, 3).V, rel=0, abs=tol.EIGEN)
