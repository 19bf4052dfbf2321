"""What is told of real runs of Exudyn, beside runs with all modes and runs with finer steps."""

from dataclasses import replace
from types import SimpleNamespace

import exudyn as exu
import numpy as np
import pytest
from exudyn import itemInterface

import exudyn_romerr as romerr
from benchmarks import mechanism_builder
from benchmarks.by_run import told_by_run
from benchmarks.random_mechanisms import drawn
from exudyn_romerr.errors import AssumptionError, RunError
from exudyn_romerr.mbs.access.detached import Detached
from exudyn_romerr.mbs.mirror import recorder as module
from exudyn_romerr.mbs.mirror import told_solve as told_solve_module
from exudyn_romerr.mbs.mirror import vectors
from exudyn_romerr.mbs.mirror.covered import unknowns_of
from exudyn_romerr.mbs.mirror.hollow_copy import HollowCopy
from exudyn_romerr.mbs.mirror.recorder import Recorder, StoredRows
from exudyn_romerr.mbs.mirror.told_solve import Asked, Ended, told_solve
from exudyn_romerr.mbs.mirror.vectors import enriched
from exudyn_romerr.mechanism.scheme import Scheme
from exudyn_romerr.report.assessment import rows_of
from models import floating
from models.robot_arm import robot_arm
from tests.helpers.observed import flexes, shown
from tests.mbs.floating.test_floating_scene import add_ground_marker, bar
from tests.mbs.floating.test_floating_scene import solve as solved
from tests.mbs.mechanism.test_same_numbers import in_units

H = 1e-3
LOCAL = 1e-9  # m: below, Newton's tolerance in the truth is as large as what is looked at


def pushed(t):
    return 0.0, 200.0, 100.0


def scene_of(n, kind="RBE3", t_end=0.05, h=H, force=pushed):
    """A pendulum that falls from rest: gravity, and a force at its tip, are there at once."""
    scene = floating.pendulum(n, kind, h=h, t_end=t_end, force=force, assemble=True)
    scene.settings.solution.sensors.writePeriod = H
    newton = scene.settings.timeIntegration.newton
    newton.relativeTolerance, newton.absoluteTolerance = 1e-11, 1e-12
    for number in scene.sensors.values():
        scene.mbs.SetSensorParameter(number, "storeInternal", True)
    return scene


def told(scene):
    """Report of a scene, and what its sensors show by their key."""
    flex = romerr.floating_body(scene.fem, scene.items)
    _, report = told_by_run(scene.mbs, [flex], scene.solve)
    return report, {key: scene.mbs.GetSensor(k)["name"] for key, k in scene.sensors.items()}


def modes_of(out):
    return sum(out.estimate_parts[x] for x in ("basis", "interfaces") if x in out.estimate_parts)


def misses(scene, truth):
    """Largest |estimate of the modes - true error| over the largest true error, of each sensor."""
    report, names = told(scene)
    own, found = shown(scene), {}
    for key, name in names.items():
        error = truth[key] - own[key]
        size = np.abs(error).max()
        if size > LOCAL:
            found[key] = np.abs(modes_of(report.outputs[name]) - error).max() / size
            most = sum(report.outputs[name].uncertainty_parts.values())
            assert np.all(np.abs(modes_of(report.outputs[name]) - error) <= 2 * most + LOCAL)
    return found


@pytest.fixture(scope="module")
def all_modes():
    scene = scene_of(0, "complete")
    scene.solve()
    return shown(scene)


def test_modes_of_a_sudden_start_are_told(all_modes):
    found = misses(scene_of(1), all_modes)
    assert found
    assert max(found.values()) < 0.02  # 2e-5 in the median; what Newton leaves of positions is the rest


def test_without_accelerations_of_forces_a_sudden_start_is_not_told(all_modes, monkeypatch):
    """Static responses alone: a tenth of the error is missing, and no half width says so."""
    monkeypatch.setattr(vectors, "_accelerations", lambda known, U, n: U[:, :0])
    report, names = told(scene := scene_of(1))
    own = shown(scene)
    off = []
    for key, name in names.items():
        error = all_modes[key] - own[key]
        if np.abs(error).max() > LOCAL:
            off.append(np.abs(modes_of(report.outputs[name]) - error).max() / np.abs(error).max())
    assert max(off) > 0.02


