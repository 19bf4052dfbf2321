"""Round-off: of the numbers that the input came in, and of the bounds themselves, which hold it."""

from functools import cache

import mpmath
import numpy as np
import pytest

import exudyn_romerr as romerr
from models import beam3d, exact, linkage, solid_bar

RELATIVE = 1e-8  # of every entry: large enough to measure, small enough to be linear
W = 2 * np.pi * linkage.FREQUENCY
T = np.linspace(0, 0.5, 401)
ALL = ("state-space", "fast", "convolution", "output-kernel", "energy", "auxiliary")
SINGLE = {"stiffness": "K", "mass": "M", "inputs": "B", "outputs": "C", "samples": "q"}


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


@cache
def true_tip():
    """The exact motion of the tip of the linkage, modes in extended precision."""
    body, B, tip = linkage.build()
    return exact.full_solution(body, B, linkage.AMPLITUDE, W).output(tip.resolve(body), T)


def exact_run(body, B, out, basis, single=(), **options):
    """Bounds of the exact reduced motion; what `single` names is rounded to 7 digits."""
    solution = exact.reduced_solution(body, basis, B, linkage.AMPLITUDE, W)
    q = [x.astype(np.float32) if "samples" in single else x for x in solution.motion(T)]
    rows = out.resolve(body)
    return romerr.evaluate(
        body,
        basis,
        romerr.Trajectory(T, *q),
        inputs=B.astype(np.float32) if "inputs" in single else B,
        outputs=[romerr.Output("tip z", rows.astype(np.float32) if "outputs" in single else rows)],
        input_function=linkage.force,
        **options,
    )


@pytest.mark.parametrize("n", [2, 4, 8, 12, 16, 20, 30, 60, 114])
def test_no_bound_is_below_the_error_not_even_by_rounding(n):
    """From 1e-4 m down to 1e-16 m, all estimators, no tolerance; near round-off the bound stops and says so."""
    body, B, out = linkage.build()
    basis = romerr.krylov_basis(body, B, n) if n < 60 else romerr.modal_basis(body, n)
    found = exact_run(body, B, out, basis, estimators=ALL, auxiliary_modes=60).compare("tip z", T, true_tip())
    for e, bound in found.bound.items():
        assert np.all(np.abs(found.error) <= bound), e
    # what interpolation over steps of 1.25 ms leaves above the 60 modes: measured 7.8e-10 m
    assert np.max(found.bound["best"]) < 1.1 * np.max(np.abs(found.error)) + 1e-9


@pytest.mark.parametrize("what", [*SINGLE, "all"])
def test_single_precision_is_taken_and_told(what):
    """Bounds are those of the numbers as they are; what their rounding has moved is within round_off."""
    names = tuple(SINGLE) if what == "all" else (what,)
    (M, K), options = linkage.matrices(), {"rayleigh": linkage.RAYLEIGH, "fixed": linkage.CLAMPED}
    M, K = (A.astype(np.float32) if name in names else A for name, A in (("mass", M), ("stiffness", K)))
    body = romerr.ElasticBody(M, K, positions=linkage.mesh()[0], **options)
    _, B, out = linkage.build()
    report = exact_run(body, B, out, romerr.krylov_basis(body, B, 8), single=names)
    found = report.compare("tip z", T, true_tip())
    assert np.all(np.abs(found.error) <= found.bound["best"] + found.round_off)
    assert ", ".join(name for name in ("mass", "stiffness", "inputs", "samples", "outputs") if name in names) in str(
        report
    )
    assert ("at round-off" in str(report)) == (what in ("stiffness", "all"))
    ours = exact_run(*linkage.build(), romerr.krylov_basis(linkage.build()[0], B, 8)).output("tip z")
    assert np.max(found.round_off) > 100 * np.max(ours.round_off)
    assert "16 digits" not in str(exact_run(*linkage.build(), romerr.krylov_basis(body, B, 8)))


def test_single_precision_that_spoils_the_stiffness_is_named():
    """The stiffness of a wire of 1 mm, rounded to 7 digits, is no longer positive definite."""
    nodes = np.outer(np.linspace(0, 1, 201), [1.0, 2.0, 3.0])
    elements = np.column_stack([np.arange(200), np.arange(1, 201)])
    M, K = beam3d.assemble(nodes, elements, beam3d.RoundSection(diameter=1e-3), beam3d.STEEL)
    assert romerr.ElasticBody(M, K, fixed=range(6)).N == 1206
    with pytest.raises(romerr.AssumptionError, match="single precision"):
        romerr.ElasticBody(M, K.astype(np.float32), fixed=range(6))


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


def test_bounds_at_nodes_hold_rounding_too():
    """A bending chain, all its modes kept, at rest in equilibrium: what is left of the error is rounding."""
    n = 20
    bend = np.diff(np.eye(n + 2), 2, axis=0)[:, 2:]
    stiffness = 1e8 * bend.T @ bend
    body = romerr.ElasticBody(np.eye(3 * n), np.kron(stiffness, np.eye(3)), positions=np.eye(n, 3))
    V = np.linalg.qr(np.random.default_rng(0).standard_normal((3 * n, 3 * n)))[0]
    load = np.eye(3 * n)[:, -1:]
    q = np.tile(np.linalg.solve(V.T @ (body.stiffness @ V), V.T @ load)[:, 0], (2, 1))
    traj = romerr.Trajectory([0.0, 1e-6], q, 0 * q, 0 * q, np.ones(2))
    report = romerr.evaluate(body, romerr.Basis(V), traj, inputs=load, initial="equilibrium")
    truth = mpmath.lu_solve(mpmath.matrix(stiffness.tolist()), mpmath.matrix([0] * (n - 1) + [1]))
    error = np.abs(np.array(truth.tolist(), dtype=float)[:, 0] - (V @ q[0])[2::3])
    assert error.max() > 0
    for e, bound in report.node_bound.items():
        assert np.all(error <= bound), e


def test_single_precision_of_damping_is_told():
    """Its entries are off by 6e-8: with the velocity, that is a force."""
    body = romerr.ElasticBody(np.eye(2), 4 * np.eye(2), damping=np.float32(0.1) * np.eye(2, dtype=np.float32))
    exact = romerr.ElasticBody(np.eye(2), 4 * np.eye(2), damping=0.1 * np.eye(2))
    one = np.ones((2, 1))
    found = []
    for each in (body, exact):
        report = romerr.evaluate(
            each,
            romerr.modal_basis(each, 1),
            romerr.Trajectory([0.0, 0.1], 0 * one, one, 0 * one),
            outputs=[romerr.Output("x", [1.0, 0.0])],
        )
        found.append((report.output("x").round_off.max(), any("damping came" in text for text in report.messages)))
    assert found[0][0] > 1e6 * found[1][0]
    assert [told for _, told in found] == [True, False]


def test_a_report_cannot_be_written_to_where_the_run_goes_on():
    """A change in place would be in the next report, and in the bounds of a run that continues."""
    body, B, out = linkage.build()
    report = exact_run(body, B, out, romerr.krylov_basis(body, B, 4))
    for array in (report.t, report.output("tip z").value, report.output("tip z").bound["energy"]):
        with pytest.raises(ValueError, match="read-only"):
            array *= 2.0
