"""Floating bodies in closed form against sums over nodes, against differences, and C against NumPy."""

import numpy as np
import pytest

from exudyn_romerr.mechanism import body as module
from exudyn_romerr.mechanism.body import Body, Motion
from exudyn_romerr.mechanism.rotations import exponential, skew

NODES = 12
SHAPES = [(3, 5, 9, 7), (4, 6, 19, 4), (2, 2, 2, 5), (0, 0, 5, 3), (8, 14, 37, 1), (3, 4, 6, 0)]  # n, na, k, rows
compiled_only = pytest.mark.skipif(module.loops is None, reason="the compiled part is not installed")


def random_body(n, na, k, kind="consistent", seed=0):
    """Return a body, its masses of nodes, positions and shapes (nodes, 3, k)."""
    rng = np.random.default_rng(seed)
    L, Z = rng.normal(size=(NODES, NODES)), rng.normal(size=(3 * NODES, 3 * NODES))
    nodal = np.diag(rng.uniform(1, 2, NODES)) if kind == "lumped" else np.eye(NODES) + L @ L.T / NODES
    mass = Z.T @ Z / NODES if kind == "any" else np.kron(nodal, np.eye(3))
    x, U = rng.normal(size=(NODES, 3)), rng.normal(size=(3 * NODES, k))
    body = Body(None, (mass, Z @ Z.T), x, U, (n, na), lambda M, K: 0.3 * M + 0.1 * K, lambda t: np.zeros(3))
    return body, nodal, x, U.reshape(NODES, 3, k)


def random_motion(rows, j, seed=0):
    rng = np.random.default_rng(seed)
    A = exponential(rng.normal(size=(rows, 3)))
    return Motion(A, *rng.normal(size=(4, rows, 3)), *rng.normal(size=(3, rows, j)))


def results(body, motion, corrected, e):
    """All that the three functions return, as one list of arrays."""
    own, coupling = body.tangent(motion)
    moved = vars(motion.moved(*e)).values()
    return [*moved, body.residual(motion), body.residual(corrected), *own, *vars(coupling).values()]


def compare(found, right):
    for x, y in zip(found, right, strict=True):
        assert x.shape == y.shape
        assert np.abs(x - y).max(initial=0) <= 1e-12 * np.abs(y).max(initial=0)


@compiled_only
@pytest.mark.parametrize("kind", ["lumped", "consistent", "any"])
@pytest.mark.parametrize("sizes", SHAPES)
def test_loops_are_numpy(sizes, kind, monkeypatch):
    """Of any symmetric mass matrix, even if directions are coupled; arrays need not be contiguous."""
    n, na, k, rows = sizes
    for seed in range(2):
        body = random_body(n, na, k, kind, seed)[0]
        e = np.random.default_rng(seed).normal(size=(rows, 3, 6 + k)).swapaxes(0, 1)
        every = vars(random_motion(2 * rows, 2 * n, seed)[::2])
        motion = Motion(**{name: x[..., ::2] if name[0] == "c" else x for name, x in every.items()})
        given = body, motion, random_motion(rows, k, seed), e
        found = results(*given)
        with monkeypatch.context() as patch:
            patch.setattr(module, "loops", None)
            compare(found, results(*given))


@compiled_only
def test_subnormal_numbers_survive(monkeypatch):
    body, motion = random_body(3, 5, 9)[0], random_motion(4, 9)
    small = Motion(motion.A, *(1e-312 * x for x in [*vars(motion).values()][1:]))
    found = body.residual(small)
    monkeypatch.setattr(module, "loops", None)
    assert np.all(found != 0)
    assert np.abs(found - body.residual(small)).max() <= 1e-320


@compiled_only
def test_wrong_sizes_and_kinds_are_refused():
    body, motion = random_body(3, 5, 9)[0], random_motion(4, 3)
    e = np.zeros((4, 15))
    for wrong in (vars(motion) | {"c1": motion.c[:, :2]}, vars(motion) | {"w": motion.w[:3]}):
        for call in (body.residual, body.tangent, lambda m: m.moved(e, e, e)):
            with pytest.raises(ValueError, match="in place of"):
                call(Motion(**wrong))
    for call in (body.residual, body.tangent, lambda m: m.moved(e, e, e)):
        with pytest.raises(ValueError, match="negative"):
            call(random_motion(4, 10))
    given = [4, 3, 9, body.mass, *body._given(motion), np.empty((4, 15))]
    for i in range(4, len(given)):
        with pytest.raises(ValueError, match="in place of"):
            module.loops.body_residual(*given[:i], given[i].astype(np.float32), *given[i + 1 :])


