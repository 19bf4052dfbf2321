"""Bodies from Abaqus files, from ngsolve, from bare matrices: the examples run, their numbers are right."""

import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import exudyn_romerr as romerr
from examples import fe_abaqus, fe_matrices, fe_ngsolve
from models import floating, make_abaqus_files
from models.beam3d import STEEL
from models.solid_exact import full_outputs
from tests.helpers import tolerances as tol
from tests.helpers.pages import BLOCK, assert_printed, shown_below
from tests.helpers.total_truth import Exact, signal
from tests.mbs.floating import test_floating_bounds as bounds

ROOT = Path(__file__).resolve().parents[2]


@cache
def abaqus():
    """The fem read from the files, and the report of the example."""
    return fe_abaqus.read_fem(), fe_abaqus.main(t_end=0.01)


def assert_bounded(out, truth, effectivity, rest=0.0):
    """Error below its bound at every time, and the bound not much above; rest: of the truth."""
    error = np.abs(truth - out.value)
    assert np.all(error <= out.bound["best"] + tol.FULL_BODY * np.abs(truth).max() + rest)
    assert 0 < out.bound["best"].max() <= effectivity * error.max()


def test_abaqus_files_are_those_that_the_script_writes(tmp_path, capsys):
    make_abaqus_files.main(tmp_path)
    assert capsys.readouterr().out.count("kB") == 3
    for end in (".inp", "_MASS1.mtx", "_STIF1.mtx"):
        name = make_abaqus_files.NAME + end
        assert (tmp_path / name).read_text() == (floating.DATA / name).read_text()
        assert (tmp_path / name).stat().st_size < 200e3


def test_abaqus_example_bounds_displacement_and_stress():
    """Against all modes in closed form; 200 sin^2 is 100 less a cosine of twice the frequency."""
    fem, report = abaqus()
    assert set(report.scope.values()) == {"complete"}
    mass = STEEL.density * 0.4 * 0.04 * 0.06
    assert report.total_mass == pytest.approx(mass, rel=1e-12)
    P = bounds.full_body("bar").P
    M, K = (bounds.symmetric(P.T @ (A @ P)) for A in (fem.massMatrix, fem.stiffnessMatrix))
    nodes, weights = floating.interface(floating.load_fem("bar"), "right")
    pull = np.zeros((65, 3))
    pull[nodes, 2] = weights
    load = signal(1, start=[[100.0]], size=[-100.0], W=[800.0], phase=[np.pi / 2])
    exact = Exact(M, 2 * M + 1e-5 * K, K, (2.0, 1e-5))
    q = exact.motion(P.T @ pull.reshape(-1, 1), load, *np.zeros((2, len(M))), report.t)[0] @ P.T
    tip = int(floating.interface(floating.load_fem("bar"), "tip")[0][0])
    assert_bounded(report.output("tip z"), q[:, [3 * tip + 2]], 1.1)
    root = fem.GetNodeAtPoint([0.12, 0, 0.06])
    material = fe_abaqus.KirchhoffMaterial(STEEL.youngs_modulus, STEEL.poisson_ratio)
    xx = romerr.node_stress("xx", node=root, fem=fem, material=material, component="xx")
    assert_bounded(report.output("stress xx"), q @ xx.rows[:, None], 1.5)


def test_matrices_example():
    """Exact truth under 200 sin(400 t); no positions, so no mass is claimed."""
    report = fe_matrices.main(t_end=0.01)
    assert report.total_mass is None
    held = floating.interface(floating.load_fem("bar"), "left")[0]
    fixed = (3 * held[:, None] + np.arange(3)).ravel()
    body = romerr.ElasticBody.from_fem(floating.load_fem("bar"), rayleigh=floating.RAYLEIGH, fixed=fixed)
    tip = 3 * int(floating.interface(floating.load_fem("bar"), "tip")[0][0]) + 2
    B = np.eye(body.N)[:, [tip]]
    truth = 200 * full_outputs(body, B, B.T, 400.0)(report.t)
    assert_bounded(report.output("tip z"), truth, 1.1)


def test_ngsolve_example():
    """Mass of the volume; displacement and stress against 300 modes and, of the forced motion, all."""
    pytest.importorskip("netgen.occ")
    report, fem = fe_ngsolve.main(mesh_size=0.06, t_end=0.002), fe_ngsolve.mesh_rod(0.06)
    rod = np.pi * fe_ngsolve.RADIUS**2 * fe_ngsolve.LENGTH
    hole = np.pi * fe_ngsolve.HOLE**2 * 2 * fe_ngsolve.RADIUS
    mass = fe_ngsolve.STEEL["density"] * (rod - hole)
    assert report.total_mass == pytest.approx(mass, rel=0.05)  # few, curved, elements
    x = fem.GetNodePositionsAsArray()
    held = (3 * np.flatnonzero(np.abs(x[:, 0]) < 1e-9)[:, None] + np.arange(3)).ravel()
    body = romerr.ElasticBody.from_fem(fem, rayleigh=(2.0, 1e-6), fixed=held)
    right = fem.GetNodesInPlane([fe_ngsolve.LENGTH, 0, 0], [1, 0, 0])
    pull = np.zeros(x.shape)
    pull[right, 2] = fem.GetNodeWeightsFromSurfaceAreas(right)
    where = [fe_ngsolve.LENGTH / 3, -fe_ngsolve.RADIUS, fe_ngsolve.HOLE]
    at = int(np.argmin(np.linalg.norm(x - where, axis=1)))
    steel = fe_ngsolve.KirchhoffMaterial(STEEL.youngs_modulus, STEEL.poisson_ratio)
    outputs = {
        "right face z": romerr.mean_displacement("m", nodes=right, component="z"),
        "stress at the hole": romerr.node_stress("xx", node=at, fem=fem, material=steel, component="xx"),
    }
    rows = np.vstack([out.resolve(body) for out in outputs.values()])
    motion = full_outputs(body, pull.reshape(-1, 1), rows, 1000.0, modes=300)
    truth, rest = 500 * motion(report.t), 500 * motion.remainder
    for i, (name, effectivity) in enumerate((("right face z", 1.2), ("stress at the hole", 20.0))):
        assert rest[i] < 1e-3 * np.abs(truth[:, i]).max()
        assert_bounded(report.output(name), truth[:, [i]], effectivity, rest[i])


def test_ngsolve_example_says_how_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "ngsolve", None)
    monkeypatch.setitem(sys.modules, "netgen.occ", None)
    with pytest.raises(SystemExit, match="pip install ngsolve"):
        fe_ngsolve.main()


def test_page_on_fe_input_runs_and_prints_what_it_shows(capsys, tmp_path, monkeypatch):
    """Its blocks are one script, run from the checkout's root."""
    page, names = (ROOT / "docs" / "fe_input.md").read_text(encoding="utf-8"), {}
    blocks = BLOCK.findall(page)
    monkeypatch.chdir(ROOT)
    exec(blocks[0], names)
    assert_printed(shown_below(page, blocks[0]), capsys.readouterr().out)
    monkeypatch.chdir(tmp_path)
    exec(blocks[1], names)
    assert abs(names["again"].stiffness - names["body"].stiffness).max() == 0
    assert names["again"].modes(1).omega == pytest.approx(names["body"].modes(1).omega, rel=1e-9)
    assert names["basis"].V.shape == (195, 6)
