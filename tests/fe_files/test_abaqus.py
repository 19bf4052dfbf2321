"""Bodies from Abaqus's files: the bar of models/floating.py, and small ones written by hand."""

import numpy as np
import pytest
from scipy import sparse

import exudyn_romerr as romerr
from models import floating
from tests.fe_files.bar_files import (
    assert_bar,
    bar,
    in_order,
    labels,
    matrix_input,
    node_lines,
    tet_lines,
    write_abaqus,
)

PRINTED = 1e-15  # 16 digits in the files
FIX = "*Boundary\n"


def test_stored_files_are_the_bar_they_were_made_of():
    """format=coordinate; the elements, turned the way Abaqus wants them, and a body and a fem that are right."""
    model, fem = romerr.read_body(floating.DATA / "abaqus_bar.inp", fixed=range(9)), floating.load_fem("bar")
    np.testing.assert_array_equal(model.positions, fem.GetNodePositionsAsArray())
    np.testing.assert_array_equal(model.node_numbers, np.arange(1, 66))
    for found, wanted in ((model.mass, fem.massMatrix), (model.stiffness, fem.stiffnessMatrix)):
        assert abs(found - wanted).max() <= PRINTED * abs(wanted).max()
    read, made = model.elements["Tet4"], np.asarray(fem.elements[0]["Tet4"])
    np.testing.assert_array_equal(read, made[:, [0, 2, 1, 3]])
    assert model.body.N == 195
    assert model.body.fixed.size == 9
    again = model.to_fem()
    np.testing.assert_array_equal(again.elements[0]["Tet4"], read)
    np.testing.assert_array_equal(again.GetNodePositionsAsArray(), model.positions)
    x = model.positions[read]
    assert np.all(np.linalg.det(x[:, 1:] - x[:, :1]) > 0)  # what Abaqus asks for
    body = romerr.ElasticBody.from_fem(again, fixed=range(9))
    np.testing.assert_allclose(body.modes(3).omega, model.body.modes(3).omega, rtol=1e-9)
    assert {frozenset(t) for t in again.surface[0]["Trigs"].tolist()} == {
        frozenset(t) for t in fem.surface[0]["Trigs"].tolist()
    }


@pytest.mark.parametrize("triangle", [sparse.tril, sparse.triu, None])
def test_matrix_input_names_its_rows(tmp_path, triangle):
    """Numbers with gaps in any order; lower, upper or both triangles; rows in any order."""
    _, tets, M, K, _ = bar()
    rng = np.random.default_rng(1)
    texts = []
    for matrix in (M, K):
        lines = matrix_input(matrix, labels(), triangle).splitlines(keepends=True)
        texts.append("** made by a test\n*Matrix\n" + "".join(rng.permutation(lines)))
    model = romerr.read_body(write_abaqus(tmp_path, None, *texts))
    assert_bar(model)
    np.testing.assert_array_equal(model.elements["Tet4"], tets)
    assert model.node(int(in_order()[5])) == 5
    with pytest.raises(romerr.InputError, match="node 11 is not among the nodes"):
        model.node(11)


def test_coordinate_rows_go_by_ascending_numbers(tmp_path):
    """Nodes in the file's own order: rows are not those of the lines."""
    _, tets, M, K, _ = bar()
    lines = np.random.default_rng(2).permutation(node_lines().splitlines(keepends=True))
    text = f"*Node\n{''.join(lines)}*Element, type=C3D4\n{tet_lines(tets)}"
    coordinate = [coordinates(matrix) for matrix in (M, K)]
    assert_bar(romerr.read_body(write_abaqus(tmp_path, text, *coordinate)))
    path = write_abaqus(tmp_path, text.replace(f"\n{in_order()[0]}, ", "\n5000, "), *coordinate)
    with pytest.raises(romerr.InputError, match=r"rigid motions of the nodes need forces .*format=matrix input"):
        romerr.read_body(path)


def coordinates(matrix):
    entries = sparse.coo_matrix(matrix)
    rows = zip(entries.row + 1, entries.col + 1, entries.data, strict=True)
    return "".join(f"{i} {j}  {x:.15e}\n" for i, j, x in rows)


