"""The example models against beam theory and against the numbers that the paper prints."""

import numpy as np
import pytest
from scipy import linalg

from models import linkage, oscillator
from models.beam3d import DOFS_PER_NODE, STEEL, RoundSection, assemble

SECTION = RoundSection(diameter=0.02)
BENDING_STIFFNESS = STEEL.youngs_modulus * SECTION.second_moment
AXIAL_STIFFNESS = STEEL.youngs_modulus * SECTION.area
TORSION_STIFFNESS = STEEL.shear_modulus * SECTION.polar_moment
MASS_PER_LENGTH = STEEL.density * SECTION.area
LENGTH = 0.8  # m

# Solving multiplies rounding, 1e-16, by the condition number of K, 1.5e6 for four clamped elements.
SOLVED = 1e-9
# Sums of products of matrix entries, no solve: some hundred roundings, and a margin of as much again.
MULTIPLIED = 1e-12


def straight(direction, count=4):
    """Matrices (dense) of a straight beam of LENGTH from the origin."""
    nodes = np.linspace(0, LENGTH, count + 1)[:, None] * np.asarray(direction)
    return [matrix.toarray() for matrix in assemble(nodes, chain(count + 1), SECTION, STEEL)]


def chain(count):
    """Elements that join count nodes in a row."""
    return np.column_stack([np.arange(count - 1), np.arange(1, count)])


def bent_frame():
    """Nodes and elements of a frame without symmetry, with a branch."""
    nodes = np.array([[0, 0, 0], [0.3, 0.1, 0], [0.5, -0.1, 0.2], [0.5, 0.4, 0.3], [0.6, -0.2, 0.7]])
    return nodes, np.array([[0, 1], [1, 2], [2, 3], [2, 4]])


def rigid_motions(nodes):
    """Three unit translations and three unit rotations about the origin, (6 n, 6)."""
    zero = np.zeros(3)
    shifts = [[np.hstack([axis, zero]) for _ in nodes] for axis in np.eye(3)]
    turns = [[np.hstack([np.cross(axis, node), axis]) for node in nodes] for axis in np.eye(3)]
    return np.array(shifts + turns).reshape(6, -1).T


def random_rotation(seed):
    """Proper rotation from global axes, (3, 3)."""
    turn, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return turn * np.sign(np.linalg.det(turn))


def clamped(matrix):
    """Without the dofs of the first node."""
    return matrix[DOFS_PER_NODE:, DOFS_PER_NODE:]


def tip_motion(stiffness, load):
    """Motion (6,) of the last node under a load (6,) there, first node clamped."""
    loads = np.zeros(len(stiffness) - DOFS_PER_NODE)
    loads[-DOFS_PER_NODE:] = load
    return linalg.solve(clamped(stiffness), loads, assume_a="pos")[-DOFS_PER_NODE:]


@pytest.mark.parametrize("seed", range(3))
def test_cantilever_bends_stretches_and_twists_as_in_beam_theory(seed):
    """Under a force across, a moment about the axis across that, a pull, and a torque."""
    axis, side, turn_axis = random_rotation(seed).T  # axis x side = turn_axis
    stiffness, zero = straight(axis)[1], np.zeros(3)
    for load, deflection, slope in (
        (np.hstack([30.0 * side, zero]), 30.0 * LENGTH**3 / 3, 30.0 * LENGTH**2 / 2),
        (np.hstack([zero, 5.0 * turn_axis]), 5.0 * LENGTH**2 / 2, 5.0 * LENGTH),
    ):
        motion = tip_motion(stiffness, load)
        deflection, slope = deflection / BENDING_STIFFNESS, slope / BENDING_STIFFNESS
        assert motion[:3] == pytest.approx(deflection * side, rel=SOLVED, abs=SOLVED * deflection)
        assert motion[3:] == pytest.approx(slope * turn_axis, rel=SOLVED, abs=SOLVED * slope)
    pull, twist = (tip_motion(stiffness, 7.0 * x) for x in (np.hstack([axis, zero]), np.hstack([zero, axis])))
    assert axis @ pull[:3] == pytest.approx(7.0 * LENGTH / AXIAL_STIFFNESS, rel=SOLVED)
    assert axis @ twist[3:] == pytest.approx(7.0 * LENGTH / TORSION_STIFFNESS, rel=SOLVED)


