"""The wheel, built of the sdist and installed from scratch without network; the rules that let it run elsewhere.

Everything that is run from the wheel is run by the Python of a fresh environment, in an empty folder.
"""

import ast
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import venv
import zipfile
from importlib import import_module
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.metadata import Distribution
from pathlib import Path
from types import SimpleNamespace

import exudyn
import pytest

import exudyn_romerr
from tests.helpers.theorem import random_case

ROOT = Path(__file__).resolve().parents[2]
BUILT_FROM = ("exudyn_romerr", "pyproject.toml", "setup.py", "README.md", "LICENSE")
PIP = (sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet")
# Modules that some systems lack
POSIX = {"fcntl", "grp", "posix", "pty", "pwd", "resource", "termios", "tty"}
FOLDERS = ("exudyn_romerr", "models", "examples", "docs")  # benchmarks measure memory, which only Linux tells them
SOURCES = {path.relative_to(ROOT).as_posix(): path for folder in FOLDERS for path in (ROOT / folder).rglob("*.py")}
TREES = {name: ast.parse(path.read_text(encoding="utf-8")) for name, path in SOURCES.items()}


@pytest.fixture(scope="module")
def sdist(tmp_path_factory):
    """Made of a copy of the sources: nothing is left in the checkout."""
    source, folder = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("sdist")
    for name in BUILT_FROM:
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy2
        copy(ROOT / name, source / name, **({"ignore": IGNORED} if copy is shutil.copytree else {}))
    code = "import sys; from setuptools.build_meta import build_sdist; build_sdist(sys.argv[1])"
    subprocess.run([sys.executable, "-c", code, folder], cwd=source, check=True, capture_output=True)
    (path,) = folder.glob("*.tar.gz")
    return path


def built(sdist, folder, **environment):
    """A wheel built of the sdist; the compiled part is not optimised, which takes minutes."""
    command = [*PIP, "wheel", "--no-deps", "--no-build-isolation", "-w", folder, sdist]
    subprocess.run(command, check=True, env=os.environ | {"CFLAGS": "-O0"} | environment)
    (path,) = folder.glob("*.whl")
    return path


@pytest.fixture(scope="module")
def wheel(sdist, tmp_path_factory):
    """With the compiled part, if there is a compiler."""
    return built(sdist, tmp_path_factory.mktemp("wheel"))


IGNORED = shutil.ignore_patterns("__pycache__", *(f"*{suffix}" for suffix in EXTENSION_SUFFIXES))


@pytest.fixture(scope="module")
def python(wheel, tmp_path_factory):
    """Runs commands of a fresh environment that has the wheel; exudyn, numpy, ... are those of the tests."""
    home = tmp_path_factory.mktemp("environment")
    venv.create(home, with_pip=False)
    places = {"base": str(home), "platbase": str(home)}
    site, scripts = (Path(sysconfig.get_path(name, vars=places)) for name in ("purelib", "scripts"))
    name = Path(sys.executable).name
    subprocess.run([*PIP, "--python", scripts / name, "install", "--no-deps", "--no-index", wheel], check=True)
    assert (site / "exudyn_romerr" / "__init__.py").is_file()
    # afterwards, for the tests' own environment may have the package too; what is installed here comes first
    (site / "outer.pth").write_text(sysconfig.get_path("purelib"), encoding="utf-8")

    def run(*command, tool="python", folder):
        """Standard output of a command; stops the test where it fails."""
        program = scripts / (name if tool == "python" else tool)
        done = subprocess.run([program, *command], cwd=folder, env=ENVIRONMENT, capture_output=True, encoding="utf-8")
        assert done.returncode == 0, done.stderr
        return done.stdout

    return SimpleNamespace(run=run, home=home)


# no checkout on the path; UTF-8 where output is piped; and no folder of a user is looked into
ENVIRONMENT = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"} | {
    "PYTHONIOENCODING": "utf-8",
    "PYTHONNOUSERSITE": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "EXUDYN_SUPPRESS_UI_WINDOW_OPEN": "1",
    "MPLBACKEND": "Agg",
}


def contents(wheel):
    """Names of the files that a wheel installs."""
    return {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}


PACKAGE = ROOT / "exudyn_romerr"
FILES = {path.relative_to(ROOT).as_posix() for path in PACKAGE.rglob("*") if path.suffix in (".py", ".typed")}
COMPILED = f"exudyn_romerr/compiled/_loops{sysconfig.get_config_var('EXT_SUFFIX')}"


