"""A body whose frame a function of time drives: bounds of scope "complete" hold for the motion of that function.

Truth (models/driven_truth.py): the full body, all modes, under exactly prescribed motion of its frame, derivatives by
hand, integrated by an explicit method of order 8 to 1e-11. It uses nothing of the package.
"""

import numpy as np
import pytest

import exudyn_romerr as romerr
from exudyn_romerr.trajectory import prescribed
from exudyn_romerr.trajectory.prescribed import resolved
from models import driven_bar, driven_truth, floating
from models.driven_truth import END, FORCE, SENSORS, STEP, WEIGHT, computed, fourth, offsets, stored
from tests.helpers import tolerances as tol


def truth(case, h=1e-3):
    """Sensor -> values (T, 3) at every step h."""
    return dict(zip(SENSORS, stored(case)[:, :: round(h / STEP)], strict=True))


def test_stored_truths_are_those_that_are_computed():
    """The first tenth of the longest expression: three angles, weight, a force."""
    assert_close = np.testing.assert_allclose
    for found, kept in zip(computed("tumbles back", END / 10), stored("tumbles back"), strict=True):
        assert_close(found, kept[: len(found)], rtol=0, atol=tol.DRIVEN * np.abs(kept).max())


PULSE = 0.0012  # s


def pulse(begin):
    """0.01 sin^4 for a moment, and its first two derivatives."""
    return lambda t: fourth(np.pi / PULSE, 0.01)(t - begin) if 0 < t - begin < PULSE else np.zeros(3)


def scene_of(name, loaded=False, **options):
    motion = offsets(name)
    scene = driven_bar.driven(lambda t: motion(t)[0], gravity=WEIGHT if loaded else (0.0, 0.0, 0.0), **options)
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
    expected = truth(name, h)
    assert_covered(report, expected)
    assert not report.messages
    out, y = report.output("displacement"), expected["displacement"]
    assert out.bound["best"].max() < 1.3 * np.abs(y - out.value).max()  # measured: 1.22 at most


@pytest.mark.parametrize("back", [False, True])
def test_errors_of_a_tumbling_loaded_body_are_covered(back):
    """Three angles and gravity; the joint's markers in either order."""
    report = solved(scene_of("tumbles", loaded=True, back=back, t_end=0.02))
    assert_covered(report, truth("tumbles back" if back else "tumbles"))


def test_errors_of_a_frame_that_turns_round_are_covered_by_all_estimators():
    """More than half a turn; outputs in global axes hold where the frame is."""
    names = ("fast", "convolution", "energy", "auxiliary")
    report = solved(scene_of("turns round", n=8), estimators=names)
    assert offsets("turns round")(END)[0, 4] > np.pi
    assert_covered(report, truth("turns round"), names)


def test_accelerations_that_jump_inside_a_step_are_covered_and_told():
    report = solved(scene_of("stops"))
    assert_covered(report, truth("stops"))
    assert any("prescribed motion" in message for message in report.messages)


def test_where_the_frame_is_counts_in_global_outputs():
    """Trapezoidal index 2 integrates the joint's velocities: without offsetUserFunction_t the frame stays behind."""
    scene = scene_of("turns")
    monitor = attached(scene)
    scene.mbs.Assemble()
    scene.mbs.SolveDynamic(scene.settings, solverType=floating.exu.DynamicSolverType.TrapezoidalIndex2)
    report, expected = monitor.report(), truth("turns")
    assert_covered(report, expected)
    out = report.output("position")
    error = expected["position"] - out.value
    assert np.abs(error).max() > 1e-2
    assert out.estimate_scope == "complete"
    np.testing.assert_allclose(out.value + out.estimate, out.corrected, rtol=0, atol=tol.ENTRIES)
    # of the frame's place the basis knows nothing
    np.testing.assert_allclose(out.estimate_parts["time step"], error, rtol=0, atol=1e-3 * np.abs(error).max())


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
    assert_covered(report, {name: y[-len(report.t) :] for name, y in truth("turns").items()})


def frozen_reason(scene, **options):
    report = solved(scene, **options)
    assert set(report.scope.values()) == {"inputs frozen"}
    return report.reason("energy") + report.scope_reason


def test_motion_that_begins_with_a_velocity_is_not_complete():
    scene = driven_bar.driven(lambda t: [0, 0, 0.01 * np.sin(30 * t), 0, 0, 0])
    assert "begins with a velocity" in frozen_reason(scene)


