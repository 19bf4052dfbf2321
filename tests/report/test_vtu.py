"""Reports over the mesh as .vtu: what meshio reads in them."""

import base64
import re

import numpy as np
import pytest

import exudyn_romerr as romerr
from examples import suspension_linkage
from exudyn_romerr.report.data import NodeFields
from models import floating, linkage
from tests.helpers.theorem import random_case

BOUND = "error bound, not certified"  # of coordinates that are made up, and leave a Galerkin defect
FIELDS = ["displacement", BOUND, "error estimate"]


def read(path):
    return pytest.importorskip("meshio").read(path)


def bar_along(t, size=1.0):
    """The bar of models/floating.py, left face held, 4 modes, a load that none of them is: report, fem and tip."""
    fem = floating.load_fem("bar")
    left, tip = (floating.interface(fem, name)[0] for name in ("left", "tip"))
    fixed = (3 * left[:, None] + np.arange(3)).ravel()
    body = romerr.ElasticBody.from_fem(fem, rayleigh=(2.0, 1e-5), fixed=fixed)
    basis, B = romerr.modal_basis(body, 4), np.eye(body.N)[:, [3 * tip[0] + 1]]
    omega, V = body.modes(4).omega, basis.V
    rates, size = omega / 5, 1e-3 * np.reshape(size, (-1, 1))
    q = size * np.sin(np.outer(t, rates)) * (V.T @ B).ravel()
    q_t, q_tt = (size * rates * np.cos(np.outer(t, rates)) * (V.T @ B).ravel(), -(rates**2) * q)
    outputs = [romerr.node_displacement("tip", node=int(tip[0]), component="xyz")]
    trajectory = romerr.Trajectory(t, q, q_t, q_tt, np.sin(300 * t)[:, None])
    report = romerr.evaluate(body, basis, trajectory, inputs=B, outputs=outputs, estimators=("energy", "auxiliary"))
    return report, fem, int(tip[0])


@pytest.fixture(scope="module")
def bar():
    return bar_along(np.linspace(0, 0.01, 41))


@pytest.mark.parametrize("place", [0.05, 0.5, 0.95])
def test_displacements_of_long_runs_are_those_where_the_bound_is_largest(place):
    """Wherever that is: of other blocks of steps the run keeps no coordinates."""
    t = np.linspace(0, 0.9, 3600)
    report, _, tip = bar_along(t, 1e-3 + np.exp(-(((t / t[-1] - place) / 0.02) ** 2)))
    out, known = report.output("tip"), report.at_nodes()
    for name, displacement in known.displacement.items():
        i = int(np.argmax(report.position_bound[name]))
        assert known.instant[name] == t[i]
        np.testing.assert_allclose(displacement[tip], out.value[i], rtol=0, atol=1e-12 * np.max(np.abs(out.value)))
    assert abs(i / len(t) - place) < 0.1


def test_fields_are_those_of_the_report(bar, tmp_path):
    """Every digit; at the tip what the output there says at the same instant."""
    report, fem, tip = bar
    report.to_vtu(tmp_path / "bar.vtu", fem)
    mesh = read(tmp_path / "bar.vtu")
    out, i = report.output("tip"), int(np.argmax(report.position_bound["auxiliary"]))
    assert list(mesh.point_data) == FIELDS
    displacement, bound, estimate = mesh.point_data.values()
    np.testing.assert_array_equal(mesh.points, fem.GetNodePositionsAsArray())
    np.testing.assert_array_equal(bound, report.node_bound["auxiliary"])
    size = np.max(np.abs(out.value))
    np.testing.assert_allclose(displacement[tip], out.value[i], rtol=0, atol=1e-12 * size)
    np.testing.assert_allclose((displacement + estimate)[tip], out.corrected[i], rtol=0, atol=1e-9 * size)
    assert np.all(np.linalg.norm(estimate, axis=1) <= bound * (1 + 1e-12))
    assert np.max(np.abs(estimate)) > 1e-3 * size  # not nothing
    stored = (tmp_path / "bar.vtu").read_text()
    raw = base64.b64decode(re.search(r'Name="TimeValue"[^>]*>([^<]*)<', stored)[1])
    assert np.frombuffer(raw[8:], "<f8") == report.t[i]


