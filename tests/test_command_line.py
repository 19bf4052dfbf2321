"""The command line: what it prints and writes, its exit status, and no traceback for a user's mistake."""

import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from exudyn_romerr import Output, __version__, load_report
from exudyn_romerr.__main__ import main
from tests.helpers.theorem import random_case

ROOT = Path(__file__).resolve().parents[1]
COMMANDS = ("show", "plot", "report", "csv")
WRITTEN = {
    "plot": ("png", b"\x89PNG"),
    "report": ("html", b"<!DOCTYPE html>"),
    "csv": ("csv", b"\xef\xbb\xbft [s],tip z [m],"),
}


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """A small report as a file."""
    case, path = random_case(1, steps=20), tmp_path_factory.mktemp("saved") / "run.npz"
    outputs = [Output("tip z", case.C[0], unit="m"), Output("Größe", case.C, unit="m", labels=("x", "y"))]
    case.report(outputs=outputs, estimators=("fast", "energy")).save(path)
    return path


@pytest.fixture
def run(saved, tmp_path, monkeypatch):
    """A copy of the file, in a folder of its own, which is the current one."""
    monkeypatch.chdir(tmp_path)
    Path("run.npz").write_bytes(saved.read_bytes())
    return Path("run.npz")


def refused(capsys, *arguments):
    """What is said when the exit status is 1; nothing is printed as a result."""
    assert main(arguments) == 1
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("romerr: ")
    assert "Traceback" not in err
    return err


def test_show_prints_the_summary(run, capsys):
    assert main(["show", "run.npz"]) == 0
    assert capsys.readouterr().out == f"{load_report(run)}\n"


@pytest.mark.parametrize("asked", [["1%"], ["2.5 %"], ["1e-3"], ["tip z=1e-3"]])
def test_show_answers_for_tolerances(run, capsys, asked):
    """The first line, too; as of romerr run."""
    assert main(["show", "run.npz", *(x for text in asked for x in ("--tolerance", text))]) == 0
    said = capsys.readouterr().out
    assert said == f"{load_report(run).summary(asked)}\n"
    assert "assumed" not in said
    assert ("No tolerance: Größe." in said) == (asked == ["tip z=1e-3"])


def test_a_name_that_no_output_has_is_wrong_usage(run, capsys):
    assert main(["show", "run.npz", "--tolerance", "tipz=1"]) == 2
    assert "did you mean 'tip z'?" in capsys.readouterr().err


@pytest.mark.parametrize(("command", "given"), [("plot", False), ("report", False), ("csv", False), ("csv", True)])
def test_commands_write_beside_the_run_or_where_told(run, capsys, command, given):
    ending, begins = WRITTEN[command]
    name = f"other.{ending}" if given else f"run.{ending}"
    assert main([command, "run.npz", *(["-o", name] if given else [])]) == 0
    assert capsys.readouterr().out == f"written: {name}\n"
    assert Path(name).read_bytes().startswith(begins)
    assert {path.name for path in Path().iterdir()} == {"run.npz", name}


@pytest.mark.parametrize(("names", "titles"), [(["tip z"], 1), (["Größe"], 2), (["Größe", "tip z"], 2), ([], 2)])
def test_plot_draws_the_outputs_asked_for(run, names, titles):
    """As many signals as outputs, or rows of one; SVG keeps what each picture shows as a comment."""
    assert main(["plot", "run.npz", "-o", "run.svg", *(["--output", *names] if names else [])]) == 0
    shown = " ".join(
        re.findall("<!-- (.*?) -->", Path("run.svg").read_text(encoding="utf-8"))
    )  # titles may be folded
    assert shown.count(": reduced model") == titles


@pytest.mark.parametrize("command", [(), *((name,) for name in COMMANDS)])
def test_help_has_an_example_that_works(run, capsys, command):
    with pytest.raises(SystemExit) as left:
        main([*command, "--help"])
    assert left.value.code == 0
    (example,) = re.findall(r"^example: romerr (.*)$", capsys.readouterr().out, re.MULTILINE)
    assert example.startswith(" ".join(command))
    assert main(shlex.split(example)) == 0


def test_the_version_is_the_same_everywhere(capsys):
    for name in ("pyproject.toml", "CITATION.cff"):
        text = (ROOT / name).read_text(encoding="utf-8")
        assert re.search(rf"^version\W+{re.escape(__version__)}\W*$", text, re.M), name
    assert f"## {__version__} " in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    with pytest.raises(SystemExit) as left:
        main(["--version"])
    assert left.value.code == 0
    assert capsys.readouterr().out == f"romerr {__version__}\n"


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["shw", "run.npz"],
        ["show"],
        ["show", "run.npz", "more"],
        ["plot", "run.npz", "--out", "tip z"],
        *(["show", "run.npz", "--tolerance", x] for x in ("0", "nan", "inf", "1 m", "%", "much")),
    ],
)
def test_wrong_usage_is_status_2(run, capsys, arguments):
    """Also shortened options: they would change their meaning when others come."""
    with pytest.raises(SystemExit) as left:
        main(arguments)
    assert left.value.code == 2
    said = capsys.readouterr().err
    assert said.startswith("usage: romerr")
    assert ("needed is a positive number in the model's unit" in said) == ("--tolerance" in arguments)


