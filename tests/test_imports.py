"""The folders of the package: their order, their size, and who may import what. docs/architecture.md shows them."""

import ast
import subprocess
import sys
from functools import cache
from pathlib import Path

import exudyn_romerr

# A folder imports from itself and from what stands above it, annotations and imports inside functions included.
ORDER = (
    "_version errors checks progress linalg model basis residual trajectory estimators report offline online "
    "mode_selection mbs.access mbs.floating mbs.monitoring mbs.studies mbs __init__ __main__"
).split()
FILES_AT_THE_TOP = 6
FILES_IN_A_FOLDER = 12
LINES_OF_A_FILE = 250
ONLY_INSIDE_FUNCTIONS = {"matplotlib", "tqdm"}
NAME = exudyn_romerr.__name__
PACKAGE = Path(exudyn_romerr.__file__).parent
PATHS = {
    path.relative_to(PACKAGE).with_suffix("").as_posix().replace("/", "."): path for path in PACKAGE.rglob("*.py")
}


class Imports(ast.NodeVisitor):
    """(absolute name, is inside a function) of everything that a file imports."""

    def __init__(self, path):
        self.package, self.found, self.depth = path.relative_to(PACKAGE.parent).parent.parts, [], 0
        self.visit(ast.parse(path.read_text(encoding="utf-8")))

    def visit_FunctionDef(self, node):
        self.depth += 1
        self.generic_visit(node)
        self.depth -= 1

    def visit_Import(self, node):
        self.found += [(alias.name, self.depth > 0) for alias in node.names]

    def visit_ImportFrom(self, node):
        parent = self.package[: len(self.package) - node.level + 1] if node.level else ()
        base = ".".join([*parent, *([node.module] if node.module else [])])
        # `from ..linalg import oscillator` imports a module, `from .body import ElasticBody` does not
        self.found += [(f"{base}.{alias.name}", self.depth > 0) for alias in node.names]


@cache
def imported(name):
    return Imports(PATHS[name]).found


def own_imports(name):
    """Modules of the package that a module imports."""
    found = [full.removeprefix(f"{NAME}.") for full, _ in imported(name) if full.startswith(f"{NAME}.")]
    candidates = [(x, x.rpartition(".")[0], f"{x.rpartition('.')[0]}.__init__".lstrip(".")) for x in found]
    return {next(module for module in names if module in PATHS) for names in candidates}


def room(name):
    """The entry of ORDER that a module belongs to; mbs/__init__.py is above all rooms of mbs."""
    module = name.removesuffix(".__init__")
    return max((x for x in ORDER if module == x or module.startswith(f"{x}.")), key=len, default=None)


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
    assert "report.plots.over_time" in own_imports("report.report")  # inside a function
    assert "model.body" in own_imports("residual.kernels")  # an annotation
    assert "exudyn" in {full.split(".")[0] for full, _ in imported("mbs.monitoring.step_hook")}


def test_importing_the_package_loads_neither_exudyn_nor_matplotlib():
    """`import exudyn_romerr` is light; mbs is loaded when first used."""
    code = (
        "import sys, exudyn_romerr; print(sorted({'exudyn', 'matplotlib', 'exudyn_romerr.mbs'} & set(sys.modules)))"
    )
    run = subprocess.run([sys.executable, "-c", code], cwd=PACKAGE.parent, capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"
