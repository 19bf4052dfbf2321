"""Bodies with damping ratios by mode in Exudyn: the matrix it gets, and the error of its own solution."""

import numpy as np
import pytest

import exudyn_romerr as romerr
from exudyn_romerr import ElasticBody, add_reduced_body
from exudyn_romerr.errors import InputError
from exudyn_romerr.linear.residual.residual import initial_coordinates
from exudyn_romerr.model.admissible_space import rigid_modes
from models import floating
from tests.helpers import tolerances as tol
from tests.helpers.mbs_scenes import (
    INPUTS,
    SOLVERS,
    TIP,
    N,
    Recorder,
    chain_body,
    force,
    new_mbs,
    random_basis,
    settings,
)
from tests.helpers.observed import attached

RATIOS = [0.05, 0.0, 0.2, 0.01]
END = 1.0  # s
FORCE = 3.0  # N, from the start


def test_ratios_by_mode_in_exudyn():
    """A constant force, so that the truth is the closed form of all modes; Exudyn's steps are in the error."""
    plain = chain_body()
    body = ElasticBody(plain.mass, plain.stiffness, rayleigh=(0.1, 0.01), modal_damping=RATIOS)
    mbs, basis = new_mbs(), romerr.modal_basis(body, 2)
    flex = romerr.add_reduced_body(mbs, body, basis, inputs=INPUTS, input_function=lambda t: FORCE)
    monitor = romerr.attach(mbs, flex, outputs=[TIP])
    mbs.Assemble()
    omega, shapes = (getattr(body.all_modes(), name) for name in ("omega", "shapes"))
    D = mbs.GetObject(flex.items["oGenericODE2"])["dampingMatrix"].GetPythonObject()
    np.testing.assert_allclose(D, np.diag(2 * np.array(RATIOS[:2]) * omega[:2]), atol=1e-12)
    mbs.SolveDynamic(settings(steps=400, end=END))
    report = monitor.report()
    out, zeta = report.output("tip"), body.damping_ratios(omega)
    assert set(report.scope.values()) == {"complete"}
    np.testing.assert_allclose(zeta[4:], (0.1 / omega + 0.01 * omega)[4:] / 2)
    eta = closed_form(omega, zeta, FORCE * (shapes.T @ INPUTS).ravel(), report.t)
    error = eta @ shapes[7] - out.value[:, 0]
    size = np.max(np.abs(error))
    assert np.all(np.abs(error) <= out.bound["best"][:, 0] + out.round_off[:, 0])
    assert np.all(np.abs(error - out.estimate[:, 0]) <= out.uncertainty[:, 0] + 1e-9 * size)
    assert np.max(out.bound["best"]) < 1.05 * size  # with ratios of the modes above left out it would not be


def closed_form(omega, zeta, force, t):
    """Modal coordinates (T, m) from rest under constant forces; all underdamped."""
    decay, ring = zeta * omega, omega * np.sqrt(1 - zeta**2)
    angle = np.outer(t, ring)
    free = np.exp(-np.outer(t, decay)) * (np.cos(angle) + decay / ring * np.sin(angle))
    return force / omega**2 * (1 - free)


@pytest.mark.parametrize("estimator", ["energy", "fast"])
def test_other_estimators_hold(estimator):
    plain = chain_body()
    body = ElasticBody(plain.mass, plain.stiffness, modal_damping=0.03)
    mbs = new_mbs()
    flex = romerr.add_reduced_body(
        mbs, body, romerr.modal_basis(body, 2), inputs=INPUTS, input_function=lambda t: FORCE
    )
    monitor = romerr.attach(mbs, flex, outputs=[TIP], estimators=estimator)
    mbs.Assemble()
    mbs.SolveDynamic(settings(steps=200, end=END))
    out = monitor.report().output("tip")
    modes = body.all_modes()
    eta = closed_form(modes.omega, np.full(N, 0.03), FORCE * (modes.shapes.T @ INPUTS).ravel(), monitor.report().t)
    error = np.abs(eta @ modes.shapes[7] - out.value[:, 0])
    assert np.all(error <= out.bound[estimator][:, 0] + out.round_off[:, 0])


@pytest.mark.parametrize("attached", [False, True])
def test_what_an_input_function_keeps_is_as_the_run_leaves_it(attached):
    """An integral over time takes arrays as if they were a time: none stays, and the run is the same."""
    kept = {"t": 0.0, "integral": 0.0}

    def force(t):
        kept["integral"] += 2.0 * (t - kept["t"])
        kept["t"] = t
        return FORCE + 0.0 * kept["integral"]

    mbs, body = new_mbs(), chain_body()
    flex = romerr.add_reduced_body(mbs, body, romerr.modal_basis(body, 2), inputs=INPUTS, input_function=force)
    monitor = romerr.attach(mbs, flex, outputs=[TIP]) if attached else None
    mbs.Assemble()
    mbs.SolveDynamic(settings(steps=40, end=END))
    if monitor is not None:
        assert np.all(np.isfinite(monitor.report().output("tip").bound["best"]))
    assert [type(x) for x in kept.values()] == [float, float]
    assert kept["t"] == pytest.approx(END, rel=1e-12)


