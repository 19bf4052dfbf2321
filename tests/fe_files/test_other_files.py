"""Bodies from Matrix Market, scipy, our own files, Exudyn's, Nastran's and Ansys's; and what these lack."""

import gzip
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy import sparse
from scipy.io import mmwrite

import exudyn_romerr as romerr
from tests.fe_files.bar_files import assert_bar, bar, in_order, labels, write_abaqus

EXACT = 0.0


@pytest.fixture
def model(tmp_path):
    """The bar with its node numbers, as read from Abaqus's files."""
    return romerr.read_body(write_abaqus(tmp_path))


def same(one, other):
    """All that a model has, bit by bit."""
    for name in ("mass", "stiffness"):
        assert abs(getattr(one, name) - getattr(other, name)).max() == 0
    for name in ("positions", "node_numbers", "held"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    for name in ("node_sets", "elements"):
        assert list(getattr(one, name)) == list(getattr(other, name))
        for key, x in getattr(one, name).items():
            np.testing.assert_array_equal(getattr(other, name)[key], x)


# --- two matrices -----------------------------------------------------------


@pytest.mark.parametrize("kind", ["mtx", "mtx.gz", "symmetric", "npz", "npy"])
def test_two_matrices(tmp_path, kind):
    """By name, or as mass= and stiffness=; without nodes, or with those of an .inp that has rows in its order."""
    _, _, M, K, _ = bar()
    ending = "mtx" if kind == "symmetric" else kind
    for name, matrix in (("mass", M), ("stiffness", K)):
        path = tmp_path / f"bar_{name}.{ending}"
        if ending == "npz":
            sparse.save_npz(path, matrix)
        elif ending == "npy":
            np.save(path, matrix.toarray())
        else:
            symmetry = "symmetric" if kind == "symmetric" else "general"
            mmwrite(tmp_path / "plain.mtx", sparse.coo_matrix(matrix), precision=17, symmetry=symmetry)
            raw = (tmp_path / "plain.mtx").read_bytes()
            path.write_bytes(gzip.compress(raw) if ending == "mtx.gz" else raw)
    mesh = write_abaqus(tmp_path)
    first = tmp_path / f"bar_stiffness.{ending}"
    found = [romerr.read_body(first), romerr.read_body(first, mass=tmp_path / f"bar_mass.{ending}", mesh=mesh)]
    assert_bar(found[1], 1e-12 if kind == "symmetric" else EXACT)  # assembled matrices are symmetric to rounding
    assert found[0].positions is None
    assert abs(found[0].mass - found[1].mass).max() == 0
    (tmp_path / f"bar_mass.{ending}").rename(tmp_path / "other")
    with pytest.raises(romerr.InputError, match=r"has one matrix; pass mass= and stiffness="):
        romerr.read_body(first)


@pytest.mark.parametrize(
    ("matrix", "message"),
    [
        (np.zeros((3, 4)), r"has a matrix of shape \(3, 4\); needed: square"),
        (np.array([[1, None], [None, 1]]), "cannot be read as a matrix: Object arrays"),
    ],
)
def test_files_that_are_no_matrix(tmp_path, matrix, message):
    np.save(tmp_path / "mass.npy", matrix, allow_pickle=True)
    np.save(tmp_path / "stiffness.npy", np.eye(3))
    with pytest.raises(romerr.InputError, match=message):
        romerr.read_body(tmp_path / "stiffness.npy")


@pytest.mark.parametrize(
    ("path", "more", "message"),
    [
        ("none.inp", {}, r"path='none\.inp' is no file"),
        (".", {}, r"path='\.' is no file"),
        ("text.xyz", {}, r"files that end in '\.xyz' are not known"),
        ("text.mtx", {"mesh": "text.xyz"}, r"mesh='text\.xyz': known are \.inp, \.cdb"),
        ("text.npz", {}, r"text\.npz cannot be read"),
        ("text.op4", {}, r"text\.op4 is an output file of Nastran.*DMIG"),
    ],
)
def test_files_of_no_known_kind(tmp_path, monkeypatch, path, more, message):
    monkeypatch.chdir(tmp_path)
    if path.startswith("text"):
        for name in {path, *map(str, more.values())}:
            Path(name).write_text("text")
    with pytest.raises(romerr.InputError, match=message):
        romerr.read_body(path, **more)


# --- saved bodies -----------------------------------------------------------


def test_own_files_come_back_bit_by_bit(model, tmp_path):
    model.node_sets["left"] = np.arange(4)
    model.save(tmp_path / "bar.npz")
    again = romerr.read_body(tmp_path / "bar.npz", fixed="left")
    same(model, again)
    assert again.body.fixed.size == 12
    assert repr(again) == "<FEModel: 195 coordinates, 65 nodes, 120 Tet4; sets left>"
    with pytest.raises(romerr.InputError, match=r"folder .* does not exist"):
        model.save(tmp_path / "none" / "bar.npz")


@pytest.mark.parametrize("kind", ["npz", "pkl", "hdf5"])
def test_what_an_interface_saves_is_exudyns_to_read(tmp_path, kind):
    """Nothing is unpickled: pickles may run any code."""
    path = tmp_path / f"bar.{kind}"
    if kind == "npz":
        np.savez(path, massMatrix=np.array({"any": "object"}, dtype=object))
    else:
        path.write_bytes(b"\x89HDF\r\n\x1a\n" if kind == "hdf5" else b"\x80\x04")
    with pytest.raises(romerr.InputError, match=r"FEMinterface\.SaveToFile .*fem\.LoadFromFile.*from_fem"):
        romerr.read_body(path)


# --- Nastran ----------------------------------------------------------------


@pytest.fixture
def nastran(tmp_path, model):
    """bar.pch, bar.bdf, as its package writes them."""
    bulk = pytest.importorskip("pyyeti.nastran.bulk")
    with open(tmp_path / "bar.bdf", "w", encoding="ascii") as stream:
        bulk.wtgrids(stream, in_order(), xyz=model.positions, form="{:16.9E}")
        for e, tet in enumerate(model.elements["Tet4"], start=1):
            stream.write(f"CTETRA  {e:8d}{1:8d}{''.join(f'{n:8d}' for n in in_order()[tet])}\n")
    names = (("kaax", model.stiffness), ("maax", model.mass), ("k2", model.stiffness))
    bulk.wtdmig(str(tmp_path / "two.pch"), {name: frame_of(matrix) for name, matrix in names})
    bulk.wtdmig(str(tmp_path / "bar.pch"), {name: frame_of(matrix) for name, matrix in names[:2]})
    return tmp_path / "bar.pch"


def frame_of(matrix):
    """A table as pyyeti writes DMIG from, both axes (node, coordinate)."""
    pandas = pytest.importorskip("pandas")
    index = pandas.MultiIndex.from_arrays(labels().T, names=["id", "dof"])
    full = matrix.toarray()
    return pandas.DataFrame((full + full.T) / 2, index=index, columns=index)


def test_nastran_dmig(nastran, model, tmp_path):
    found = romerr.read_body(tmp_path / "bar.pch", mesh=tmp_path / "bar.bdf")
    for one, other in ((found.stiffness, model.stiffness), (found.mass, model.mass)):
        assert abs(one - other).max() <= 1e-8 * abs(other).max()  # 10 digits in the file
    np.testing.assert_array_equal(found.node_numbers, model.node_numbers)
    # nodes in the same file
    text = (tmp_path / "bar.pch").read_text() + (tmp_path / "bar.bdf").read_text()
    (tmp_path / "both.pch").write_text(text)
    same(romerr.read_body(tmp_path / "both.pch"), found)


LOCAL = """GRID    999     0       0.      0.      0.      10
CORD2R  10      0       0.      0.      0.      0.      0.      1.
        1.      0.      0.
"""


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (LOCAL, r"node 999 has displacements in local axes \(CD of GRID\)"),
        ("RBE2    900     10      123456  13      16\n", "has RBE2: constraints between nodes are not read"),
    ],
)
def test_nastran_bulk_data_that_is_refused(nastran, tmp_path, more, message):
    with open(tmp_path / "bar.bdf", "a", encoding="ascii") as stream:
        stream.write(more)
    with pytest.raises(romerr.InputError, match=message):
        romerr.read_body(nastran, mesh=tmp_path / "bar.bdf")


