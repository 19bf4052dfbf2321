"""The moving frame: motion of Exudyn's frame nodes, inertia terms node by node, outputs in global axes."""

from functools import cache

import exudyn as exu
import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp
from exudyn import itemInterface
from scipy.spatial.transform import Rotation

from exudyn_romerr import AssumptionError, mean_rotation, node_displacement
from exudyn_romerr.linear.estimators.bounds import Bounds, seen_in
from exudyn_romerr.mbs.floating.frame_node import FrameNode
from exudyn_romerr.model.floating_frame import (
    FrameMotion,
    FramePose,
    inertia_columns,
    inertia_coordinates,
    left_jacobian,
    skew,
)
from exudyn_romerr.model.outputs import View
from tests.helpers import tolerances as tol
from tests.mbs.floating.test_floating_scene import (
    EULER,
    HINGE,
    LIE,
    SCENES,
    TURNED,
    Quantity,
    add_load,
    add_marker,
    add_node_marker,
    bar,
    defect,
    settings,
    solve,
    supported,
    watched,
)

ELSEWHERE = np.array([1.0, -2.0, 0.5]), TURNED  # where an undeformed body may be
NODES, SAMPLES, MODES = 7, 5, 3

# --- the frame's node -------------------------------------------------------

NODE_OUTPUTS = {
    "r": Quantity.Position,
    "r_t": Quantity.Velocity,
    "r_tt": Quantity.Acceleration,
    "A": Quantity.RotationMatrix,
    "w": Quantity.AngularVelocityLocal,
    "global w": Quantity.AngularVelocity,
}


@cache
def spinning(node, solver="GeneralizedAlpha"):
    """Motion as FrameNode has it, and what the node gave at every step, of a soft bar that tumbles in space."""
    scene = bar(node=node, soft=1e-3, at=ELSEWHERE)
    add_load(scene, scene.right, [10.0, 20.0, -30.0], torque=True)
    add_load(scene, scene.left, [1000.0, 20.0, -30.0])
    number, mbs, rows = scene.items["nRigidBody"], scene.mbs, []
    outputs = {**NODE_OUTPUTS, **({"global al": Quantity.AngularAcceleration} if node == EULER else {})}
    size = len(mbs.GetNode(number)["referenceCoordinates"])

    def note(mbs, t):
        system = mbs.systemData
        reads = system.GetODE2Coordinates, system.GetODE2Coordinates_t, system.GetODE2Coordinates_tt
        seen = [np.atleast_1d(mbs.GetNodeOutput(number, quantity)) for quantity in outputs.values()]
        rows.append([t, *(read()[:size] for read in reads), *seen])
        return True

    mbs.SetPostStepUserFunction(note)
    solve(scene, steps=60, solver=solver)
    t, q, q_t, q_tt, *seen = (np.array(column) for column in zip(*rows, strict=True))
    motion = FrameNode(mbs.GetNode(number)).motion(q, q_t, q_tt)
    return motion, {"t": t, **dict(zip(outputs, seen, strict=True))}


def ours(motion, what):
    if what.startswith("global"):
        return np.einsum("sij,sj->si", motion.A, getattr(motion, what.split()[1]))
    return getattr(motion, what).reshape(len(motion.r), -1)


@pytest.mark.parametrize(
    ("node", "what"), [*((n, what) for n in (EULER, LIE) for what in NODE_OUTPUTS), (EULER, "global al")]
)
def test_motion_is_the_nodes_own(node, what):
    motion, seen = spinning(node)
    size = np.abs(seen[what]).max()
    np.testing.assert_allclose(ours(motion, what), seen[what], rtol=0, atol=tol.UNIT_NORM * size)


@pytest.mark.parametrize("node", [EULER, LIE])
def test_frames_turn_by_large_angles(node):
    A = spinning(node)[0].A
    angles = Rotation.from_matrix(A @ A[0].T).magnitude()
    assert angles.max() > 3


def test_lie_group_acceleration_is_the_rate_of_the_angular_velocity():
    motion, seen = spinning(LIE)
    mean = (motion.al[1:] + motion.al[:-1]) / 2
    change = np.diff(motion.w, axis=0) / np.diff(seen["t"])[:, None]
    # a while after the loads came on, the trapezoidal rule is off by the curvature of al only: 5 %
    assert np.abs(change - mean)[-20:].max() < 0.1 * np.abs(mean[-20:]).max()


def test_rotation_matrix_is_the_nodes_own_also_where_euler_parameters_drift():
    motion, seen = spinning(EULER, "TrapezoidalIndex2")
    np.testing.assert_allclose(ours(motion, "A"), seen["A"], rtol=0, atol=tol.ENTRIES)


