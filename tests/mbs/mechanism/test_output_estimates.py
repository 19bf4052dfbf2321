"""The estimate of every output on a body of a mechanism; truth: the same simulation with all modes, stored.

Both have the same integrator and the same steps: their difference is what the basis leaves out, the part "basis".
"""

from functools import cache
from types import SimpleNamespace

import exudyn as exu
import numpy as np
import pytest
from exudyn import itemInterface
from exudyn.FEM import ObjectFFRFreducedOrderInterface

import exudyn_romerr as romerr
from exudyn_romerr.mbs.monitoring.body_monitor import FEWEST, MOST, ToleranceCheck
from exudyn_romerr.report.scope import SMOOTHLY
from exudyn_romerr.report.verdicts import MORE_VECTORS
from models import floating, mechanisms, output_truths
from tests.helpers import tolerances as tol
from tests.helpers.mechanism_runs import (
    COUPLED,
    FROZEN,
    LIE,
    from_to,
    pendulum,
    reports,
    solve,
    watch,
    with_frames,
)
from tests.helpers.observed import attached, flexes

CASES = [
    ("slider_crank", 0, "RBE3"),
    ("slider_crank", 4, "RBE3"),
    ("double_pendulum", 0, "RBE2"),
    ("sprung_body", 0, "RBE3"),
    ("sprung_body", 4, "RBE2"),
]
# Issue: estimates of errors below 1e-6 of the output are not asked for. Rotations of the right face are held by its
# static modes to 1e-5.
MATTERS = 1e-6
NEWTON = 1e-10  # of the largest value: relative tolerance of both runs
FIRST = 20  # steps
WIDEST = 1.5  # bound over error, of the component where both are largest
CONTINUED = {"basis": 0.01, "time step": 0.05}  # of the largest: tangents at other steps; one-sided where a run ends


@cache
def estimated(name, n, kind):
    """Reports of all bars."""
    scene = output_truths.SCENES[name](n, kind)
    outputs = output_truths.outputs(scene)
    flexible = flexes(scene)
    monitors = [romerr.attach(scene.mbs, flex, outputs=outputs) for flex in flexible]
    scene.solve()
    return [monitor.report() for monitor in monitors]


def of_basis(out):
    """Their truth has the same steps."""
    return out.estimate_parts["basis"] + out.estimate_parts["interfaces"]


@pytest.mark.parametrize(("name", "n", "kind"), CASES)
def test_estimate_is_the_difference_to_all_modes(name, n, kind):
    """Bars of issue 18: 3 % of the largest error in global axes, 5 % in the frame; measured: 0.13 % and 1.2 %."""
    truth, compared = output_truths.stored(name), set()
    for i, report in enumerate(estimated(name, n, kind), start=1):
        assert report.scope == {"auxiliary": COUPLED}
        for key, out in report.outputs.items():
            error = truth[f"{key} of bar {i}"] - out.value
            largest = np.max(np.abs(error))
            assert out.estimate_scope == "coupled (linearised)"
            if largest > MATTERS * np.max(np.abs(out.value)):
                allowed = 0.03 if key in ("displacement", "position", "velocity") else 0.05
                assert np.max(np.abs(of_basis(out) - error)) <= allowed * largest
                compared.add(key)
    assert compared >= {"displacement", "velocity", "displacement in the frame", "velocity in the frame"}
    assert compared >= {"rotation", "stress"}


def test_gravity_turns_a_body_by_its_undeformed_mass_centre():
    """So does Exudyn. With the moment of gravity on what vectors move, positions here were off by 68 % of the error.

    What Newton's tolerance leaves of both runs is 1.2 % of it.
    """
    truth = output_truths.stored("double_pendulum")
    for i, report in enumerate(estimated("double_pendulum", 1, "RBE3"), start=1):
        for key in ("displacement", "position", "velocity"):
            out = report.output(key)
            error = truth[f"{key} of bar {i}"] - out.value
            assert np.max(np.abs(of_basis(out) - error)) <= 0.03 * np.max(np.abs(error)), key


