"""Strain and stress at nodes: exact fields, Exudyn's own values, bounds against truths in every scope, von Mises."""

from functools import cache
from itertools import product
from pathlib import Path
from types import SimpleNamespace

import exudyn as exu
import numpy as np
import pytest
from exudyn import itemInterface
from exudyn.FEM import FEMinterface, KirchhoffMaterial

import exudyn_romerr as romerr
from benchmarks.by_run import told_by_run
from examples import stress_bound
from exudyn_romerr.model import solid_elements as solid
from models import floating
from models.beam3d import STEEL
from tests.helpers import tolerances as tol
from tests.helpers.pages import BLOCK
from tests.mbs.floating import test_floating_bounds as bounds

ROOT = Path(__file__).resolve().parents[2]
MATERIAL = KirchhoffMaterial(STEEL.youngs_modulus, STEEL.poisson_ratio, STEEL.density)
COMPONENTS = ("xx", "yy", "zz", "yz", "xz", "xy")
PROBE = 23  # node of the bar at x = 0.12 m, on its upper edge
# Elements as Abaqus numbers their nodes (Abaqus Analysis User's Guide, solid isoparametric elements).
CUBE = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
BELOW, ABOVE, UPRIGHT = (
    [[0.5, 0, 0], [1, 0.5, 0], [0.5, 1, 0], [0, 0.5, 0]],
    [[0.5, 0, 1], [1, 0.5, 1], [0.5, 1, 1], [0, 0.5, 1]],
    [[0, 0, 0.5], [1, 0, 0.5], [1, 1, 0.5], [0, 1, 0.5]],
)
CORNERS = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
MIDDLES = [[0.5, 0, 0], [0.5, 0.5, 0], [0, 0.5, 0], [0, 0, 0.5], [0.5, 0, 0.5], [0, 0.5, 0.5]]
ELEMENTS = {
    "Tet4": CORNERS,
    "Tet10": CORNERS + MIDDLES,
    "Hex8": CUBE,
    "Hex20": CUBE + BELOW + ABOVE + UPRIGHT,
}


def fem_of(nodes, **elements):
    """What the makers read of a FEMinterface."""
    fem = FEMinterface()
    fem.nodes = {"Position": np.array(nodes, dtype=float)}
    fem.elements = [{"Name": "mesh", **elements}] if elements else []
    return fem


def linear_field(x, G):
    """Displacements u = G x (3 n,) and their strain (6,)."""
    E = G + G.T
    return (x @ G.T).ravel(), np.array([G[0, 0], G[1, 1], G[2, 2], E[1, 2], E[0, 2], E[0, 1]])


def quadratic_field(where):
    """Displacements (3 n,) that no linear element follows, and their strain (n, 6)."""
    x, y, z = where.T
    u = np.stack([x * x + 2 * y * z, x * y - z * z, 3 * x * z + y * y], axis=1)
    return u.ravel(), np.stack([2 * x, x, 3 * x, 2 * y - 2 * z, 2 * y + 3 * z, 2 * z + y], axis=1)


def rows_of_all_nodes(fem):
    """Strain rows (nodes, 6, N)."""
    return np.array([solid.strain_rows(fem, node) for node in range(fem.NumberOfNodes())])


@cache
def bar(name="bar"):
    return floating.load_fem(name)


def stress(node=PROBE, name="s", body="bar", component=None):
    return romerr.node_stress(name, node=node, fem=bar(body), material=MATERIAL, component=component)


# elements


@pytest.mark.parametrize("mirror", [1, -1])
@pytest.mark.parametrize("kind", ELEMENTS)
def test_strain_of_fields_that_an_element_can_follow_is_exact(kind, mirror):
    """At every node, of a skewed element, also where it is turned inside out as a whole, as ngsolve counts them."""
    G, skew = np.random.default_rng(1).standard_normal((2, 3, 3))
    nodes = np.array(ELEMENTS[kind]) @ (np.eye(3) + 0.2 * skew) * [1, 1, mirror] + [3, -1, 2]
    rows = rows_of_all_nodes(fem_of(nodes, **{kind: [list(range(len(nodes)))]}))
    u, strain = linear_field(nodes, G)
    np.testing.assert_allclose(rows @ u, np.tile(strain, (len(nodes), 1)), atol=tol.ORTHONORMAL * 100)
    if kind in ("Tet10", "Hex20"):
        u, strain = quadratic_field(nodes)
        np.testing.assert_allclose(rows @ u, strain, atol=tol.ORTHONORMAL * 1000)


