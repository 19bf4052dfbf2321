"""The round-off of an output: what rounding of the stiffness matrix' entries does to it."""

import numpy as np
import pytest

import exudyn_romerr as romerr
from models import exact, linkage, solid_bar

RELATIVE = 1e-8  # of every entry: large enough to measure, small enough to be linear


def static_report(body, basis, B, outputs):
    """One instant of the reduced body in static equilibrium under unit load."""
    V = basis.V
    q = np.linalg.solve(V.T @ (body.stiffness @ V), V.T @ B).T
    zero = np.zeros_like(q)
    return romerr.evaluate(body, basis, romerr.Trajectory([0.0], q, zero, zero, [1.0]), inputs=B, outputs=outputs)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("build", [linkage.build, lambda: solid_bar.build(0)], ids=["linkage", "solid"])
def test_perturbed_entries_move_the_output_by_less(build, seed):
    """Random relative changes of K's entries move C K^-1 B by at most the scaled round-off, and not by much less."""
    body, B, outputs = build()
    outputs = outputs if isinstance(outputs, list) else [outputs]
    report = static_report(body, romerr.krylov_basis(body, B, 3), B, outputs)
    signs = body.K.copy()
    signs.data = np.random.default_rng(seed).choice([-1.0, 1.0], signs.nnz)
    dK = body.K.multiply((signs + signs.T) / 2)
    u = body.stiffness_factor.solve(B[body.free])
    for out in outputs:
        C = out.resolve(body)[:, body.free]
        moved = RELATIVE * np.abs(C @ body.stiffness_factor.solve(dK @ u))
        allowed = RELATIVE / np.finfo(float).eps * report.output(out.name).round_off.T
        assert np.all(moved <= allowed)
        assert np.all(moved >= 1e-3 * allowed)  # signs at random cancel like the square root of their number


def test_report_says_at_round_off():
    """36 of 114 modes: the reduction error is below what rounding of the matrices does, and the report says so."""
    body, B, tip = linkage.build()
    basis = romerr.krylov_basis(body, B, 36)
    t = np.linspace(0, 0.05, 2001)
    W = 2 * np.pi * linkage.FREQUENCY
    q, q_t, q_tt = exact.reduced_solution(body, basis, B, linkage.AMPLITUDE, W).motion(t)
    traj = romerr.Trajectory(t, q, q_t, q_tt, linkage.force(t))
    options = {"inputs": B, "outputs": [tip], "time": "sampled", "auxiliary_modes": 60}
    assert "at round-off" in str(romerr.evaluate(body, basis, traj, **options))
    coarse = romerr.krylov_basis(body, B, 4)
    q, q_t, q_tt = exact.reduced_solution(body, coarse, B, linkage.AMPLITUDE, W).motion(t)
    traj = romerr.Trajectory(t, q, q_t, q_tt, linkage.force(t))
    assert "at round-off" not in str(romerr.evaluate(body, coarse, traj, **options))