@pytest.mark.parametrize(("name", "n", "kind"), CASES)
def test_parts_add_up_and_so_do_checks(name, n, kind):
    for report in estimated(name, n, kind):
        for out in report.outputs.values():
            largest = np.max(np.abs(out.estimate))
            np.testing.assert_allclose(sum(out.estimate_parts.values()), out.estimate, atol=tol.SUMS * largest)
            np.testing.assert_allclose(sum(out.uncertainty_parts.values()), out.uncertainty, rtol=tol.SUMS)
            assert np.max(out.uncertainty) > 0


@pytest.mark.parametrize(("name", "n", "kind"), CASES)
def test_what_frames_see_is_within_its_bound_and_nothing_else_has_one(name, n, kind):
    """At every instant, displacements, velocities, stresses; and the largest bound is not far above the error."""
    truth, seen = output_truths.stored(name), set()
    for i, report in enumerate(estimated(name, n, kind), start=1):
        for key, out in report.outputs.items():
            bound, error = out.bound["best"], np.abs(truth[f"{key} of bar {i}"] - out.value)
            if key in ("displacement", "position", "velocity"):
                assert np.isinf(bound).all()
            elif np.isfinite(bound).all():
                assert (error <= bound + NEWTON * np.max(np.abs(out.value))).all(), key
                if key == "displacement in the frame":
                    assert (bound.max(axis=0) <= WIDEST * error.max(axis=0)).any()
                seen.add(key)
    # where interfaces are rigid, idle forces of theirs leave no bound
    assert kind == "RBE2" or {"displacement in the frame", "velocity in the frame", "stress"} <= seen


def test_first_steps_of_the_truth_are_those_stored():
    wanted = output_truths.stored("sprung_body")
    for key, found in output_truths.solved("sprung_body", FIRST).items():
        allowed = tol.MECHANISM_NEWTON * np.max(np.abs(wanted[key]))
        np.testing.assert_allclose(found, wanted[key][: FIRST + 1], rtol=0, atol=allowed)


@pytest.mark.slow
@pytest.mark.parametrize("name", output_truths.SCENES)
def test_all_steps_of_the_truth_are_those_stored(name):
    wanted = output_truths.stored(name)
    for key, found in output_truths.solved(name).items():
        allowed = tol.MECHANISM_NEWTON * np.max(np.abs(wanted[key]))
        np.testing.assert_allclose(found, wanted[key], rtol=0, atol=allowed)


# --- where the mechanism does not answer -------------------------------------------


def frozen_estimate(report, name="probe"):
    """The output, whose estimate is the correction under frozen inputs."""
    out = report.output(name)
    assert out.estimate_scope == FROZEN
    np.testing.assert_array_equal(out.uncertainty, sum(out.uncertainty_parts.values()))
    assert np.max(np.abs(out.estimate)) > 0
    return out


def test_frozen_inputs_are_those_of_version_0_1():
    """Bounds in global axes are finite, and the correction is the estimate; its parts tell time steps apart."""
    for report in reports(pendulum(), outputs="tip {}", scope=FROZEN):
        out = frozen_estimate(report)
        assert set(report.scope.values()) == {FROZEN}
        assert np.isfinite(out.bound["best"]).all()
        np.testing.assert_allclose(out.value + out.estimate, out.corrected, rtol=0, atol=1e-15)  # of 0.1 m
        np.testing.assert_array_equal(out.uncertainty, out.corrected_bound)
        assert np.max(np.abs(out.estimate_parts["time step"])) > 0


def test_frames_without_euler_parameters_have_the_estimate_under_frozen_inputs():
    """No mechanism answers, and the report says why."""
    scene = with_frames(LIE, mechanisms.sprung_body, n=0, h=1e-6, t_end=2e-5)
    (monitor,) = watch(scene, outputs="tip {}")
    solve(scene, solverType=exu.DynamicSolverType.RK44)
    report = monitor.report()
    assert set(report.scope.values()) == {FROZEN}
    assert "RigidBodyRotVecLG" in report.scope_reason
    frozen_estimate(report)


