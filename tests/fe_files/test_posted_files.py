"""Files of the kinds that people post: read by what is in them, and refused in words that are true of them."""

import numpy as np
import pytest
from scipy import sparse
from scipy.io import hb_write

import exudyn_romerr as romerr
from tests.fe_files.bar_files import matrix_input
from tests.fe_files.brick import FREE, LEFT, NUMBERS, OMEGA, brick, calculix, deck, harwell, market, pair, triples

WHOLE = np.arange(162)
DIGITS = 1e-5  # of OMEGA, which has six
PRINTED = 1e-13  # 14 digits in the files


def first(model, **held):
    return model.elastic_body(**held).modes(1).omega[0]


def assert_brick(model):
    """All of it, or of held nodes the places."""
    M, K, x, cells = brick()
    np.testing.assert_array_equal(model.node_numbers, NUMBERS)
    np.testing.assert_allclose(model.positions, x, atol=1e-9)
    np.testing.assert_array_equal(model.elements["Hex8"], cells)
    kept = np.setdiff1d(WHOLE, model.held)
    for found, wanted in ((model.mass, M), (model.stiffness, K)):
        assert abs(found - wanted)[kept][:, kept].max() <= PRINTED * abs(wanted).max()


# --- CalculiX ---------------------------------------------------------------


def test_calculix_held_by_boundary(tmp_path):
    """Rows of the held nodes are left out; the .dof names the rest. By the deck alone, too."""
    path = calculix(tmp_path, FREE)
    named = {"stiffness": tmp_path / "job.sti", "mass": tmp_path / "job.mas"}
    for model in (romerr.read_body(path, **named), romerr.read_body(path)):
        assert first(model) == pytest.approx(OMEGA, rel=DIGITS)
        np.testing.assert_array_equal(model.body.fixed, np.arange(18))
        np.testing.assert_array_equal(model.node_sets["left"], LEFT)
        assert_brick(model)


def test_calculix_free(tmp_path):
    """By its .sti; the .mas and the .inp are found beside it."""
    mesh = calculix(tmp_path, WHOLE)
    stiffness, mass = tmp_path / "job.sti", tmp_path / "job.mas"
    for model in (
        romerr.read_body(stiffness, mass=mass, mesh=mesh),
        romerr.read_body(stiffness),
        romerr.read_body(mass),
    ):
        assert_brick(model)
        assert first(model, fixed="left") == pytest.approx(OMEGA, rel=DIGITS)


@pytest.mark.parametrize("rows", [WHOLE, FREE])
def test_calculix_without_dof(tmp_path, rows):
    """Rows in the order of the nodes, without those that *Boundary holds; refused if it cannot be that order."""
    path = calculix(tmp_path, rows)
    (tmp_path / "job.dof").unlink()
    assert_brick(romerr.read_body(path))
    calculix(tmp_path, np.r_[rows[-3:], rows[:-3]])
    (tmp_path / "job.dof").unlink()
    with pytest.raises(
        romerr.InputError, match=r"not those of the nodes in ascending order.*the \.dof that"
    ) as error:
        romerr.read_body(path)
    assert "Abaqus" not in str(error.value)
    deck(path)
    if len(rows) < len(WHOLE):
        with pytest.raises(romerr.InputError, match=r"144 rows, the mesh 54 nodes.*the \.dof that CalculiX") as error:
            romerr.read_body(path)
        assert "Abaqus" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("5.1\n", r"job\.dof names 1 rows, .*job\.sti has 162: they are not of one run"),
        ("5.0\n", r"job\.dof has '5\.0'; needed: node\.direction"),
        ("five\n", r"job\.dof has 'five'"),
    ],
)
def test_calculix_dof_that_does_not_fit(tmp_path, text, message):
    calculix(tmp_path, WHOLE)
    (tmp_path / "job.dof").write_text(text)
    with pytest.raises(romerr.InputError, match=message):
        romerr.read_body(tmp_path / "job.sti")