def test_sections_and_sets(tmp_path):
    """Two of nodes, three of elements; sets by numbers, ranges, other sets, elements, and from the assembly."""
    _, tets, *_, sets = bar()
    lines = node_lines().splitlines(keepends=True)
    n = in_order()
    text = (
        f"*Heading\n*PART, Name=bar\n*node, nset=FIRST\n{''.join(lines[:20])}*Node\n{''.join(lines[20:])}"
        f"*Element, Type=C3D4, Elset=one\n{tet_lines(tets[:50])}** a comment\n*Element, elset=two,\n type=C3D4\n"
        f"{tet_lines(tets[50:], 51)}*Element, type=SPRING1\n 500, {n[0]}\n"
        f"*Nset, nset=left\n{', '.join(map(str, n[sets['left'][:4]]))},\n{', '.join(map(str, n[sets['left'][4:]]))}\n"
        "*Nset, nset=All, generate\n10, 202, 3\n*Nset, nset=both\nleft, first\n*Nset, elset=two, nset=of two\n"
        "*Elset, elset=last, generate\n 118, 120\n*Nset, nset=of last, elset=last\n*End Part\n"
        "*Assembly, name=a\n*Instance, name=bar-1, part=bar\n*End Instance\n"
        f"*Nset, nset=tip, instance=bar-1\n {n[sets['tip'][0]]},\n*Nset, nset=again\n bar-1.{n[3]}\n*End Assembly\n"
        "*Material, name=steel\n*Step\n*Matrix Generate, stiffness, mass\n*End Step\n"
    )
    model = romerr.read_body(write_abaqus(tmp_path, text))
    assert_bar(model)
    np.testing.assert_array_equal(model.elements["Tet4"], tets)
    found = {name: sorted(nodes.tolist()) for name, nodes in model.node_sets.items()}
    assert found == {
        "FIRST": list(range(20)),
        "left": sets["left"].tolist(),
        "All": list(range(65)),
        "both": sorted({*sets["left"].tolist(), *range(20)}),
        "of two": sorted(set(tets[50:].ravel().tolist())),
        "of last": sorted(set(tets[117:].ravel().tolist())),
        "tip": sets["tip"].tolist(),
        "again": [3],
    }
    held = (3 * sets["left"][:, None] + np.arange(3)).ravel()
    np.testing.assert_array_equal(model.elastic_body(fixed="left").fixed, held)
    body = model.elastic_body(rayleigh=(2.0, 1e-5), fixed=["left", 3 * 30])
    assert body.rayleigh == (2.0, 1e-5)
    np.testing.assert_array_equal(body.fixed, np.union1d(held, [90]))
    with pytest.raises(romerr.InputError, match=r"fixed='right' is unknown; allowed: .*'left'"):
        model.elastic_body(fixed="right")


@pytest.mark.parametrize(
    ("support", "dofs"),
    [
        ("{0}, ENCASTRE", {0: [0, 1, 2]}),
        ("{0}, pinned\n{1}, xsymm", {0: [0, 1, 2], 1: [0]}),
        ("{0}, 2, 3\n{1}, 1", {0: [1, 2], 1: [0]}),
        ("ends, 3, 3, 0.0", {0: [2], 1: [2]}),
        ("bar-1.{1}, 1, 2", {1: [0, 1]}),
        ("*Equation\n1\n{0}, 2, 5.0\n1\nends, 1, 1.0", {0: [0, 1], 1: [0]}),
    ],
)
def test_supports_are_held(tmp_path, support, dofs):
    n = in_order()
    step = support if support.startswith("*") else f"{FIX}{support}"
    text = f"*Node\n{node_lines()}*Nset, nset=ends\n{n[0]}, {n[1]}\n*Step\n{step.format(*n)}\n*End Step\n"
    model = romerr.read_body(write_abaqus(tmp_path, text))
    assert model.held.tolist() == [3 * node + k for node, ks in dofs.items() for k in ks]
    assert_bar(model)


def test_coordinates_without_rows_and_with_1e36_are_held(tmp_path):
    """What Abaqus leaves out, or holds by 1e36 on the diagonal; the rest is the matrix without these."""
    _, _, M, K, _ = bar()
    K = K.tolil()
    K[7, :] = K[:, 7] = 0.0
    K[7, 7] = 1e36
    kept = np.setdiff1d(np.arange(195), [3, 4])
    texts = [matrix_input(sparse.csr_matrix(A)[kept][:, kept], labels()[kept]) for A in (M, K)]
    model = romerr.read_body(write_abaqus(tmp_path, None, *texts))
    assert model.held.tolist() == [3, 4, 7]
    free = np.setdiff1d(kept, [7])
    wanted = sparse.csr_matrix(K)[free][:, free]
    assert abs(model.stiffness[free][:, free] - wanted).max() <= 1e-14 * abs(wanted).max()
    assert model.stiffness[7, 7] == 0
    with pytest.raises(romerr.InputError, match=r"holds 3 coordinates, \[3, 4, 7\].*Exudyn's bodies are free"):
        model.to_fem()
    # of format=coordinate, too: there the order of rows is not checked
    coordinate = romerr.read_body(write_abaqus(tmp_path, None, coordinates(M), coordinates(K)))
    assert coordinate.held.tolist() == [7]


def test_an_instance_is_moved_then_turned(tmp_path):
    x, tets, *_ = bar()
    text = (
        f"*Part, name=bar\n*Node\n{node_lines()}*Element, type=C3D4\n{tet_lines(tets)}*End Part\n*Assembly, name=a\n"
        "*Instance, name=i, part=BAR\n1., 2., 3.\n0., 0., 0., 0., 0., 2., 90.\n*End Instance\n*End Assembly\n"
    )
    model = romerr.read_body(write_abaqus(tmp_path, text))
    moved = x + np.array([1.0, 2.0, 3.0])
    np.testing.assert_allclose(model.positions, np.column_stack([-moved[:, 1], moved[:, 0], moved[:, 2]]), atol=1e-14)


