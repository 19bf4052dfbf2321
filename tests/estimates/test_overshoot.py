"""Overshoot of generalised-alpha at a sudden start, against Exudyn; the mass norms of the free body that carry it."""

import exudyn as exu
import numpy as np
import pytest
from exudyn.itemInterface import NodeGenericODE2, ObjectGenericODE2

import exudyn_romerr as romerr
from exudyn_romerr.estimates import overshoot
from exudyn_romerr.estimates.overshoot import Overshoot, overshoots
from exudyn_romerr.model.admissible_space import rigid_modes
from exudyn_romerr.residual.free_mass import FreeInterfaces, FreeMass
from exudyn_romerr.trajectory.scheme import Scheme
from models import floating
from models.hex_bar import hex_bar

H, STEPS = 1e-3, 40
OMEGA = np.geomspace(3e2, 1e8, 150)  # rad/s, others than those that are looked at
ROUNDING = 1e-6  # of the exact bound: what Exudyn's numbers leave of it at omega h = 1e5
DAMPINGS = [(0.0, 2e-4), (0.0, 1e-5), (5.0, 0.0), (2.0, 1e-5)]


def motion(radius, alpha, beta, begin=0.0):
    """By Exudyn: x, x' (STEPS, all) of x'' + (alpha + beta omega^2) x' + omega^2 x = 1 from begin on."""
    mbs, n = exu.SystemContainer().AddSystem(), len(OMEGA)
    none = [0.0] * n
    rest = {"referenceCoordinates": none, "initialCoordinates": none, "initialCoordinates_t": none}
    node = mbs.AddNode(NodeGenericODE2(numberOfODE2Coordinates=n, **rest))
    mbs.AddObject(
        ObjectGenericODE2(
            nodeNumbers=[node],
            massMatrix=np.eye(n),
            stiffnessMatrix=np.diag(OMEGA**2),
            dampingMatrix=np.diag(alpha + beta * OMEGA**2),
            forceUserFunction=lambda mbs, t, item, q, q_t: np.full(n, float(t >= begin)),
        )
    )
    mbs.Assemble()
    settings, rows = floating.solver_settings(H, STEPS * H), []
    settings.timeIntegration.generalizedAlpha.spectralRadius = radius

    def take(mbs, t):
        rows.append([mbs.systemData.GetODE2Coordinates(), mbs.systemData.GetODE2Coordinates_t()])
        return True

    mbs.SetPostStepUserFunction(take)
    mbs.SolveDynamic(settings)
    return np.array(rows[1:]).swapaxes(0, 1)


def found(radius, *dampings):
    """E and F (STEPS, 2), in two blocks."""
    one, t = Overshoot(Scheme.of_radius(radius), 0.0, dampings), H * np.arange(1, STEPS + 1)
    return np.vstack([one.advance(t[:7]), one.advance(t[7:])])


@pytest.mark.parametrize("radius", [0.0, 0.6, 0.9])
@pytest.mark.parametrize("damping", DAMPINGS)
def test_what_exudyn_makes_of_a_sudden_start_is_bounded_and_reached(radius, damping):
    x, x_t = motion(radius, *damping)
    E, F = found(radius, damping).T[..., None]
    more = np.abs(x - 1 / OMEGA**2) - (1 + ROUNDING) / OMEGA**2
    more_t = np.abs(x_t) - (1 + ROUNDING) / OMEGA
    assert np.all(more <= E * (1 + 1e-3))  # 16 omega a decade are looked at: so much between them
    assert np.all(more_t <= F * (1 + 1e-3))
    assert more_t[0].max() > (0.7 if damping[1] else 0.95) * F[0, 0] > 0  # F is that of no damping
    if damping[1]:
        assert more[:3].max() > 0.9 * E[:3].max() > 0


@pytest.mark.parametrize("radius", [0.0, 0.6, 0.9, 1.0])
@pytest.mark.parametrize("damping", DAMPINGS)
def test_what_begins_within_the_run_does_not_overshoot(radius, damping):
    x, x_t = motion(radius, *damping, begin=2.5 * H)
    assert np.all(np.abs(x[2:] - 1 / OMEGA**2) <= (1 + ROUNDING) / OMEGA**2)
    assert np.all(np.abs(x_t[2:]) <= (1 + ROUNDING) / OMEGA)


def test_no_overshoot_without_numerical_damping():
    assert not overshoots(Scheme.of_radius(1.0))
    assert not overshoots(Scheme(0.0, 0.0, 0.25, 0.5))
    assert all(overshoots(Scheme.of_radius(radius)) for radius in (0.0, 0.5, 0.99))
    x, x_t = motion(1.0, *DAMPINGS[0])
    assert np.all(np.abs(x - 1 / OMEGA**2) <= (1 + ROUNDING) / OMEGA**2)
    assert np.all(np.abs(x_t) <= (1 + ROUNDING) / OMEGA)