def test_quadratic_mesh_of_ngsolve_gets_its_middle_nodes_back():
    """Exudyn keeps the four corners; strain of a quadratic field is exact at all 311 nodes."""
    fem = bar("bar_fine")
    assert np.shape(fem.elements[0]["Tet4"]) == (120, 4)
    u, strain = quadratic_field(fem.GetNodePositionsAsArray())
    np.testing.assert_allclose(rows_of_all_nodes(fem) @ u, strain, atol=1e-12)


def test_curved_mesh_of_ngsolve():
    """Middle nodes are those of ngsolve, also where arcs are so long that only Trigs6 tells."""
    occ, ngsolve = pytest.importorskip("netgen.occ"), pytest.importorskip("ngsolve")
    shape = occ.Cylinder(occ.Pnt(0, 0, 0), occ.X, r=0.02, h=0.3)
    shape = shape - occ.Cylinder(occ.Pnt(0.1, -0.02, 0), occ.Y, r=0.008, h=0.04)
    mesh = ngsolve.Mesh(occ.OCCGeometry(shape).GenerateMesh(maxh=0.03, curvaturesafety=0.7))
    fem = FEMinterface()
    fem.ImportMeshFromNGsolve(mesh, density=1.0, youngsModulus=1.0, poissonsRatio=0.3, meshOrder=2)
    (kind, found), *_ = solid.elements_of(fem, fem.GetNodePositionsAsArray())
    wanted = np.array([[p.nr - 1 for p in element.points] for element in mesh.ngmesh.Elements3D()])
    assert kind == "Tet10"
    assert np.array_equal(found, wanted[:, [0, 1, 2, 3, 4, 7, 5, 6, 8, 9]])


def test_no_guess_which_node_is_the_middle_of_a_long_arc():
    """Node 4 is 0.4 of its edge off the middle: known from the 6-node triangles of the surface, or refused."""
    nodes = np.array(CORNERS + MIDDLES)
    nodes[4] += [0, -0.2, -0.35]
    fem = fem_of(nodes, Tet4=[[0, 1, 2, 3]])
    with pytest.raises(romerr.InputError, match=r"6 nodes .* nor the middles of their 6 edges"):
        solid.strain_rows(fem, 2)
    fem.surface = [{"Name": "meshSurface", "Trigs6": [[1, 0, 3, 4, 7, 8]]}]
    told = solid.strain_rows(fem_of(nodes, Tet10=[list(range(10))]), 2)
    assert np.array_equal(solid.strain_rows(fem, 2), told)


# Exudyn's own values


@pytest.mark.parametrize("maker", ["StressLocal", "StrainLocal"])
def test_values_are_those_of_exudyns_modes(maker):
    """Order of components, engineering shears, the mean over the elements at a node; every node, random modes."""
    fem = floating.load_fem("bar")
    fem.modeBasis = {"matrix": np.random.default_rng(3).standard_normal((195, 2)), "type": "any"}
    fem.ComputePostProcessingModes(MATERIAL, getattr(exu.OutputVariableType, maker))
    modes = fem.postProcessingModes["matrix"].reshape(65, 2, 6)
    for node in range(65):
        if maker == "StressLocal":
            out = stress(node)
        else:
            out = romerr.node_strain("s", node=node, fem=fem)
        mine = (out.rows @ fem.modeBasis["matrix"]).T
        np.testing.assert_allclose(mine, modes[node], atol=tol.ENTRIES * np.abs(modes).max())


def test_values_in_a_run_are_those_of_a_sensor(monkeypatch):
    """StressLocal of the clamped bar, and one component alone; the sensor itself has no bound."""
    original = floating.reduce

    def reduce(fem, *modes):
        original(fem, *modes)
        fem.ComputePostProcessingModes(MATERIAL, exu.OutputVariableType.StressLocal)

    monkeypatch.setattr(floating, "reduce", reduce)
    scene = floating.clamped_bar(2, h=1e-3, t_end=0.01)
    sensor = itemInterface.SensorSuperElement(
        bodyNumber=scene.items["oFFRFreducedOrder"],
        meshNodeNumber=PROBE,
        outputVariableType=exu.OutputVariableType.StressLocal,
        storeInternal=True,
    )
    number = scene.mbs.AddSensor(sensor)
    flex = romerr.floating_body(scene.fem, scene.items)
    with pytest.raises(romerr.InputError, match="StressLocal"):
        romerr.attach(scene.mbs, flex, outputs=[number])
    monitor = romerr.attach(scene.mbs, flex, outputs=[stress(), stress(name="xz", component="xz")])
    scene.solve()
    measured, report = scene.mbs.GetSensorStoredData(number)[:, 1:], monitor.report()
    size = np.abs(measured).max()
    np.testing.assert_allclose(report.output("s").value, measured, atol=1e-10 * size)
    _, told = told_by_run(scene.mbs, [flex], scene.solve)
    assert any("romerr.node_stress" in why for _, why in told.plan.left_out)
    assert len(told.outputs) >= 2  # others are told
    np.testing.assert_allclose(report.output("xz").value[:, 0], measured[:, 4], atol=1e-10 * size)
    assert (report.output("s").unit, report.output("s").quantity) == ("", "stress")


