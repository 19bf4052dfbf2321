"""A body whose frame a function of time drives: bounds of scope "complete" hold for the motion of that function.

Truth: the full body, all modes, under exactly prescribed motion of its frame (derivatives by hand), integrated by an
explicit method of order 8 to 1e-11. It uses nothing of the package but models/.
"""

from functools import cache
from itertools import pairwise

import numpy as np
import pytest
import tolerances as tol
from scipy.integrate import solve_ivp

import exudyn_romerr as romerr
from exudyn_romerr import prescribed
from exudyn_romerr.prescribed import resolved
from models import floating, hex_bar

END = 0.04  # s
SENSORS = ("displacement", "position", "velocity", "displacement local", "velocity local")
FORCE = np.array([0.0, 5.0, -3.0])  # N, times sin(60 t)^2
WEIGHT = (0.0, 3.0, -9.81)  # m/s^2


def fourth(rate, size):
    """Size sin(rate t)^4 and its first two derivatives: smooth from rest."""

    def motion(t):
        s, c = np.sin(rate * t), np.cos(rate * t)
        return size * np.array([s**4, 4 * rate * s**3 * c, 4 * rate**2 * (3 * s**2 * c**2 - s**4)])

    return motion


def stopped(t):
    """Part of a cosine that ends inside a step: accelerations jump at its beginning and at its end."""
    angle, goes = 200.0 * min(t, 0.0163), t < 0.0163
    return 0.01 * np.array([1 - np.cos(angle), goes * 200 * np.sin(angle), goes * 4e4 * np.cos(angle)])


MOTIONS = {
    "turns": {4: fourth(30.0, 0.1)},
    "shifts": {2: fourth(30.0, 0.02)},
    "tumbles": {0: fourth(30.0, 0.02), 3: fourth(25.0, 0.4), 4: fourth(30.0, -0.3), 5: fourth(40.0, 0.6)},
    "turns round": {4: fourth(20.0, 12.5)},
    "stops": {2: stopped},
}


def offsets(name):
    """F(t), f'(t), f''(t) side by side (3, 6)."""
    parts = MOTIONS[name]

    def motion(t):
        found = np.zeros((3, 6))
        for axis, part in parts.items():
            found[:, axis] = part(t)
        return found

    return motion


UNITS = np.cross(np.eye(3)[:, None], np.eye(3)).swapaxes(1, 2)  # e~ of the three axes


def rotation(angles):
    """Rx Ry Rz of angles and their derivatives (3, 3), with its first two derivatives."""
    A = np.eye(3), np.zeros((3, 3)), np.zeros((3, 3))
    for axis in range(3):
        e, (a, a_t, a_tt) = UNITS[axis], angles[:, axis]
        R = np.eye(3) + np.sin(a) * e + (1 - np.cos(a)) * e @ e
        B = R, a_t * R @ e, R @ (a_t**2 * e @ e + a_tt * e)
        A = A[0] @ B[0], A[1] @ B[0] + A[0] @ B[1], A[2] @ B[0] + 2 * A[1] @ B[1] + A[0] @ B[2]
    return A