def test_nastran_names_and_damage(nastran, tmp_path):
    with pytest.raises(romerr.InputError, match=r"mass='mxx' is not in .*; it has kaax, maax"):
        romerr.read_body(nastran, mass="mxx")
    with pytest.raises(romerr.InputError, match=r"bar\.pch has no GRID; pass mesh="):
        romerr.read_body(nastran, mesh=nastran)
    with pytest.raises(romerr.InputError, match=r"no single stiffness matrix .*: 2 that may be it \(kaax, k2\)"):
        romerr.read_body(tmp_path / "two.pch")
    assert romerr.read_body(tmp_path / "two.pch", stiffness="K2").positions is None
    nastran.write_text("text")
    with pytest.raises(romerr.InputError, match=r"bar\.pch (cannot be read|has no single)"):
        romerr.read_body(nastran)


# --- Ansys ------------------------------------------------------------------


@pytest.fixture
def full(tmp_path):
    """A .full of Mapdl, which ansys-mapdl-reader brings, with its .rst: a clamped bar of 40 Solid186."""
    examples = pytest.importorskip("ansys.mapdl.reader.examples")
    for name in ("fullfile", "rstfile"):
        shutil.copy(getattr(examples, name), tmp_path)
    return tmp_path / "file.full"


def test_ansys_full_has_the_published_frequencies(full):
    """Those in the package's documentation, in Hz, to their last digit; one end is held, 21 nodes."""
    model = romerr.read_body(full)
    np.testing.assert_allclose(
        model.body.modes(4).omega / (2 * np.pi), [1283.200, 1283.200, 5781.975, 6919.399], rtol=0, atol=5e-4
    )
    assert len(model.held) == 63
    assert {kind: len(x) for kind, x in model.elements.items()} == {"Hex20": 40}
    held = model.positions[np.unique(model.held // 3)]
    assert np.ptp(held[:, 2]) == 0  # a face
    rest = np.setdiff1d(np.arange(321), model.held // 3)
    assert np.all(model.positions[rest, 2] != held[0, 2])


def test_ansys_without_nodes(full):
    full.with_suffix(".rst").unlink()
    model = romerr.read_body(full)
    assert model.positions is None
    assert len(model.node_numbers) == 321
    for damaged, why in ((full.read_bytes()[:5000], "it is truncated"), (b"text", "")):
        full.write_bytes(damaged)
        with pytest.raises(romerr.InputError, match=rf"file\.full cannot be read as a \.full file: .*{why}"):
            romerr.read_body(full)


@pytest.mark.parametrize(
    ("module", "name", "extra"),
    [("ansys.mapdl", "a.full", "ansys"), ("pyyeti", "a.pch", "nastran")],
)
def test_packages_that_are_not_installed_are_named(tmp_path, monkeypatch, module, name, extra):
    for key in [key for key in sys.modules if key.startswith(module)]:
        monkeypatch.delitem(sys.modules, key)
    monkeypatch.setitem(sys.modules, module, None)
    (tmp_path / name).write_text("")
    with pytest.raises(romerr.InputError, match=rf"{name} needs .*pip install .*{extra}"):
        romerr.read_body(tmp_path / name)


# --- mass for stiffness -----------------------------------------------------


def test_swapped_matrices_are_told(tmp_path):
    """By what translations cost, whether the file has nodes or not, and also where supports would hide it."""
    _, _, M, K, _ = bar()
    for name, matrix in (("mass", K), ("stiffness", M)):
        mmwrite(tmp_path / f"{name}.mtx", matrix)
    with pytest.raises(romerr.InputError, match="mass and stiffness are swapped"):
        romerr.read_body(tmp_path / "stiffness.mtx", mass=tmp_path / "mass.mtx")
    held = {"fixed": range(12), "rayleigh": (0.0, 0.0)}
    with pytest.raises(romerr.InputError, match="mass and stiffness are swapped"):
        romerr.ElasticBody(K, M, **held)
    assert romerr.ElasticBody(M, K, **held).N == len(M.toarray())


def test_matrices_that_are_no_bodies_of_nodes_are_not_called_swapped():
    """A chain of masses; a free one as both, which is singular and no more."""
    chain = np.diag([2.0] * 6) - np.diag([1.0] * 5, 1) - np.diag([1.0] * 5, -1)
    assert romerr.ElasticBody(np.eye(6), chain).N == 6
    free = bar()[3]
    with pytest.raises(romerr.InputError, match="mass is not positive"):
        romerr.ElasticBody(free, free)