@pytest.mark.parametrize("node", [EULER, LIE])
def test_reference_pose_is_where_the_body_was_put(node):
    scene = bar(node=node, at=ELSEWHERE)
    r, A = FrameNode(scene.mbs.GetNode(scene.items["nRigidBody"])).reference_pose()
    np.testing.assert_allclose(r, ELSEWHERE[0], rtol=tol.ENTRIES)
    np.testing.assert_allclose(A, ELSEWHERE[1], atol=tol.ENTRIES)


def test_tait_bryan_angles_are_refused_with_a_cure():
    scene = bar(node="NodeType.RotationRxyz")
    with pytest.raises(AssumptionError, match=r"RotationRxyz.*rigidBodyNodeType='NodeType.RotationEulerParameters'"):
        FrameNode(scene.mbs.GetNode(scene.items["nRigidBody"]))
    with pytest.raises(AssumptionError, match="rigidBodyNodeType"):
        watched(scene)


# --- inertia terms ----------------------------------------------------------


@pytest.fixture
def rng():
    return np.random.default_rng(0)


def random_motion(rng, S=SAMPLES):
    A = Rotation.random(S, random_state=0).as_matrix()
    r, r_t, r_tt, w, al = rng.standard_normal((5, S, 3))
    return FrameMotion(r, r_t, r_tt, A, w, al)


def test_inertia_terms_are_those_of_the_nodes(rng):
    root = rng.standard_normal((NODES, NODES))
    mass = sp.csc_matrix(np.kron(root @ root.T, np.eye(3)))
    x, V = rng.standard_normal((NODES, 3)), rng.standard_normal((3 * NODES, MODES))
    b, (q, q_t) = rng.standard_normal((SAMPLES, 3)), rng.standard_normal((2, SAMPLES, MODES))
    motion = random_motion(rng)
    forces = inertia_coordinates(b, motion, q, q_t) @ inertia_columns(mass, x, V).T
    for s in range(SAMPLES):
        place, rate = x + (V @ q[s]).reshape(-1, 3), (V @ q_t[s]).reshape(-1, 3)
        w, al = motion.w[s], motion.al[s]
        a = b[s] + np.cross(al, place) + np.cross(w, np.cross(w, place)) + 2 * np.cross(w, rate)
        expected = mass @ a.ravel()
        np.testing.assert_allclose(forces[s], expected, rtol=0, atol=tol.ENTRIES * np.abs(expected).max())


def test_skew_is_the_cross_product(rng):
    a, b = rng.standard_normal((2, SAMPLES, 3))
    np.testing.assert_allclose(np.einsum("sij,sj->si", skew(a), b), np.cross(a, b), atol=tol.ENTRIES)


def test_rows_of_a_motion_are_cut_as_they_were_put_together(rng):
    motion = random_motion(rng)
    for name, part in vars(FrameMotion.of(motion.rows())).items():
        np.testing.assert_array_equal(part, getattr(motion, name))


def test_global_vectors_are_seen_in_the_axes_of_the_body(rng):
    motion = random_motion(rng)
    vectors = rng.standard_normal((SAMPLES, 3))
    back = np.einsum("sij,sj->si", motion.A, motion.local(vectors))
    np.testing.assert_allclose(back, vectors, atol=tol.ENTRIES)
    np.testing.assert_allclose(motion.local(vectors[0]), motion.A.transpose(0, 2, 1) @ vectors[0], atol=tol.ENTRIES)


ANGLES = (0.0, 1e-8, 0.99e-3, 1.01e-3, 0.1, 1.0, 3.1)


@pytest.mark.parametrize("angle", ANGLES)
def test_left_jacobian_is_the_integral_of_the_rotations(angle, rng):
    theta = rng.standard_normal(3)
    theta *= angle / la.norm(theta)
    block = np.zeros((6, 6))  # exp [[X, I], [0, 0]] = [[exp X, int_0^1 exp(s X) ds], [0, I]]
    block[:3, :3], block[:3, 3:] = skew(theta), np.eye(3)
    np.testing.assert_allclose(left_jacobian(theta[None])[0], la.expm(block)[:3, 3:], atol=tol.SERIES)


@pytest.mark.parametrize("angle", ANGLES)
def test_left_jacobian_turns_rates_of_the_rotation_vector_into_angular_velocities(angle, rng):
    theta, rate = rng.standard_normal((2, 3))
    theta *= angle / la.norm(theta)
    d = 1e-5
    after, before = (la.expm(skew(theta + s * d * rate)) for s in (1, -1))
    spin = (after - before) @ la.expm(skew(theta)).T / (2 * d)  # w~ = A' A^T
    np.testing.assert_allclose(skew(left_jacobian(theta[None])[0] @ rate), spin, atol=tol.CENTRAL_DIFFERENCE)


