"""The folders of the package: their order, their size, and who may import what; docs/architecture.md shows them."""

import subprocess
import sys

from docs.make_architecture import ORDER, PACKAGE, PATHS, imported, own_imports, room

FILES_AT_THE_TOP = 6
FILES_IN_A_FOLDER = 14
LINES_OF_A_FILE = 400
ONLY_INSIDE_FUNCTIONS = {"matplotlib", "tqdm"}


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
    assert "linear.estimators.bounds" in own_imports("linear.estimators.paper")
    assert "report.plots.panels" in own_imports("report.report")  # inside a function
    assert "model.body" in own_imports("linear.residual.kernels")  # an annotation
    assert "exudyn" in {full.split(".")[0] for full, _ in imported("mbs.monitoring.step_hook")}


def test_importing_the_package_loads_neither_exudyn_nor_matplotlib():
    """`import exudyn_romerr` is light; mbs is loaded when first used."""
    code = (
        "import sys, exudyn_romerr; print(sorted({'exudyn', 'matplotlib', 'exudyn_romerr.mbs'} & set(sys.modules)))"
    )
    run = subprocess.run([sys.executable, "-c", code], cwd=PACKAGE.parent, capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"