def test_motion_that_begins_elsewhere_is_not_complete():
    scene = driven_bar.driven(lambda t: [0, 0, 0.01, 0, 0, 0])
    assert "does not begin where the bodies are" in frozen_reason(scene)


def test_function_that_remembers_is_not_complete():
    calls = []

    def motion(t):
        calls.append(t)
        return [0, 0, 1e-3 * np.sin(30 * t) ** 4 + 1e-15 * len(calls), 0, 0, 0]

    assert "remembers its calls" in frozen_reason(driven_bar.driven(motion))


def test_function_that_remembers_in_variables_finds_them_as_they_were():
    motion = offsets("shifts")
    scene = driven_bar.driven(lambda t: motion(t)[0])
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


def test_functions_may_write_to_their_parameters():
    """Exudyn gives them a list of their own: one that fills it in and returns it moves the frame as another does."""
    motion, found = offsets("shifts"), []

    def filled_in(mbs, t, i, parameters):
        for k, x in enumerate(motion(t)[0].tolist()):
            parameters[k] += x
        return parameters

    for function in (None, filled_in):
        scene = driven_bar.driven(lambda t: motion(t)[0], kind="complete", t_end=0.01)
        if function is not None:
            joint = scene.mbs.systemData.NumberOfObjects() - 1
            scene.mbs.SetObjectParameter(joint, "offsetUserFunction", function)
        monitor = attached(scene)
        scene.solve()
        found.append(monitor.report())
    assert [report.scope["energy"] for report in found] == ["complete", "complete"]
    bounds = [report.output("position").bound["energy"] for report in found]
    np.testing.assert_array_equal(*bounds)


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


def test_a_pulse_between_the_nodes_of_a_long_polynomial_is_seen():
    """All 17 nodes of one polynomial may miss a pulse of ten times the shortest panel, here of 1.2 ms in 20 ms."""
    t, shortest = np.linspace(0, END / 2, 2001), 2.5e-4 / 4
    for begin in np.linspace(0.001, 0.018, 18):
        values, _, exact = np.transpose([pulse(begin)(time) for time in t])
        found = resolved(lambda x, b=begin: np.array([[pulse(b)(y)[0]] for y in x]), 0.0, END / 2, shortest)(t)
        np.testing.assert_allclose(found.f[:, 0], values, atol=1e-2 * values.max())
        beyond = np.abs(found.f_tt[:, 0] - exact) - found.off[:, 0]
        assert beyond.max() < 1e-2 * exact.max()  # measured 1.6e-3, where the pulse fills a sixth of a panel


def test_a_pulse_of_some_steps_in_a_quiet_motion_is_covered(monkeypatch):
    """Not a message told of it, and errors were 42 times their bounds."""
    begin, h = 0.00507, 2.5e-4
    monkeypatch.setitem(driven_truth.MOTIONS, "pulse", {4: pulse(begin)})
    report = solved(scene_of("pulse", h=h, t_end=END / 2))
    t = h * np.arange(len(report.t))
    assert_covered(report, driven_truth.FullBody("pulse").motion(t, (begin, begin + PULSE)))


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


@pytest.mark.parametrize("since", [-1.0, END / 2], ids=["at once", "later"])
def test_what_an_integral_over_time_keeps_is_as_the_run_leaves_it(since):
    """It goes back exactly where it was at an earlier time; where it begins late, bounds end."""
    motion, kept = offsets("shifts"), []

    def keep(mbs, t, i, parameters):
        if t > since:
            kept[-1]["integral"] += t - kept[-1]["t"]
            kept[-1]["t"] = t
        return motion(t)[0].tolist()

    for watched in (False, True):
        kept.append({"t": 0.0, "integral": 0.0})
        scene = driven_bar.driven(lambda t: motion(t)[0])
        scene.mbs.SetObjectParameter(scene.mbs.systemData.NumberOfObjects() - 1, "offsetUserFunction", keep)
        monitor = attached(scene) if watched else None
        scene.solve()
    assert kept[0] == kept[1]
    if since < 0:
        assert "remembers its calls" in monitor.report().scope_reason
    else:
        with pytest.raises(romerr.errors.AssumptionError, match="remembers its calls"):
            monitor.report()