def test_file_has_the_estimate_under_frozen_inputs(tmp_path):
    scene = pendulum()
    file = scene.settings.solution.file
    file.write, file.writePeriod, file.binary, file.name = True, 0, True, str(tmp_path / "run.sol")
    solve(scene)
    flex = romerr.floating_body(scene.fem, scene.bodies[0])
    out = frozen_estimate(
        romerr.evaluate_file(scene.mbs, flex, file.name, outputs=[scene.sensors["tip 1"]]), "sensor0"
    )
    np.testing.assert_allclose(out.value + out.estimate, out.corrected, rtol=0, atol=1e-15)  # of 0.1 m


def test_static_solve_is_corrected_to_its_end():
    """K e = -R: with it every load step is exact, under the wrenches of the run; rounding is left."""
    scene = floating.clamped_bar(0, h=1e-3, t_end=1e-2, force=lambda t: (0.0, 200.0, 100.0))
    monitor = attached(scene, outputs=[scene.sensors["tip"]])
    scene.mbs.Assemble()
    scene.mbs.SolveStatic(scene.settings)
    report = monitor.report()
    out = next(iter(report.outputs.values()))
    assert out.estimate_scope == "complete"
    np.testing.assert_allclose(out.value + out.estimate, out.corrected, rtol=tol.SUMS)
    np.testing.assert_array_equal(np.abs(out.estimate) + out.corrected_bound, out.bound["best"])
    full = floating.clamped_bar(0, "complete", h=1e-3, t_end=1e-2, force=lambda t: (0.0, 200.0, 100.0))
    full.mbs.Assemble()
    full.mbs.SolveStatic(full.settings)
    error = full.mbs.GetSensorStoredData(full.sensors["tip"])[-1, 1:] - out.value[-1]
    np.testing.assert_allclose(out.estimate[-1], error, rtol=0, atol=tol.STATIC * np.max(np.abs(error)))


# --- continued solves ---------------------------------------------------------------


def test_continued_solve_goes_on_with_its_estimate():
    """As if it had not been interrupted."""
    whole = reports(pendulum(steps=12), outputs="tip {}")[0].output("probe")
    scene = pendulum(steps=12)
    monitors = watch(scene, outputs="tip {}")
    for start, end in ((0, 6), (6, 12)):
        from_to(scene, start, end)
        solve(scene, updateInitialValues=True) if start == 0 else solve(scene)
    later = monitors[0].report().output("probe")
    assert later.estimate_scope == "coupled (linearised)"
    assert len(later.value) == 7
    for cause, allowed in CONTINUED.items():
        wanted = whole.estimate_parts[cause]
        found, allowed = later.estimate_parts[cause], allowed * np.max(np.abs(wanted))
        np.testing.assert_allclose(found, wanted[6:], rtol=0, atol=allowed)


# --- what reports advise is tried ---


SUDDEN = {"h": 1e-3, "grows": 0.0, "beta": 0.0, "vectors": "auto", "scope": "auto", "n": 4}
T_END = 0.05  # s
SMOOTH = {"grows": 0.03}  # s
# times smaller half widths: what a smooth start brings at least (measured 58 to 7600, 43000 with frozen inputs), what
# each of the others at most that stood beside it once (0.5 to 3.1: half the step made forces twice as uncertain), and
# half the step once loads begin smoothly (1.17 to 4)
ONLY_CURE, NO_CURE, HALF_THE_STEP = 30.0, 6.0, 1.1
SMALLER = 2.0  # times, an error of resolved time steps that are halved (measured 9)