def test_bodies_are_told_in_a_line():
    """Not their matrices, nor the mbs: these fill screens."""
    flex = romerr.add_reduced_body(new_mbs(), chain_body(), romerr.modal_basis(chain_body(), 3))
    scene = floating.clamped_bar(1)
    for body in (flex, romerr.floating_body(scene.fem, scene.items)):
        assert len(repr(body).splitlines()) == 1
        assert f"items={body.items}" in repr(body)


# --- add_reduced_body: the equations that Exudyn solves are the projected ones ---


NEWTON = 1e-9  # generalised-alpha meets the equations of motion to its Newton tolerance, relative to a load of 1


def run(basis, solver="generalised-alpha", **options):
    mbs = new_mbs()
    flex = add_reduced_body(mbs, chain_body(), basis, **options)
    recorder = Recorder()
    mbs.SetPostStepUserFunction(recorder)
    mbs.Assemble()
    SOLVERS[solver](mbs, settings())
    return flex, recorder


@pytest.mark.parametrize("galerkin", [True, False])
@pytest.mark.parametrize("solver", SOLVERS)
def test_every_solver_meets_the_projected_equations(solver, galerkin):
    basis = random_basis(galerkin=galerkin)
    flex, seen = run(basis, solver, inputs=INPUTS, input_function=force)
    body, V = flex.body, basis.V
    q, q_t, q_tt = (seen.rows(k)[1:] for k in range(3))
    u = np.array([force(t) for t in seen.t[1:]])
    R = body.mass @ (V @ q_tt.T) + body.D @ (V @ q_t.T) + body.stiffness @ (V @ q.T) - INPUTS * u
    assert np.abs(R).max() > 0.1  # the residual itself is not small, only its projection is
    assert np.abs(basis.W.T @ R).max() < NEWTON


def test_full_basis_gives_the_full_static_solution():
    basis = random_basis(N, galerkin=False)
    flex, seen = run(basis, "static", inputs=INPUTS, input_function=force)
    exact = np.linalg.solve(flex.body.stiffness.toarray(), INPUTS[:, 0] * force(1.0))
    np.testing.assert_allclose(basis.V @ seen.rows(0)[-1], exact, rtol=1e-7, atol=1e-9 * np.abs(exact).max())


def test_one_input_may_be_a_float_or_an_array_and_several_a_list():
    single = run(random_basis(), "RK44", inputs=INPUTS, input_function=force)[1]
    array = run(random_basis(), "RK44", inputs=INPUTS, input_function=lambda t: np.array([force(t)]))[1]
    halves = np.hstack([INPUTS, INPUTS])
    quarters = lambda t: [0.25 * force(t), 0.75 * force(t)]  # noqa: E731
    listed = run(random_basis(), "RK44", inputs=halves, input_function=quarters)[1]
    np.testing.assert_array_equal(single.rows(0), array.rows(0))
    np.testing.assert_allclose(single.rows(0), listed.rows(0), rtol=1e-12, atol=1e-15)


def test_initial_state_is_projected_and_moves_without_inputs():
    rng = np.random.default_rng(3)
    q0, q0_t = rng.standard_normal((2, N))
    flex, seen = run(random_basis(galerkin=False), initial=(q0, q0_t))
    qr0, qr0_t = initial_coordinates(flex.body, flex.basis, q0, q0_t)
    np.testing.assert_array_equal(seen.rows(0)[0], qr0)
    np.testing.assert_array_equal(seen.rows(1)[0], qr0_t)
    assert np.abs(seen.rows(0)[-1] - qr0).max() > 0.01


def test_items_name_what_was_added():
    mbs = new_mbs()
    first = add_reduced_body(mbs, chain_body(), random_basis(3))
    second = add_reduced_body(mbs, chain_body(), random_basis(2))
    assert [int(first.items[key]) for key in ("nGenericODE2", "oGenericODE2")] == [0, 0]
    assert [int(second.items[key]) for key in ("nGenericODE2", "oGenericODE2")] == [1, 1]
    assert [int(n) for n in mbs.GetObject(second.items["oGenericODE2"])["nodeNumbers"]] == [1]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"inputs": INPUTS}, "input_function is missing"),
        ({"input_function": force}, "inputs is missing"),
        ({"inputs": INPUTS, "input_function": 3.0}, r"input_function=3.0.*f\(t\)"),
        ({"inputs": INPUTS[1:], "input_function": force}, r"inputs has shape \(7, 1\)"),
        ({"inputs": INPUTS * np.nan, "input_function": force}, "inputs has a nan"),
        ({"initial": np.zeros(N)}, "initial=.*q0, q0_t"),
        ({"initial": (np.zeros(N), np.zeros(3))}, r"q0_t has shape \(3,\)"),
    ],
)
def test_bad_input(options, words):
    mbs = new_mbs()
    with pytest.raises(InputError, match=words):
        add_reduced_body(mbs, chain_body(), random_basis(), **options)
    assert mbs.systemData.NumberOfObjects() == 0


