"""The bodies of models/floating.py against rigid bodies and beam theory, and a few steps of its scenes."""

import exudyn as exu
import numpy as np
import pytest
from scipy import sparse

from exudyn_romerr.model.admissible_space import HELD, mean_motion
from models import floating
from models.beam3d import STEEL
from tests.helpers.truth import rigid_motions

LENGTH, WIDTH, HEIGHT = 0.4, 0.04, 0.06  # m, of the bar
BODIES = ("bar", "bar_fine", "rotor")

# Sums of products of matrix entries: some hundred roundings, and a margin of as much again.
MULTIPLIED = 1e-12
# Modes come out of an eigenvalue solver; entries of M-orthonormal columns are of order 1.
SOLVED = 1e-10


@pytest.fixture(params=BODIES)
def fem(request):
    return floating.load_fem(request.param)


def volume(fem):
    """Volume of the tetrahedra."""
    a, b, c, d = fem.GetNodePositionsAsArray()[fem.elements[0]["Tet4"]].transpose(1, 0, 2)
    return np.abs(np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a)).sum() / 6


def missed_conditions(fem):
    """Largest |C_0 v| of a mode relative to |C_0| |v|."""
    C, V = mean_motion(*floating.interface(fem, "left")).rows(fem.GetNodePositionsAsArray()), fem.modeBasis["matrix"]
    return np.max(np.abs(C @ V) / np.outer(np.linalg.norm(C, axis=1), np.linalg.norm(V, axis=0)))


def run(scene):
    """Solve; return sensor name -> displacements (steps + 1, 3)."""
    scene.solve()
    return {name: scene.mbs.GetSensorStoredData(number)[:, 1:] for name, number in scene.sensors.items()}


@pytest.mark.parametrize(("name", "nodes"), [("bar", (50, 70)), ("bar_fine", (250, 350)), ("rotor", (120, 200))])
def test_sizes(name, nodes):
    fem = floating.load_fem(name)
    assert nodes[0] <= fem.NumberOfNodes() <= nodes[1]
    assert fem.massMatrix.shape == fem.stiffnessMatrix.shape == (3 * fem.NumberOfNodes(),) * 2
    assert (floating.DATA / f"floating_{name}.npz").stat().st_size < 3e6


def test_translation_has_the_energy_of_the_total_mass(fem):
    shifts = rigid_motions(fem.GetNodePositionsAsArray())[:, :3]
    mass = STEEL.density * volume(fem)
    assert shifts.T @ fem.massMatrix @ shifts == pytest.approx(mass * np.eye(3), rel=MULTIPLIED, abs=MULTIPLIED)


def test_bar_has_the_volume_of_a_box():
    for name in ("bar", "bar_fine"):
        assert volume(floating.load_fem(name)) == pytest.approx(LENGTH * WIDTH * HEIGHT, rel=MULTIPLIED)


def test_matrices_are_symmetric_and_the_body_is_one_piece(fem):
    for matrix in (fem.massMatrix, fem.stiffnessMatrix):
        assert abs(matrix - matrix.T).max() == 0
    assert sparse.csgraph.connected_components(fem.stiffnessMatrix)[0] == 1


def test_free_body_has_exactly_the_six_rigid_modes(fem):
    K, M = fem.stiffnessMatrix.tocsc(), fem.massMatrix.tocsc()
    assert np.abs(K @ rigid_motions(fem.GetNodePositionsAsArray())).max() < MULTIPLIED * abs(K).max()
    # Shifted below zero, so that the matrix to factorise is positive definite.
    values = sparse.linalg.eigsh(K, 7, M, sigma=-1e6, v0=np.ones(K.shape[0]), return_eigenvectors=False)
    rigid, elastic = np.split(np.sort(values), [6])
    assert np.abs(rigid).max() < 1e-6 * elastic[0]


