"""Half widths of the error by time steps, which do not resolve what a burst of three of them leaves ringing.

Truth: the same reduced model with steps h/8 and h/16, extrapolated. Newton's tolerance is tight, for forces show it.
"""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import exudyn as exu
import numpy as np
import pytest
from exudyn import itemInterface
from exudyn.FEM import ObjectFFRFreducedOrderInterface

import exudyn_romerr as romerr
from benchmarks import estimates
from benchmarks.estimates import Row
from exudyn_romerr.mbs.floating import reference_search
from exudyn_romerr.mbs.floating.floating_body import read_object
from exudyn_romerr.report.causes import RESOLVED
from exudyn_romerr.report.derived import features_of
from models import estimate_truths, floating, mechanisms
from models.estimate_scenes import SCENES
from models.hex_bar import hex_bar
from tests.helpers.observed import named, observed, observed_all, shown

H, STEPS, BEGIN = 1e-3, 100, 50
FINER = (8, 16)
IN_FRAMES = ("tip 1 local", "tip 2 local", "middle 1 local", "middle 2 local")
FORCES = ("hinge 1", "hinge 2")
WIDE = 25.0  # errors that a half width may be; measured 20, with checks that grow without end 58
OFF = 3.0  # half widths that an instant may be off by; measured 2.95, in the step in which the burst begins


def burst(t):
    share = (t / H - BEGIN) / 3
    return 0.0, 0.0, 50.0 * np.sin(np.pi * share) ** 2 if 0 < share < 1 else 0.0


def scene(finer=1):
    made = mechanisms.double_pendulum(2, h=H / finer, t_end=STEPS * H, force=burst, damping=(0.0, 2e-6))
    for name in FORCES:
        made.sensors[name] = made.mbs.AddSensor(
            itemInterface.SensorObject(
                objectNumber=made.objects[name],
                outputVariableType=exu.OutputVariableType.ForceLocal,
                storeInternal=True,
            )
        )
    named(made)
    made.settings.solution.sensors.writePeriod = H
    newton = made.settings.timeIntegration.newton
    newton.relativeTolerance, newton.absoluteTolerance = 1e-12, 1e-13
    return made


@cache
def errors():
    """By output: error (T, 3) by time steps, its estimate, its half width, and what the truth is not known to."""
    truths = []
    for finer in FINER:
        made = scene(finer)
        made.solve()
        truths.append(shown(made))
    made = scene()
    report = observed_all(made)
    coarse, fine = truths
    found = {}
    for name, y in shown(made).items():
        out = report.output(name)
        step = (fine[name] - coarse[name]) / 3
        unknown = np.abs(step).max(axis=0) / 4
        found[name] = fine[name] + step - y, out.estimate_parts["time step"], out.uncertainty, unknown
    return found


def test_half_widths_do_not_grow_with_the_square_of_the_phase():
    for name in (*IN_FRAMES, *FORCES):
        error, _, width, _ = errors()[name]
        assert np.all(width.max(axis=0) < WIDE * np.abs(error).max(axis=0)), name


def test_errors_are_inside_right_before_a_burst_too():
    for name, (error, estimate, width, unknown) in errors().items():
        off = np.abs(estimate - error) - unknown
        assert np.all(off <= OFF * width), name


# --- how good estimates of the whole error are ---


SMALL = pytest.mark.xfail(
    strict=True,
    reason="middle and tip in the plane, errors of 1e-9 m or 1e-5 of the output: off by up to 24 %, and not resolved",
)
INSIDE = 0.95  # of all instants
MANY = 3.0  # deviations that an uncertainty may be


@cache
def rows(scene: str, n: int) -> tuple[list[Row], list[str]]:
    return estimates.rows_of(scene, n)


def compared(scene: str, n: int, axes: str) -> list[Row]:
    """Rows of the outputs in some axes that bars are for; all of them have an estimate."""
    found, none = rows(scene, n)
    assert axes not in {estimates.axes_of(SCENES[scene], text.split(": ")[1]) for text in none}
    found = [row for row in found if row.axes == axes and (not row.left_out or _only_rings(row))]
    assert found
    return found


def _only_rings(row: Row) -> bool:
    """Of the driven bar all errors ring: by its first bending, whose phase the exact flow follows."""
    return row.scene == "driven_bar" and "rings" in row.left_out