def test_wheel_has_the_package_and_nothing_else(wheel):
    assert contents(wheel) - {COMPILED} == FILES
    assert "exudyn_romerr/py.typed" in FILES


@pytest.mark.skipif(os.name == "nt", reason="CC names no compiler there")
def test_wheel_without_a_compiler_lacks_the_compiled_part_only(wheel, sdist, tmp_path):
    assert contents(built(sdist, tmp_path, CC=sys.executable + " -c raise")) == FILES
    if not shutil.which((sysconfig.get_config_var("CC") or "cc").split()[0]):
        pytest.skip("there is no compiler to build the wheel with, either")
    assert contents(wheel) == FILES | {COMPILED}


def test_wheel_asks_for_four_packages(python):
    (info,) = Path(python.home).rglob("exudyn_romerr-*.dist-info")
    needed = [text for text in Distribution.at(info).requires if "extra ==" not in text]
    assert sorted(re.match(r"[\w-]+", text)[0] for text in needed) == ["exudyn", "matplotlib", "numpy", "scipy"]


def test_import_brings_nothing(python, tmp_path):
    """Neither NumPy nor Exudyn, nor anything else that is not Python's own: a script may still configure them."""
    code = (
        "import sys; own = {*sys.stdlib_module_names, *sys.modules}; import exudyn_romerr; "
        "print(exudyn_romerr.__file__); print(*{name.split('.')[0] for name in sys.modules} - own)"
    )
    place, brought = python.run("-c", code, folder=tmp_path).splitlines()
    assert Path(place).is_relative_to(python.home)
    assert brought.split() == ["exudyn_romerr"]


def test_installed_package_shows_a_saved_report(python, tmp_path):
    report = random_case(1, steps=20).report(estimators=("fast",))
    report.save(tmp_path / "a run.npz")  # a name with a space, as on other systems
    code = "import exudyn_romerr as romerr; print(romerr.load_report('a run.npz'))"
    for printed in (
        python.run("-c", code, folder=tmp_path),
        python.run("-m", "exudyn_romerr", "show", "a run.npz", folder=tmp_path),
        python.run("show", "a run.npz", tool="romerr", folder=tmp_path),
    ):
        assert printed.strip() == str(exudyn_romerr.load_report(tmp_path / "a run.npz")).strip()


SPAWNED = """
import multiprocessing

import exudyn as exu
import numpy as np

import exudyn_romerr as romerr


def bound(parameters):
    K = 1e4 * (2 * np.eye(6) - np.eye(6, k=1) - np.eye(6, k=-1))
    body, B = romerr.ElasticBody(np.eye(6), K, rayleigh=(0.5, 1e-5)), np.eye(6)[:, [5]]
    SC = exu.SystemContainer()
    mbs = SC.AddSystem()
    basis = romerr.krylov_basis(body, B, int(parameters["n"]))
    flex = romerr.add_reduced_body(mbs, body, basis, inputs=B, input_function=np.sin)
    monitor = romerr.attach(mbs, flex, outputs=[romerr.Output("end", B.T)])
    mbs.Assemble()
    settings = exu.SimulationSettings()
    settings.timeIntegration.numberOfSteps = 20
    settings.solution.file.write = False
    mbs.SolveDynamic(settings)
    return multiprocessing.current_process().name, monitor.report().output("end").bound["best"].max()


if __name__ == "__main__":
    multiprocessing.set_start_method("spawn")
    options = {"useMultiProcessing": True, "numberOfThreads": 2}
    for process, largest in romerr.sweep(bound, {"n": [2, 4]}, **options).complete():
        print("RESULT", process, largest)
"""


def test_sweep_works_in_spawned_processes(python, tmp_path):
    """As on Windows and macOS: every process imports the script anew."""
    script = tmp_path / "spawned.py"
    script.write_text(SPAWNED, encoding="utf-8")
    lines = [line.split() for line in python.run(script, folder=tmp_path).splitlines() if line.startswith("RESULT")]
    assert all(process.startswith("Spawn") for _, process, _ in lines)
    coarse, fine = (float(largest) for *_, largest in lines)
    assert 0 < fine < coarse


@pytest.mark.parametrize(
    ("example", "option"), [("suspension_linkage", ()), ("fundamental_matrix_norms", ("--output",))]
)
def test_examples_run_from_any_folder(example, option, python, tmp_path):
    """They find models/ by their own place, and write to the folder they are given, relative to the current one."""
    python.run(ROOT / "examples" / f"{example}.py", *option, "pictures", folder=tmp_path)
    assert f"{example}.png" in [path.name for path in (tmp_path / "pictures").iterdir()]
    assert [path.name for path in tmp_path.iterdir()] == ["pictures"]


