"""The scenes of models/mechanisms.py: joints and springs hold, energies balance, more modes come closer to all."""

import functools

import exudyn as exu
import numpy as np
import pytest
from exudyn import itemInterface
from scipy.integrate import trapezoid

from models import floating, mechanisms
from models.mechanisms import CRANK_RADIUS, PISTON_MASS, double_pendulum, slider_crank, sprung_body

SCENES = [double_pendulum, slider_crank, sprung_body]
EVERY = [*SCENES, floating.clamped_bar, floating.pendulum, floating.rotor]
LENGTH, MASS = 0.4, 7850.0 * 0.4 * 0.04 * 0.06  # m, kg, of the bar
# Newton's tolerance of constraints, which are solved at position level in every step.
CLOSED = 1e-8
# Time steps err by some (h omega)^2, omega the speed of turning: measured 3e-4 at 200 rad/s and h = 2.5e-4 s.
BALANCED = 1e-3


def no_force(t):
    return 0.0, 0.0, 0.0


def marker_sensors(scene, variable, *markers):
    """Add sensors of markers, to be read after solving."""
    sensor = functools.partial(itemInterface.SensorMarker, outputVariableType=variable, storeInternal=True)
    return [scene.mbs.AddSensor(sensor(markerNumber=marker)) for marker in markers]


def body_sensor(scene, body, variable):
    sensor = itemInterface.SensorBody(bodyNumber=body, outputVariableType=variable, storeInternal=True)
    return scene.mbs.AddSensor(sensor)


def stored(scene, sensor):
    """Return the values of a sensor after every step, (steps + 1, components)."""
    return scene.mbs.GetSensorStoredData(sensor)[:, 1:]


def run(scene):
    """Solve; return sensor name -> displacements (steps + 1, 3)."""
    scene.solve()
    return {name: stored(scene, number) for name, number in scene.sensors.items()}


def joint_markers(scene, name):
    return scene.mbs.GetObject(scene.objects[name])["markerNumbers"]


def motion_at(scene, joint):
    """Add sensors of position and orientation of the two markers of a joint."""
    kinds = exu.OutputVariableType.Position, exu.OutputVariableType.RotationMatrix
    return [marker_sensors(scene, kind, *joint_markers(scene, joint)) for kind in kinds]


def gap_and_tilt(scene, sensors):
    """Distances of the two markers (steps + 1, 3) and cosines of y of the first with x and z of the second."""
    (p0, p1), (R0, R1) = ([stored(scene, number) for number in pair] for pair in sensors)
    R0, R1 = (R.reshape(-1, 3, 3) for R in (R0, R1))
    return p1 - p0, np.einsum("tij,tik->tjk", R0, R1)[:, 1, [0, 2]]


@pytest.mark.parametrize(
    ("build", "joints"),
    [(double_pendulum, ["hinge 1", "hinge 2"]), (slider_crank, ["shaft", "crank pin", "guide", "piston pin"])],
)
def test_joints_hold(build, joints):
    scene = build()
    sensors = {joint: motion_at(scene, joint) for joint in joints}
    motion = run(scene)
    for joint in joints:
        gap, tilt = gap_and_tilt(scene, sensors[joint])
        held = {"guide": [1, 2], "piston pin": [0, 2]}.get(joint, [0, 1, 2])
        assert np.abs(gap[:, held]).max() < CLOSED
        if joint != "piston pin":
            assert np.abs(tilt).max() < CLOSED
    assert np.abs(motion["tip 1"]).max() > 0.1


@pytest.mark.parametrize("build", SCENES)
def test_sensors_are_of_the_tip_and_the_middle_of_every_bar(build):
    scene = build(assemble=True)
    count = len(scene.bodies)
    assert set(scene.sensors) == {
        f"{probe} {number}{suffix}"
        for probe in ("tip", "middle")
        for number in range(1, count + 1)
        for suffix in ("", " local")
    }
    positions = scene.fem.GetNodePositionsAsArray()
    for name, number in scene.sensors.items():
        sensor = scene.mbs.GetSensor(number)
        assert int(sensor["bodyNumber"]) == int(scene.bodies[int(name.split()[1]) - 1]["oFFRFreducedOrder"])
        x = positions[sensor["meshNodeNumber"]]
        assert x == pytest.approx([LENGTH if "tip" in name else LENGTH / 2, 0.04, 0.06])


@pytest.mark.parametrize("build", SCENES)
def test_bars_bend_and_start_smoothly(build):
    motion = run(build())
    for name, displacement in motion.items():
        assert np.isfinite(displacement).all()
        assert displacement.shape[1] == 3
        if "local" in name:
            largest = np.abs(displacement).max()
            assert 1e-6 < largest < 1e-3
            assert np.abs(displacement[:4]).max() < 0.02 * largest