@pytest.mark.parametrize("command", COMMANDS)
def test_a_missing_file_is_named(run, capsys, command):
    assert "runn.npz is no file" in refused(capsys, command, "runn.npz")
    assert os.listdir() == ["run.npz"]


@pytest.mark.parametrize("command", COMMANDS)
def test_a_file_that_is_no_report_is_refused(run, capsys, command):
    Path("text.npz").write_text("not a report")
    assert "text.npz is no report" in refused(capsys, command, "text.npz")
    assert ". is a folder" in (said := refused(capsys, command, "."))
    assert "of a sweep, romerr collect FOLDER makes a table" in said


@pytest.mark.parametrize("seed", range(40))
def test_damaged_files_leave_no_traceback(run, capsys, seed):
    """Any bytes changed: refused, or, where they do not matter, the same summary; zlib and zipfile raise much."""
    rng, data = np.random.default_rng(seed), bytearray(run.read_bytes())
    wanted = str(load_report(run))
    for at in rng.integers(len(data), size=1 + seed % 3):
        data[at] ^= 1 << int(rng.integers(8))
    run.write_bytes(data)
    status = main(["show", "run.npz"])
    out, err = capsys.readouterr()
    assert (status, out, err.startswith("romerr: run.npz is no report")) in (
        (0, f"{wanted}\n", False),
        (1, "", True),
    )


def test_unknown_outputs_are_refused_with_the_known_ones(run, capsys):
    said = refused(capsys, "plot", "run.npz", "--output", "tip z", "tip")
    assert "output='tip' is unknown; allowed: 'tip z', 'Größe'" in said
    assert os.listdir() == ["run.npz"]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["plot", "run.npz", "-o", "run.docx"], "use .png, .svg or .pdf"),
        (["csv", "run.npz", "-o", "no/such/run.csv"], "cannot be written: folder 'no/such' does not exist"),
        (["csv", "run.npz", "-o", "keep.py"], "keep.py does not end in .csv or .txt; pass such a name after -o"),
        (["report", "run.npz", "-o", "x.pdf"], "x.pdf does not end in .html or .htm; pass such a name after -o"),
    ],
)
def test_places_that_cannot_be_written_are_refused(run, capsys, arguments, says):
    assert says in refused(capsys, *arguments)
    assert os.listdir() == ["run.npz"]


@pytest.mark.parametrize("command", WRITTEN)
@pytest.mark.parametrize("name", ["run.npz", "./run.npz", "link.npz"])
def test_the_run_itself_is_never_written_over(run, capsys, command, name):
    before = run.read_bytes()
    os.symlink("run.npz", "link.npz")
    assert "would be lost" in refused(capsys, command, "run.npz", "-o", name)
    assert run.read_bytes() == before
    ending = WRITTEN[command][0]
    run.rename(f"run.{ending}")  # a name that ends like the result
    assert "would be lost" in refused(capsys, command, f"run.{ending}")


WITHOUT_EXUDYN = """
import runpy, sys
sys.modules["exudyn"] = None  # import exudyn raises ImportError
sys.path.insert(0, sys.argv.pop(1))
try:
    runpy.run_module("exudyn_romerr", run_name="__main__", alter_sys=True)
finally:
    print("matplotlib" in sys.modules, file=sys.stderr)
"""


@pytest.mark.parametrize("command", COMMANDS)
def test_needs_no_exudyn_and_loads_matplotlib_for_pictures_only(run, command):
    """As a process, where importing exudyn raises; in a terminal that cannot show every letter."""
    environment = {**os.environ, "PYTHONIOENCODING": "ascii"}
    line = [sys.executable, "-c", WITHOUT_EXUDYN, str(ROOT), command, "run.npz"]
    done = subprocess.run(line, capture_output=True, text=True, check=False, env=environment)
    assert (done.returncode, done.stderr) == (0, f"{command in ('plot', 'report')}\n")
    assert ("Gr??e" if command == "show" else "written: run.") in done.stdout


def test_a_reader_that_stops_early_is_no_error(run):
    """As in `romerr show run.npz | head -1`."""
    line = [sys.executable, "-m", "exudyn_romerr", "show", "run.npz"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    with subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment) as process:
        process.stdout.close()
        assert process.stderr.read() == b""
    assert process.returncode == 0


def test_romerr_is_this_program():
    """The entry point that the wheel installs."""
    scripts = (ROOT / "pyproject.toml").read_text(encoding="utf-8").partition("[project.scripts]\n")[2]
    module, _, function = json.loads(re.match(r"romerr = (.*)\n", scripts)[1]).partition(":")
    assert getattr(sys.modules[module], function) is main