def test_calculix_nodes_that_the_mesh_lacks(tmp_path):
    """As those of shells, which it makes solids of."""
    calculix(tmp_path, WHOLE)
    mesh = deck(tmp_path / "job.inp", numbers=NUMBERS + 1)
    with pytest.raises(romerr.InputError, match=r"no position .*Of shells and beams CalculiX makes solids"):
        romerr.read_body(tmp_path / "job.sti", mesh=mesh)


# --- Harwell-Boeing ---------------------------------------------------------

FLAVOURS = {
    "scipy": lambda path, matrix: hb_write(path, sparse.csc_matrix(matrix)),
    "scipy's triangle": lambda path, matrix: hb_write(path, sparse.csc_matrix(sparse.tril(matrix))),
    "Ansys": lambda path, matrix: path.write_text(harwell(matrix, rhs=2)),
    "unsymmetric": lambda path, matrix: path.write_text(harwell(matrix, "RUA", "E", a_line=1)),
}


@pytest.mark.parametrize(("flavour", "ending"), [*zip(FLAVOURS, ["hb", "matrix", "txt", "dat"], strict=True)])
def test_harwell_boeing(tmp_path, flavour, ending):
    """By the header, whatever the ending; a triangle or the whole, right-hand sides, exponents with D."""
    path = pair(tmp_path, ending, FLAVOURS[flavour])
    model = romerr.read_body(path, mass=tmp_path / f"M.{ending}", mesh=deck(tmp_path / "bar.inp"))
    assert_brick(model)
    assert first(model, fixed="left") == pytest.approx(OMEGA, rel=DIGITS)


def test_harwell_boeing_with_the_mapping_of_ansys(tmp_path):
    """Rows in the solver's order, which .mapping names; without it they are refused."""
    rows = np.random.default_rng(4).permutation(WHOLE)
    M, K, *_ = brick()
    shuffled = {"stiffness": K[rows][:, rows], "mass": M[rows][:, rows]}
    path = pair(tmp_path, "matrix", FLAVOURS["Ansys"], **shuffled)
    read = {"mass": tmp_path / "M.matrix", "mesh": deck(tmp_path / "bar.inp")}
    with pytest.raises(romerr.InputError, match=r"If HBMAT of Ansys wrote them.*\.mapping") as error:
        romerr.read_body(path, **read)
    assert "Abaqus" not in str(error.value)
    lines = [f"{i:12d}{NUMBERS[k // 3]:12d}   U{'XYZ'[k % 3]}" for i, k in enumerate(rows, start=1)]
    for name in "KM":
        (tmp_path / f"{name}.mapping").write_text("\n".join(["  Matrix Eqn   Node   DOF", *lines[::-1], ""]))
    assert_brick(romerr.read_body(path, **read))
    (tmp_path / "K.mapping").write_text("1 5 TEMP\n")
    with pytest.raises(romerr.InputError, match="names TEMP; known are UX"):
        romerr.read_body(path, **read)
    (tmp_path / "K.mapping").write_text("1 5 UX\n")
    with pytest.raises(romerr.InputError, match=r"has 162 rows, its \.mapping names 1"):
        romerr.read_body(path, **read)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text.replace("RSA", "CSA"), "of type CSA; known: real and assembled"),
        (lambda text: "\n".join(text.splitlines()[:-9]), "numbers where its header promises .*: it is damaged"),
        (lambda text: text.replace("D+0", "D+x"), "cannot be read as a matrix"),
    ],
)
def test_harwell_boeing_that_is_damaged(tmp_path, change, message):
    path = pair(tmp_path, "hb", lambda path, matrix: path.write_text(change(harwell(matrix))))
    with pytest.raises(romerr.InputError, match=message):
        romerr.read_body(path, mass=tmp_path / "M.hb")


# --- what is refused --------------------------------------------------------

SUBSTRUCTURE = """** ABAQUS/Standard
*USER ELEMENT, NODES=       2, LINEAR
** ELEMENT NODES
5, 8
 1, 2, 3
*MATRIX,TYPE=STIFFNESS
1.0
0.0, 1.0
*MATRIX,TYPE=MASS
2.0
0.0, 2.0
"""


