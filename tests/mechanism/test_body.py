"""A floating body in closed form: its residual is a sum over nodes, its tangent the derivative of it."""

import numpy as np
import pytest

from exudyn_romerr.mechanism.rotations import exponential, times
from tests.helpers.small_body import SmallBody

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


def test_moved_motions_are_right_to_second_order():
    """Beside a motion that is turned exactly, with its rates by differences: errors are of the third order."""
    small = SmallBody()
    rng, dt = np.random.default_rng(5), 1e-4

    def turned(share):
        m = small.motion(T=1)
        e, e1, e2 = share * rng.normal(size=(3, 1, 6 + small.body.k))
        found = m.moved(e, e1, e2)
        places = []
        for s in (-dt, 0.0, dt):
            phi = e[:, 3:6] + s * e1[:, 3:6] + s**2 / 2 * e2[:, 3:6]
            own = m.A @ exponential(s * m.w + s**2 / 2 * m.alpha)
            places.append(exponential(phi) @ own)
        W = np.swapaxes(places[1], 1, 2) @ (places[2] - places[0]) / (2 * dt)
        w = np.stack([W[:, 2, 1], W[:, 0, 2], W[:, 1, 0]], axis=1)
        return np.abs(found.w - w).max()

    rng_state = rng.bit_generator.state
    coarse = turned(0.2)
    rng.bit_generator.state = rng_state
    fine = turned(0.1)
    assert coarse < 0.2**2
    assert fine < coarse / 6  # 8 but for what differences leave