def test_steps_are_told():
    """Beside Richardson's extrapolation of runs with a quarter and an eighth of steps that resolve all modes."""
    h = 1e-4
    report, names = told(scene := scene_of(2, h=h, t_end=0.02))
    own, fine = shown(scene), []
    for times in (4, 8):
        finer = scene_of(2, h=h / times, t_end=0.02)
        finer.solve()
        fine.append(shown(finer))
    each = round(H / h)
    for key, name in names.items():
        truth = (4 * fine[1][key] - fine[0][key]) / 3 - own[key]
        estimate = report.outputs[name].estimate_parts["time step"][::each]
        assert np.abs(estimate - truth).max() < 0.05 * np.abs(truth).max()


def test_rigid_interfaces_are_told_apart(all_modes):
    """Modes and interfaces together are what all modes with free interfaces show."""
    found = misses(scene_of(4, "RBE2"), all_modes)
    assert max(found.values()) < 0.02
    rigid, free = (told(scene_of(4, kind))[0] for kind in ("RBE2", "RBE3"))
    assert all(np.abs(out.estimate_parts["interfaces"]).max() > 0 for out in rigid.outputs.values())
    assert not any(out.estimate_parts["interfaces"].any() for out in free.outputs.values())


def test_a_controller_in_pre_step_shows_at_the_rows():
    scene = robot_arm(4, t_end=0.02)
    with pytest.raises(AssumptionError, match="PreStep"):
        told_by_run(scene.mbs, flexes(scene), scene.solve)


def test_a_body_that_rests_is_not_said_to_be_controlled():
    """Forces of stiff springs in the rounding of places are all there is: none acts of the user's."""
    scene = bar(gravity=(0.0, 0.0, 0.0))
    for marker in (scene.left, scene.right):
        markers = [marker, add_ground_marker(scene, marker)]
        scene.mbs.AddObject(itemInterface.CartesianSpringDamper(markerNumbers=markers, stiffness=[2e8] * 3))
    with pytest.raises(AssumptionError, match="nothing moves: what coordinates show is rounding"):
        told_by_run(scene.mbs, [romerr.floating_body(scene.fem, scene.items)], lambda: solved(scene))


def test_nothing_is_told_without_a_step():
    scene = scene_of(1)
    recorder = Recorder(scene.mbs, None)
    recorder(scene.mbs, 0.0)
    asked = Asked([romerr.floating_body(scene.fem, scene.items)], [()], Scheme.of_radius(1.0), False)
    with pytest.raises(RunError, match="no step"):
        told_solve(scene.mbs, asked, recorder.runs()[0])


def static(scene, steps=1):
    settings = exu.SimulationSettings()
    settings.staticSolver.verboseMode, settings.staticSolver.numberOfLoadSteps = 0, steps
    settings.solution.file.write = False
    scene.mbs.SolveStatic(settings, updateInitialValues=True)


def solves(scene, *runs):
    """Reports of solves one after another, each with what the one before has left; runs : (solve, is static)."""
    mbs, before, found = scene.mbs, None, []
    flex = romerr.floating_body(scene.fem, scene.items)
    for solve, is_static in runs:
        recorder = Recorder(mbs, None)
        mbs.SetPostStepUserFunction(recorder)
        solve()
        mbs.SetPostStepUserFunction(0)
        solver = mbs.sys["dynamicSolver" if not is_static else "staticSolver"]
        scheme = Scheme.of_radius(1.0)
        if not is_static:
            scheme = Scheme(solver.alphaM, solver.alphaF, solver.newmarkBeta, solver.newmarkGamma)
        told, before = told_solve(mbs, Asked([flex], [()], scheme, is_static), recorder.runs()[-1], before)
        found.append(told.report(told.sensors))
    return found


def clamped(n, kind="RBE3"):
    scene = floating.clamped_bar(n, kind, h=1e-4, t_end=0.01, force=lambda t: (0.0, 100.0, 50.0), assemble=True)
    for number in scene.sensors.values():
        scene.mbs.SetSensorParameter(number, "storeInternal", True)
    return scene


def test_a_run_that_begins_in_equilibrium_begins_with_its_static_error():
    """Begun without error its modes would ring about that; here a bar that goes on to rest."""
    truth = clamped(0, "complete")
    static(truth)
    scene = clamped(0)
    names = {key: scene.mbs.GetSensor(k)["name"] for key, k in scene.sensors.items()}
    at_rest, moving = solves(scene, (lambda: static(scene), True), (scene.solve, False))
    truth.solve()
    own, full = shown(scene), shown(truth)
    assert at_rest.time == "static"
    for key, name in names.items():
        error = (full[key] - own[key])[-1]
        size = np.abs(error).max()
        if size > LOCAL:
            for report in (at_rest, moving):
                estimate = modes_of(report.outputs[name])
                np.testing.assert_allclose(estimate[-1], error, rtol=0, atol=0.05 * size)
            first, last = modes_of(moving.outputs[name])[[0, -1]]
            np.testing.assert_allclose(first, last, rtol=0, atol=0.02 * size)


