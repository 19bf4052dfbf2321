"""add_reduced_body: the equations that Exudyn solves are the projected ones."""

import numpy as np
import pytest

from exudyn_romerr.errors import InputError
from exudyn_romerr.linear.residual.residual import initial_coordinates
from exudyn_romerr.mbs import add_reduced_body
from tests.helpers.mbs_scenes import INPUTS, SOLVERS, N, Recorder, chain_body, force, new_mbs, random_basis, settings

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