def test_tetrahedra_are_those_of_the_mesh_and_upright(bar, tmp_path):
    """Those of ngsolve turn the other way round."""
    report, fem, _ = bar
    report.to_vtu(tmp_path / "bar.vtu", fem)
    (cells,) = read(tmp_path / "bar.vtu").cells
    assert cells.type == "tetra"
    assert [set(x) for x in cells.data.tolist()] == [set(x) for x in fem.elements[0]["Tet4"].tolist()]
    corners = fem.GetNodePositionsAsArray()[cells.data]
    assert np.all(np.linalg.det(corners[:, 1:] - corners[:, :1]) > 0)


def test_other_estimators_and_no_mesh(bar, tmp_path):
    report, _, tip = bar
    report.to_vtu(tmp_path / "bar.vtu", estimator="energy")
    mesh = read(tmp_path / "bar.vtu")
    assert [(cells.type, len(cells.data)) for cells in mesh.cells] == [("vertex", len(mesh.points))]
    np.testing.assert_array_equal(mesh.point_data[BOUND], report.node_bound["energy"])
    i = int(np.argmax(report.position_bound["energy"]))
    out = report.output("tip")
    np.testing.assert_allclose(mesh.point_data["displacement"][tip], out.value[i], atol=1e-12 * np.max(out.value))


def test_a_saved_report_writes_the_same_file(bar, tmp_path):
    report, fem, _ = bar
    report.to_vtu(tmp_path / "one.vtu", fem)
    report.save(tmp_path / "run.npz")
    romerr.load_report(tmp_path / "run.npz").to_vtu(tmp_path / "two.vtu", fem)
    assert (tmp_path / "one.vtu").read_bytes() == (tmp_path / "two.vtu").read_bytes()


def test_beams(tmp_path):
    """Lines, six coordinates a node."""
    report = suspension_linkage.simulate()
    report.to_vtu(tmp_path / "linkage.vtu", linkage.mesh())
    mesh = read(tmp_path / "linkage.vtu")
    assert [cells.type for cells in mesh.cells] == ["line"]
    assert mesh.point_data["displacement"].shape == (len(mesh.points), 3)


@pytest.mark.parametrize(
    ("kind", "columns"), [("triangle", 3), ("tetra10", 10), ("hexahedron", 8), ("hexahedron20", 20), (None, 7)]
)
def test_kinds_of_elements(bar, tmp_path, kind, columns):
    report, fem, _ = bar
    mesh = fem.GetNodePositionsAsArray(), np.arange(2 * columns).reshape(2, columns)
    if kind is None:
        with pytest.raises(romerr.InputError, match=r"elements of mesh has 7 columns; needed: 2 \(Line2\)"):
            report.to_vtu(tmp_path / "bar.vtu", mesh)
        return
    report.to_vtu(tmp_path / "bar.vtu", mesh)
    (cells,) = read(tmp_path / "bar.vtu").cells
    assert cells.type == kind
    assert [set(x) for x in cells.data.tolist()] == [set(x) for x in mesh[1].tolist()]


def test_what_cannot_be_written_is_refused(bar, tmp_path):
    report, fem, _ = bar
    x = fem.GetNodePositionsAsArray()
    for mesh, message in (
        ((2 * x, None), "nodes elsewhere than the body of this report"),
        ((x[:-1], None), "positions of mesh has shape"),
        ((x, [[0, 1, 2, len(x)]]), f"node {len(x)}; allowed: node numbers"),
    ):
        with pytest.raises(romerr.InputError, match=message):
            report.to_vtu(tmp_path / "bar.vtu", mesh)
    with pytest.raises(romerr.InputError, match=r"pass one with \.vtu"):
        report.to_vtu(tmp_path / "bar.vtk")
    with pytest.raises(romerr.InputError, match="estimator='fast' is unknown"):
        report.to_vtu(tmp_path / "bar.vtu", estimator="fast")
    case = random_case(1, steps=20)
    with pytest.raises(romerr.InputError, match="no node positions"):
        case.report(estimators=("fast",)).to_vtu(tmp_path / "bar.vtu")
    assert list(tmp_path.iterdir()) == []


def test_a_report_of_version_0_1_has_bounds_only(bar, tmp_path):
    report = romerr.load_report(saved(bar[0], tmp_path))
    report.nodes = NodeFields(report.node_bound)
    again = romerr.load_report(saved(report, tmp_path))
    assert again.node_bound.keys() == report.node_bound.keys()
    with pytest.raises(romerr.InputError, match=r"saved by version 0\.1"):
        again.to_vtu(tmp_path / "bar.vtu")


def saved(report, folder):
    report.save(folder / "run.npz")
    return folder / "run.npz"
