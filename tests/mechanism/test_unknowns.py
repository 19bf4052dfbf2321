"""Unknowns beside coordinates: dq = J z both ways, with rates and accelerations, and finite motions."""

import numpy as np

from exudyn_romerr.mechanism.rotations import rotation_matrix
from tests.helpers.small_body import on_its_screw
from tests.helpers.small_mechanism import SmallMechanism


def moving(seed=0):
    mechanism = SmallMechanism(seed=seed)
    return mechanism.unknowns, mechanism.rows


def inverses(u, q, v, a):
    """H, H', H'' (3, T, n_a, n_q), column by column: of errors of coordinates, of rates, of accelerations."""
    H = np.zeros((3, len(q), u.n_a, u.n_q))
    e = np.zeros((len(q), 3, u.n_q, u.n_q))
    e[:, 0] = np.eye(u.n_q)
    H[:] = np.moveaxis(u.of_coordinates(q, v, a, e)[:, :, : u.n_a], 1, 0)
    return H


def test_one_way_and_back():
    """Of unknowns that the run has; frames are in axes of bodies on the one way, in global ones on the other."""
    u, rows = moving()
    J, H = u.jacobians(rows.q, rows.v, rows.a), inverses(u, rows.q, rows.v, rows.a)
    z = np.random.default_rng(1).normal(size=(len(rows), u.n_a))
    z[:, u.kept] = 0.0
    back = (H[0] @ (J[0] @ u.in_body_axes(z, rows.q)[..., None]))[..., 0]
    np.testing.assert_allclose(back, z, rtol=0, atol=1e-12)
    X = np.random.default_rng(2).normal(size=(len(rows), 4, u.n_a))
    X[..., u.kept] = 0.0
    np.testing.assert_allclose(u.by_coordinates(X, rows.q), X @ H[0], rtol=0, atol=1e-12)
    X = np.random.default_rng(2).normal(size=(len(rows), 4, u.n_q))
    np.testing.assert_allclose(u.by_unknowns(X, rows.q), X @ J[0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(u.in_global_axes(u.in_body_axes(z, rows.q), rows.q), z, rtol=0, atol=1e-13)


def test_finite_motions_begin_as_small_ones():
    u, rows = moving()
    z = np.random.default_rng(1).normal(size=(len(rows), u.n_a))
    J = u.jacobians(rows.q, rows.v, rows.a)[0]
    dq = (J @ u.in_body_axes(z, rows.q)[..., None])[..., 0]
    for share, within in ((1e-3, 1e-3), (1e-4, 1e-4)):  # the second order is a share of the first
        moved = u.moved([rows.q], [share * z])[0] - rows.q
        np.testing.assert_allclose(moved / share, dq, rtol=0, atol=5 * within * np.abs(dq).max())


def test_frames_move_along_their_screws():
    u, rows = moving()
    z = 0.1 * np.random.default_rng(1).normal(size=(len(rows), u.n_a))
    (moved,) = u.moved([rows.q], [z])
    places, turns = u.nodes[0].own[:3], u.nodes[0].own[3:]
    for i, (q, p) in enumerate(zip(rows.q, moved, strict=True)):
        A, shift = on_its_screw(z[i])
        np.testing.assert_allclose(p[places] - q[places], shift, atol=1e-12)
        before, after = (rotation_matrix(u.nodes[0].reference[3:] + x[turns]) for x in (q, p))
        np.testing.assert_allclose(after, A @ before, atol=1e-12)


def test_rates_of_jacobians_are_those_of_parameters():
    """J' is J of the rates in place of the parameters; with A held, as the rates of unknowns are in global axes."""
    u, rows = moving()
    _, J1, J2 = u.jacobians(rows.q, rows.v, rows.a)
    _, H1, H2 = inverses(u, rows.q, rows.v, rows.a)
    node = u.nodes[0]
    spin = node.shifts_and_turns[1]
    dt = 1e-6
    ahead, behind = (inverses(u, rows.q + s * rows.v, rows.v, rows.a)[0] for s in (dt, -dt))
    np.testing.assert_allclose((ahead - behind) / (2 * dt), H1, rtol=0, atol=1e-7 * np.abs(H1).max())
    assert np.abs(J1[:, node.own[3:], spin]).max() > 0
    assert not np.any([J1[:, node.own[:3]], J2[:, node.own[:3]]])
    assert np.abs(H2[:, spin]).max() > 0


def test_steps_move_nodes_alike():
    """A turn by a share, shapes by what moves a node by that share of the body."""
    u, _ = moving()
    body, steps = u.bodies[0], u.steps(1e-3)
    np.testing.assert_allclose(steps[u.turns], 1e-3)
    moved = np.abs(steps[u.blocks[0].start + 6 : u.blocks[0].stop] * body.largest[: body.na])
    np.testing.assert_allclose(moved, 1e-3 * body.size)
    assert steps.shape == (u.n,)
