"""Matrices to which a triangle was added that was there already: told from the numbers, with a cure that is right."""

import numpy as np
import pytest
from scipy import sparse

import exudyn_romerr as romerr
from tests.fe_files.bar_files import matrix_input
from tests.fe_files.brick import FREE, NUMBERS, brick, calculix, deck, market, pair


def both(matrix):
    """A whole matrix and its transpose without the diagonal: what is right of a triangle only."""
    return matrix + matrix.T - sparse.diags(matrix.diagonal())


TWICE = {
    "both": (both, r"its off-diagonal terms are twice what they should be: a triangle was added twice\. Halve"),
    "below": (lambda A: A + sparse.triu(A, 1).T, r"below the diagonal are twice .*: a triangle was added twice"),
    "above": (
        lambda A: A + sparse.tril(A, -1).T,
        r"above the diagonal are twice .*: a triangle was added twice",
    ),
    "diagonal": (lambda A: sparse.triu(A) + sparse.triu(A).T, "its diagonal terms are twice what they should be"),
}


@pytest.mark.parametrize("meshed", [True, False])
@pytest.mark.parametrize("how", TWICE)
def test_a_triangle_added_twice(tmp_path, how, meshed):
    change, message = TWICE[how]
    M, K, *_ = brick()
    path = pair(tmp_path, "mtx", market, stiffness=change(K), mass=change(M))
    mesh = {"mesh": deck(tmp_path / "bar.inp")} if meshed else {}
    with pytest.raises(romerr.InputError, match=message) as error:
        romerr.read_body(path, mass=tmp_path / "M.mtx", **mesh)
    assert "Abaqus" not in str(error.value)
    assert "swapped" not in str(error.value)


@pytest.mark.parametrize("how", TWICE)
def test_a_triangle_added_twice_where_the_body_is_held(tmp_path, how):
    """And rows are named; what the held nodes do not touch is asked."""
    change, message = TWICE[how]
    with pytest.raises(romerr.InputError, match=message):
        romerr.read_body(calculix(tmp_path, FREE, change=change))


def test_a_mass_matrix_with_a_triangle_added_twice(tmp_path):
    """Alone; also where matrices are passed on without a file."""
    M, K, *_ = brick()
    wrong = TWICE["below"][0](M)
    path = pair(tmp_path, "mtx", market, mass=wrong)
    with pytest.raises(romerr.InputError, match=r"the mass matrix is not symmetric: .*a triangle was added twice"):
        romerr.read_body(path, mass=tmp_path / "M.mtx")
    with pytest.raises(romerr.InputError, match=r"mass is not symmetric: .*a triangle was added twice"):
        romerr.ElasticBody(wrong, K, fixed=range(18))


def test_springs_to_the_ground_are_not_called_a_triangle(tmp_path):
    """Rigid motions need forces by them, however much is halved; named rows are not asked for their order."""
    M, K, *_ = brick()
    rows = np.column_stack([np.repeat(NUMBERS, 3), np.tile([1, 2, 3], len(NUMBERS))])
    held = K + sparse.diags(np.r_[np.full(18, 1e9), np.zeros(144)])
    path = deck(tmp_path / "job.inp")
    for name, matrix in (("STIF", held), ("MASS", M)):
        (tmp_path / f"job_{name}1.mtx").write_text(matrix_input(matrix, rows))
    assert romerr.read_body(path).body.N == 162
    (tmp_path / "job_STIF1.mtx").write_text(matrix_input(both(K), rows))
    with pytest.raises(romerr.InputError, match="its off-diagonal terms are twice"):
        romerr.read_body(path)