def test_types_are_shown_for_what_is_loaded_later():
    """Type checkers and editors see imports under TYPE_CHECKING, Python sees __getattr__: the same names."""
    branches = [node for node in TREES["exudyn_romerr/__init__.py"].body if isinstance(node, ast.If)]
    (branch,) = [node for node in branches if ast.unparse(node.test) == "TYPE_CHECKING"]
    shown = {alias.name: node.module for node in branch.body for alias in node.names}
    assert all(alias.asname == alias.name for node in branch.body for alias in node.names)  # else they are private
    use = (ROOT / "tests" / "docs_and_examples" / "typed_use.py").read_text(encoding="utf-8")
    assert {name for name in shown if name.islower()} <= set(re.findall(r"romerr\.(\w+)", use))  # mypy reads it
    assert shown == exudyn_romerr._MODULES
    for name in shown:
        assert getattr(exudyn_romerr, name) is getattr(import_module(f"exudyn_romerr.{shown[name]}"), name)


def calls(tree):
    return [node for node in ast.walk(tree) if isinstance(node, ast.Call)]


def is_text_without_encoding(call):
    """Whether a call opens, reads or writes text with the encoding of the system."""
    name = ast.unparse(call.func).split(".")[-1]
    if any(keyword.arg == "encoding" for keyword in call.keywords):
        return False
    if name in ("read_text", "write_text"):
        return True
    modes = [text for text in map(ast.unparse, call.args[1:2])]
    return ast.unparse(call.func) == "open" and not any("b" in mode for mode in modes)


def offenders(find):
    """Return {file: what find(tree) finds in it} of all sources where it finds something."""
    return {name: found for name, tree in TREES.items() if (found := find(tree))}


def test_text_files_are_utf_8():
    assert offenders(lambda tree: [ast.unparse(c) for c in calls(tree) if is_text_without_encoding(c)]) == {}


def test_text_without_encoding_is_found():
    """Otherwise the test above would pass on anything."""
    found = [is_text_without_encoding(call) for call in calls(ast.parse("open(p); p.write_text('µ'); open(p, 'rb')"))]
    assert found == [True, True, False]


def not_everywhere(tree):
    """Imports of modules that some systems lack, and forks."""
    imported = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    imported |= {str(node.module) for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    return imported & POSIX | {ast.unparse(call.func) for call in calls(tree)} & {"os.fork", "os.nice"}


def test_nothing_needs_one_system():
    assert offenders(not_everywhere) == {}
    assert not_everywhere(ast.parse("import fcntl, os; os.fork()")) == {"fcntl", "os.fork"}


def done_when_imported(tree):
    """Calls at the top of a script, but for the two that put the checkout on the path and limit threads."""
    top = [node.value for node in tree.body if isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)]
    return {ast.unparse(call.func) for call in top} - {"sys.path.insert", "os.environ.setdefault"}


def test_scripts_do_nothing_when_imported():
    """A spawned process imports the script that started it: main() is called under the guard only."""
    scripts = {name: tree for name, tree in TREES.items() if name.startswith(("examples", "docs"))}
    assert len(scripts) > 10
    assert offenders(done_when_imported).keys() == {"examples/reductionErrorCMS.py"}  # as those of Exudyn are
    for name, tree in scripts.items():
        has_main = any(isinstance(node, ast.FunctionDef) and node.name == "main" for node in tree.body)
        guards = [ast.unparse(node.test) for node in tree.body if isinstance(node, ast.If)]
        assert ("__name__ == '__main__'" in guards) == has_main, name


def test_file_names_are_good_on_every_system():
    """No colons and the like; none that differ in capitals only."""
    folders = (*FOLDERS, "benchmarks", "tests")
    names = [path.relative_to(ROOT).as_posix() for folder in folders for path in (ROOT / folder).rglob("*.*")]
    assert len(names) > 100
    assert all(re.fullmatch(r"[\w./-]+", name, re.ASCII) for name in names)
    assert len({name.lower() for name in names}) == len(names)


def test_old_exudyn_is_refused_with_a_cure(monkeypatch):
    """A checkout on the path, no pip: markers of 1.11 do not tell their axes."""
    monkeypatch.setattr(exudyn, "__version__", "1.11.0")
    with pytest.raises(
        exudyn_romerr.InputError, match=r"Exudyn 1\.11\.0 is installed; .* pip install --upgrade exudyn"
    ):
        exudyn_romerr.floating_body(None, {})
