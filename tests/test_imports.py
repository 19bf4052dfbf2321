"""A module imports only from modules above it in this list; Exudyn only below the line (design.md, Layout)."""

ORDER = """
errors writing progress factor matrices oscillator modes space frame views definite body outputs solid stress
basis kernels lagtable products residual recurrence inputs propagate forgetting split problem round_off
packing matrix_exponential estimators.base estimators.paper estimators.energy estimators.auxiliary
estimators.output_kernel estimators.static estimators.turning estimators.mechanism estimators nodes enrichment
feedback scope plan samples bezier reconstruct rows stream made verdict saving formats style plot band
pictures surface page_parts page report load choice messages assemble offline starts defect online static_run
mechanism evaluate forecast mbs.scene mbs.scope mbs.gather mbs.tangent mbs.late mbs.watch mbs.reaction mbs.mechanism
mbs.live mbs.hook mbs.bodies mbs.linear mbs.frames mbs.floating mbs.reference mbs.actions mbs.sensors
mbs.support mbs.terms mbs.sampling mbs.enriched mbs.moving mbs.asked mbs.monitor mbs.solution mbs.trial
mbs.two_level mbs.choose mbs.fem_modes mbs study __main__
""".split()
MAY_IMPORT_EXUDYN = ("mbs", "study", "__main__")
ONLY_INSIDE_FUNCTIONS = ("matplotlib", "tqdm")

import ast  # noqa: E402
import subprocess  # noqa: E402
import sys  # noqa: E402
from pathlib import Path  # noqa: E402

import pytest  # noqa: E402

import exudyn_romerr  # noqa: E402

PACKAGE = Path(exudyn_romerr.__file__).parent


def module_name(path):
    """`body`, `estimators.base`, `estimators`; empty for the package itself."""
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


FILES = {module_name(path): path for path in sorted(PACKAGE.rglob("*.py"))}


class Imports(ast.NodeVisitor):
    """(absolute name, is inside a function) of everything a file imports when it runs."""

    def __init__(self, path):
        package = path.relative_to(PACKAGE.parent).parent.parts
        self.package, self.found, self.depth = package, [], 0
        self.visit(ast.parse(path.read_text(encoding="utf-8")))

    def visit_If(self, node):
        if "TYPE_CHECKING" not in ast.unparse(node.test):
            self.generic_visit(node)

    def visit_FunctionDef(self, node):
        self.depth += 1
        self.generic_visit(node)
        self.depth -= 1

    def visit_Import(self, node):
        self.found += [(alias.name, self.depth > 0) for alias in node.names]

    def visit_ImportFrom(self, node):
        parent = list(self.package[: len(self.package) - node.level + 1]) if node.level else []
        base = ".".join(parent + ([node.module] if node.module else []))
        # `from . import oscillator` imports a module, `from .body import ElasticBody` does not
        inner = [f"{base}.{alias.name}" for alias in node.names]
        modules = [name for name in inner if name.removeprefix("exudyn_romerr.") in FILES and base]
        self.found += [(name, self.depth > 0) for name in (modules or [base])]


def own_imports(name):
    """Modules of the package that a module imports."""
    prefix = "exudyn_romerr."
    return {m.removeprefix(prefix) for m, _ in Imports(FILES[name]).found if m.startswith(prefix)}


def test_every_module_is_listed():
    """A new module takes its place in ORDER, once."""
    assert set(FILES) - {""} - set(ORDER) == set()
    assert len(ORDER) == len(set(ORDER))


@pytest.mark.parametrize("name", [name for name in FILES if name])
def test_imports_point_upwards(name):
    """Only modules above; a subpackage's own modules come before it."""
    above = set(ORDER[: ORDER.index(name)]) if name in ORDER else set(FILES)  # not listed: the test above says so
    assert own_imports(name) - above == set()


def test_the_reader_of_imports_sees_them():
    """Otherwise the test above would pass on nothing."""
    assert {"errors", "factor", "modes", "oscillator", "matrices"} <= own_imports("body")
    assert "estimators.base" in own_imports("estimators.paper")
    assert "plot" in own_imports("report")  # inside a function, still an import
    assert "body" not in own_imports("kernels")  # TYPE_CHECKING only
    assert any(name.split(".")[0] == "exudyn" for name, _ in Imports(FILES["mbs.hook"]).found)


@pytest.mark.parametrize("name", FILES)
def test_exudyn_is_imported_by_mbs_only(name):
    """Nothing above mbs/ imports exudyn, not even inside a function; matplotlib inside functions only."""
    for module, inside in Imports(FILES[name]).found:
        root = module.split(".")[0]
        assert root != "exudyn" or name.split(".")[0] in MAY_IMPORT_EXUDYN
        assert root not in ONLY_INSIDE_FUNCTIONS or inside


def test_importing_the_package_loads_neither_exudyn_nor_matplotlib():
    """`import exudyn_romerr` is light; mbs is loaded when first used."""
    code = (
        "import sys, exudyn_romerr; print(sorted({'exudyn', 'matplotlib', 'exudyn_romerr.mbs'} & set(sys.modules)))"
    )
    run = subprocess.run([sys.executable, "-c", code], cwd=PACKAGE.parent, capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"