@cache
def fall(**options):
    """Report of the fall; grows : time that gravity takes to grow, s."""
    of = {**SUDDEN, **options}
    fem = floating.load_fem("bar")
    floating.craig_bampton(fem, ("left", "right"), of["n"], "RBE3")
    mbs = exu.SystemContainer().AddSystem()
    items = ObjectFFRFreducedOrderInterface(fem).AddObjectFFRFreducedOrder(
        mbs, stiffnessProportionalDamping=of["beta"]
    )
    body = items["oFFRFreducedOrder"]

    def gravity(mbs, t, load):
        share = 1.0 if t >= of["grows"] else (1 - np.cos(np.pi * t / of["grows"])) / 2
        return [0.0, 0.0, -9.81 * share]

    marker = mbs.AddMarker(itemInterface.MarkerBodyMass(bodyNumber=body))
    load = itemInterface.LoadMassProportional(markerNumber=marker, loadVector=[0, 0, -9.81])
    load.loadVectorUserFunction = gravity
    mbs.AddLoad(load)
    nodes, weights = floating.interface(fem, "left")
    left = floating.add_interface_marker(mbs, body, nodes, weights)
    ground = mbs.AddObject(
        itemInterface.ObjectGround(referencePosition=weights @ fem.GetNodePositionsAsArray()[nodes])
    )
    hinge = mbs.AddMarker(itemInterface.MarkerBodyRigid(bodyNumber=ground))
    joint = itemInterface.GenericJoint(markerNumbers=[hinge, left], constrainedAxes=[1, 1, 1, 1, 0, 1])
    joint = mbs.AddObject(joint)
    tip = int(floating.interface(fem, "tip")[0][0])
    shown = exu.OutputVariableType
    place = {"bodyNumber": body, "meshNodeNumber": tip, "outputVariableType": shown.Displacement}
    mbs.AddSensor(itemInterface.SensorSuperElement(name="tip", **place))
    force = {"objectNumber": joint, "outputVariableType": shown.ForceLocal}
    mbs.AddSensor(itemInterface.SensorObject(name="force", **force))
    flex = romerr.floating_body(fem, items)
    monitor = romerr.attach(mbs, [flex], auxiliary_modes=of["vectors"], scope=of["scope"])
    mbs.Assemble()
    settings = floating.solver_settings(of["h"], T_END)
    settings.timeIntegration.generalizedAlpha.spectralRadius = 1
    mbs.SolveDynamic(settings)
    return monitor.report()


def half_widths(**options):
    return {name: np.max(out.uncertainty) for name, out in fall(**options).outputs.items()}


def factors(cure, **base):
    """How many times smaller the half width of each output gets."""
    before, after = half_widths(**base), half_widths(**{**base, **cure})
    return {name: before[name] / after[name] for name in before}


def cures(report):
    """Cure of the time steps' error of each output."""
    return [report.output(name).verdict["step"].cure for name in report.outputs]


def test_what_starts_at_once_needs_a_smooth_start():
    """The report says so where the estimate is not resolved, else how many steps; a smooth start helps far more."""
    report = fall()
    assert all(cure == SMOOTHLY or cure.startswith("take ") for cure in cures(report) if cure)
    assert {out.beside_steps for out in report.outputs.values()} == {(SMOOTHLY,)}
    assert MORE_VECTORS not in str(report)
    found = factors(SMOOTH)  # how far the tip swings is another error
    assert min(found[name] for name in found if name != "tip") > ONLY_CURE
    assert SMOOTHLY not in cures(fall(**SMOOTH))


def test_frozen_inputs_need_no_more_vectors():
    """Their estimate is resolved here, and time steps make most of the error: halving them lowers it."""
    report, finer = fall(scope="inputs frozen"), fall(scope="inputs frozen", h=5e-4)
    assert MORE_VECTORS not in str(report)
    sizes = [np.max(np.abs(made.output("tip").estimate)) for made in (report, finer)]
    assert sizes[0] > SMALLER * sizes[1]
    assert min(factors(SMOOTH, scope="inputs frozen").values()) > ONLY_CURE


@pytest.mark.parametrize("scope", ["auto", "inputs frozen"])
@pytest.mark.parametrize("other", [{"h": 5e-4}, {"beta": 1e-5}, {"vectors": 60}], ids=str)
def test_nothing_else_helps_by_far_as_much(other, scope):
    """These stood beside it, or in its place."""
    assert max(factors(other, scope=scope).values()) < NO_CURE