# --- outputs in global axes -------------------------------------------------


def vectors_at(rng, of, k=2):
    """A view of k vectors, and rows of frames, base values: displacement, then velocity if the output is one."""
    view = View((0, 1, 2), rng.standard_normal((k, 3)), rng.uniform(0.5, 1.5, k), of)
    base = rng.standard_normal((SAMPLES, 3 * k * (2 if of == "velocity" else 1)))
    return view, random_motion(rng), base


@pytest.mark.parametrize("of", ["displacement", "position", "velocity"])
def test_view_is_what_an_observer_at_rest_sees(of, rng):
    view, motion, base = vectors_at(rng, of)
    pose = FramePose(rng.standard_normal(3), Rotation.random(random_state=1).as_matrix())
    seen = view.values(base, motion.rows(), pose).reshape(SAMPLES, -1, 3)
    for s in range(SAMPLES):
        u, A = base[s].reshape(-1, 3), motion.A[s]
        for k, (X, shift) in enumerate(zip(view.places, view.shift, strict=True)):
            place = shift * motion.r[s] + A @ (X + u[k])
            expected = {
                "position": place,
                "displacement": place - shift * pose.r - pose.A @ X,
                "velocity": shift * motion.r_t[s] + A @ (np.cross(motion.w[s], X + u[k]) + u[k - len(view.places)]),
            }[of]
            np.testing.assert_allclose(seen[s, k], expected, atol=tol.ENTRIES)


def bounds_of(outputs, **more):
    zero = np.zeros(len(outputs))
    known = {"position": zero, "velocity": zero, "outputs": outputs, "jumped": None, "correction": None}
    return Bounds(**{**known, "correction_bound": None, **more})


@pytest.mark.parametrize("of", ["displacement", "velocity"])
def test_bound_of_a_view_is_attained_by_the_worst_error_within_the_bounds_of_its_rows(of, rng):
    view, motion, base = vectors_at(rng, of)
    bound = seen_in(view, bounds_of(np.abs(base)), motion.rows()).outputs
    H = view.matrices(motion.rows())
    worst = np.einsum("srk,srk->sr", H, np.sign(H) * np.abs(base)[:, None])
    np.testing.assert_allclose(bound, worst, rtol=tol.SUMS)


def test_infinite_bound_counts_only_where_it_is_seen(rng):
    view, motion, base = vectors_at(rng, "displacement")
    rows = np.abs(base)
    rows[:, 0] = np.inf
    bound = seen_in(view, bounds_of(rows), motion.rows()).outputs
    assert np.isinf(bound[:, :3]).all()
    assert np.isfinite(bound[:, 3:]).all()


def posed_bar():
    """A soft bar on a hinge, its frame neither at the origin nor along the global axes."""
    scene = supported(HINGE, soft=1e-3, at=ELSEWHERE)
    scene.sensors = {}
    add_load(scene, scene.right, [3.0, 50.0, -14.0])
    return scene, settings()


def model_scene(name):
    make, h = SCENES[name]
    scene = make(h=h, t_end=20 * h)
    scene.body = scene.items["oFFRFreducedOrder"]
    return scene, scene.settings


SENSED = {
    "node": (Quantity.Position, Quantity.Displacement, Quantity.Velocity, Quantity.DisplacementLocal),
    "rigid marker": (Quantity.Position, Quantity.Displacement, Quantity.Velocity),
    "position marker": (Quantity.Position, Quantity.Displacement, Quantity.Velocity),
}
SENSED["node"] = (*SENSED["node"], Quantity.VelocityLocal)
MOVING = {"pendulum": model_scene, "rotor": model_scene, "elsewhere": lambda name: posed_bar()}


@cache
def sensed(name):
    """Return the report of all sensors as outputs, and what they stored."""
    scene, simulation = MOVING[name](name)
    markers = {
        "rigid marker": add_marker(scene, "right"),
        "position marker": add_node_marker(scene, (20, 30), (0.3, 0.7)),
    }
    sensors = {}
    for kind, quantities in SENSED.items():
        for quantity in quantities:
            common = {"outputVariableType": quantity, "storeInternal": True, "name": f"{kind} {quantity.name}"}
            sensors[common["name"]] = scene.mbs.AddSensor(
                itemInterface.SensorSuperElement(bodyNumber=scene.body, meshNodeNumber=20, **common)
                if kind == "node"
                else itemInterface.SensorMarker(markerNumber=markers[kind], **common)
            )
    monitor = watched(scene, outputs=sensors.values(), scope="inputs frozen")
    scene.mbs.Assemble()
    scene.mbs.SolveDynamic(simulation)
    stored = {key: scene.mbs.GetSensorStoredData(number)[:, 1:] for key, number in sensors.items()}
    assert defect(monitor) <= tol.BALANCED
    return monitor.report(), stored