def test_it_ends_and_is_looked_at_no_longer(monkeypatch):
    one = Overshoot(Scheme.of_radius(0.6), 0.0, [(0.0, 2e-4)])
    first = one.advance(H * np.arange(1, 201))
    last = int(np.flatnonzero(first.any(axis=1))[-1])
    assert 4 < last < 100
    monkeypatch.setattr(overshoot, "LOWEST", None)  # nothing begins again
    assert not one.advance(H * np.arange(201, 400)).any()


@pytest.mark.parametrize("held", ["nodes", "mean motion"])
def test_mass_norms_are_those_of_the_free_body(held):
    fem = hex_bar(2, (0.5, 0.03, 0.04), (2e9, 1500.0, 0.3))
    x = fem.GetNodePositionsAsArray()
    end = np.flatnonzero(x[:, 0] == x[:, 0].min())
    if held == "nodes":  # the end is rigid
        body = romerr.ElasticBody.from_fem(fem, fixed=(3 * end[:, None] + np.arange(3)).ravel())
    else:
        body = romerr.ElasticBody.from_fem(fem, reference=romerr.mean_motion(end))
    M, Rg, rng = body.mass.toarray(), rigid_modes(x), np.random.default_rng(3)
    X = np.hstack([body.expand(np.eye(body.free.size)), Rg])
    inverse = X @ np.linalg.solve(X.T @ M @ X, X.T)
    loads = rng.standard_normal((body.N, 4))
    loads -= M @ Rg @ np.linalg.solve(Rg.T @ M @ Rg, Rg.T @ loads)  # they balance
    exact = np.sqrt(np.sum(loads * (inverse @ loads), axis=0))
    assert FreeMass(body).norms(body.space.loads(loads)) == pytest.approx(exact, rel=1e-9)
    rows = rng.standard_normal((3, body.N))
    assert FreeMass(body).gram(rows) == pytest.approx(rows @ inverse @ rows.T, rel=1e-9)


def test_accelerations_of_a_start_are_those_that_any_joints_leave():
    """|a|_K of M a = -R - F w is at most what FreeInterfaces tells, and its parts are exact."""
    fem = hex_bar(2, (0.5, 0.03, 0.04), (2e9, 1500.0, 0.3))
    x = fem.GetNodePositionsAsArray()
    end, far = (np.flatnonzero(x[:, 0] == side) for side in (x[:, 0].min(), x[:, 0].max()))
    body = romerr.ElasticBody.from_fem(fem, reference=romerr.mean_motion(end))
    M, K = body.mass.toarray(), fem.GetStiffnessMatrix(sparse=True).toarray()
    F = np.hstack([romerr.mean_motion(nodes).motion_rows(x).T for nodes in (far, end)])
    Rg, rng = rigid_modes(x), np.random.default_rng(3)
    found = FreeInterfaces(body, FreeMass(body), body.space.loads(F[:, :6]))
    inverse = np.linalg.inv(M)
    values = np.linalg.eigvals(np.linalg.solve(F.T @ inverse @ F, F.T @ inverse @ K @ inverse @ F))
    assert found.steepest == pytest.approx(np.sqrt(values.real.max()), rel=1e-6)
    shares = []
    for seed in range(20):
        R = rng.standard_normal(body.N) if seed % 2 else F @ rng.standard_normal(12)
        R -= M @ Rg @ np.linalg.solve(Rg.T @ M @ Rg, Rg.T @ R)
        own, joined = found.split(body.space.loads(R[:, None])[:, 0])
        w = np.linalg.solve(F.T @ inverse @ F, F.T @ inverse @ R)
        rest = inverse @ (R - F @ w)
        assert own == pytest.approx(np.sqrt(max(rest @ K @ rest, 0)), rel=1e-6, abs=1e-6 * found.steepest * joined)
        assert joined == pytest.approx(np.sqrt(w @ F.T @ inverse @ F @ w), rel=1e-6)
        held = F @ rng.standard_normal((12, 3))  # what ideal joints hold, whatever else is joined
        G = held.T @ inverse @ held
        a = inverse @ (R - held @ np.linalg.solve(G, held.T @ inverse @ R))
        shares.append(np.sqrt(a @ K @ a) / (own + found.steepest * joined))
    assert 0.1 < max(shares) <= 1


def test_motion_relative_to_the_frame_is_bounded():
    fem = hex_bar(2, (0.5, 0.03, 0.04), (2e9, 1500.0, 0.3))
    x = fem.GetNodePositionsAsArray()
    end = np.flatnonzero(x[:, 0] == x[:, 0].min())
    body = romerr.ElasticBody.from_fem(fem, reference=romerr.mean_motion(end))
    M, Rg, held = body.mass.toarray(), rigid_modes(x), romerr.mean_motion(end).rows(x)
    pi = np.eye(body.N) - Rg @ np.linalg.solve(held @ Rg, held)
    L = np.linalg.cholesky(M)
    exact = np.linalg.norm(L.T @ pi @ np.linalg.inv(L.T), 2)
    assert exact <= FreeMass(body).relative <= 1.01 + exact
