"""Floating bodies in closed form: loops in C against NumPy."""

import numpy as np
import pytest

from exudyn_romerr.mechanism import body as module
from exudyn_romerr.mechanism.body import Body, Motion
from exudyn_romerr.mechanism.rotations import exponential

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