def test_intervals_are_one_run():
    """Each begins with what the one before has left wrong; accelerations are those of the equations anew.

    Which makes the runs themselves differ: 8 % of the error of a bar that rings.
    """
    whole = scene_of(2, t_end=0.06)
    (once,) = solves(whole, (whole.solve, False))
    scene = scene_of(2, t_end=0.06)

    def interval(k):
        def solve():
            time = scene.settings.timeIntegration
            time.startTime, time.endTime, time.numberOfSteps = 0.02 * k, 0.02 * (k + 1), 20
            scene.mbs.SolveDynamic(scene.settings, updateInitialValues=True)

        return solve, False

    reports = solves(scene, *map(interval, range(3)))
    for name, out in once.outputs.items():
        joined = np.concatenate([report.outputs[name].estimate[k > 0 :] for k, report in enumerate(reports)])
        np.testing.assert_allclose(joined, out.estimate, rtol=0, atol=0.2 * np.abs(out.estimate).max())
        assert not reports[-1].outputs[name].uncertified


def test_what_goes_on_from_a_run_that_is_not_known_is_doubted():
    scene = scene_of(1)
    flex = romerr.floating_body(scene.fem, scene.items)
    recorder = Recorder(scene.mbs, None)
    scene.mbs.SetPostStepUserFunction(recorder)
    scene.solve()
    (rows,) = recorder.runs()
    asked = Asked([flex], [()], Scheme.of_radius(1.0), False)
    told, _ = told_solve(scene.mbs, asked, rows, Ended(rows.q[0], rows.v[0]))
    report = told.report(told.sensors)
    assert {doubt.reason for doubt in report.uncertified} == {"GOES_ON"}
    assert not any(row.answer.value == "enough" for row in rows_of(report))


def stopped(h, stiffness=1e5):
    """An arm that falls on a stop: contact as the user function of a spring, without data coordinates."""
    scene = floating.pendulum(2, h=h, t_end=0.1, force=lambda t: (0.0, 0.0, -60.0))
    mbs = scene.mbs
    ground = mbs.AddMarker(itemInterface.MarkerBodyPosition(bodyNumber=mbs.AddObject(itemInterface.ObjectGround())))

    def contact(mbs, t, item, u, v, k, d, offset):
        return [0.0, 0.0, stiffness * min(0.0, u[2] + 0.01)]

    mbs.AddObject(
        itemInterface.ObjectConnectorCartesianSpringDamper(
            markerNumbers=[ground, scene.markers["right"]], stiffness=[1, 1, 1], springForceUserFunction=contact
        )
    )
    mbs.Assemble()
    return scene


def test_numbers_that_grow_beyond_all_bounds_warn_nobody(monkeypatch):
    """Warnings of numpy are errors in tests, as they may be in a user's script."""
    inner = told_solve_module.estimates

    def growing(*arguments):
        assert np.isinf(np.array([1e308]) * 10).all()
        return inner(*arguments)

    monkeypatch.setattr(told_solve_module, "estimates", growing)
    report, names = told(scene_of(2))
    assert all(np.isfinite(report.outputs[name].estimate).all() for name in names.values())


def test_forces_that_are_not_smooth_are_not_told_as_numbers():
    """Told as 4.5e-4 +- 6e-5 where 1.1e-4 was true; now the half width is as large as the number."""
    report, names = told(stopped(H))
    for name in names.values():
        out = report.outputs[name]
        size = np.abs(out.estimate_parts["time step"]).max()
        assert out.uncertainty_parts["linearisation of steps"].max() > 0.3 * size
    smooth, names = told(scene_of(2))
    for name in names.values():
        out = smooth.outputs[name]
        assert (
            out.uncertainty_parts["linearisation of steps"].max()
            < 0.1 * np.abs(out.estimate_parts["time step"]).max()
        )


