"""CarriedTurn: forces that change their sign from step to step move no mode further than it says; their sizes."""

import exudyn as exu
import numpy as np
import pytest
from exudyn.FEM import ObjectFFRFreducedOrderInterface
from scipy.linalg import block_diag, eigh, null_space
from scipy.spatial.transform import Rotation

import exudyn_romerr as romerr
from exudyn_romerr.estimates.overshoot import CarriedTurn
from exudyn_romerr.mbs.access.equations import Equations
from exudyn_romerr.residual.free_mass import FreeMass, turned_mass
from exudyn_romerr.trajectory.scheme import Scheme
from models.hex_bar import hex_bar

RESOLVED, STIFF = 0.01, 1e5  # omega h
H, STEPS = 2e-3, 400
ANGLE = 1e-3  # rad: what is of second order is 1e-6 of the rest, and rounding less


def swung(omega, forces):
    """Root of twice the energy (S, modes) of modes of unit mass at rest, under mean forces (S,) of steps H.

    Exact for the trapezoidal rule: v' = f - omega^2 x, both averaged over the step.
    """
    x, v, found = np.zeros_like(omega), np.zeros_like(omega), []
    for f in forces:
        change = (H * f - H * omega**2 * (x + H * v / 2)) / (1 + (omega * H / 2) ** 2)
        x, v = x + H * (v + change / 2), v + change
        found.append(np.hypot(omega * x, v))
    return np.array(found)


@pytest.mark.parametrize("seed", range(4))
def test_no_mode_has_more_energy(seed):
    rng = np.random.default_rng(seed)
    turned = 0.1 * np.abs(np.convolve(rng.standard_normal(STEPS + 20), np.ones(21) / 21, "valid"))
    omega = np.geomspace(RESOLVED, STIFF, 300) / H
    bound = CarriedTurn(Scheme.of_radius(1.0), 3.0).advance(np.full(STEPS, H), turned)
    energy = swung(omega, 3.0 * turned / 4 * (-1.0) ** np.arange(STEPS)).max(axis=1)
    assert np.all(energy <= bound)
    assert energy.max() > 0.3 * bound[-1] / 2  # the sum of changes is of the worst case


def test_a_constant_turn_is_nearly_attained():
    omega = np.geomspace(RESOLVED, STIFF, 300) / H
    bound = CarriedTurn(Scheme.of_radius(1.0), 1.0).advance(np.full(STEPS, H), np.full(STEPS, 0.1))
    energy = swung(omega, 0.1 / 4 * (-1.0) ** np.arange(STEPS))
    assert np.all(energy.max(axis=1) <= bound)
    assert energy.max() > 0.9 * bound[-1]


def test_chunks_of_steps_say_the_same():
    turned, h = np.linspace(0.0, 0.1, 50), np.full(50, H)
    whole, parts = (CarriedTurn(Scheme.of_radius(0.8), 1.0) for _ in range(2))
    found = np.concatenate([parts.advance(h[part], turned[part]) for part in (slice(0, 7), slice(7, 50))])
    np.testing.assert_allclose(found, whole.advance(h, turned), rtol=1e-14)  # sums in another order


def test_what_was_moved_stays_when_nothing_turns_any_more():
    """A block without any turn let it go: undamped modes go on."""
    turned = np.append(np.full(20, 0.1), np.zeros(40))
    carried = CarriedTurn(Scheme.of_radius(1.0), 1.0)
    found = np.concatenate([carried.advance(np.full(20, H), part) for part in np.split(turned, 3)])
    omega = np.geomspace(RESOLVED, STIFF, 300) / H
    energy = swung(omega, turned / 4 * (-1.0) ** np.arange(60)).max(axis=1)
    assert np.all(energy <= found)
    assert np.all(found[20:] >= found[19])


def test_a_rest_before_makes_nothing_older():
    rest, turned = np.zeros(30), np.full(30, 0.1)
    late, at_once = (CarriedTurn(Scheme.of_radius(0.8), 1.0) for _ in range(2))
    assert not late.advance(np.full(30, H), rest).any()
    np.testing.assert_array_equal(*(one.advance(np.full(30, H), turned) for one in (late, at_once)))


@pytest.mark.parametrize("radius", [0.0, 0.5, 0.9])
def test_numerical_damping_forgets(radius):
    h, turned = np.full(2000, H), np.full(2000, 0.1)
    bound = CarriedTurn(Scheme.of_radius(radius), 1.0).advance(h, turned)
    assert np.isfinite(bound).all()
    assert bound.max() <= 2 * H * 0.1 / 4  # |f| is largest at first, and only falls


NODES = [exu.NodeType.RotationEulerParameters, exu.NodeType.RotationRotationVector]


def turned_masses(fem, body, node, rng):
    """|dM a|_{M^-1} over |a|_M at most, a radian, about axes of a body and some others, of Exudyn's M: all modes."""
    modes, start = body.expand(np.eye(body.free.size)), Rotation.from_rotvec([0.4, -0.3, 0.9])
    fem.modeBasis = {"matrix": modes, "type": "NormalModes"}
    mbs = exu.SystemContainer().AddSystem()
    cms = ObjectFFRFreducedOrderInterface(fem, rigidBodyNodeType=node)
    cms.AddObjectFFRFreducedOrder(mbs, positionRef=[0.1, 0.2, 0.3], rotationMatrixRef=start.as_matrix())
    mbs.Assemble()
    reference = np.array(mbs.systemData.GetODE2Coordinates(exu.ConfigurationType.Reference))
    equations, is_euler = Equations(mbs), node == exu.NodeType.RotationEulerParameters

    def mass(turn):
        q = 0 * reference
        p = (start * Rotation.from_rotvec(turn)).as_quat(scalar_first=True)
        if is_euler:
            q[3:7] = p * np.sign(p @ reference[3:7]) - reference[3:7]
        else:
            q[3:6] = (start * Rotation.from_rotvec(turn)).as_rotvec() - reference[3:6]
        mbs.systemData.SetODE2Coordinates(q)
        return equations.mass(mbs).copy()

    p = start.as_quat(scalar_first=True)
    X = block_diag(np.eye(3), null_space(p[None]) if is_euler else np.eye(3), np.eye(modes.shape[1]))
    axes, found = np.vstack([np.eye(3), rng.standard_normal((5, 3))]), []
    for axis in axes / np.linalg.norm(axes, axis=1)[:, None]:
        dM = mass(ANGLE / 2 * axis) - mass(-ANGLE / 2 * axis)
        found.append(np.abs(eigh(X.T @ dM @ X, X.T @ mass(0 * axis) @ X, eigvals_only=True)).max() / ANGLE)
    return np.array(found)


@pytest.mark.parametrize("held", ["nodes", "mean motion"])
@pytest.mark.parametrize("node", NODES)
def test_masses_of_exudyn_turn_by_no_more(held, node):
    fem = hex_bar(2, (0.5, 0.03, 0.04), (2e9, 1500.0, 0.3))
    x = fem.GetNodePositionsAsArray()[:, 0]
    end = np.flatnonzero(x == x.min())
    at = {"fixed": (3 * end[:, None] + np.arange(3)).ravel()} if held == "nodes" else {}
    body = romerr.ElasticBody.from_fem(fem, **at or {"reference": romerr.mean_motion(end)})
    found, bound = turned_masses(fem, body, node, np.random.default_rng(1)), turned_mass(body, FreeMass(body))
    assert np.all(found <= bound)
    if node == exu.NodeType.RotationEulerParameters:
        assert found.max() > 0.8 * bound