@pytest.mark.parametrize(("name", "as_path"), [("sub.mtx", True), ("sub.inp", True), ("sub", False)])
def test_a_substructure_is_called_one(tmp_path, name, as_path):
    path = tmp_path / name
    path.write_text(SUBSTRUCTURE)
    message = rf"{name} is a substructure of Abaqus, reduced already: .*\*Matrix Generate"
    given = {"stiffness": path, "mass": path}
    with pytest.raises(romerr.InputError, match=message):
        romerr.read_body(path) if as_path else romerr.read_body(deck(tmp_path / "bar.inp"), **given)


@pytest.mark.parametrize("name", ["part.xyz", "part", "keyword.k"])
def test_what_is_not_known_is_told_with_what_is(tmp_path, name):
    path = tmp_path / name
    path.write_text("*KEYWORD\n*NODE\n1, 0, 0, 0\n" if name == "keyword.k" else "solid part\n")
    with pytest.raises(romerr.InputError, match=r"\.sti and \.mas of CalculiX.*Harwell-Boeing.*begins with") as error:
        romerr.read_body(path)
    assert path.read_text().split("\n")[0] in str(error.value)
    with pytest.raises(romerr.InputError, match=r"mesh='.*': known are \.inp, \.cdb"):
        romerr.read_body(deck(tmp_path / "bar.inp"), mesh=path)


def test_a_mesh_alone_is_called_one(tmp_path):
    path = tmp_path / "bar.bdf"
    path.write_text("BEGIN BULK\nGRID    1               0.      0.      0.\nENDDATA\n")
    with pytest.raises(romerr.InputError, match=r"bar\.bdf has nodes and no matrices; pass mass= and stiffness="):
        romerr.read_body(path)


@pytest.mark.parametrize(
    ("more", "wanted", "unwanted"),
    [
        ("*STEP\n*FREQUENCY, SOLVER=MATRIXSTORAGE", r"no bar\.sti beside bar\.inp: .*CalculiX", "Abaqus"),
        ("*STEP\n*Matrix Generate, stiffness, mass", r"no bar_STIF1\.mtx beside bar\.inp: .*Abaqus", "CalculiX"),
        ("", r"Abaqus writes after .*\(bar\.sti, which CalculiX writes", "Ansys"),
    ],
)
def test_a_deck_without_matrices_names_its_program(tmp_path, more, wanted, unwanted):
    with pytest.raises(romerr.InputError, match=wanted) as error:
        romerr.read_body(deck(tmp_path / "bar.inp", more=more))
    assert unwanted not in str(error.value)


# --- endings that say nothing -----------------------------------------------


def to_npz(path, matrix):
    with open(path, "wb") as stream:
        sparse.save_npz(stream, matrix)


def to_npy(path, matrix):
    with open(path, "wb") as stream:
        np.save(stream, matrix.toarray())


CONTENTS = {
    "Matrix Market": market,
    "scipy's npz": to_npz,
    "npy": to_npy,
    "lines": lambda path, matrix: path.write_text(triples(matrix)),
    "matrix input": lambda path, matrix: path.write_text(
        matrix_input(matrix, np.column_stack([np.repeat(NUMBERS, 3), np.tile([1, 2, 3], len(NUMBERS))]))
    ),
}


@pytest.mark.parametrize(("content", "ending"), [*((content, "xyz") for content in CONTENTS), ("npy", "mtx")])
def test_content_goes_before_the_ending(tmp_path, content, ending):
    path = pair(tmp_path, ending, CONTENTS[content])
    mesh = deck(tmp_path / "bar.mesh")
    for model in (
        romerr.read_body(path, mass=tmp_path / f"M.{ending}", mesh=mesh),
        romerr.read_body(mesh, mass=tmp_path / f"M.{ending}", stiffness=path),
    ):
        assert_brick(model)