class FullBody:
    """All modes of the bar in a frame that moves as prescribed; joint: its left face, at `hinge`."""

    def __init__(self, name, back=False, weight=(0.0, 0.0, 0.0), force=0.0):
        fem = hex_bar.load_fem()
        floating.reduce(fem, 0, "complete")
        self.P, M = fem.modeBasis["matrix"], fem.massMatrix.toarray()
        self.omega, self.PM = np.sqrt(fem.eigenValues), self.P.T @ M
        self.zeta2 = floating.RAYLEIGH[0] + floating.RAYLEIGH[1] * self.omega**2
        self.x = fem.GetNodePositionsAsArray()
        nodes, weights = floating.interface(fem, "left")
        self.hinge = weights @ self.x[nodes]
        nodes, weights = floating.interface(fem, "right")
        self.pull = np.einsum("i,ijm->jm", weights, self.P.reshape(-1, 3, len(self.omega))[nodes])
        self.offsets, self.back, self.weight, self.force = offsets(name), back, np.array(weight), force

    def frame(self, t):
        """R, r', r'' of the origin, and A, A', A''."""
        f, sign = self.offsets(t), -1 if self.back else 1
        A = rotation(f[:, 3:])
        A = tuple(x.T for x in A) if self.back else A
        place = np.array([self.hinge, 0 * self.hinge, 0 * self.hinge]) + sign * f[:, :3]
        return [p - x @ self.hinge for p, x in zip(place, A, strict=True)], A

    def slope(self, t, y):
        q, q_t = np.split(y, 2)
        (*_, r_tt), (A, A_t, A_tt) = self.frame(t)
        u, u_t = ((self.P @ x).reshape(-1, 3) for x in (q, q_t))
        a = A.T @ (r_tt - self.weight) + (self.x + u) @ (A.T @ A_tt).T + 2 * u_t @ (A.T @ A_t).T
        load = self.pull.T @ (A.T @ FORCE) * self.force * np.sin(60 * t) ** 2
        return np.concatenate([q_t, load - self.PM @ a.ravel() - self.zeta2 * q_t - self.omega**2 * q])

    def motion(self, t, breaks=()):
        """What the sensors show at times t (T,), sensor -> (T, 3)."""
        y, edges = np.zeros((len(t), 2 * len(self.omega))), [0.0, *breaks, t[-1]]
        state = y[0]
        for first, last in pairwise(edges):
            inside = (t > first) & (t <= last)
            at = np.append(t[inside], last)
            found = solve_ivp(self.slope, (first, last), state, "DOP853", np.unique(at), rtol=1e-11, atol=1e-15)
            y[inside], state = found.y.T[: inside.sum()], found.y[:, -1]
        rows, values = self.P[-3:], []
        for time, (q, q_t) in zip(t, y.reshape(len(t), 2, -1), strict=True):
            (r, r_t, _), (A, A_t, _) = self.frame(time)
            u, u_t, x = rows @ q, rows @ q_t, self.x[-1]
            values.append([r + A @ (x + u) - x, r + A @ (x + u), r_t + A_t @ (x + u) + A @ u_t, u, u_t])
        return dict(zip(SENSORS, np.swapaxes(values, 0, 1), strict=True))


@cache
def truth(name, back=False, loaded=False, end=END):
    """At every 0.25 ms."""
    loads = {"weight": WEIGHT, "force": 1.0} if loaded else {}
    breaks = (0.0163,) if name == "stops" else ()
    return FullBody(name, back, **loads).motion(2.5e-4 * np.arange(round(end / 2.5e-4) + 1), breaks)


def scene_of(name, loaded=False, **options):
    motion = offsets(name)
    scene = hex_bar.driven(lambda t: motion(t)[0], gravity=WEIGHT if loaded else (0.0, 0.0, 0.0), **options)
    if loaded:
        floating._loaded(scene, floating.itemInterface.LoadForceVector, "right", _force, False)
    return scene


def _force(t):
    return FORCE * np.sin(60 * t) ** 2


def attached(scene, **options):
    flex = romerr.floating_body(scene.fem, scene.items)
    return romerr.attach(scene.mbs, flex, outputs=[scene.sensors[name] for name in SENSORS], **options)


def solved(scene, **options):
    monitor = attached(scene, **options)
    scene.solve()
    return monitor.report()


def assert_covered(report, expected, estimators=("energy", "auxiliary", "best")):
    """Every value below its bound, corrected ones too; velocities' round-off is that of the frame's rates."""
    assert set(report.scope.values()) == {"complete"}
    for name, y in expected.items():
        out, noise = report.output(name), tol.DRIVEN * np.abs(y).max()
        assert out.value.shape == y.shape
        for e in estimators:
            assert np.all(np.abs(y - out.value) <= out.bound[e] + noise)
        assert np.all(np.abs(y - out.corrected) <= out.corrected_bound + noise)


def at_steps(expected, h):
    return {name: y[:: round(h / 2.5e-4)] for name, y in expected.items()}