# bounds


def assert_bounded(report, truth, effectivity, noise, name="s"):
    """Errors of components, of corrected ones, of von Mises below their bounds; that of the largest one sharply."""
    out, size = report.output(name), np.abs(truth).max()
    error = np.abs(truth - out.value)
    assert np.all(error <= out.bound["best"] + noise * size)
    assert np.all(np.abs(truth - out.corrected) <= out.corrected_bound + noise * size)
    largest = int(np.argmax(error.max(axis=0)))
    assert error[:, largest].max() > 1e3 * noise * size  # else nothing was shown
    assert out.bound["best"][:, largest].max() <= effectivity * error[:, largest].max()
    mises = romerr.von_mises(report, name)
    np.testing.assert_allclose(mises.value, deviator_norm(out.value), atol=tol.ENTRIES * size)
    assert np.all(np.abs(deviator_norm(truth) - mises.value) <= mises.bound + 2 * noise * size)
    assert np.all(np.abs(deviator_norm(truth) - mises.corrected) <= mises.corrected_bound + 2 * noise * size)
    return np.max(mises.bound) / np.max(np.abs(deviator_norm(truth) - mises.value))


def deviator_norm(s):
    """Von Mises stress (T,) by its definition: the root of 3/2 of the deviator's square."""
    xx, yy, zz, yz, xz, xy = np.moveaxis(s, -1, 0)
    tensor = np.stack([xx, xy, xz, xy, yy, yz, xz, yz, zz], axis=-1).reshape(*s.shape[:-1], 3, 3)
    deviator = tensor - np.trace(tensor, axis1=-2, axis2=-1)[..., None, None] / 3 * np.eye(3)
    return np.sqrt(1.5 * (deviator**2).sum(axis=(-2, -1)))


@pytest.mark.parametrize(("kind", "n"), [("RBE2", 0), ("RBE3", 0), ("RBE3", 4)])
def test_complete_bound_of_stress(kind, n):
    """The clamped bar, all modes in closed form; time steps included. Measured: 1.05 to 1.7, von Mises 2.3 to 2.6."""
    scene = floating.clamped_bar(n, kind, h=1e-4, t_end=0.012)
    flex = romerr.floating_body(scene.fem, scene.items)
    monitor = romerr.attach(scene.mbs, flex, outputs=[stress()], auxiliary_modes=120)
    scene.solve()
    report = monitor.report()
    assert set(report.scope.values()) == {"complete"}
    truth = bounds.clamped_motion(bounds.full_body("bar").P, report.t) @ stress().rows.T
    assert assert_bounded(report, truth, 2.5, tol.FULL_BODY) <= 4.0


# von Mises


def report_of(value, bound, corrected=None, left=None, scopes=("complete",)):
    """What von_mises reads of a report."""
    of = {"value": value, "bound": {"best": bound}, "corrected": corrected, "corrected_bound": left}
    out = SimpleNamespace(**of, uncertified=())
    return SimpleNamespace(output=lambda name: out, scope=dict(enumerate(scopes)))


def test_von_mises_of_every_error_in_the_box_is_below_the_bound():
    """Random stresses and errors; attained, from zero stress, at one of the 64 vertices."""
    rng = np.random.default_rng(5)
    s, sizes = rng.standard_normal((2, 2000, 6))
    box = np.abs(sizes) * 10.0 ** rng.uniform(-3, 3, (2000, 6))
    found = romerr.von_mises(report_of(s, box), "s")
    for _ in range(20):
        e = box * rng.uniform(-1, 1, box.shape)
        change = np.abs(deviator_norm(s + e) - found.value)
        assert np.all(change <= found.bound * (1 + tol.ENTRIES))
    vertices = np.array([deviator_norm(box * signs) for signs in product((-1, 1), repeat=6)])
    np.testing.assert_allclose(found.bound, vertices.max(axis=0), rtol=tol.ENTRIES)
    assert found.corrected is None


