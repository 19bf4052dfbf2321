"""Bodies that are held by the mean motion of some nodes instead of fixed coordinates."""

import numpy as np
import pytest
import scipy.linalg as la

import exudyn_romerr as romerr
from models import solid_bar, solid_exact

ROUNDING = 1e-9  # of the largest entry: the solid's matrices have a condition of about 1e6

SHARP = 3.0  # what 40 auxiliary modes must reach on the clamped bar too
W = 2 * np.pi * 100.0  # rad/s


def held_bar():
    """The solid bar with its clamped face held in the mean only, its load and outputs."""
    clamped, B, outputs = solid_bar.build(0)
    nodes = np.unique(clamped.fixed // 3)
    reference = romerr.mean_motion(nodes, np.random.default_rng(1).uniform(0.5, 1.5, len(nodes)))
    options = {"rayleigh": clamped.rayleigh, "positions": clamped.positions, "reference": reference}
    return romerr.ElasticBody(clamped.mass, clamped.stiffness, **options), B, outputs, reference


def test_modes_are_those_of_the_constrained_pencil():
    """Frequencies agree with the pencil on a dense null space of the conditions; shapes meet the conditions."""
    body, _, _, reference = held_bar()
    C = reference.rows(body.positions)
    Z = la.null_space(C)
    squares = la.eigh(Z.T @ (body.stiffness @ Z), Z.T @ (body.mass @ Z), eigvals_only=True, subset_by_index=[0, 5])
    modes = body.modes(6)
    np.testing.assert_allclose(modes.omega, np.sqrt(squares), rtol=ROUNDING)
    shapes = body.expand(modes.shapes)
    assert np.abs(C @ shapes).max() < ROUNDING * np.abs(C).max() * np.abs(shapes).max()


@pytest.mark.parametrize("n", [2, 6])
def test_bounds_hold_on_a_mean_held_body(n):
    """Exact motion of the held bar under a sine load: the error is below the bound, and the bound is sharp."""
    body, B, outputs, _ = held_bar()
    basis = romerr.krylov_basis(body, B, n)
    t = np.linspace(0, 5e-3, 1001)
    q, q_t, q_tt = solid_exact.reduced_motion(body, basis, B, W).motion(t)
    report = romerr.evaluate(
        body,
        basis,
        romerr.Trajectory(t, q, q_t, q_tt, np.sin(W * t)),
        inputs=B,
        outputs=outputs,
        input_function=lambda t: np.sin(W * t),
        auxiliary_modes=40,
    )
    for out in outputs:
        y = solid_exact.full_outputs(body, B, out.resolve(body), W)(t)
        found = report.compare(out.name, t, y)
        assert np.all(np.abs(found.error) <= found.bound["best"] + ROUNDING * np.abs(y).max())
        assert found.effectivity["best"][0] < SHARP


def test_basis_that_misses_the_conditions_is_refused():
    """Modes of the clamped bar move its face not at all: fine; a random basis is refused by name."""
    body = held_bar()[0]
    clamped = solid_bar.build(0)[0]
    assert romerr.modal_basis(clamped, 2).restricted_to(body)[0].shape == (body.free.size, 2)
    random = romerr.Basis(np.random.default_rng(2).standard_normal((body.N, 2)))
    with pytest.raises(romerr.InputError, match="V misses the reference conditions"):
        random.restricted_to(body)


@pytest.mark.parametrize(
    ("nodes", "weights", "error", "message"),
    [
        ([0, 1], None, romerr.InputError, "at least three"),
        ([0, 1, 2], [1, 1, -1], romerr.InputError, "weights contains -1"),
        ([0, 1, 2], [1, 1], romerr.InputError, "weights has shape"),
    ],
)
def test_wrong_reference_is_refused(nodes, weights, error, message):
    """Too few nodes, weights that do not fit."""
    with pytest.raises(error, match=message):
        romerr.mean_motion(nodes, weights)


def test_nodes_on_a_line_do_not_hold_the_body():
    """Three nodes on one line leave the rotation about it free."""
    positions = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    with pytest.raises(romerr.AssumptionError, match="six rigid motions"):
        romerr.ElasticBody(np.eye(15), np.eye(15), positions=positions, reference=romerr.mean_motion([0, 1, 2]))


def test_reference_and_fixed_exclude_each_other():
    """A body is held by one of them."""
    positions = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]])
    with pytest.raises(romerr.InputError, match="fixed and reference"):
        romerr.ElasticBody(
            np.eye(9), np.eye(9), fixed=[0], positions=positions, reference=romerr.mean_motion([0, 1, 2])
        )