CASES = [
    ("turns", "RBE3", 4, 1e-3),
    ("turns", "RBE2", 8, 1e-3),
    ("turns", "RBE3", 4, 2.5e-4),
    ("turns", "RBE3", 4, 4e-3),
    ("shifts", "RBE3", 4, 1e-3),
    ("shifts", "RBE2", 8, 2.5e-4),
]


@pytest.mark.parametrize(("name", "kind", "n", "h"), CASES)
def test_errors_under_a_prescribed_motion_are_covered_and_bounds_are_sharp(name, kind, n, h):
    report = solved(scene_of(name, n=n, kind=kind, h=h, t_end=END))
    expected = at_steps(truth(name), h)
    assert_covered(report, expected)
    assert not report.messages
    out, y = report.output("displacement"), expected["displacement"]
    assert out.bound["best"].max() < 1.3 * np.abs(y - out.value).max()  # measured: 1.22 at most


@pytest.mark.parametrize("back", [False, True])
def test_errors_of_a_tumbling_loaded_body_are_covered(back):
    """Three angles and gravity; the joint's markers in either order."""
    report = solved(scene_of("tumbles", loaded=True, back=back, t_end=0.02))
    assert_covered(report, at_steps(truth("tumbles", back, loaded=True, end=0.02), 1e-3))


def test_errors_of_a_frame_that_turns_round_are_covered_by_all_estimators():
    """More than half a turn; outputs in global axes hold where the frame is."""
    names = ("fast", "convolution", "energy", "auxiliary")
    report = solved(scene_of("turns round", n=8), estimators=names)
    assert offsets("turns round")(END)[0, 4] > np.pi
    assert_covered(report, at_steps(truth("turns round"), 1e-3), names)


def test_accelerations_that_jump_inside_a_step_are_covered_and_told():
    report = solved(scene_of("stops"))
    assert_covered(report, at_steps(truth("stops"), 1e-3))
    assert any("prescribed motion" in message for message in report.messages)


def test_where_the_frame_is_counts_in_global_outputs():
    """Trapezoidal index 2 integrates the joint's velocities: without offsetUserFunction_t the frame stays behind."""
    scene = scene_of("turns")
    monitor = attached(scene)
    scene.mbs.Assemble()
    scene.mbs.SolveDynamic(scene.settings, solverType=floating.exu.DynamicSolverType.TrapezoidalIndex2)
    report, expected = monitor.report(), at_steps(truth("turns"), 1e-3)
    assert_covered(report, expected)
    assert np.abs(expected["position"] - report.output("position").value).max() > 1e-2


def test_bounds_of_every_step_are_those_of_blocks():
    """With a tolerance every step is a block; polynomials through the function are other ones then."""
    one = solved(scene_of("turns"), tolerance=dict.fromkeys(SENSORS, 10.0))
    other = solved(scene_of("turns"))
    for name in SENSORS:
        a, b = (report.output(name).bound["best"] for report in (one, other))
        np.testing.assert_allclose(a, b, atol=1e-4 * b.max())  # measured 2e-5


def test_a_second_solve_goes_on_with_the_bound():
    scene = scene_of("turns", t_end=END / 2)
    monitor = attached(scene)
    scene.solve()
    system, times = scene.mbs.systemData, scene.settings.timeIntegration
    system.SetSystemState(system.GetSystemState(), floating.exu.ConfigurationType.Initial)
    times.startTime, times.endTime = END / 2, END
    scene.mbs.SolveDynamic(scene.settings)
    report = monitor.report()
    assert any("continues the run before" in message for message in report.messages)
    assert_covered(report, {name: y[-len(report.t) :] for name, y in at_steps(truth("turns"), 1e-3).items()})


def frozen_reason(scene, **options):
    report = solved(scene, **options)
    assert set(report.scope.values()) == {"inputs frozen"}
    return report.reason("energy") + report.scope_reason


def test_motion_that_begins_with_a_velocity_is_not_complete():
    scene = hex_bar.driven(lambda t: [0, 0, 0.01 * np.sin(30 * t), 0, 0, 0])
    assert "begins with a velocity" in frozen_reason(scene)


def test_motion_that_begins_elsewhere_is_not_complete():
    scene = hex_bar.driven(lambda t: [0, 0, 0.01, 0, 0, 0])
    assert "does not begin where the bodies are" in frozen_reason(scene)


