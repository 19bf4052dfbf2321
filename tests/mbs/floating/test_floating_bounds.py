"""Total errors of floating bodies in Exudyn stay below their bounds; truths that use nothing of the package.

Scope "complete": the clamped bar, all its modes in closed form. Scope "inputs frozen": the full body, all its modes,
under frame motion, loads and wrenches of the reduced run, linear between samples.
"""

from dataclasses import dataclass
from functools import cache
from math import factorial

import numpy as np
import pytest
import scipy.linalg as la

import exudyn_romerr as romerr
from exudyn_romerr.linear.residual import modal_split as split
from exudyn_romerr.mbs.floating.moving_subject import MovingSubject
from models import estimate_truths, floating
from models.estimate_scenes import clamped_bar
from models.floating import GRAVITY, RAYLEIGH
from tests.helpers import tolerances as tol
from tests.helpers.observed import attached, observed
from tests.helpers.total_truth import Exact, signal

CRAIG_BAMPTON = [(kind, n) for kind in ("RBE2", "RBE3") for n in (0, 4, 16)]
STEP, END = 1e-4, 0.05  # s; 0.24 rad of the bar's first mode, 20 of its periods
RAMP = 0.01  # s, of floating.ramped_force
ESTIMATORS = ("energy", "auxiliary", "best")


@dataclass(frozen=True)
class Body:
    """Nodes x (N/3, 3), mass (N, N) and all modes P (N, m), M-orthonormal, that the conditions C_0 u = 0 leave.

    zeta (m,): their damping ratios.
    """

    x: np.ndarray
    M: np.ndarray
    omega: np.ndarray
    zeta: np.ndarray
    P: np.ndarray
    probes: dict[str, int]


@cache
def full_body(name, free=False):
    """Return the Body whose left face (or, free: all of it) has no mean motion."""
    fem = floating.load_fem(name)
    x, M, K = fem.GetNodePositionsAsArray(), fem.massMatrix.toarray(), fem.stiffnessMatrix.toarray()
    if free:  # C_0 u = Rg^T M u
        turns = [np.cross(axis, x).ravel() for axis in np.eye(3)]
        conditions = np.array([*np.tile(np.eye(3), len(x)), *turns]) @ M
    else:
        conditions = left_face(fem, x)
    Z = la.null_space(conditions)
    squares, modes = la.eigh(Z.T @ K @ Z, Z.T @ M @ Z)
    tip = int(floating.interface(fem, {"bar": "tip", "rotor": "rim"}[name])[0][0])
    inside = int(np.argmin(la.norm(x - x.mean(axis=0), axis=1)))
    omega = np.sqrt(squares)
    return Body(x, M, omega, rayleigh_ratios(omega), Z @ modes, {"tip": tip, "inside": inside})


def rayleigh_ratios(omega):
    return (RAYLEIGH[0] / omega + RAYLEIGH[1] * omega) / 2


def left_face(fem, x):
    """Conditions (6, N): sum w_i u_i = 0 and sum w_i (x_i - x_mean) x u_i = 0 over the left face."""
    nodes, weights = floating.interface(fem, "left")
    C = np.zeros((6, *x.shape))
    for node, arm, weight in zip(nodes, x[nodes] - weights @ x[nodes], weights, strict=True):
        C[:3, node] = weight * np.eye(3)
        C[3:, node] = weight * np.cross(arm, np.eye(3)).T
    return C.reshape(6, -1)


def outputs(body):
    """Displacements of a node at the tip and one inside, in body and in global axes; a velocity."""
    both = [
        romerr.node_displacement(f"{name} {frame}", node=node, frame=frame)
        for name, node in body.probes.items()
        for frame in ("body", "global")
    ]
    return [*both, romerr.node_velocity("velocity", node=body.probes["tip"], frame="global")]