def worst(found: list[Row]) -> float:
    """Largest deviation of an estimate, a share of its bar."""
    return max(row.off / estimates.bar_of(row) for row in found)


@pytest.mark.parametrize(
    ("scene", "axes"),
    [
        ("linear_bar", "frame"),
        ("clamped_bar", "frame"),
        ("clamped_bar", "global"),
        ("driven_bar", "frame"),
        ("driven_bar", "global"),
        ("slider_crank", "frame"),
        ("slider_crank", "global"),
        ("sprung_body", "frame"),
        ("sprung_body", "global"),
        pytest.param("double_pendulum", "frame", marks=SMALL),
        ("double_pendulum", "global"),
        pytest.param("wishbone_fine", "global", marks=pytest.mark.slow),
        ("slider_crank", "rigid"),
        ("slider_crank_fine", "joint"),
        pytest.param("wishbone_fine", "rigid", marks=pytest.mark.slow),
    ],
)
def test_estimate_is_the_error(scene, axes):
    assert worst(compared(scene, SCENES[scene].n[0], axes)) <= 1


def test_forces_along_a_crank_that_begins_to_turn():
    """1e-6 of the force: 9 and 5 % off where accelerations were squared, or what drives the remainder jumped."""
    found = {row.name: row.off for row in compared("slider_crank_fine", 0, "joint")}
    assert all(found[f"{joint} ForceLocal x"] <= 0.03 for joint in ("shaft", "crank pin"))


def test_forces_of_joints_that_ring_are_not_resolved():
    """Those that do not ring are as good as promised, 10 %; steps of the slider crank resolve no mode of its bar.

    One that is 1e-5 of the largest torque is off by more: it says so.
    """
    found = compared("slider_crank", 4, "joint")
    assert not [row.name for row in found if row.resolved and row.off > RESOLVED and row.within < INSIDE]


def test_what_is_off_by_more_than_promised_is_not_resolved():
    """In the frames of the double pendulum; there, and in the rigid one, the error is where the estimate says."""
    found = compared("double_pendulum", 4, "frame")
    assert not [row.name for row in found if row.resolved and row.off > RESOLVED and row.within < INSIDE]
    assert min(row.within for row in found) > INSIDE


def test_sudden_gravity_that_steps_resolve():
    assert worst(compared("hinged_bar_fine", 2, "frame")) <= 1


@pytest.mark.parametrize("n", [2, 8])
def test_sudden_gravity_that_steps_do_not_resolve(n):
    """The estimate says how far it is off: at most twice its uncertainty, which is no excuse."""
    found = [row for row in rows("hinged_bar", n)[0] if row.axes == "frame" and row.share > estimates.ABOVE]
    assert len(found) == 6
    assert min(row.wide for row in found) >= 1 / estimates.TIMES
    assert max(found, key=lambda row: row.error).wide <= MANY  # of small components it is much wider


def test_errors_by_cause_are_what_the_full_model_says():
    """A full run at the same steps tells the basis' part from the time steps'."""
    for scene in ("slider_crank", "sprung_body", "clamped_bar"):
        for row in compared(scene, 4, "frame"):
            for true, found in (row.steps, row.basis):
                assert np.abs(found - true) <= 2 * estimates.bar_of(row) * row.error


@pytest.mark.parametrize(("scene", "share"), [("slider_crank", 0.7), ("sprung_body", 0.9)])
def test_peaks_means_and_last_values(scene, share):
    """Errors of these numbers are within two half widths; forces of joints are resolved last."""
    of, told = SCENES[scene], []
    outputs, *_ = estimates.monitored(of, 4)
    for name, truth in estimate_truths.stored(scene).items():
        out, sizes = outputs[name], np.abs(truth.value - outputs[name].value).max(axis=0)
        report = SimpleNamespace(t=of.h * np.arange(len(out.value)), scope={}, time="sampled")
        found = features_of(report, out)
        true = features_of(report, replace(out, value=truth.value, estimate=None))
        compared = sizes > estimates.ABOVE * np.abs(truth.value).max()
        for feature, full in zip(found.values(), true.values(), strict=True):
            error = (full.value - feature.value)[compared]
            off = np.abs(error - feature.error[compared])
            assert np.all(off <= 2 * feature.half_width[compared] + truth.off[compared])
            told += list(off <= 0.3 * np.abs(error))
    assert np.mean(told) > share  # are told within 30 % of the error