def test_correction_sharpens_von_mises_where_it_has_the_same_scope():
    """A known error of 5 in xx beside an unknown one of 0.1; an infinite bound stays infinite, never nan."""
    value, error = np.zeros((2, 6)), np.zeros((2, 6))
    error[:, 0] = 5.0
    left = np.full((2, 6), [0.1, 0, 0, 0, 0, 0])
    left[1, 3] = np.inf
    report = report_of(value, np.full((2, 6), 10.0), value + error, left)
    found = romerr.von_mises(report, "s")
    np.testing.assert_allclose(found.bound[0], 5.1)
    np.testing.assert_allclose(found.corrected_bound, [0.1, np.inf])
    np.testing.assert_allclose(
        found.bound[1], romerr.von_mises(report_of(value, np.full((2, 6), 10.0)), "s").bound[1]
    )
    report.scope["other"] = "inputs frozen"
    assert romerr.von_mises(report, "s").bound[0] > 20


# page and example


def test_page_on_stress_runs(capsys):
    """Its last block needs ngsolve: rows of a strain averaged over a ball, exact for linear fields."""
    blocks, names = BLOCK.findall((ROOT / "docs" / "stress.md").read_text(encoding="utf-8")), {}
    exec(blocks[0], names)
    assert "von Mises error at most" in capsys.readouterr().out
    assert names["mises"].bound.max() < 0.05 * names["mises"].value.max()
    pytest.importorskip("ngsolve")
    exec(blocks[1], names)
    u, strain = linear_field(names["fem"].GetNodePositionsAsArray(), np.arange(9.0).reshape(3, 3) - 2)
    assert names["mean_strain"].rows @ u == pytest.approx(strain[0], rel=1e-10)


def test_example_on_stress(tmp_path, capsys):
    """Bounds of xx and of von Mises above the error at every time; stress further off than displacement."""
    reports, mises = stress_bound.main(tmp_path, t_end=0.002, eigenmodes=(0, 4))
    assert (tmp_path / "stress_bound.png").read_bytes().startswith(b"\x89PNG")
    assert "most loaded: node" in capsys.readouterr().out
    found = romerr.von_mises(reports[4], "stress")
    noise = 1e-6 * mises.max()  # of the truth: loads linear within 1 us
    assert np.all(np.abs(mises - found.value) <= found.bound + noise)
    for report in reports.values():
        stress, tip = (report.output(name) for name in ("stress", "tip z"))
        assert np.all(np.abs(stress.error) <= stress.bound["best"] + noise)
        shares = [stress_bound.share(out, np.abs(out.error)) for out in (stress, tip)]
        assert shares[0] > 2 * shares[1] > 0


# wrong input


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"component": "zx"}, "component='zx' is unknown; allowed: 'xx', 'yy'"),
        ({"node": 65}, "node 65; allowed: node numbers 0..64"),
        ({"material": 210e9}, "no elasticityTensor; pass KirchhoffMaterial"),
        ({"material": SimpleNamespace(elasticityTensor=np.eye(3))}, r"elasticityTensor has shape \(3, 3\)"),
        ({"fem": fem_of(CORNERS)}, "fem has no elements"),
        ({"fem": fem_of(CORNERS, Tet4=[[0, 1, 2, 4]])}, "node 4; allowed"),
        ({"fem": fem_of(CORNERS, Tet10=[[0, 1, 2, 3]])}, r"'Tet10' of shape \(1, 4\); allowed: Tet4, Tet10"),
        ({"fem": fem_of(CUBE, Wedge6=[[0, 1, 2, 4, 5, 6]])}, "'Wedge6' of shape"),
        ({"fem": fem_of(CORNERS + MIDDLES[:5], Tet4=[[0, 1, 2, 3]])}, "5 nodes .* nor the middles of their 6 edges"),
        ({"fem": fem_of([*CUBE, [9, 9, 9]], Hex8=[list(range(8))])}, r"1 nodes, \[8\] ..., are in none"),
        ({"fem": fem_of(np.array(CORNERS) * [1, 1, 0], Tet4=[[0, 1, 2, 3]])}, "Tet4 element 0 .* is flat or turned"),
        ({"fem": fem_of(CUBE, Hex8=[[0, 1, 2, 3, 4, 5, 7, 6]])}, "Hex8 element 0 .* is flat or turned"),
    ],
)
def test_wrong_input_is_named(change, words):
    arguments = {"node": 0, "fem": bar(), "material": MATERIAL, **change}
    with pytest.raises(romerr.InputError, match=words):
        romerr.node_stress("s", **arguments)


def test_components_are_rows_of_all_six():
    """Of strain too, which has no unit."""
    whole = stress().rows
    for row, component in enumerate(COMPONENTS):
        assert np.array_equal(stress(component=component).rows, whole[row])
    strain = romerr.node_strain("e", node=PROBE, fem=bar(), component="xy")
    assert np.array_equal(strain.rows, solid.strain_rows(bar(), PROBE)[5])
    assert (strain.unit, strain.quantity) == ("", "strain")