def attached_to(scene, body, ratios=None, **options):
    flex = romerr.floating_body(scene.fem, scene.items, modal_damping=ratios)
    if ratios is not None:
        romerr.set_modal_damping(scene.mbs, flex)
    return romerr.attach(scene.mbs, flex, outputs=outputs(body), **options)


def assert_covered(error, bound, size):
    """Error (T, 3) below its bound at every time; size: of what the truth is as exact as."""
    assert error.shape == bound.shape
    assert np.all(error <= bound + tol.FULL_BODY * size)


# scope "complete"


def force_signal(ramping):
    """Gravity, then force in y and z: sines; (1 - cos(pi t/RAMP))/2 sin(b t), while it grows, is three of them."""
    bend = np.pi / RAMP
    sines = [
        pair
        for b in (400.0, 900.0)
        for pair in ([(100.0, b), (-50.0, b + bend), (-50.0, b - bend)] if ramping else [(200.0, b)])
    ]
    size, W = zip((0.0, 0.0), *sines, strict=True)
    start = np.zeros((1, len(size)))
    start[0, 0] = 1.0
    return signal(len(size), start=start, size=size, W=W)


def clamped_motion(X, t, ratios=None):
    """Exact motion (T, N) of the clamped bar on the columns X, from rest; ratios: of the modes X, else Rayleigh's."""
    fem = floating.load_fem("bar")
    M, K = (symmetric(X.T @ (matrix @ X)) for matrix in (fem.massMatrix, fem.stiffnessMatrix))
    exact = Exact(M, RAYLEIGH[0] * M + RAYLEIGH[1] * K, K, RAYLEIGH)
    if ratios is not None:
        exact.zeta, exact.D = ratios, np.diag(2 * ratios * exact.omega)
    nodes, weights = floating.interface(fem, "right")
    pull = np.zeros((len(X) // 3, 3, 3))
    pull[nodes] = weights[:, None, None] * np.eye(3)
    weight = fem.massMatrix @ np.tile(GRAVITY, len(X) // 3)
    y, z = (pull[:, :, axis].ravel() for axis in (1, 2))
    parts = (
        (True, [weight, y, y, y, z, z, z], t <= RAMP * (1 + 1e-9)),
        (False, [weight, y, z], t >= RAMP * (1 - 1e-9)),
    )
    state, found = np.zeros((2, len(M))), []
    for ramping, columns, when in parts:
        if not when.any():
            continue
        q, q_t = exact.motion(X.T @ np.column_stack(columns), force_signal(ramping), *state, t[when])
        state = q[-1], q_t[-1]
        found.append(q @ X.T)
    return np.vstack([found[0], *(motion[1:] for motion in found[1:])])


def symmetric(A):
    return (A + A.T) / 2


@cache
def clamped_truth(h=STEP, end=END):
    return clamped_motion(full_body("bar").P, h * np.arange(round(end / h) + 1))


@cache
def clamped_report(kind, n, modes):
    scene = floating.clamped_bar(n, kind, h=STEP, t_end=END)
    monitor = attached_to(scene, full_body("bar"), auxiliary_modes=modes)
    scene.solve()
    return monitor.report()


def clamped_errors(kind, n, modes):
    """(output's report, truth (T, 3)) of all displacements of the clamped bar; its frame stays in the global one."""
    report, truth = clamped_report(kind, n, modes), clamped_truth().reshape(round(END / STEP) + 1, -1, 3)
    assert set(report.scope.values()) == {"complete"}
    assert not report.messages
    for name, node in full_body("bar").probes.items():
        for frame in ("body", "global"):
            yield report.output(f"{name} {frame}"), truth[:, node]


@pytest.mark.parametrize("modes", [20, 40])
@pytest.mark.parametrize(("kind", "n"), CRAIG_BAMPTON)
def test_total_errors_of_the_clamped_bar_are_covered(kind, n, modes):
    """At every time, tip and inside, in the body's axes and in global ones; of corrected outputs, too."""
    for out, truth in clamped_errors(kind, n, modes):
        for e in ESTIMATORS:
            assert_covered(np.abs(truth - out.value), out.bound[e], np.max(np.abs(truth)))
        assert_covered(np.abs(truth - out.corrected), out.corrected_bound, np.max(np.abs(truth)))


@pytest.mark.parametrize(("kind", "n"), CRAIG_BAMPTON)
def test_bounds_of_the_clamped_bar_are_sharp(kind, n):
    """40 auxiliary modes, every component whose error is above 1e-4 of it."""
    compared = 0
    for out, truth in clamped_errors(kind, n, 40):
        error = np.max(np.abs(truth - out.value), axis=0)
        meant = error > 1e-4 * np.max(np.abs(truth), axis=0)
        assert np.all(np.max(out.bound["best"], axis=0)[meant] < tol.SHARP_BAR * error[meant])
        compared += meant.sum()
    assert compared == 12


def test_both_truths_of_the_clamped_bar_agree():
    """The complete basis in Exudyn: second order in the step, and 1e-3 of the motion away at a quarter of it."""
    tip, found, end = full_body("bar").probes["tip"], {}, RAMP / 2
    for h in (STEP, STEP / 4):
        scene = floating.clamped_bar(kind="complete", h=h, t_end=end)
        scene.solve()
        stored = scene.mbs.GetSensorStoredData(scene.sensors["tip local"])
        truth = clamped_truth(h, end)[:, 3 * tip : 3 * tip + 3]
        found[h] = np.max(np.abs(stored[:, 1:] - truth)) / np.max(np.abs(truth))
    assert found[STEP / 4] < 1e-3
    assert found[STEP] / found[STEP / 4] == pytest.approx(16, rel=0.2)


@pytest.mark.parametrize(("kind", "n"), [("RBE2", 0), ("RBE2", 4), ("RBE3", 0)])
def test_sampled_bounds_of_the_clamped_bar_cover_the_reduction_error(kind, n):
    """Full and reduced body exact in time; samples carry the run's time error: by that, "auxiliary" may be off."""
    h, end, body = STEP / 8, 0.02, full_body("bar")
    scene = floating.clamped_bar(n, kind, h=h, t_end=end)
    monitor = attached_to(scene, body, auxiliary_modes=40, time="sampled")
    scene.solve()
    report = monitor.report()
    full, reduced = clamped_truth(h, end), clamped_motion(scene.fem.modeBasis["matrix"], report.t)
    for name, node in body.probes.items():
        at, out = slice(3 * node, 3 * node + 3), report.output(f"{name} body")
        error, step = np.abs(full - reduced)[:, at], np.max(np.abs(reduced[:, at] - out.value))
        assert step < tol.CONVERGED * np.max(error)
        assert np.all(error <= out.reduction_bound["energy"])
        assert np.all(error <= out.reduction_bound["auxiliary"] + step)
        assert np.all(np.max(out.reduction_bound["best"], axis=0) < tol.SHARP_BAR * np.max(error, axis=0))


# scope "inputs frozen"


@dataclass(frozen=True)
class Recorded:
    """A reduced run: its report and samples; inputs u (T, p) multiply columns (N, p); r, A, w, al of the frame."""

    report: romerr.BoundReport
    t: np.ndarray
    u: np.ndarray
    q0: np.ndarray
    columns: np.ndarray
    r: np.ndarray
    r_t: np.ndarray
    A: np.ndarray
    w: np.ndarray
    al: np.ndarray


def recorded(scene, body, **options):
    """Solve the scene and keep what the monitor was given."""
    rows, subjects, original = [], [], MovingSubject.sampled

    def sampled(self, t, *states):
        found = original(self, t, *states)
        rows.append([np.array(x) for x in (t, found[0], found[3], found[4])])
        subjects.append(self)
        return found

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(MovingSubject, "sampled", sampled)
        monitor = attached_to(scene, body, scope="inputs frozen", **options)
        scene.solve()
        report = monitor.report()
    t, q, u, frame = (np.concatenate(parts) for parts in zip(*rows, strict=True))
    assert not q[0].any()
    columns, n = subjects[0]._sampler.terms.columns, q.shape[1]
    bare = np.r_[0:12, 12 + 9 * n : u.shape[1]]  # without the reduced body's own turning terms
    r, r_t, A, w, al, _ = np.split(frame, (3, 6, 15, 18, 21), axis=1)
    return Recorded(report, t, u[:, bare], q[0], columns[:, bare], r, r_t, A.reshape(-1, 3, 3), w, al)


def tilde(v):
    """V~ (..., 3, 3) with v~ x = v x x."""
    return np.cross(v[..., None, :], np.eye(3)).swapaxes(-1, -2)


def at_nodes(A, u):
    """A (T, 3, 3) applied to every node of u (T, N)."""
    return (u.reshape(len(u), -1, 3) @ A.swapaxes(1, 2)).reshape(u.shape)


def frozen_motion(run, body, fine=1):
    """U, u' (T, N) of the full body from rest: P^T of M (u'' + 2 w~ u' + S u) + D u' + K u = columns u(t).

    Inputs, w and S are linear between samples. The turning terms are cubics in every step, of 1/fine of a sample
    interval, through values and slopes of the motion found before; modal oscillators are then exact. Repeated until
    nothing changes.
    """
    omega, zeta, P, MP, steps = body.omega, body.zeta, body.P, body.M @ body.P, fine * (len(run.t) - 1)
    h = (run.t[-1] - run.t[0]) / steps
    between = np.arange(steps + 1) / fine
    left = np.minimum(between.astype(int), len(run.t) - 2)

    def linear(x):
        share = (between - left).reshape(-1, *np.ones(x.ndim - 1, dtype=int))
        return (1 - share) * x[left] + share * x[left + 1]

    S = tilde(run.al) + tilde(run.w) @ tilde(run.w)
    f, W, S = linear(run.u @ (P.T @ run.columns).T), 2 * linear(tilde(run.w)), linear(S)
    W_t, S_t = np.diff(W, axis=0) / h, np.diff(S, axis=0) / h
    step = oscillator_steps(omega, zeta, h)
    force = np.stack([f[:-1], np.diff(f, axis=0), 0 * f[1:], 0 * f[1:]])
    last = np.inf
    for _ in range(30):
        y, v = step(force)
        change, last = np.max(np.abs(v - last)) / np.max(np.abs(v)), v
        if change < 1e-12:
            return (y @ P.T)[::fine], (v @ P.T)[::fine]
        u, u_t = y @ P.T, v @ P.T
        c = -(at_nodes(W, u_t) + at_nodes(S, u)) @ MP
        u_tt = (f + c - 2 * zeta * omega * v - omega**2 * y) @ P.T
        c_t = at_nodes(W, u_tt) + at_nodes(S, u_t)
        slopes = [
            -h * (c_t[k] + at_nodes(W_t, u_t[k]) + at_nodes(S_t, u[k])) @ MP for k in (slice(-1), slice(1, None))
        ]
        dc = np.diff(c, axis=0)
        bent = slopes[0], 3 * dc - 2 * slopes[0] - slopes[1], slopes[0] + slopes[1] - 2 * dc
        force = np.stack([f[:-1] + c[:-1], np.diff(f, axis=0) + bent[0], *bent[1:]])
    raise AssertionError("the turning terms did not settle")


def oscillator_steps(omega, zeta, h):
    """Return F -> x, x' (S + 1, m) from rest; F (4, S, m) are coefficients of (s/h)^j of the forces in every step."""
    chain = np.zeros((len(omega), 6, 6))
    chain[:, 0, 1], chain[:, 1, 0], chain[:, 1, 1], chain[:, 1, 2] = omega * h, -omega * h, -2 * zeta * omega * h, h
    chain[:, [2, 3, 4], [3, 4, 5]] = 1.0
    whole = la.expm(chain)[:, :2]
    move, driven = np.moveaxis(whole[:, :, :2], 0, 2), whole[:, :, 2:] * [factorial(j) for j in range(4)]

    def step(F):
        added = np.einsum("mij,jsm->sim", driven, F)
        states = [np.zeros((2, len(omega)))]
        for more in added:
            x, v = states[-1]
            states.append(move[:, 0] * x + move[:, 1] * v + more)
        x, v = np.array(states).swapaxes(0, 1)
        return x / omega, v

    return step


SCENES = {
    "pendulum": (floating.pendulum, "bar", {"h": STEP, "t_end": 0.1}),
    "rotor": (floating.rotor, "rotor", {"h": STEP, "t_end": 0.05}),
}
FROZEN = [("pendulum", *case) for case in CRAIG_BAMPTON] + [("pendulum", "free", 12), ("rotor", "RBE3", 6)]


@cache
def frozen(name, kind, n):
    """Recorded run with 40 auxiliary modes, and the motion of the full body under its inputs."""
    make, body, times = SCENES[name]
    body = full_body(body, kind == "free")
    run = recorded(make(n, kind, **times), body, auxiliary_modes=40)
    return run, body, frozen_motion(run, body)


def frozen_errors(name, kind, n):
    """(output's report, truth (T, 3), largest elastic part of it) of every output, in the axes it is seen in."""
    run, body, (u, u_t) = frozen(name, kind, n)
    assert set(run.report.scope.values()) == {"inputs frozen"}
    assert not any("defect" in message for message in run.report.messages)
    for probe, node in body.probes.items():
        at, own = body.x[node], u[:, 3 * node : 3 * node + 3]
        seen = run.r + np.einsum("tij,tj->ti", run.A, at + own) - at
        yield run.report.output(f"{probe} body"), own, np.max(np.abs(own))
        yield run.report.output(f"{probe} global"), seen, np.max(np.abs(own))
    node = body.probes["tip"]
    own, rate = (x[:, 3 * node : 3 * node + 3] for x in (u, u_t))
    turned = np.cross(run.w, body.x[node] + own) + rate
    seen = run.r_t + np.einsum("tij,tj->ti", run.A, turned)
    yield run.report.output("velocity"), seen, np.max(np.abs(rate))


@pytest.mark.parametrize(("name", "kind", "n"), FROZEN)
def test_errors_under_frozen_inputs_are_covered(name, kind, n):
    """Displacements of a tip and a node inside, a velocity, in body and global axes, at every time; corrected too."""
    for out, truth, size in frozen_errors(name, kind, n):
        for e in ESTIMATORS:
            assert_covered(np.abs(truth - out.value), out.bound[e], size)
        assert_covered(np.abs(truth - out.corrected), out.corrected_bound, size)


@pytest.mark.parametrize(("name", "kind", "n"), FROZEN)
def test_bounds_under_frozen_inputs_are_sharp(name, kind, n):
    """Displacements in body axes, 40 auxiliary modes; the rotor is fast, and its bound counts what turning adds."""
    for out, truth, _ in frozen_errors(name, kind, n):
        if out.name.endswith("body"):
            error = np.max(np.abs(truth - out.value), axis=0)
            assert np.all(np.max(out.bound["best"], axis=0) < tol.SHARP_FROZEN[name] * error)


@pytest.mark.parametrize(
    "case", [("pendulum", "RBE2", 16), pytest.param(("rotor", "RBE3", 6), marks=pytest.mark.slow)]
)
def test_half_the_step_does_not_change_the_full_motion(case):
    run, body, (u, u_t) = frozen(*case)
    for found, wanted in zip((u, u_t), frozen_motion(run, body, fine=2), strict=True):
        assert np.max(np.abs(found - wanted)) < tol.FULL_BODY * np.max(np.abs(wanted))


def test_the_full_motion_is_that_of_a_complete_basis():
    """A pendulum with all modes in Exudyn has no reduction error: what is left falls with the step squared."""
    found = []
    for h in (2 * STEP, STEP):
        scene, body = floating.pendulum(kind="complete", h=h, t_end=0.01), full_body("bar")
        run = recorded(scene, body, estimators="energy")
        out, node = run.report.output("tip body"), body.probes["tip"]
        u = frozen_motion(run, body)[0][:, 3 * node : 3 * node + 3]
        found.append(np.max(np.abs(u - out.value)) / np.max(np.abs(u)))
    assert found[1] < 1e-2
    assert 2.5 < found[0] / found[1] < 6  # 4, but for modes that no step resolves


@cache
def finely_stepped(n, **options):
    """The clamped bar with n eigenmodes in 200 steps of 1 us, its tip compared with the exact motion."""
    scene, tip = floating.clamped_bar(n, h=1e-6, t_end=2e-4), full_body("bar").probes["tip"]
    report = observed(scene, outputs=[romerr.node_displacement("tip", node=tip)], **options)
    u = clamped_motion(full_body("bar").P, report.t).reshape(len(report.t), -1, 3)[:, tip]
    return report, report.compare("tip", report.t, u)


def test_more_modes_do_not_make_the_bound_larger():
    """Short steps ring in all of the basis, and "auto" follows: bound / error was 91 with 80 modes, 222 with 120."""
    bounds = [finely_stepped(n)[1].bound["best"].max(axis=0) for n in (40, 80, 120)]
    assert np.all(np.diff(bounds, axis=0) < 0)
    for n in (80, 120):
        out = finely_stepped(n)[1]
        assert np.all(np.abs(out.error) <= out.bound["best"] + out.round_off)
        assert out.effectivity["best"].max() <= 15  # measured 7.9 and 11.6, along the bar


def test_as_many_auxiliary_modes_as_the_reduced_body_rings_in():
    """Counted among all modes of the bar; 60 where that is enough."""
    for n in (4, 40):
        report, _ = finely_stepped(n)
        M, K = (x.toarray() for x in (floating.load_fem("bar").massMatrix, floating.load_fem("bar").stiffnessMatrix))
        scene = floating.clamped_bar(n)
        V = scene.fem.modeBasis["matrix"]
        highest = np.sqrt(la.eigh(V.T @ K @ V, V.T @ M @ V, eigvals_only=True)[-1])
        expected = max(60, int(np.sum(full_body("bar").omega < highest)))
        assert f"{expected} modes up to" in str(report.plan)
        assert report.messages == []


def test_the_report_says_where_more_ring_than_are_followed(monkeypatch):
    monkeypatch.setattr(split, "LARGEST_CAP", 80)
    scene = floating.clamped_bar(80, t_end=1e-3)
    report = observed(scene, outputs=[romerr.node_displacement("tip", node=20)])
    said = [message for message in report.messages if "rings in 94 modes of the full one" in message]
    assert len(said) == 1
    assert "auxiliary_modes=94 follows all" in said[0]
    assert "80 modes up to" in str(report.plan)


def test_bound_holds_from_the_start_where_the_solver_leaves_accelerations_out():
    """Its first step is wrong then, by several times what it is otherwise."""
    scene = clamped_bar(4, "RBE3", 2e-4, 0.04)
    tip = romerr.node_displacement("tip", node=int(floating.interface(scene.fem, "tip")[0][0]))
    monitor = attached(scene, outputs=[tip])
    scene.settings.timeIntegration.generalizedAlpha.computeInitialAccelerations = False
    scene.solve()
    report, truth = monitor.report(), estimate_truths.stored("clamped_bar")["tip local"]
    out = report.output("tip")
    error = np.abs(truth.value - out.value)
    assert report.t[0] == 0.0
    assert error[1].max() > 5 * np.abs(truth.value - truth.same_steps)[1].max()
    assert (error <= out.bound["best"] + out.round_off + truth.off).all()
    signed = truth.value - out.value
    assert (np.abs(signed - out.estimate) <= out.uncertainty + out.round_off + truth.off).all()