def test_function_that_remembers_is_not_complete():
    calls = []

    def motion(t):
        calls.append(t)
        return [0, 0, 1e-3 * np.sin(30 * t) ** 4 + 1e-15 * len(calls), 0, 0, 0]

    assert "remembers its calls" in frozen_reason(hex_bar.driven(motion))


def test_function_that_remembers_in_variables_finds_them_as_they_were():
    motion = offsets("shifts")
    scene = hex_bar.driven(lambda t: motion(t)[0])
    joint = scene.mbs.systemData.NumberOfObjects() - 1

    def counted(mbs, t, i, parameters):
        mbs.variables["calls"] += 1
        return motion(t)[0].tolist()

    scene.mbs.SetObjectParameter(joint, "offsetUserFunction", counted)
    scene.mbs.variables["calls"] = 0
    monitor = attached(scene)
    scene.mbs.Assemble()
    scene.mbs.variables["calls"] = 7
    assert monitor.plan is not None
    assert scene.mbs.variables["calls"] == 7
    scene.solve()
    assert "remembers its calls" in monitor.report().scope_reason


@pytest.mark.parametrize("options", [{"time": "sampled"}, {"scope": "inputs frozen"}])
def test_what_does_not_use_the_function_is_not_complete(options):
    assert "used alongside a run" in frozen_reason(scene_of("shifts"), **options)


def test_plan_after_a_run_says_what_the_report_says():
    scene = scene_of("shifts")
    monitor = attached(scene)
    scene.solve()
    assert "complete" in str(monitor.plan)
    assert monitor.report().scope["energy"] == "complete"


def test_the_run_is_the_same_with_and_without_bounds():
    """On modes that are the same in both, to the last bit: all of them."""
    runs = []
    for watched in (True, False):
        scene = scene_of("tumbles", kind="complete", t_end=0.01)
        if watched:
            attached(scene)
        scene.solve()
        runs.append(scene.mbs.GetSensorStoredData(scene.sensors["position"]))
    np.testing.assert_array_equal(*runs)


def test_derivatives_of_polynomials_through_a_function():
    """1e-9 of the second derivative, as asked for, and the estimate of what is off is above it."""
    t, motion = np.linspace(0, END, 301), fourth(30.0, 0.02)
    found = resolved(lambda times: motion(times)[0][:, None], 0.0, END, 2.5e-4)(t)
    for values, exact in zip(found, motion(t), strict=False):
        np.testing.assert_allclose(values[:, 0], exact, atol=1e-9 * np.abs(exact).max())
    assert np.all(np.abs(found.f_tt[:, 0] - motion(t)[2]) <= found.off[:, 0])


def test_derivatives_of_a_function_with_a_kink():
    """Far from it nothing is lost; near it the estimate is above what is off."""
    t, kink = np.linspace(0, END, 1000), 0.0123
    found = resolved(lambda times: np.maximum(times - kink, 0.0)[:, None] ** 2 / 2, 0.0, END, 2.5e-4)(t)
    off = np.abs(found.f_tt[:, 0] - (t > kink))
    near = np.abs(t - kink) < 2.5e-4
    assert np.all(off <= found.off[:, 0])
    assert off[~near].max() < 1e-6
    assert off[near].max() > 0.1


@pytest.mark.parametrize("kink", [0.0, END / 2, prescribed.CUT * END])
def test_a_velocity_that_jumps_where_polynomials_meet_is_seen(kink):
    """Otherwise each of them would resolve its own side, and nothing would tell of the jump between."""
    t = np.linspace(0, END, 1001)

    def ramp(times):
        return np.maximum(times - kink, 0.0)[:, None]

    off = resolved(ramp, 0.0, END, 2.5e-4)(t).off[:, 0]
    assert prescribed.has_kink(ramp, kink, 1e-4)
    assert not prescribed.has_kink(ramp, END / 3, 1e-4)
    if kink:
        assert off[np.argmin(np.abs(t - kink))] > 1 / 2.5e-4
    assert np.median(off) < 1e-6