def test_basis_of_another_body_is_refused():
    basis = random_basis()
    basis.V = basis.W = basis.V[:-1]
    with pytest.raises(InputError, match="V has 7 rows"):
        add_reduced_body(new_mbs(), chain_body(), basis)


# --- modes of a FEMinterface ---


OFF = 1e-5  # of the modes; Exudyn leaves 1.3e-6 in a block of steel, 1e-4 in the arm of models/wishbone.py
SAME = 1e-11  # of the modes: rounding of two small solves


def bar_modes(n=5):
    fem = floating.load_fem("bar")
    floating.reduce(fem, n)
    return fem


def test_kept_modes_are_those_asked_for():
    fem = bar_modes()
    V, values = fem.modeBasis["matrix"], fem.eigenValues
    romerr.keep_modes(fem, (3, 1))
    np.testing.assert_array_equal(fem.modeBasis["matrix"], V[:, [0, 1, 2, 3, 4, 5, 7, 9]])
    np.testing.assert_array_equal(fem.eigenValues, values[[1, 3]])
    romerr.keep_modes(fem, ())
    assert fem.modeBasis["matrix"].shape[1] == 6


def moved_modes():
    """Modes with a rigid motion in each, as Exudyn's solver leaves it; of the bar it leaves 1.6e-11 of them."""
    fem = bar_modes()
    made = fem.modeBasis["matrix"]
    romerr.hold_modes(fem, *floating.interface(fem, "left"))
    held = fem.modeBasis["matrix"]
    assert np.abs(held - made).max() < tol.STATIC_MODES * np.abs(made).max()
    Rg = rigid_modes(fem.GetNodePositionsAsArray())
    shares = np.random.default_rng(1).standard_normal((6, held.shape[1]))
    fem.modeBasis = {**fem.modeBasis, "matrix": held + OFF * np.abs(held).max() * Rg @ shares}
    return fem, held


def test_held_modes_are_those_without_the_rigid_motion():
    fem, held = moved_modes()
    romerr.hold_modes(fem, *floating.interface(fem, "left"))
    np.testing.assert_allclose(fem.modeBasis["matrix"], held, rtol=0, atol=SAME * np.abs(held).max())


def test_modes_that_miss_the_conditions_by_little_have_a_rigid_part(monkeypatch):
    """The plan tells how much; tests/mbs/floating/test_frames_and_cures.py: with which estimates."""
    moved = moved_modes()[0]
    monkeypatch.setattr(floating, "reduce", lambda fem, n, kind: setattr(fem, "modeBasis", moved.modeBasis))
    scene = floating.clamped_bar(5, h=1e-3, t_end=2e-3)
    monitor = attached(scene, outputs=[scene.sensors["tip"]])
    scene.solve()
    assert monitor.report().scope["auxiliary"] == "complete"
    assert "moves the body as a rigid one, which is taken for motion of its frame" in str(monitor.plan)


def test_weights_of_zero_have_no_say():
    """Exudyn gives the middle nodes of quadratic tetrahedra none."""
    x = floating.load_fem("bar").GetNodePositionsAsArray()
    with_zero, without = romerr.mean_motion([3, 5, 8, 9], [1, 2, 1, 0]), romerr.mean_motion([3, 5, 8], [1, 2, 1])
    np.testing.assert_array_equal(with_zero.rows(x), without.rows(x))
    with pytest.raises(romerr.InputError, match="2 nodes with a weight"):
        romerr.mean_motion([3, 5, 8, 9], [1, 2, 0, 0])


@pytest.mark.parametrize("change", [lambda fem: romerr.keep_modes(fem, [0]), lambda fem: romerr.hold_modes(fem, [0])])
def test_what_cannot_be_changed_is_refused(change):
    with pytest.raises(romerr.InputError, match="no modes"):
        change(floating.load_fem("bar"))
    fem = bar_modes()
    fem.postProcessingModes = {"matrix": np.ones((65, 66))}
    with pytest.raises(romerr.InputError, match="compute them after"):
        change(fem)


def test_modes_that_are_not_there_are_refused():
    with pytest.raises(romerr.InputError, match=r"modes lists 5; allowed: 0\.\.4"):
        romerr.keep_modes(bar_modes(), [1, 5])