def test_mass_acts_on_the_three_directions_alike(fem):
    by_direction = [fem.massMatrix[axis::3] for axis in range(3)]
    for axis, rows in enumerate(by_direction):
        assert abs(rows[:, axis::3] - by_direction[0][:, ::3]).max() < MULTIPLIED
        assert abs(rows[:, (axis + 1) % 3 :: 3]).max() == 0


def test_node_sets_are_the_end_faces(fem):
    positions = fem.GetNodePositionsAsArray()
    for name, x in (("left", 0.0), ("right", positions[:, 0].max())):
        nodes, weights = floating.interface(fem, name)
        assert sorted(nodes) == fem.GetNodesInPlane([x, 0, 0], [1, 0, 0])
        assert weights.sum() == pytest.approx(1, rel=MULTIPLIED)
        assert weights.min() > 0
        assert weights == pytest.approx(fem.GetNodeWeightsFromSurfaceAreas(nodes), rel=MULTIPLIED)


def test_mean_of_a_bar_end_is_its_centre():
    for name in ("bar", "bar_fine"):
        fem = floating.load_fem(name)
        nodes, weights = floating.interface(fem, "right")
        middle = [LENGTH, WIDTH / 2, HEIGHT / 2]
        assert weights @ fem.GetNodePositionsAsArray()[nodes] == pytest.approx(middle, rel=MULTIPLIED)


def test_rotor_is_unbalanced_by_its_hole_only():
    fem = floating.load_fem("rotor")
    mass = fem.massMatrix[::3, ::3].sum(axis=1).A1
    centre = mass @ fem.GetNodePositionsAsArray() / mass.sum()
    # The hole lies on z, at a distance of 60 mm; 15 sided polygons for circles leave a tenth of it in y.
    assert -2e-3 < centre[2] < -1e-3
    assert abs(centre[1]) < 1e-4


def test_rim_node_lies_on_the_rim():
    fem = floating.load_fem("rotor")
    (node,), _ = floating.interface(fem, "rim")
    assert np.linalg.norm(fem.GetNodePositionsAsArray()[node, 1:]) == pytest.approx(0.1, rel=1e-6)


@pytest.fixture(params=["bar", "rotor"])
def small_fem(request):
    """Bodies whose dense eigenvalue problems take less than a second."""
    return floating.load_fem(request.param)


@pytest.mark.parametrize("kind", ["RBE2", "RBE3"])
def test_craig_bampton_modes(fem, kind):
    floating.reduce(fem, 4, kind)
    assert fem.modeBasis["matrix"].shape == (fem.NumberOfCoordinates(), 10)
    assert missed_conditions(fem) < HELD


def test_free_modes_are_elastic(small_fem):
    floating.reduce(small_fem, 5, "free")
    V = small_fem.modeBasis["matrix"]
    assert V.shape == (small_fem.NumberOfCoordinates(), 5)
    momenta = rigid_motions(small_fem.GetNodePositionsAsArray()).T @ small_fem.massMatrix @ V
    # A rigid mode has a momentum of order 1; the solver's rounding, 1e-16 of the highest squared frequency, is up
    # to 1e6 times as much of the lowest.
    assert np.abs(momenta).max() < 1e-8
    assert V.T @ small_fem.stiffnessMatrix @ V == pytest.approx(
        np.diag(small_fem.eigenValues), abs=1e-9 * small_fem.eigenValues[-1]
    )


def test_complete_basis_is_all_that_the_reference_conditions_admit(small_fem):
    floating.reduce(small_fem, 0, "complete")
    V = small_fem.modeBasis["matrix"]
    assert V.shape == (small_fem.NumberOfCoordinates(), small_fem.NumberOfCoordinates() - 6)
    assert missed_conditions(small_fem) < SOLVED
    assert V.T @ small_fem.massMatrix @ V == pytest.approx(np.eye(V.shape[1]), abs=SOLVED)