@pytest.mark.parametrize("until", [0.0203, 0.0207, 0.02])
def test_a_load_that_ends_inside_a_step_is_told(until):
    """It was told as 2.7e-5 +- 7e-6, "enough", where 4.7e-4 was true: samples know nothing of when it ends."""

    def made(times):
        return scene_of(2, h=H / times, t_end=0.03, force=lambda t: (0.0, 0.0, -200.0 if t < until else 0.0))

    report, names = told(scene := made(1))
    own, fine = shown(scene), []
    for times in (40, 80):
        finer = made(times)
        finer.solve()
        fine.append(shown(finer))
    key = "tip"
    truth, unsure = fine[1][key] - own[key], np.abs(fine[1][key] - fine[0][key]).max()
    out = report.outputs[names[key]]
    half = out.uncertainty_parts["loads"] + out.uncertainty_parts["linearisation of steps"]
    off = np.abs(out.estimate_parts["time step"] - truth).max(axis=0)
    assert np.all(off <= 2 * half.max(axis=0) + unsure)
    assert np.abs(truth).max() > 1e-4


def reports_in(monkeypatch, seed, length=1.0, mass=1.0):
    side, share = mechanism_builder.CUBE
    with monkeypatch.context() as patched:
        patched.setattr(mechanism_builder, "CUBE", (side * length, share))
        scene = mechanism_builder.built(in_units(replace(drawn(seed), steps=40), length, mass))
    newton = scene.settings.timeIntegration.newton
    newton.relativeTolerance, newton.absoluteTolerance = 1e-12, 1e-12 * mass * length
    newton.modifiedNewtonContractivity, newton.maxModifiedNewtonIterations, newton.maxIterations = 0.9, 25, 50
    return told_by_run(scene.mbs, scene.flexible(), scene.solve)[1]


def test_a_body_that_flies_has_no_constraint():
    """But the length of its Euler parameters, which unknowns keep: rounding of it made matrices singular."""
    scene = mechanism_builder.built(replace(drawn(8), steps=40))
    report = told_by_run(scene.mbs, scene.flexible(), scene.solve)[1]
    for out in report.outputs.values():
        assert np.all(out.uncertainty < np.inf)
        assert np.abs(out.estimate).max() > 0


def test_what_no_force_knows_is_read_as_nothing():
    """As of a body that nothing acts on, in one of Exudyn's examples."""
    scene = scene_of(1)
    none = Detached(scene.mbs, [])
    one = enriched(scene.mbs, romerr.floating_body(scene.fem, scene.items), 10, 0.0, none)
    copy = HollowCopy(scene.mbs, [one], unknowns_of(scene.mbs, [one.body]), none)
    copy.seen = np.zeros(0, int)
    q, lam = np.zeros(copy.own.size), scene.mbs.systemData.GetAECoordinates()
    reading = copy.read(0.0, q, q, q, lam)
    assert not reading.K.nnz
    assert not reading.H.nnz
    assert reading.G.shape == (0, len(copy.scales))


@pytest.mark.parametrize("seed", [112, 30])
def test_units_do_not_matter(seed, monkeypatch):
    """Millimetres and tonnes: every number to 1e-6, half widths to what rounding leaves of small differences.

    Two bars with joints, one of which starts suddenly; rigid interfaces. Before, what is constant over time, and the
    drift of rates, mixed lengths with angles: estimates 4e-4 off, a half width 0.2.
    """
    metres, millimetres = reports_in(monkeypatch, seed), reports_in(monkeypatch, seed, 1e3, 1e-3)
    assert set(metres.outputs) == set(millimetres.outputs)
    for name, out in metres.outputs.items():
        other = millimetres.outputs[name]
        for one, two, off in ((out.estimate, other.estimate, 1e-6), (out.uncertainty, other.uncertainty, 1e-4)):
            np.testing.assert_allclose(two / 1e3, one, rtol=0, atol=off * np.abs(one).max())


def loaded_between(n, kind="RBE3"):
    """A pendulum with a force that is there at once on a node between its interfaces."""
    scene = floating.pendulum(n, kind, h=H, t_end=0.03, force=pushed)
    x = np.asarray(scene.fem.GetNodePositionsAsArray())
    node = int(np.argmin(np.abs(x[:, 0] - x[:, 0].mean())))
    marker = itemInterface.MarkerSuperElementPosition(
        bodyNumber=scene.items["oFFRFreducedOrder"], meshNodeNumbers=[node], weightingFactors=[1.0]
    )
    load = itemInterface.LoadForceVector(markerNumber=scene.mbs.AddMarker(marker), loadVector=[0.0, -60.0, 80.0])
    scene.mbs.AddLoad(load)
    scene.mbs.Assemble()
    newton = scene.settings.timeIntegration.newton
    newton.relativeTolerance, newton.absoluteTolerance = 1e-11, 1e-12
    for number in scene.sensors.values():
        scene.mbs.SetSensorParameter(number, "storeInternal", True)
    return scene