def test_rigid_translation_has_the_energy_of_the_total_mass():
    nodes, elements = bent_frame()
    mass, _ = assemble(nodes, elements, SECTION, STEEL)
    shift = rigid_motions(nodes)[:, :3]
    lengths = np.linalg.norm(nodes[elements[:, 1]] - nodes[elements[:, 0]], axis=1)
    total = MASS_PER_LENGTH * lengths.sum()
    assert shift.T @ (mass @ shift) == pytest.approx(total * np.eye(3), rel=MULTIPLIED, abs=MULTIPLIED * total)


def test_rigid_rotation_has_the_energy_of_a_slender_rod():
    mass, _ = straight([1.0, 0.0, 0.0])
    spin = rigid_motions(np.linspace(0, LENGTH, 5)[:, None] * [1.0, 0.0, 0.0])[:, 3:]
    own = STEEL.density * SECTION.polar_moment * LENGTH
    # No rotary inertia of the section about its bending axes: exactly m L^2 / 3, the rod without thickness.
    slender = MASS_PER_LENGTH * LENGTH**3 / 3
    inertia = np.diag([own, slender, slender])
    assert spin.T @ mass @ spin == pytest.approx(inertia, rel=MULTIPLIED, abs=MULTIPLIED * own)


def test_free_frame_has_exactly_the_six_rigid_modes():
    nodes, elements = bent_frame()
    stiffness = assemble(nodes, elements, SECTION, STEEL)[1].toarray()
    values = linalg.eigvalsh(stiffness)
    assert np.abs(stiffness @ rigid_motions(nodes)).max() < MULTIPLIED * values[-1]
    assert np.abs(values[:6]).max() < MULTIPLIED * values[-1]
    # The softest elastic mode is a bending mode, far above rounding.
    assert values[6] > 1e-6 * values[-1]


@pytest.mark.parametrize("seed", range(3))
def test_matrices_turn_with_the_frame(seed):
    nodes, elements = bent_frame()
    rotation = random_rotation(seed)
    turn = np.kron(np.eye(2 * len(nodes)), rotation)
    for original, turned in zip(
        assemble(nodes, elements, SECTION, STEEL),
        assemble(nodes @ rotation.T, elements, SECTION, STEEL),
        strict=True,
    ):
        expected = turn @ original.toarray() @ turn.T
        assert turned.toarray() == pytest.approx(expected, rel=0, abs=MULTIPLIED * np.abs(expected).max())


def test_mass_is_positive_definite_and_both_are_symmetric():
    mass, stiffness = (matrix.toarray() for matrix in linkage.matrices())
    assert linalg.eigvalsh(mass)[0] > 0
    for matrix in (mass, stiffness):
        assert np.abs(matrix - matrix.T).max() <= MULTIPLIED * np.abs(matrix).max()


@pytest.mark.parametrize("count", [4, 8])
def test_first_frequency_of_a_cantilever(count):
    mass, stiffness = (clamped(matrix) for matrix in straight([0.0, 1.0, 0.0], count))
    first = np.sqrt(linalg.eigvalsh(stiffness, mass)[0])
    wave_number = 1.8751040687  # times the length
    exact = wave_number**2 * np.sqrt(BENDING_STIFFNESS / (MASS_PER_LENGTH * LENGTH**4))
    # Consistent mass is a Rayleigh-Ritz method: the frequency is too high, with cubic functions by
    # (k h)^4 / 1440 (Strang and Fix). The term after it is 3 % of that for four elements.
    assert first / exact - 1 == pytest.approx((wave_number / count) ** 4 / 1440, rel=0.05)


# The linkage: every tolerance below is half a unit in the last digit that is published.


