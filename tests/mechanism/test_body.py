"""A floating body in closed form: its residual is a sum over nodes, its tangent the derivative of it."""

import numpy as np
import pytest
import scipy.linalg as la

from exudyn_romerr.mechanism.rotations import skew, times
from tests.helpers.small_body import SmallBody, on_its_screw

STEP = 1e-6  # of unknowns of size 1, both ways: leaves 1e-12 of curvature and 1e-10 of rounding


@pytest.fixture(params=[(0, (2, 4, 7)), (1, (3, 3, 6)), (2, (2, 5, 5))], ids=["kept", "no kept", "no oscillators"])
def small(request):
    return SmallBody(*request.param)


@pytest.mark.parametrize("is_wide", [False, True])
def test_the_residual_is_the_sum_over_nodes(small, is_wide):
    m = small.motion(count=small.body.k if is_wide else None)
    found, truth = small.body.residual(m), small.node_sums(m)
    np.testing.assert_allclose(found, truth, rtol=0, atol=1e-12 * np.abs(truth).max())


def in_axes_of(m, moved, F):
    """Forces and moments (T, 6 + k) of a moved body in axes of the body before."""
    turn = np.swapaxes(m.A, 1, 2) @ moved.A
    return np.concatenate([times(turn, F[:, :3]), times(turn, F[:, 3:6]), F[:, 6:]], axis=1)


def test_the_tangent_is_the_derivative_of_the_residual(small):
    """Rows of forces and moments turn with the body: what they turn by is no part of the tangent.

    Columns are in axes of the body: unit motions (A dr, A dphi, dc) in global ones.
    """
    body, m = small.body, small.motion()
    (M, D, K), coupling = body.tangent(m)
    F = body.residual(m)
    wide = [np.concatenate(pair, axis=2) for pair in zip((M, D, K), vars(coupling).values(), strict=False)]
    for order, X in zip((2, 1, 0), wide, strict=True):
        for j in range(6 + body.k):
            e = np.zeros((3, len(m.c), 6 + body.k))
            e[order, :, j] = STEP
            if j < 6:
                part = slice(0, 3) if j < 3 else slice(3, 6)
                e[order][:, part] = times(m.A, e[order][:, part])
            moved = [m.moved(*(sign * e)) for sign in (1, -1)]
            F_moved = [in_axes_of(m, x, body.residual(x)) for x in moved]
            column = (F_moved[0] - F_moved[1]) / (2 * STEP)
            if order == 0 and 3 <= j < 6:  # a force that turns with the body
                axis = np.eye(3)[j - 3]
                column[:, :3] -= np.cross(axis, F[:, :3])
                column[:, 3:6] -= np.cross(axis, F[:, 3:6])
            s = 6 + body.na
            np.testing.assert_allclose(column[:, :s], X[:, :, j], rtol=0, atol=1e-7 * max(1, np.abs(X).max()))


def test_what_oscillators_feel_is_the_derivative_of_their_rows(small):
    body, m = small.body, small.motion()
    _, coupling = body.tangent(m)
    for order, X in zip((2, 1, 0), (coupling.M, coupling.D_back, coupling.K_back), strict=True):
        for j in range(6 + body.na):
            e = np.zeros((3, len(m.c), 6 + body.k))
            e[order, :, j] = STEP
            if j < 6:
                part = slice(0, 3) if j < 3 else slice(3, 6)
                e[order][:, part] = times(m.A, e[order][:, part])
            rows = [body.residual(m.moved(*(sign * e)))[:, 6 + body.na :] for sign in (1, -1)]
            column = (rows[0] - rows[1]) / (2 * STEP)
            np.testing.assert_allclose(column, X[:, j], rtol=0, atol=1e-7 * max(1, np.abs(X).max(initial=0.0)))


def test_moved_motions_are_those_of_a_frame_on_its_screw():
    """Beside places found by scipy's expm, with their rates by differences."""
    small, dt = SmallBody(), 1e-4
    m, rng = small.motion(T=1), np.random.default_rng(5)
    e, e1, e2 = 0.3 * rng.normal(size=(3, 1, 6 + small.body.k))
    w, alpha, bent = (times(m.A, x)[0] for x in (m.w, m.alpha, m.b))  # r'' = A b

    def place(s):
        """Frame after time s, of a motion that has w, alpha, r'' now: axes, and origin less its own r and r'."""
        turn, shift = on_its_screw((e + s * e1 + s**2 / 2 * e2)[0])
        turned = la.expm(skew(s * w + s**2 / 2 * alpha)) @ m.A[0]
        return turn @ turned, s**2 / 2 * bent + shift

    (A0, r0), (A, r), (A2, r2) = (place(s) for s in (-dt, 0.0, dt))
    W, W1 = A.T @ (A2 - A0) / (2 * dt), A.T @ (A2 - 2 * A + A0) / dt**2
    found = m.moved(e, e1, e2)
    np.testing.assert_allclose(found.A[0], A, atol=1e-14)
    np.testing.assert_allclose(skew(found.w[0]), W, atol=1e-5)  # dt^2 w^3 / 6
    np.testing.assert_allclose(skew(found.alpha[0]) + W @ W, W1, atol=1e-5)
    np.testing.assert_allclose(found.b[0], A.T @ (r2 - 2 * r + r0) / dt**2, atol=1e-5)