@pytest.mark.parametrize("what", [f"{kind} {q.name}" for kind, quantities in SENSED.items() for q in quantities])
@pytest.mark.parametrize("name", MOVING)
def test_value_of_an_output_is_the_sensors(name, what):
    report, stored = sensed(name)
    size = np.abs(stored[what]).max()
    np.testing.assert_allclose(report.output(what).value, stored[what], rtol=0, atol=tol.UNIT_NORM * (1 + size))
    assert size > 1e-9


@pytest.mark.parametrize("what", ["node", "rigid marker", "position marker"])
def test_bound_of_a_position_is_that_of_the_displacement(what):
    report, _ = sensed("rotor")
    bounds = [report.output(f"{what} {of}").bound["best"] for of in ("Position", "Displacement")]
    np.testing.assert_array_equal(*bounds)


def test_bound_in_global_axes_spreads_the_bounds_in_body_axes():
    report, _ = sensed("rotor")
    local, seen = (report.output(f"node {of}").bound["best"] for of in ("DisplacementLocal", "Displacement"))
    lengths = np.linalg.norm(local, axis=1), np.linalg.norm(seen, axis=1)
    assert (lengths[1] >= lengths[0] * (1 - tol.SUMS)).all()
    assert (seen <= local.sum(axis=1)[:, None] * (1 + tol.SUMS)).all()


@pytest.mark.parametrize("of", [Quantity.Displacement, Quantity.Velocity])
def test_bounds_in_global_axes_are_those_in_body_axes_of_a_frame_at_rest(of):
    scene = supported()
    sensor = itemInterface.SensorSuperElement
    pair = [
        scene.mbs.AddSensor(
            sensor(bodyNumber=scene.body, meshNodeNumber=20, outputVariableType=quantity, name=quantity.name)
        )
        for quantity in (of, getattr(Quantity, f"{of.name}Local"))
    ]
    monitor = watched(scene, outputs=pair)
    solve(scene, h=1e-4, steps=10)
    seen, local = (out.bound["best"] for out in monitor.report().outputs.values())
    assert seen.max() > 0
    np.testing.assert_allclose(seen, local, rtol=tol.ROTATED)


def test_components_are_chosen_in_global_axes():
    scene = supported(at=ELSEWHERE)
    outputs = [node_displacement(axes, node=20, component=axes, frame="global") for axes in ("xyz", "zx")]
    monitor = watched(scene, outputs=outputs)
    solve(scene, h=1e-4, steps=5)
    whole, some = (monitor.report().output(axes) for axes in ("xyz", "zx"))
    np.testing.assert_allclose(some.value, whole.value[:, [2, 0]], rtol=0, atol=tol.ENTRIES)
    np.testing.assert_allclose(some.bound["best"], whole.bound["best"][:, [2, 0]], rtol=tol.SUMS)


def test_mean_rotation_is_the_markers_turn_against_the_frame():
    scene = supported(HINGE, soft=1e-5)
    add_load(scene, scene.right, [3.0, 5.0, -4.0], torque=True)
    item = scene.mbs.GetMarker(scene.right)
    out = mean_rotation("turn", nodes=item["meshNodeNumbers"], weights=item["weightingFactors"])
    monitor = watched(scene, outputs=[out])
    solve(scene)
    right, frame = (
        np.reshape(matrix, (3, 3))
        for matrix in (
            scene.mbs.GetMarkerOutput(scene.right, Quantity.RotationMatrix),
            scene.mbs.GetNodeOutput(scene.items["nRigidBody"], Quantity.RotationMatrix),
        )
    )
    turn = Rotation.from_matrix(frame.T @ right).as_rotvec()
    assert np.linalg.norm(turn) > 0.3
    np.testing.assert_allclose(monitor.report().output("turn").value[-1], turn, atol=tol.UNIT_NORM)


def test_sensors_are_named_by_number_or_index():
    scene = supported()
    sensor = itemInterface.SensorSuperElement(
        bodyNumber=scene.body, meshNodeNumber=20, outputVariableType=Quantity.Displacement, name="here"
    )
    number = scene.mbs.AddSensor(sensor)
    assert isinstance(number, exu.SensorIndex)
    monitor = watched(scene, outputs=[int(number)])
    solve(scene, h=1e-4, steps=3)
    assert list(monitor.report().outputs) == ["here"]
