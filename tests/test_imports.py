"""The folders of the package: their order, their size, and who may import what; docs/architecture.md shows them."""

import subprocess
import sys

from docs.make_architecture import ORDER, PACKAGE, PATHS, imported, own_imports, room

FILES_AT_THE_TOP = 6
FILES_IN_A_FOLDER = 14
LINES_OF_A_FILE = 400
ONLY_INSIDE_FUNCTIONS = {"matplotlib", "tqdm"}
# what the core of issues 48 and 49 replaces: folders and files; mbs/memory, which linear bodies need, goes with them
GOERS = (
    "estimates mbs.control mbs.derivatives mbs.mechanism mbs.shadow mbs.coupled online.coupled_runs "
    "estimators.coupled_energy estimators.rigid_motion residual.felt_residuals residual.slow_modes"
).split()
DOOR = "mbs.monitoring.coupled_core"
# a linear body, from samples and in Exudyn, and a pendulum with inputs frozen; each has bounds in the end
WITHOUT_GOERS = """
import sys
import numpy as np
import exudyn as exu
import exudyn_romerr as romerr
from models import floating, linkage
from tests.helpers import mbs_scenes

body, B, out = linkage.build()
basis = romerr.krylov_basis(body, B, 4)
zeros = np.zeros((5, 4))
report = romerr.evaluate(body, basis, romerr.Trajectory(1e-3 * np.arange(5), zeros, zeros, zeros), inputs=B,
                         input_function=linkage.force, outputs=[out])
assert np.isfinite(report.output(out.name).bound["best"]).all()

mbs = mbs_scenes.new_mbs()
flex = romerr.add_reduced_body(mbs, body, basis, inputs=B, input_function=linkage.force)
monitor = romerr.attach(mbs, flex, outputs=[out])
several = mbs_scenes.new_mbs()
flexes = [romerr.add_reduced_body(several, body, basis, inputs=B, input_function=linkage.force) for _ in range(2)]
both = romerr.attach(several, flexes, outputs=[(flexes[0], out)])
for each in (mbs, several):
    each.Assemble()
    each.SolveDynamic(mbs_scenes.settings(20, 0.02))
assert np.max(monitor.report().output(out.name).bound["best"]) > 0
assert both.plan and np.max(both.report().output(out.name).bound["best"]) > 0

scene = floating.pendulum(2, t_end=0.01)
monitor = romerr.attach(scene.mbs, romerr.floating_body(scene.fem, scene.items), scope="inputs frozen")
scene.solve()
assert all(np.max(out.bound["best"]) > 0 for out in monitor.report().outputs.values())

print(*sorted(name.removeprefix("exudyn_romerr.") for name in sys.modules if name.startswith("exudyn_romerr.")))
"""


def test_every_folder_has_its_place():
    assert [name for name in PATHS if room(name) is None] == []
    assert {room(name) for name in PATHS} == set(ORDER)


def test_imports_point_upwards():
    wrong = {
        f"{name} imports {other}"
        for name in PATHS
        for other in own_imports(name)
        if ORDER.index(room(other)) > ORDER.index(room(name))
    }
    assert wrong == set()


def circle_through(graph):
    """One circle of a graph {name: names}, or (): names that lead nowhere are taken out until all lead on."""
    left = {name: set(others) for name, others in graph.items()}
    while ends := {name for name, others in left.items() if not others}:
        left = {name: others - ends for name, others in left.items() if name not in ends}
    walk = list(left)[:1]
    while walk and len(walk) == len(set(walk)):
        walk.append(sorted(left[walk[-1]])[0])
    return tuple(walk[walk.index(walk[-1]) :]) if walk else ()


def test_no_circle():
    assert circle_through({name: own_imports(name) for name in PATHS}) == ()
    assert circle_through({"a": {"b"}, "b": {"c"}, "c": {"b"}, "d": set()}) == ("b", "c", "b")


def test_folders_and_files_are_small():
    folders = {path.parent for path in PATHS.values()}
    many = {
        folder.name: count
        for folder in folders
        if (count := len(list(folder.glob("*.py")))) > (FILES_AT_THE_TOP if folder == PACKAGE else FILES_IN_A_FOLDER)
    }
    assert many == {}
    lines = {name: path.read_text(encoding="utf-8").count("\n") for name, path in PATHS.items()}
    assert {name: count for name, count in lines.items() if count > LINES_OF_A_FILE} == {}


def test_only_mbs_imports_exudyn():
    """Not even inside a function; matplotlib inside functions only."""
    for name in PATHS:
        roots = {(full.split(".")[0], inside) for full, inside in imported(name)}
        assert name.startswith("mbs.") or "exudyn" not in dict(roots), name
        assert not {root for root, inside in roots if not inside} & ONLY_INSIDE_FUNCTIONS, name


def test_the_reader_of_imports_sees_them():
    """Otherwise the tests above would pass on nothing."""
    assert {"errors", "linalg.symmetric_factor", "linalg.oscillator"} <= own_imports("model.body")
    assert "estimators.mass_norm" in own_imports("estimators.paper")
    assert "report.plots.panels" in own_imports("report.report")  # inside a function
    assert "model.body" in own_imports("decay.kernels")  # an annotation
    assert "exudyn" in {full.split(".")[0] for full, _ in imported("mbs.monitoring.step_hook")}


def goes(name):
    return any(name == goer or name.startswith(f"{goer}.") for goer in GOERS)


def test_one_door_leads_to_what_goes():
    """Annotations and imports inside functions included: what stays will stand when the rest is taken away."""
    assert {name for name in PATHS if not goes(name) and any(map(goes, own_imports(name)))} == {DOOR}
    assert [goer for goer in GOERS if not any(name == goer or name.startswith(f"{goer}.") for name in PATHS)] == []


def test_linear_bodies_and_frozen_inputs_do_without_what_goes():
    run = subprocess.run(
        [sys.executable, "-c", WITHOUT_GOERS], cwd=PACKAGE.parent, capture_output=True, text=True, check=True
    )
    loaded = run.stdout.split("\n")[-2].split()
    assert "mbs.monitoring.evaluation" in loaded
    assert [name for name in loaded if goes(name) or name == DOOR] == []


def test_importing_the_package_loads_neither_exudyn_nor_matplotlib():
    """`import exudyn_romerr` is light; mbs is loaded when first used."""
    code = (
        "import sys, exudyn_romerr; print(sorted({'exudyn', 'matplotlib', 'exudyn_romerr.mbs'} & set(sys.modules)))"
    )
    run = subprocess.run([sys.executable, "-c", code], cwd=PACKAGE.parent, capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"