@pytest.mark.parametrize("kind", ["RBE2", "RBE3", "complete"])
@pytest.mark.parametrize("build", SCENES)
def test_scenes_run_with_every_kind_of_modes(build, kind, capfd):
    motion = run(build(kind=kind, h=1e-3, t_end=0.005))
    for displacement in motion.values():
        assert displacement.shape == (6, 3)
        assert np.isfinite(displacement).all()
        assert np.abs(displacement).max() > 0
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("build", EVERY)
def test_scenes_are_assembled_when_asked_for(build):
    assert build(assemble=True).mbs.systemIsConsistent
    assert not build().mbs.systemIsConsistent


@pytest.mark.parametrize("build", EVERY)
def test_damping_is_rayleigh(build):
    cms = build(damping=(3.0, 2e-5)).cms
    expected = 3.0 * cms.massMatrixReduced + 2e-5 * cms.stiffnessMatrixReduced
    assert cms.dampingMatrixReduced == pytest.approx(expected, rel=1e-12)


def test_double_pendulum_turns_height_into_speed():
    scene = double_pendulum(force=no_force, damping=(0.0, 0.0))
    faces = marker_sensors(scene, exu.OutputVariableType.Position, *scene.markers.values())
    kinetic = [
        body_sensor(scene, items["oFFRFreducedOrder"], exu.OutputVariableType.KineticEnergy) for items in scene.bodies
    ]
    scene.solve()
    speed = sum(stored(scene, number)[:, 0] for number in kinetic)
    height = sum(stored(scene, number)[:, 2] for number in faces) / 2  # of the centres of mass, summed
    energy = speed + MASS * 9.81 * (height - height[0])
    full = scene.mbs.GetSensorStoredData(kinetic[0])[:, 0] > mechanisms.GRAVITY_RAMP
    assert speed[-1] > 10
    assert np.ptp(energy[full]) < BALANCED * speed[-1]


def test_second_bar_of_the_double_pendulum_bends_the_first_out_of_plane():
    motion = run(double_pendulum())
    assert np.abs(motion["tip 1 local"][:, 1]).max() > 2 * np.abs(motion["tip 2 local"][:, 1]).max() > 1e-5
    still = run(double_pendulum(force=no_force))
    # The mesh of tetrahedra is not symmetric: weight bends the bars a little in y, too.
    assert np.abs(still["tip 1"][:, 1]).max() < 0.05 * np.abs(motion["tip 1"][:, 1]).max()


@pytest.fixture(scope="module")
def crank_motion():
    """Crank angle, speed, torque, piston's position, kinetic and potential energy of an undamped slider crank."""
    scene = slider_crank(damping=(0.0, 0.0), h=2.5e-4)
    crank, piston = scene.objects["crank"], scene.objects["piston"]
    types = exu.OutputVariableType
    kinetic = [
        body_sensor(scene, number, types.KineticEnergy)
        for number in (crank, piston, scene.bodies[0]["oFFRFreducedOrder"])
    ]
    speed, where, turned = (
        body_sensor(scene, *wanted)
        for wanted in ((crank, types.AngularVelocity), (piston, types.Position), (crank, types.RotationMatrix))
    )
    load = scene.mbs.systemData.NumberOfLoads() - 1
    faces = marker_sensors(scene, types.Position, scene.markers["left 1"], scene.markers["right 1"])
    torque = scene.mbs.AddSensor(itemInterface.SensorLoad(loadNumber=load, storeInternal=True))
    scene.solve()
    R = stored(scene, turned).reshape(-1, 3, 3)
    return {
        "t": scene.mbs.GetSensorStoredData(speed)[:, 0],
        "angle": np.unwrap(np.arctan2(R[:, 0, 2], R[:, 0, 0])),
        "speed": stored(scene, speed)[:, 1],
        "torque": stored(scene, torque)[:, 1],
        "piston": stored(scene, where)[:, 0],
        "kinetic": sum(stored(scene, number)[:, 0] for number in kinetic),
        "potential": MASS * 9.81 * sum(stored(scene, number)[:, 2] - 0.03 for number in faces) / 2,
    }


def test_crank_makes_more_than_a_turn_up_to_its_speed(crank_motion):
    assert crank_motion["angle"][-1] > 2 * np.pi
    assert crank_motion["speed"][-1] == pytest.approx(200.0, rel=0.05)


def test_piston_goes_where_crank_and_rod_push_it(crank_motion):
    angle = crank_motion["angle"]
    x = CRANK_RADIUS * (np.cos(angle) - 1) + np.sqrt(LENGTH**2 - (CRANK_RADIUS * np.sin(angle)) ** 2)
    # The rod is pressed and pulled by its own and the piston's inertia: E A = 5e8 N, some 1e4 N.
    pressed = (MASS / 2 + PISTON_MASS) * 200.0**2 * CRANK_RADIUS * 1.25 * LENGTH / (2.1e11 * 0.04 * 0.06)
    assert np.abs(crank_motion["piston"] - x).max() < 2 * pressed
    assert np.ptp(crank_motion["piston"]) == pytest.approx(2 * CRANK_RADIUS, rel=0.01)