def test_included_files(tmp_path):
    _, tets, *_ = bar()
    (tmp_path / "nodes.inp").write_text(f"** of the mesher\n{node_lines()}")
    (tmp_path / "elements.inp").write_text(f"*Element, type=C3D4\n{tet_lines(tets)}")
    text = "*Node, input=nodes.inp\n*Include, input=elements.inp\n"
    model = romerr.read_body(write_abaqus(tmp_path, text))
    assert_bar(model)
    np.testing.assert_array_equal(model.elements["Tet4"], tets)
    (tmp_path / "nodes.inp").unlink()
    with pytest.raises(romerr.InputError, match=r"job\.inp, line 1.*nodes\.inp is no file"):
        romerr.read_body(tmp_path / "job.inp")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("*Heading\n", r"job\.inp has no \*Node"),
        ("{nodes}*Equation\n2\n10, 1, 1., 13, 1, -1.\n", "line 67.*several terms couples nodes"),
        ("{nodes}*Tie, name=t\n a, b\n", r"line 67, \*Tie, name=t: its matrices hold such constraints"),
        ("{nodes}*MPC\nBEAM, 10, 13\n", "its matrices hold such"),
        ("{nodes}*Ngen\n10, 13\n", "nodes or elements that Abaqus makes"),
        ("{nodes}*Boundary\n10, 1, 1, 0.5\n", r"10 is moved by 0\.5; only supports at zero"),
        ("{nodes}*Boundary\nleft, 1\n", "no set 'left' before this line"),
        ("{nodes}*Nset, nset=a\nb,\n", "cannot be read .*no set 'b'"),
        ("*Node\n10, 0, 0, zero\n", r"line 1, \*Node: cannot be read .*'zero'"),
        ("*Instance, name=a\n{nodes}*End Instance\n*Instance, name=b\n{nodes}", r"2 instances \(a, b\); merge"),
        ("*Node\n10, 0, 0, 0\n", r"node 13 has rows in the matrices and no position \(64 such nodes\)"),
    ],
)
def test_what_is_not_read_is_refused(tmp_path, text, message):
    path = write_abaqus(tmp_path, text.format(nodes=f"*Node\n{node_lines()}"))
    with pytest.raises(romerr.InputError, match=message):
        romerr.read_body(path)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("MASS", None, r"there is no job_MASS1\.mtx beside job\.inp: the mass matrix, which Abaqus writes after"),
        ("STIF", "", "begins with ''; known: Matrix Market"),
        ("STIF", "some text\n", "begins with 'some text'"),
        ("STIF", "1,1, 1,1, two\n", "cannot be read as a matrix: could not convert"),
        ("STIF", "1,1, 1,1, 2\n3\n", "cannot be read as a matrix: .*number of columns changed from 5 to 1"),
        ("STIF", "-1,1, 1,1, 2.0\n", r"internal nodes of Abaqus \(negative numbers\)"),
        ("STIF", "1,11, 1,1, 2.0\n", "coordinate 11 of a node"),
        ("STIF", "0 1 2.0\n", "row or column 0; they are counted from 1"),
        ("STIF", "1 1 2.0\n", "the mass matrix has 195 rows, the stiffness matrix 1"),
        ("STIF", "1,1, 1,1, 2.0\n", "node 1 has rows in the matrices and no position"),
    ],
)
def test_matrices_that_lack_something(tmp_path, name, text, message):
    path = write_abaqus(tmp_path)
    matrix = tmp_path / f"job_{name}1.mtx"
    matrix.unlink() if text is None else matrix.write_text(text)
    with pytest.raises(romerr.InputError, match=message):
        romerr.read_body(path)


def test_matrices_elsewhere(tmp_path):
    """Named; of two steps one has to be."""
    path = write_abaqus(tmp_path)
    (tmp_path / "job_STIF2.mtx").write_text((tmp_path / "job_STIF1.mtx").read_text())
    with pytest.raises(romerr.InputError, match=r"job_STIF1\.mtx, job_STIF2\.mtx; pass stiffness=, one of them"):
        romerr.read_body(path)
    assert_bar(romerr.read_body(path, stiffness=tmp_path / "job_STIF2.mtx"))
    with pytest.raises(romerr.InputError, match=r"stiffness='none\.mtx' is no file"):
        romerr.read_body(path, stiffness="none.mtx")
    # without nodes, or with those of another file
    pair = romerr.read_body(tmp_path / "job_STIF1.mtx")
    assert pair.positions is None
    np.testing.assert_array_equal(pair.node_numbers, in_order())
    assert_bar(romerr.read_body(tmp_path / "job_MASS1.mtx", mesh=path))
    with pytest.raises(romerr.InputError, match="no file had node positions"):
        pair.to_fem()
