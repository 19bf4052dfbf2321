"""The quarter car with a flexible lower arm: its mesh, its equilibrium, and bounds against runs with more modes."""

from functools import cache

import numpy as np
import pytest
import scipy.sparse.linalg as sla

import exudyn_romerr as romerr
from benchmarks.told_and_true import parts
from examples import wishbone_suspension
from models import floating, solid_bar, wishbone
from models.beam3d import STEEL
from models.wishbone import INTERFACES, TYRE_STIFFNESS, WHEEL_LOAD
from tests.helpers.truth import rigid_motions

STEP, END = 1e-3, 0.04  # s
BUSHES = INTERFACES[:2]
COUPLED = "coupled (linearised)"
# What Newton's iterations leave, relative 1e-10 of coordinates of up to 0.1 m in the equilibrium
AT_REST = 1e-9


def flat(t):
    return 0.0, 0.0


@cache
def arm():
    """Nodes, M, K."""
    fem = wishbone.load_fem()
    return fem.GetNodePositionsAsArray(), fem.GetMassMatrix(sparse=True), fem.GetStiffnessMatrix(sparse=True)


@cache
def run(n, kind="RBE3", static=INTERFACES, vectors="auto"):
    """The scene after its drive, and the monitor of its ball joint."""
    scene = wishbone.quarter_car(n, kind, static, h=STEP, t_end=END)
    nodes, weights = floating.interface(scene.fem, "ball")
    ball = romerr.mean_displacement("ball", nodes=nodes, weights=weights)
    flex = romerr.floating_body(scene.fem, scene.bodies[0])
    monitor = romerr.attach(scene.mbs, flex, outputs=[ball], auxiliary_modes=vectors)
    scene.solve()
    return scene, monitor


def truth_run():
    return run(16, "RBE3", INTERFACES, 40)[1].report().output("ball")


def compared(*basis):
    """Output, true error (T, 3) and how far it is known: what the run that is the truth is told to miss."""
    truth, out = truth_run(), run(*basis)[1].report().output("ball")
    missed, half = parts(truth, "modes")
    return out, np.abs(truth.value - out.value), np.abs(missed) + half


def stored(scene, name):
    return scene.mbs.GetSensorStoredData(scene.sensors[name])


def test_stored_arm_is_what_make_wishbone_makes():
    pytest.importorskip("netgen.occ")
    from models import make_wishbone

    made = make_wishbone.arrays(make_wishbone.imported())
    with np.load(wishbone.DATA / "wishbone.npz") as file:
        assert set(file) == set(made)
        for name in made:
            np.testing.assert_allclose(file[name], made[name], rtol=0, atol=1e-12)


def test_arm_is_of_steel_and_free_to_move():
    nodes, M, K = arm()
    rigid = rigid_motions(nodes)
    assert 3000 <= 3 * len(nodes) <= 6000
    assert 4.0 < (rigid.T @ (M @ rigid))[0, 0] < 7.0  # kg
    volume = solid_volume()
    np.testing.assert_allclose(rigid[:, :3].T @ (M @ rigid[:, :3]), STEEL.density * volume * np.eye(3), atol=1e-9)
    assert np.abs(K @ rigid).max() < 1e-11 * np.abs(K).max() * np.abs(rigid).max()


def solid_volume():
    with np.load(wishbone.DATA / "wishbone.npz") as file:
        corners = file["nodes"][file["tets"][:, :4]]
    return np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])).sum() / 6


def test_lowest_eigenfrequency_is_that_of_an_arm():
    _, M, K = arm()
    values = np.sort(sla.eigsh(K, 7, M, sigma=-1e4, v0=np.ones(K.shape[0]), return_eigenvectors=False))
    assert np.abs(values[:6]).max() < 1e-6 * values[6]
    assert 100 < np.sqrt(values[6]) / (2 * np.pi) < 400  # Hz


def test_interfaces_are_four_holes():
    fem = wishbone.load_fem()
    nodes = [floating.interface(fem, name)[0] for name in INTERFACES]
    assert len(np.unique(np.concatenate(nodes))) == sum(map(len, nodes))
    for name in INTERFACES:
        chosen, weights = floating.interface(fem, name)
        assert weights.sum() == pytest.approx(1.0)
        centre = weights @ fem.GetNodePositionsAsArray()[chosen]
        np.testing.assert_allclose(centre, wishbone.POINTS[name], atol=1e-3)