@pytest.fixture(scope="module")
def free_linkage():
    """Mass and stiffness (114, 114) of the clamped linkage, and its output row (114,)."""
    mass, stiffness = (clamped(matrix.toarray()) for matrix in linkage.matrices())
    row = np.zeros(len(mass))
    row[linkage.TIP_Z - DOFS_PER_NODE] = 1.0
    return mass, stiffness, row


@pytest.fixture(scope="module")
def spectrum(free_linkage):
    """Angular frequencies and damping ratios of the 114 modes."""
    mass, stiffness, _ = free_linkage
    omega = np.sqrt(linalg.eigvalsh(stiffness, mass))
    alpha, beta = linkage.RAYLEIGH
    return omega, (alpha / omega + beta * omega) / 2


def peak_decay(omega, zeta):
    """exp(-zeta omega t*), t* the instant of the largest |s|; no mode is critically damped."""
    # omega t* = acos(zeta) / sqrt(1 - zeta^2). Overdamped: acosh(zeta) / sqrt(zeta^2 - 1), the same, as both
    # parts turn imaginary.
    return np.exp(-zeta * np.abs(np.emath.arccos(zeta) / np.emath.sqrt(1 - zeta**2)))


@pytest.mark.parametrize("m", [1.0, 1e-2, 1e-4])  # zeta = 0.03, 0.3, 3.2
def test_oscillator_has_the_damping_of_the_paper(m):
    k, d = 10.0, 0.2  # (16)
    omega, zeta = np.sqrt(k / m), d / (2 * np.sqrt(k * m))
    # One mode, a handful of roundings.
    assert oscillator.build(m).constants().C12 == pytest.approx(peak_decay(omega, zeta) / omega, rel=1e-13)


def test_linkage_mesh():
    nodes, elements = linkage.mesh()
    lengths = np.linalg.norm(np.diff(nodes, axis=0), axis=1)
    assert nodes.shape == (20, 3)
    assert np.array_equal(elements, chain(20))
    for piece in (slice(0, 3), slice(3, 16), slice(16, 19)):
        assert lengths[piece] == pytest.approx(lengths[piece][0], rel=MULTIPLIED)
    assert np.array_equal(nodes[[0, 3, 16, 19]], linkage.CORNERS)


def test_linkage_frequencies(spectrum):
    hertz = spectrum[0][:3] / (2 * np.pi)
    assert hertz[:2] == pytest.approx([8.11, 8.71], rel=0, abs=0.005)
    assert hertz[2] == pytest.approx(44.7, rel=0, abs=0.05)


def test_linkage_damping(spectrum):
    _, zeta = spectrum
    assert len(zeta) == 114
    assert np.count_nonzero(zeta > 1) == 45
    assert zeta[-1] == pytest.approx(2.92, rel=0, abs=0.005)


def test_linkage_constants(spectrum, free_linkage):
    """C1, C12 and C2 of the paper."""
    (omega, zeta), (mass, _, row) = spectrum, free_linkage
    decay = peak_decay(omega, zeta)
    assert np.max(omega * decay) == pytest.approx(4.34920e4, rel=0, abs=0.05)
    assert np.argmax(omega * decay) == 113
    assert np.max(decay / omega) == pytest.approx(0.0196001, rel=0, abs=5e-8)
    constant = np.sqrt(row @ linalg.solve(mass, row, assume_a="pos"))
    assert constant == pytest.approx(6.9151, rel=0, abs=5e-5)


def test_linkage_force():
    assert linkage.force(0.25) == pytest.approx(100.0)
    # sin(pi) is 1.2e-16 in double precision, times 100 N.
    assert linkage.force(np.array([0.0, 0.5, 0.75])) == pytest.approx([0.0, 0.0, -100.0], abs=1e-12)


def test_linkage_input_is_a_unit_force_at_node_20_in_z():
    _, inputs, _ = linkage.build()
    assert inputs.shape == (120, 1)
    assert np.flatnonzero(inputs) == [19 * 6 + 2]
    assert inputs.sum() == 1
