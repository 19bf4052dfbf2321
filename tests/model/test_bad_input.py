"""Bad bodies and bases: the right type of error, and a message that names the argument and what to do."""

import numpy as np
import pytest

from exudyn_romerr import (
    AssumptionError,
    Basis,
    ElasticBody,
    InputError,
    RunError,
    gramian_basis,
    initial_error,
    krylov_basis,
    modal_basis,
)
from tests.helpers.bad_input import BODY, FREE, GENERAL, B, K, M, N, V, changed, check_error, check_refused, run

BODIES = {
    "mass unsymmetric": (lambda: ElasticBody(changed(M, (0, 1), 9.0), K), "mass is not symmetric"),
    "stiffness unsymmetric": (lambda: ElasticBody(M, changed(K, (0, 1), 9.0)), "stiffness is not symmetric"),
    "mass indefinite": (lambda: ElasticBody(M - 2 * M[0, 0] * np.ones((N, N)), K), "mass"),
    "mass indefinite inside": (
        lambda: ElasticBody(np.eye(N) + 3 * (np.eye(N, k=1) + np.eye(N, k=-1)), K),
        "mass is not positive definite: some motion has no inertia, or a negative one",
    ),
    "massless": (
        lambda: ElasticBody(np.diag([0.0] + [1.0] * (N - 1)), K),
        r"coordinates \[0\].*condense them statically",
    ),
    "stiffness singular": (lambda: ElasticBody(M, FREE), r"stiffness.*1 rigid-body.*fixed=\.\.\.", AssumptionError),
    "stiffness indefinite": (lambda: ElasticBody(M, -K), "stiffness is not positive definite", AssumptionError),
    "mass not square": (lambda: ElasticBody(M[:5], K), r"mass has shape \(5, 10\); needed: square"),
    "stiffness of another size": (lambda: ElasticBody(M, K[:5, :5]), r"stiffness has shape \(5, 5\).*10 rows"),
    "no coordinates": (lambda: ElasticBody(np.zeros((0, 0)), np.zeros((0, 0))), "mass"),
    "mass nan": (lambda: ElasticBody(changed(M, (1, 1), np.nan), K), "mass has a nan or inf"),
    "stiffness inf": (lambda: ElasticBody(M, changed(K, (1, 1), np.inf)), "stiffness has a nan or inf"),
    "damping nan": (lambda: ElasticBody(M, K, damping=changed(M, (1, 1), np.nan)), "damping has a nan"),
    "mass is text": (lambda: ElasticBody("mass", K), "mass='mass'; needed: a matrix"),
    "stiffness missing": (lambda: ElasticBody(M, None), r"stiffness=None; needed: a matrix \(N, N\)"),
    "both dampings": (lambda: ElasticBody(M, K, rayleigh=(0, 1), damping=M), "rayleigh and damping.*one of them"),
    "rayleigh nan": (lambda: ElasticBody(M, K, rayleigh=(np.nan, 0)), "rayleigh"),
    "rayleigh of three": (lambda: ElasticBody(M, K, rayleigh=(0, 0, 0)), r"rayleigh has shape \(3,\)"),
    "negative alpha": (lambda: ElasticBody(M, K, rayleigh=(-1, 0)), "rayleigh.*must be >= 0", AssumptionError),
    "negative beta": (lambda: ElasticBody(M, K, rayleigh=(0, -1)), "rayleigh.*must be >= 0", AssumptionError),
    "negative damping": (lambda: ElasticBody(M, K, damping=-M), "damping feeds energy in.*need", AssumptionError),
    "indefinite damping": (
        lambda: ElasticBody(M, K, damping=np.diag([1.0, -1e-3] + [0.0] * 8)),
        "damping feeds energy in",
        AssumptionError,
    ),
    "damping of a coordinate without diagonal": (
        lambda: ElasticBody(M, K, damping=np.diag([1.0] * 9, 1) + np.diag([1.0] * 9, -1)),
        "damping feeds energy in",
        AssumptionError,
    ),
    "damping of another size": (lambda: ElasticBody(M, K, damping=M[:3, :3]), "damping has shape"),
    "fixed out of range": (lambda: ElasticBody(M, K, fixed=[N]), r"fixed contains 10; allowed:.*0\.\.9"),
    "fixed negative": (lambda: ElasticBody(M, K, fixed=[-1]), "fixed contains -1"),
    "fixed not whole": (lambda: ElasticBody(M, K, fixed=[0.5]), "fixed contains 0.5"),
    "everything fixed": (lambda: ElasticBody(M, K, fixed=range(N)), "fixed lists all 10.*at least one"),
    "positions of another body": (lambda: ElasticBody(M, K, positions=np.zeros((4, 3))), "positions lists 4"),
    "positions nan": (lambda: ElasticBody(np.eye(6), np.eye(6), positions=[[0, 0, np.nan]]), "positions"),
    "too many modes": (lambda: BODY.modes(N + 1), r"number of modes=11; allowed: a whole number 1\.\.10"),
    "constants without modal damping": (lambda: GENERAL.constants(), "C1, C11, C12 need Rayleigh", AssumptionError),
}