# --- what rigid (RBE2) interfaces make of the estimate in a mechanism ---


# of the part: second order of what was linearised, and what the truths miss of it; measured 1.65e-2
SHARE = 0.02


@cache
def ran(n, kind, m=None, **options):
    """Sensor -> values of a run, and its report if m vectors were asked for."""
    scene, report = mechanisms.sprung_body(n, kind, h=1e-3, t_end=0.03), None
    names = ["tip 1 local", "middle 1 local"]
    if m is not None:
        named(scene, *names)
        flex = romerr.floating_body(scene.fem, scene.bodies[0], **options)
        sensors = [scene.sensors[name] for name in names]
        monitor = romerr.attach(scene.mbs, flex, outputs=sensors, auxiliary_modes=m)
    scene.solve()
    if m is not None:
        report = monitor.report()
    return shown(scene, *names), report


def test_part_of_rigid_interfaces_is_what_they_stiffen():
    """With its sign; and what is left of the estimate is what modes with rigid interfaces lack."""
    (free, _), (rigid, _), (few, report) = ran(0, "complete"), ran(60, "RBE2"), ran(0, "RBE2", "auto")
    for name, out in report.outputs.items():
        stiffened, missing = free[name] - rigid[name], rigid[name] - few[name]
        size = np.abs(stiffened).max(axis=0)
        assert np.all(size > 0.05 * np.abs(stiffened + missing).max(axis=0))
        for part, true in (("interfaces", stiffened), ("basis", missing)):
            assert np.all(np.abs(out.estimate_parts[part] - true).max(axis=0) <= SHARE * size)


def test_bound_is_shared_as_the_errors_are():
    """By largest values of the parts: what modes lack moves with inertia, which static errors know nothing of."""
    (free, _), (rigid, _), (few, report) = ran(0, "complete"), ran(60, "RBE2"), ran(0, "RBE2", "auto")
    for name, out in report.outputs.items():
        stiff, modes = (np.abs(x).max(axis=0) for x in (free[name] - rigid[name], rigid[name] - few[name]))
        found, rest = (out.causes[cause].max(axis=0) for cause in ("interfaces", "basis"))
        np.testing.assert_allclose(rest / (found + rest), modes / (stiff + modes), atol=SHARE)  # at the tip 0.3 %


@pytest.mark.parametrize("m", [6, 8])
def test_few_vectors_that_deform_interfaces_are_checked(m):
    """By a third of them, and by what linear equations miss."""
    (free, _), (few, report) = ran(0, "complete"), ran(0, "RBE2", m)
    for name, out in report.outputs.items():
        off = np.abs(free[name] - few[name] - (out.estimate - out.estimate_parts["time step"])).max(axis=0)
        assert np.all(off <= out.uncertainty.max(axis=0)), name


@pytest.mark.parametrize(("kind", "options"), [("RBE3", {}), ("RBE2", {"interfaces": "rigid"})])
def test_there_is_no_such_part_where_no_interface_is_stiffened(kind, options):
    for out in ran(0, kind, 6, **options)[1].outputs.values():
        assert not out.estimate_parts["interfaces"].any()
        assert out.estimate_parts["basis"].any()


def test_rigid_interfaces_without_a_marker_are_found():
    """By eigenmodes that vanish there; nodes that all modes leave still, or that none does, are no such interface."""
    scene = mechanisms.sprung_body(4, "RBE2")
    flex = romerr.floating_body(scene.fem, scene.bodies[0])
    V = read_object(scene.mbs, flex).V
    left, right = (floating.interface(scene.fem, side)[0] for side in ("left", "right"))
    marked = {"left": romerr.mean_motion(left)}
    found = reference_search.stiff_space(flex, V, marked)
    both = reference_search.stiff_space(flex, V, marked | {"right": romerr.mean_motion(right)})
    assert found.is_rigid
    assert np.array_equal(found.free, both.free)
    assert reference_search.stiff_space(flex, V[:, :6], marked).is_rigid is False  # static modes alone do not tell