@pytest.mark.parametrize("kind", ["lumped", "consistent"])
def test_residual_is_the_sum_over_nodes(kind):
    """Forces are masses times accelerations; weight acts at the undeformed mass centre."""
    for j in (3, 9):
        body, nodal, x, U = random_body(3, 5, 9, kind)
        m = random_motion(4, j)
        found = body.residual(m)
        for t in range(4):
            y, u1, u2 = x + U[..., :j] @ m.c[t], U[..., :j] @ m.c1[t], U[..., :j] @ m.c2[t]
            W = skew(m.w[t])
            f = nodal @ (m.b[t] + y @ (skew(m.alpha[t]) + W @ W).T + 2 * u1 @ W.T + u2)
            weights = nodal.sum(1)[:, None] * m.g[t]
            force, moment = (f - weights).sum(0), np.cross(y, f).sum(0) - np.cross(x, weights).sum(0)
            modal = np.einsum("ai,aik->k", f - weights, U)
            modal += m.c[t] @ body.K[:j] + m.c1[t] @ body.D[:j]
            right = np.concatenate([force, moment, modal])
            assert np.abs(found[t] - right).max() < 1e-12 * np.abs(right).max()


def differences(body, m, order):
    """Central differences of rows by e, e' or e'', (T, 6 + k, 6 + k): columns are (A^T dr, A^T dphi, dc)."""
    T, count, h, columns = len(m.c), 6 + body.k, 1e-5, []
    for i in range(count):
        unit = np.zeros((T, count))
        unit[:, i] = h
        if i < 6:
            own = slice(0, 3) if i < 3 else slice(3, 6)
            unit[:, own] = (m.A @ unit[:, own, None])[..., 0]
        e = [unit if o == order else np.zeros((T, count)) for o in range(3)]
        ahead, behind = (body.residual(m.moved(*(sign * x for x in e))) for sign in (1, -1))
        columns.append((ahead - behind) / (2 * h))
    return np.stack(columns, axis=2)


def test_tangent_is_the_derivative_of_residuals():
    """Of rows in axes that turn with the perturbed body, about its moved frame: of residuals as they are, not of E F.

    b and g turn against the body, b = A^T r'' and g = A^T g_0: columns of rotations have what forces they make. g is
    no part of b, for its moment is that of the undeformed body.
    """
    n, na = 3, 5
    for kind in ("lumped", "consistent"):
        body, m = random_body(n, na, 9, kind)[0], random_motion(4, n)
        (M, D, K), coupling = body.tangent(m)
        s = 6 + na
        pairs = [(M, coupling.M, coupling.M), (D, coupling.D, coupling.D_back), (K, coupling.K, coupling.K_back)]
        for order, (own, coupled, back) in zip((2, 1, 0), pairs, strict=True):
            right = differences(body, m, order)
            for found, part in ((own, right[:, :s, :s]), (coupled, right[:, :s, s:])):
                assert np.abs(found - part).max() < 1e-6 * np.abs(part).max()
            assert np.abs(back - right[:, s:, :s].swapaxes(1, 2)).max() < 1e-6 * np.abs(right).max()


def exact_rates(m, phi, phi1, phi2, time):
    """Return w (T, 3) of exp(phi~) A at a time near 0."""
    turned = m.A @ exponential(time * m.w + time**2 / 2 * m.alpha)
    globally = phi + time * phi1 + time**2 / 2 * phi2, phi1 + time * phi2
    w, (th, rate) = m.w + time * m.alpha, (np.einsum("tij,ti->tj", turned, x) for x in globally)
    rate = rate - np.cross(w, th)
    a = np.linalg.norm(th, axis=1)[:, None, None]
    right = np.eye(3) - (1 - np.cos(a)) / a**2 * skew(th) + (a - np.sin(a)) / a**3 * skew(th) @ skew(th)
    return np.einsum("tij,ti->tj", exponential(th), w) + np.einsum("tij,tj->ti", right, rate)


def test_moved_motions_are_right_to_second_order():
    """A, b, g are exact; errors of w and alpha fall by 8 where e is halved."""
    m, h = random_motion(5, 3), 1e-4
    rng = np.random.default_rng(1)
    e, e1, e2 = 0.1 * rng.normal(size=(3, 5, 6 + 4))
    errors = []
    for share in (1, 0.5, 0.25):
        moved = m.moved(share * e, share * e1, share * e2)
        turned = exponential(share * e[:, 3:6]) @ m.A
        assert np.abs(moved.A - turned).max() < 1e-14
        b = np.einsum("tij,ti->tj", turned, np.einsum("tij,tj->ti", m.A, m.b) + share * e2[:, :3])
        assert np.abs(moved.b - b).max() < 1e-13
        assert np.abs(moved.g - np.einsum("tij,ti->tj", turned, np.einsum("tij,tj->ti", m.A, m.g))).max() < 1e-13
        behind, now, ahead = (exact_rates(m, *(share * x[:, 3:6] for x in (e, e1, e2)), s * h) for s in (-1, 0, 1))
        errors.append([np.abs(moved.w - now).max(), np.abs(moved.alpha - (ahead - behind) / (2 * h)).max()])
    ratios = np.array(errors[:-1]) / np.array(errors[1:])
    assert np.all((6.5 < ratios) & (ratios < 9.5))


def test_shapes_of_moved_motions_are_sums():
    m, e = random_motion(5, 3), np.random.default_rng(2).normal(size=(3, 5, 10))
    moved = m.moved(*e)
    for found, own, more in zip((moved.c, moved.c1, moved.c2), (m.c, m.c1, m.c2), e, strict=True):
        assert np.array_equal(found[:, :3], own + more[:, 6:9])
        assert np.array_equal(found[:, 3:], more[:, 9:])