@pytest.mark.parametrize("kind", ["RBE2", "RBE3"])
def test_modes_hold_the_first_interface(kind):
    """Exudyn's RBE3 modes in N/m do to 4 digits only."""
    fem = wishbone.load_fem()
    wishbone.reduce(fem, 2, kind)
    V = fem.modeBasis["matrix"]
    assert V.shape[1] == 18 + 2
    rows = romerr.mean_motion(*floating.interface(fem, "front")).rows(fem.GetNodePositionsAsArray())
    assert np.abs(rows @ V).max() < 1e-14 * np.abs(rows).max() * np.abs(V).max()


def test_eigenmodes_have_their_eigenvalues_and_leave_every_interface_at_rest():
    fem = wishbone.load_fem()
    wishbone.reduce(fem, 2)
    V = fem.modeBasis["matrix"][:, 18:]
    for name in INTERFACES:
        rows = romerr.mean_motion(*floating.interface(fem, name)).rows(fem.GetNodePositionsAsArray())
        assert np.abs(rows @ V).max() < 1e-12 * np.abs(rows).max() * np.abs(V).max()
    rayleigh = np.sum(V * (fem.stiffnessMatrix @ V), axis=0) / np.sum(V * (fem.massMatrix @ V), axis=0)
    np.testing.assert_allclose(rayleigh, fem.eigenValues, rtol=1e-9)


def test_matrices_are_those_of_the_mesh():
    with np.load(wishbone.DATA / "wishbone.npz") as file:
        mass, stiffness = solid_bar.matrices(file["nodes"], file["tets"].astype(int))
    _, M, K = arm()
    assert abs(M - mass).max() == abs(K - stiffness).max() == 0


def test_car_stands_still_on_a_flat_road():
    scene = wishbone.quarter_car(0, h=STEP, t_end=0.02, road=flat)
    scene.solve()
    for name in ("chassis", "wheel", "ball node local"):
        assert np.ptp(stored(scene, name)[:, 1:], axis=0).max() < AT_REST
    mass = wishbone.SPRUNG_MASS + wishbone.WHEEL_MASS + wishbone.UPPER_ARM_MASS + STEEL.density * solid_volume()
    pressed = WHEEL_LOAD - TYRE_STIFFNESS * stored(scene, "wheel")[-1, 3]
    assert pressed == pytest.approx(9.81 * mass, rel=1e-4)


def test_bump_is_smooth_and_50_mm_high():
    length = wishbone.BUMP[1] / wishbone.SPEED
    t = np.linspace(-0.1, length + 0.1, 2001)
    height, slope = np.array([wishbone.bump(x) for x in t]).T
    assert height.max() == pytest.approx(0.05, rel=1e-4)
    assert np.all(height[(t <= 0) | (t >= length)] == 0)
    np.testing.assert_allclose(slope, np.gradient(height, t) / wishbone.SPEED, atol=2e-3)


def test_wheel_follows_the_bump_and_stays_on_the_road():
    scene = wishbone.quarter_car(0, h=2e-3, t_end=0.3)
    scene.solve()
    wheel, road = (stored(scene, name)[-151:, 3] for name in ("wheel", "road"))
    np.testing.assert_allclose(road, [wishbone.bump(2e-3 * i)[0] for i in range(151)], atol=1e-12)
    assert wheel.max() - wheel[0] > 0.045
    assert np.min(WHEEL_LOAD - TYRE_STIFFNESS * (wheel - road)) > 1e3


def test_loads_are_the_same_where_the_static_solve_ends_and_the_drive_begins():
    monitor = run(0)[1]
    static, drive = monitor.report(0).output("ball").value, monitor.report().output("ball").value
    np.testing.assert_allclose(drive[0], static[-1], rtol=1e-14)  # the same state, not the same order of sums
    assert np.abs(drive[1] - drive[0]).max() < 1e-3 * np.abs(drive).max()


@pytest.mark.parametrize("basis", [(0,), (8, "RBE3", BUSHES), (0, "RBE2")])
def test_bounds_are_coupled_and_nothing_is_missing(basis):
    report = run(*basis)[1].report()
    assert report.scope["auxiliary"] == COUPLED
    assert not [message for message in report.messages if "Galerkin" in message]