BASES = {
    "V rank-deficient": (
        lambda: Basis(np.column_stack([V, V[:, 0]])),
        r"V of shape \(10, 4\) has rank 3, but 4 columns; remove.*rows are the N coordinates",
    ),
    "W rank-deficient": (lambda: Basis(V, V[:, [0, 1, 1]]), r"W of shape \(10, 3\) has rank 2"),
    "V zero column": (lambda: Basis(changed(V, (slice(None), 1), 0.0)), r"V has a zero column \(1\)"),
    "V wide": (lambda: Basis(V.T), "V has shape"),
    "V without columns": (lambda: Basis(V[:, :0]), "V has shape"),
    "V a vector": (lambda: Basis(V[:, 0]), "V has shape"),
    "V nan": (lambda: Basis(changed(V, (2, 1), np.nan)), r"V has a nan or inf at \(2, 1\)"),
    "W of another shape": (lambda: Basis(V, V[:, :2]), r"W has shape \(10, 2\)"),
    "W inf": (lambda: Basis(V, changed(V, (0, 0), np.inf)), "W has a nan or inf"),
    "W^T V singular": (lambda: Basis(np.eye(N)[:, :2], np.eye(N)[:, 1:3]), r"W\^T V is singular.*choose another W"),
    "V of another body": (lambda: run(basis=Basis(V[:8])), "V has 8 rows.*N = 10"),
    "V moves fixed": (lambda: run(ElasticBody(M, K, fixed=[0])), "V moves fixed coordinates.*must be 0"),
    "modal n": (lambda: modal_basis(BODY, 11), r"number of modes=11; allowed: a whole number 1\.\.10"),
    "krylov n": (lambda: krylov_basis(BODY, B, 0), r"n=0; allowed: a whole number 1\.\.10"),
    "krylov shifts": (lambda: krylov_basis(BODY, B, 3, shifts=(-1.0,)), "shifts=.*>= 0"),
    "krylov shift nan": (lambda: krylov_basis(BODY, B, 3, shifts=(np.nan,)), "shifts has a nan or inf"),
    "krylov shift inf": (lambda: krylov_basis(BODY, B, 3, shifts=(np.inf,)), "shifts has a nan or inf"),
    "krylov no shifts": (lambda: krylov_basis(BODY, B, 3, shifts=()), "shifts"),
    "krylov inputs": (lambda: krylov_basis(BODY, B[:3], 3), r"inputs has shape \(3, 1\); needed: \(10, any\)"),
    "krylov body": (lambda: krylov_basis(M, B, 3), "body is a ndarray; needed: ElasticBody"),
    "krylov no load": (lambda: krylov_basis(BODY, 0 * B, 3), "inputs do not move"),
    "gramian band": (lambda: gramian_basis(BODY, B, 3, band=(2.0, 1.0)), "band=.*0 <= w_lo < w_hi"),
    "gramian n": (lambda: gramian_basis(BODY, B, 11, band=(0.0, 1.0)), r"n=11; allowed: a whole number 1\.\.10"),
}


@pytest.mark.parametrize("row", [*BODIES.values(), *BASES.values()], ids=[*BODIES, *BASES])
def test_what_is_wrong_is_named(row):
    """Matrices, damping, fixed coordinates, positions; V and W, and what the makers of bases take."""
    check_refused(*row)


@pytest.mark.parametrize("apart", [1e-4, 1e-9])
def test_initial_state_of_nearly_dependent_columns(apart):
    """Columns that Basis takes make no singular equations: a state in their span is met, though V^T V is singular."""
    close = np.column_stack([V, V[:, 0] + apart * np.eye(N)[0]])
    q0 = close @ [1.0, 2.0, 3.0, 4.0]
    e0, e0_t = initial_error(BODY, Basis(close), q0, q0)
    # what a triangular solve leaves, of |V| |qr0| <= 20
    assert max(np.abs(e0).max(), np.abs(e0_t).max()) <= 1e3 * np.finfo(float).eps * np.abs(q0).max()


def test_input_function_that_raises_is_named():
    """The message has the time it was called at, and what it raised."""

    def fails_late(t):
        if t > 0.5:
            raise KeyError("table ends")
        return 1.0

    check_error(
        lambda: run(input_function=fails_late),
        InputError,
        r"input_function\(0\.\d+\) raised KeyError: 'table ends'",
    )


def test_types_are_also_the_builtin_ones():
    """Except ValueError and except RuntimeError catch them."""
    assert issubclass(InputError, ValueError)
    assert issubclass(AssumptionError, ValueError)
    assert issubclass(RunError, RuntimeError)