def test_half_the_step_helps_once_loads_begin_smoothly():
    told = {cure for cure in cures(fall(**SMOOTH)) if cure}
    assert told <= {"halve the step", "shorter steps"}
    assert min(factors({"h": 5e-4}, **SMOOTH).values()) > HALF_THE_STEP


# --- a tolerance in a mechanism ---


def bound(report):
    return np.max(report.output("probe").bound["best"], axis=1)


@pytest.mark.parametrize("share", [0.01, 0.3, 0.9])
def test_solve_stops_at_the_step_where_it_is_exceeded(share, tmp_path):
    """Bounds rise here smoothly; in the first steps as many are made before they are compared as were before."""
    free, _ = reports(pendulum(steps=40), scope=FROZEN)
    limit = share * np.max(bound(free))
    scene = pendulum(steps=40)
    stopped, other = [*watch(scene, 1, tolerance=limit), *watch(scene, 2)]
    solve(scene)
    t, first = stopped.report().t, int(np.argmax(bound(free) > limit))
    assert t[-1] == other.report().t[-1]
    assert first < len(t) <= 1 + max(2 * first, 1)
    assert set(stopped.report().scope.values()) == {COUPLED}  # while the solve goes on bounds have frozen inputs
    said = next(message for message in stopped.report().messages if "stopped" in message)
    assert said.startswith(f"stopped at t = {t[-1]:g}: tolerance on 'probe' exceeded")
    assert (f"exceeded at t = {t[first]:g}" in said) == (first < len(t) - 1)
    for monitor in (stopped, other):  # in files, too
        monitor.report().save(tmp_path / "report.npz")
        for report in (monitor.report(), romerr.load_report(tmp_path / "report.npz")):
            assert {out.stopped for out in report.outputs.values()} == ({t[-1]} if monitor is stopped else {None})
    assert {out.stopped for out in free.outputs.values()} == {None}


class Rising:
    """A run whose bound follows a function of the number of steps."""

    def __init__(self, of):
        self._of, self.times = of, np.arange(1)

    def best_of_last(self, count):
        return {"x": self._of(self.times[-count:])[:, None]}

    def doubts(self):
        return ()


def made_until(of, steps):
    """What a check says, the step it says it at, and the number of calls until then."""
    check, run, calls = ToleranceCheck({"x": 1.0}), Rising(of), 0
    while len(run.times) <= steps:
        calls += 1
        found = check.exceeded(run)
        if found:
            return SimpleNamespace(found=found, step=run.times[-1], calls=calls)
        run.times = np.arange(len(run.times) + check.room)
    return SimpleNamespace(found=[], step=run.times[-1], calls=calls)


@pytest.mark.parametrize("steps", [3.5, 100.5, 3000.5])
def test_a_bound_that_rises_steadily_is_stopped_at_once(steps):
    stopped = made_until(lambda k: k / steps, 10_000)
    assert stopped.step == np.ceil(steps)
    assert stopped.found == [f"tolerance on 'x' exceeded, {np.ceil(steps) / steps:.3g} > 1"]


def test_a_bound_that_jumps_is_found_in_the_same_block():
    """And the step is told."""
    stopped = made_until(lambda k: np.where(k < 1000, 0.1, 2.0), 10_000)
    assert 1000 <= stopped.step < 1000 + MOST
    assert stopped.found == ["tolerance on 'x' exceeded at t = 1000, 2 > 1"]


def test_a_bound_close_below_is_compared_every_few_steps():
    close = made_until(lambda k: 0.5 + 0.49 * np.sin(0.3 * k), 10_000)
    assert not close.found
    assert close.calls <= FEWEST + 1 + (1 + close.step) / FEWEST


def test_without_bounds_it_stops():
    assert made_until(lambda k: np.where(k < 3, 0.0, np.inf), 10).found == [
        "tolerance on 'x' exceeded at t = 3, inf > 1"
    ]