@pytest.mark.parametrize("basis", [(0,), (8, "RBE3", BUSHES), (0, "RBE2")])
def test_error_is_below_its_bound(basis):
    """At every instant, in all three directions."""
    out, error, known = compared(*basis)
    assert np.all(error <= out.bound["auxiliary"] + known)


def test_bound_is_sharp_for_a_basis_that_is_proven_to_meet_1_percent():
    out, error, known = compared(8, "RBE3", BUSHES)
    assert known.max() < 1e-2 * error.max()
    assert out.bound["auxiliary"].max() < 0.01 * np.abs(out.value).max()
    assert out.bound["auxiliary"].max() < 2 * error.max()


def test_static_modes_of_all_interfaces_need_no_eigenmode():
    """They miss 1e-6 of the displacement, and that is known and bounded."""
    out, error, _ = compared(0)
    modes, half = parts(out, "modes")
    assert (np.abs(modes) + half).max() < 1e-4 * np.abs(out.value).max()
    assert error.max() < 1e-5 * np.abs(out.value).max()
    assert error.max() < out.bound["best"].max() < 1.5 * error.max()


@pytest.mark.slow
def test_more_vectors_tell_what_all_static_modes_leave():
    """1e-6 of the displacement: 60 vectors tell it within 2 % and what the truth is known to, and bound it."""
    out, error, known = compared(0, "RBE3", INTERFACES, 60)
    modes, _ = parts(out, "modes")
    assert np.abs(np.abs(modes) - error).max() < 0.02 * error.max() + known.max()
    assert error.max() < out.bound["best"].max() < 1.1 * error.max()


def test_rigid_interfaces_are_an_error_that_the_bound_shows():
    out, error, _ = compared(0, "RBE2")
    assert error.max() > 0.01 * np.abs(out.value).max()
    assert out.bound["auxiliary"].max() > 0.99 * error.max()


def test_results_are_the_same_with_and_without_bounds():
    scene = wishbone.quarter_car(0, h=STEP, t_end=END)  # static modes alone: no random digits
    scene.solve()
    for name in scene.sensors:
        np.testing.assert_array_equal(stored(scene, name), stored(run(0)[0], name))


@pytest.mark.slow
def test_choose_modes_picks_a_basis_whose_bound_is_small_enough_and_above_the_error(monkeypatch):
    monkeypatch.setattr(wishbone_suspension, "STEP", STEP)
    promise = 0.002
    choice = wishbone_suspension.fewest(promise, END)
    assert choice.met
    assert len(choice.tried) <= 4
    out, truth = choice.reports[0].output(wishbone_suspension.NAME), truth_run()
    error = np.abs(truth.value - out.value)
    assert error.max() <= out.bound["auxiliary"].max() <= promise * np.abs(out.value).max()
    assert np.all(error <= out.bound["auxiliary"] + truth.bound["best"])


def test_example_draws_and_tells_what_is_enough(tmp_path, monkeypatch, capsys):
    basis, n = wishbone_suspension.SHOWN
    bases = {
        name: (kind, static, (n,) if name == basis else (), (), marker)
        for name, (kind, static, *_, marker) in wishbone_suspension.BASES.items()
    }
    monkeypatch.setattr(wishbone_suspension, "BASES", bases)
    monkeypatch.setattr(wishbone_suspension, "TRUTH", {"n": 4, "vectors": 20})
    monkeypatch.setattr(wishbone_suspension, "PROMISES", (1.0, 1e-9))
    monkeypatch.setattr(wishbone_suspension, "fewest", lambda promise, t_end: f"{promise} until {t_end}")
    (case,) = wishbone_suspension.main(tmp_path, t_end=0.005)
    assert case.modes == 6 + n
    assert np.abs(case.estimate - case.error).max() < 1e-3 * np.abs(case.error).max()
    for name in ("wishbone", "wishbone_modes"):
        assert (tmp_path / f"{name}.png").read_bytes().startswith(b"\x89PNG")
    printed = capsys.readouterr().out
    assert f"enough by the estimate, {basis}: 100 %: {6 + n} modes, 1e-07 %: none of these" in printed
    assert f"choose_modes for 1e-07 %, {basis}: 1e-09 until 0.005" in printed