def test_work_of_the_torque_becomes_speed(crank_motion):
    work = trapezoid(crank_motion["torque"] * crank_motion["speed"], crank_motion["t"])
    assert crank_motion["kinetic"][-1] > 5000
    assert crank_motion["kinetic"][-1] + crank_motion["potential"][-1] == pytest.approx(work, rel=BALANCED)


def rigid_constraints(scene):
    """Return the constraints of joints and of Euler parameters as rows acting on the frames of all bodies."""
    data, types = scene.mbs.systemData, exu.ComputeItemType
    frames = [items["nRigidBody"] for items in scene.bodies]
    frames += [scene.mbs.GetObject(scene.objects[name])["nodeNumber"] for name in ("crank", "piston")]
    columns = np.array([data.GetNodeLTGODE2(frame) for frame in frames])
    q = data.GetODE2Coordinates()
    rows = np.zeros((0, q.size))
    for name in ("shaft", "crank pin", "guide", "piston pin"):
        local = np.array(scene.mbs.ComputeItem(scene.objects[name], types.ConstraintJacobian))
        wide = np.zeros((len(local), q.size))
        wide[:, data.GetObjectLTGODE2(scene.objects[name])] = local
        rows = np.vstack([rows, wide[np.abs(wide).max(axis=1) > 0]])  # directions left free are empty
    norms = np.zeros((len(frames), q.size))
    for norm, frame, at in zip(norms, frames, columns, strict=True):
        norm[at[3:]] = q[at[3:]] + scene.mbs.GetNode(frame)["referenceCoordinates"][3:]
    return np.vstack([rows, norms])[:, columns.ravel()]


@pytest.mark.parametrize("t_end", [0.005, 0.05, 0.12])
def test_slider_crank_has_no_redundant_constraint(t_end):
    scene = slider_crank(t_end=t_end)
    scene.solve()
    G = rigid_constraints(scene)
    assert G.shape == (3 * 5 + 2 + 3, 3 * 7)  # one motion is left
    values = np.linalg.svd(G, compute_uv=False)
    assert values[-1] > 1e-3 * values[0]


def test_sprung_body_has_no_constraint():
    scene = sprung_body(assemble=True)
    assert scene.mbs.systemData.GetAECoordinates().size == 1  # of its Euler parameters


def test_sprung_body_hangs_on_its_springs():
    scene = sprung_body(force=no_force, assemble=True)
    scene.settings.staticSolver.verboseMode = 0
    scene.mbs.SolveStatic(scene.settings)
    sag = MASS * 9.81 / 2e5
    for side in ("left 1", "right 1"):
        place = scene.mbs.GetMarkerOutput(scene.markers[side], exu.OutputVariableType.Position)
        assert place[2] - 0.03 == pytest.approx(-sag, rel=0.01)


SHORT = {
    double_pendulum: {"h": 1e-3, "t_end": 0.02, "force": lambda t: (0.0, 500.0 * np.sin(150.0 * t) ** 4, 0.0)},
    slider_crank: {"h": 1e-3, "t_end": 0.02},
    sprung_body: {"h": 1e-3, "t_end": 0.02, "force": lambda t: mechanisms.shaking_force(3 * t)},
}


@functools.cache
def short_run(build, n, kind):
    """Motion over the first 20 ms, in which something happens."""
    return run(build(n, kind, **SHORT[build]))


@pytest.mark.parametrize("build", SCENES)
def test_more_modes_come_closer_to_all(build):
    truth, *reduced = (short_run(build, n, kind) for n, kind in [(0, "complete"), (0, "RBE3"), (16, "RBE3")])
    for name in (name for name in truth if "local" in name):
        size = np.abs(truth[name]).max()
        errors = [np.abs(motion[name] - truth[name]).max() for motion in reduced]
        assert errors[1] < errors[0] / 3
        assert 1e-9 * size < errors[1] < 0.01 * size


def test_rigid_faces_are_an_error_that_no_number_of_modes_removes():
    truth, *reduced = (
        short_run(sprung_body, n, kind)["tip 1 local"] for n, kind in [(0, "complete"), (16, "RBE2"), (16, "RBE3")]
    )
    rigid, free = (np.abs(motion - truth).max() for motion in reduced)
    assert 0.2 * np.abs(truth).max() > rigid > 20 * free


@pytest.mark.parametrize("share", [0.5, pytest.param(1.0, marks=pytest.mark.slow)])
@pytest.mark.parametrize("build", SCENES)
def test_effect_of_modes_does_not_depend_on_the_step(build, share):
    def effect(h):
        few, many = (run(build(n, h=h, t_end=end)) for n in (4, 16))
        return {name: many[name] - few[name] for name in few if "local" in name}

    time = build().settings.timeIntegration
    step, end = time.endTime / time.numberOfSteps, share * time.endTime
    coarse, fine = effect(step), effect(step / 2)
    for name, change in fine.items():
        assert np.abs(change[::2] - coarse[name]).max() < 0.03 * np.abs(change).max()