def cantilever(width, height, tip_force, weight):
    """Deflection of Timoshenko's cantilever along its height: force at the tip, weight (N) spread over the length."""
    bending = LENGTH**3 / (STEEL.youngs_modulus * width * height**3 / 12)
    shear = LENGTH / (5 / 6 * STEEL.shear_modulus * width * height)
    return tip_force * (bending / 3 + shear) + weight * (bending / 8 + shear / 2)


@pytest.mark.parametrize("body", ["bar", "bar_fine"])
def test_clamped_bar_bends_as_in_beam_theory(body):
    scene = floating.clamped_bar(body=body, force=lambda t: (0.0, 200.0, 100.0), assemble=True)
    scene.settings.staticSolver.verboseMode = 0
    scene.mbs.SolveStatic(scene.settings)
    _, y, z = scene.mbs.GetSensorValues(scene.sensors["right"])
    weight = 9.81 * STEEL.density * LENGTH * WIDTH * HEIGHT
    expected = cantilever(HEIGHT, WIDTH, 200.0, 0.0), cantilever(WIDTH, HEIGHT, 100.0, -weight)
    if body == "bar":  # one linear tetrahedron across the width is nearly four times too stiff
        assert 0.1 * expected[0] < y < 0.5 * expected[0]
    else:  # quadratic, held by mean motion, so that no section is kept from warping: 0.1 % off
        assert (y, z) == pytest.approx(expected, rel=5e-3)


@pytest.mark.parametrize("kind", ["RBE2", "RBE3", "free", "complete"])
@pytest.mark.parametrize("scene", [floating.clamped_bar, floating.pendulum])
def test_bar_scenes_run(scene, kind, capfd):
    motion = run(scene(kind=kind, h=1e-3, t_end=0.005))
    for displacement in motion.values():
        assert displacement.shape == (6, 3)
        assert np.isfinite(displacement).all()
        assert 1e-9 < np.abs(displacement).max() < 1e-3
    assert capfd.readouterr() == ("", "")


def test_pendulum_falls_like_a_rigid_body_at_first():
    t = 0.01
    fall = 9.81 * LENGTH**2 / 2 / (LENGTH**2 / 3 + HEIGHT**2 / 12) * t**2 / 2
    # It turns by 2e-3 rad; its elastic deflection is 3e-7 m.
    assert run(floating.pendulum(t_end=t))["right"][-1, 2] == pytest.approx(-fall, rel=1e-3)


@pytest.mark.parametrize("scene", [floating.clamped_bar, floating.pendulum])
def test_reduced_scene_follows_the_complete_one(scene):
    reduced, complete = (run(scene(kind=kind, t_end=0.01))["tip local"] for kind in ("RBE3", "complete"))
    assert 0 < np.abs(reduced - complete).max() < 0.02 * np.abs(complete).max()


def test_more_modes_come_closer_to_the_complete_bar():
    complete = run(floating.clamped_bar(kind="complete", t_end=0.01))["tip"]
    errors = [np.abs(run(floating.clamped_bar(n, t_end=0.01))["tip"] - complete).max() for n in (0, 20)]
    assert errors[1] < errors[0] / 3


def test_rotor_reaches_its_speed_about_a_fixed_axis():
    scene = floating.rotor(speed=80.0)
    motion = run(scene)
    omega = scene.mbs.GetNodeOutput(scene.items["nRigidBody"], exu.OutputVariableType.AngularVelocityLocal)
    # Gravity on the eccentric mass holds it back in the first half turn.
    assert omega[0] == pytest.approx(80.0, rel=0.01)
    assert np.abs(motion["right"]).max() < 1e-6
    # The rim goes to the other side, 0.2 m away, and bends by less than a tenth of a millimetre.
    assert np.abs(motion["rim"][:, 2]).max() == pytest.approx(0.2, rel=0.02)
    assert 1e-6 < np.abs(motion["rim local"]).max() < 1e-4