def test_a_load_between_interfaces_is_felt_by_vectors():
    """It acts on vectors that are kept for it, whatever tangents know of them."""
    truth = loaded_between(0, "complete")
    truth.solve()
    assert max(misses(loaded_between(1), shown(truth)).values()) < 0.03
    scene = loaded_between(1)
    none = Detached(scene.mbs, [])
    one = enriched(scene.mbs, romerr.floating_body(scene.fem, scene.items), 10, 0.0, none)
    unknowns = unknowns_of(scene.mbs, [one.body])
    copy, recorder = HollowCopy(scene.mbs, [one], unknowns, none), Recorder(scene.mbs, None)
    scene.mbs.SetPostStepUserFunction(recorder)
    scene.solve()
    (rows,) = recorder.runs()
    copy.note_dependence([copy.read(*rows.row(i)) for i in (1, 3)])
    assert len(unknowns.kept)
    assert set(unknowns.kept) <= set(copy.felt)


# --- rows of a run ---


class System:
    """What a recorder reads: q, q_t, q_tt of two coordinates, one multiplier; accelerations are numbers of rows."""

    def __init__(self):
        self.q, self.number = np.zeros(2), 0

    def GetODE2Coordinates(self, *_):
        return self.q

    def GetODE2Coordinates_t(self, *_):
        return 10 * self.q

    def GetODE2Coordinates_tt(self, *_):
        return np.full(2, self.number)

    def GetAECoordinates(self, *_):
        return self.q[:1] - 1

    def GetODE1Coordinates(self, *_):
        return self.q[:0]

    GetODE1Coordinates_t = GetODE1Coordinates


def recorded(times):
    """A recorder of rows whose coordinates are t, 2 t."""
    mbs = SimpleNamespace(systemData=System())
    found = Recorder(mbs, None)
    for number, t in enumerate(times):
        mbs.systemData.q, mbs.systemData.number = np.array([t, 2 * t]), number
        assert found(mbs, t) is True
    return found, mbs


@pytest.mark.parametrize("count", [1, 3, 4, 5, 23])
def test_rows_in_a_file_are_the_same(count, monkeypatch):
    (wanted,) = recorded(np.arange(count))[0].runs()
    monkeypatch.setattr(module, "MOST", 8 * 8 * 11)  # eleven rows
    found, mbs = recorded(np.arange(count))
    (rows,) = found.runs()
    assert isinstance(rows.q, np.memmap) == (count > 12)
    for one, other in zip(vars(rows).values(), vars(wanted).values(), strict=True):
        np.testing.assert_array_equal(one, other)
    np.testing.assert_array_equal(wanted.v, 10 * np.outer(np.arange(count), [1, 2]))
    np.testing.assert_array_equal(wanted.multipliers[:, 0], np.arange(count) - 1)
    mbs.systemData.q = np.array([99.0, 198.0])
    found(mbs, 99.0)  # it goes on where it was
    np.testing.assert_array_equal(found.runs()[0].t, [*range(count), 99.0])


def test_a_solver_that_begins_again_begins_a_run_or_goes_on():
    runs = recorded([0, 1, 2, 2, 3, 0, 1, 0.5, 1.5])[0].runs()
    assert [rows.t.tolist() for rows in runs] == [[0, 1, 2, 3], [0, 1], [0.5, 1.5]]
    assert runs[0].a[:, 0].tolist() == [0, 1, 3, 4]  # accelerations that a solver finds anew
    assert recorded([])[0].runs() == []


def test_what_cannot_be_kept_is_told_and_stops_nothing(monkeypatch):
    def full(*_):
        raise OSError("No space left on device")

    monkeypatch.setattr(StoredRows, "append", full)
    with pytest.raises(RunError, match="could not be kept: No space left"):
        recorded([0.0, 1.0])[0].runs()
    monkeypatch.undo()
    found, mbs = recorded([0.0])
    mbs.systemData.q = np.zeros(3)
    assert found(mbs, 1.0) is True
    with pytest.raises(RunError, match="could not be kept"):
        found.runs()