# --- bounds over many periods of what nothing damps ---


GROWTH = 1.5  # from one second to ten; measured: 1.005


@pytest.mark.slow
def test_bounds_of_an_undamped_pendulum_do_not_grow():
    """10,000 steps: it falls and swings, and is shaken at 60 rad/s."""
    scene = floating.pendulum(4, h=1e-3, t_end=10.0, damping=(0.0, 0.0))
    scene.mbs.SetSensorParameter(scene.sensors["tip local"], "name", "tip")
    report = observed(scene, outputs=[scene.sensors["tip local"]])
    bound, t = report.output("tip").bound["best"], report.t
    assert np.all(bound.max(axis=0) <= GROWTH * bound[t <= 1.0].max(axis=0))


# --- a bar that spins and is stretched by it, which its modes cannot follow: the full one falls behind ---


SPEED, STEP, HALF_TURNS = 200.0, 1e-3, 150  # rad/s, s
ALL = 42  # modes: 48 coordinates less six that the hinge's frame takes
SHOWN = ("global", "local")


def spinning_bar(n):
    """Sensors by name and body of a bar of n bending modes, hinged at its left end, without loads."""
    fem = hex_bar(3, (0.5, 0.04, 0.05), (2e10, 7800.0, 0.3))
    floating.reduce(fem, range(n), "complete")
    nodes, weights = floating.interface(fem, "left")
    centre = weights @ fem.GetNodePositionsAsArray()[nodes]
    mbs = exu.SystemContainer().AddSystem()
    items = ObjectFFRFreducedOrderInterface(fem).AddObjectFFRFreducedOrder(
        mbs,
        initialAngularVelocity=[0.0, 0.0, SPEED],
        initialVelocity=list(np.cross(centre, [0.0, 0.0, SPEED])),
        stiffnessProportionalDamping=2e-4,
    )
    body = items["oFFRFreducedOrder"]
    ground = mbs.AddObject(itemInterface.ObjectGround(referencePosition=centre))
    markers = [
        mbs.AddMarker(itemInterface.MarkerBodyRigid(bodyNumber=ground)),
        floating.add_interface_marker(mbs, body, nodes, weights),
    ]
    mbs.AddObject(itemInterface.GenericJoint(markerNumbers=markers, constrainedAxes=[1, 1, 1, 1, 1, 0]))
    tip = {"bodyNumber": body, "meshNodeNumber": int(floating.interface(fem, "tip")[0][0]), "storeInternal": True}
    kinds = exu.OutputVariableType.Displacement, exu.OutputVariableType.DisplacementLocal
    sensors = [
        mbs.AddSensor(itemInterface.SensorSuperElement(name=name, outputVariableType=kind, **tip))
        for name, kind in zip(SHOWN, kinds, strict=True)
    ]
    return mbs, fem, items, sensors


def motion(mbs, sensors):
    """What sensors show (HALF_TURNS + 1, 3) of the run."""
    mbs.Assemble()
    mbs.SolveDynamic(floating.solver_settings(STEP, HALF_TURNS * STEP))
    return [mbs.GetSensorStoredData(sensor)[:, 1:] for sensor in sensors]


def test_rotor_that_falls_behind_is_turned_not_stretched():
    """Truth: all modes, same steps; after 0.15 s it is 0.1 rad behind.

    The estimate in global axes is 1 to 2 % off; 8.4 % with Euler parameters that were added to instead of turned.
    """
    mbs, _, _, sensors = spinning_bar(ALL)
    truth = motion(mbs, sensors)
    mbs, fem, items, sensors = spinning_bar(2)
    monitor = romerr.attach(mbs, romerr.floating_body(fem, items), outputs=sensors)
    shown = motion(mbs, sensors)
    errors = [(full - reduced)[:, :2] for full, reduced in zip(truth, shown, strict=True)]
    for name, error in zip(SHOWN, errors, strict=True):
        assert np.all(np.abs(error) <= monitor.report().output(name).bound["best"][:, :2])
    out = monitor.report().output("global")
    missed = (out.estimate - out.estimate_parts["time step"])[:, :2] - errors[0]
    assert np.abs(missed).max() < 0.03 * np.abs(errors[0]).max()
