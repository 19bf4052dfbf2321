"""Sweeps in a folder: what was ready is there after an interrupt, and `romerr collect` shows it."""

import csv
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import exudyn_romerr as romerr
from exudyn_romerr.__main__ import main
from exudyn_romerr.mbs.studies.sweeps import read_result, table_of
from exudyn_romerr.report.scope import COUPLED
from exudyn_romerr.report.wording import rounded_up
from tests.helpers.theorem import random_case
from tests.sweeps.test_executor import GRID, PRODUCTS, InCaller, product

ROOT = Path(__file__).resolve().parents[2]
CALLS = []
VALUES = {
    1: 0.1 + 0.2,
    2: {"tip": (1, [2.5, None]), 3: np.array([[1.0, np.nan]]), "name": "a | b"},
    3: np.float32(1 / 3),
    4: [],
    5: np.arange(3) * 1j,
    6: (np.inf, True, "text"),
}


def counted(parameters):
    """Interrupted at the third call."""
    CALLS.append((parameters["a"], parameters["b"]))
    if len(CALLS) == 3:
        raise KeyboardInterrupt
    return product(parameters)


def failing(parameters):
    CALLS.append(parameters["a"])
    if parameters["a"] == 2 and len(CALLS) < 4:
        raise ValueError("the first | time\nonly")
    return {"sum": parameters["a"] + 0.5, "row": np.array([1.0, -3.0])}


def report(parameters):
    case = random_case(int(parameters["seed"]), steps=20)
    found = case.report(outputs=[romerr.Output("tip z", case.C[0], unit="m")], estimators=("fast",))
    return found, 3.0


def report_to_first_order(parameters):
    found, _ = report(parameters)
    found.scope = dict.fromkeys(found.scope, COUPLED)
    return found


def value(parameters):
    return VALUES[parameters["i"]]


def function_or_lambda(parameters):
    return product if parameters["a"] == 2 else 1.0


@pytest.fixture(autouse=True)
def fresh():
    CALLS.clear()


def test_an_interrupted_sweep_goes_on_where_it_was(tmp_path):
    """What was ready has its whole file; nothing is run twice but what was interrupted, also where the grid grew."""
    with pytest.raises(KeyboardInterrupt):
        romerr.sweep(counted, GRID, folder=tmp_path)
    assert len(list(tmp_path.iterdir())) == 2
    assert romerr.sweep(counted, GRID, folder=tmp_path).values == PRODUCTS
    assert CALLS == [(1, 0.5), (1, 4.0), (2, 0.5), (2, 0.5), (2, 4.0), (3, 0.5), (3, 4.0)]
    grown = romerr.sweep(counted, {"a": [1, 3], "b": [4.0, 6.0]}, folder=tmp_path, executor=InCaller)
    assert CALLS[7:] == [(1, 6.0), (3, 6.0)]
    assert grown.values == [4.0, 6.0, 12.0, 18.0]
    assert len(list(tmp_path.iterdir())) == 8
    assert {path.suffix for path in tmp_path.iterdir()} == {".npz"}


KILLED = """
import os, signal, sys
sys.path.insert(0, sys.argv[1])
import exudyn_romerr as romerr

def product(parameters):
    if parameters["a"] == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return parameters["a"] * parameters["b"]

romerr.sweep(product, {"a": [1, 2, 3], "b": [0.5, 4.0]}, folder="results")
"""


def test_a_killed_process_leaves_what_was_ready(tmp_path):
    """Killed as a whole, serially; this process takes the four results and adds two."""
    done = subprocess.run([sys.executable, "-c", KILLED, str(ROOT)], cwd=tmp_path, check=False, timeout=60)
    assert done.returncode < 0
    folder = tmp_path / "results"
    before = {path: path.stat().st_mtime_ns for path in folder.glob("*.npz")}
    assert len(before) == 4
    assert romerr.sweep(product, GRID, folder=folder).values == PRODUCTS
    assert before.items() <= {path: path.stat().st_mtime_ns for path in folder.iterdir()}.items()


def test_failures_are_tried_again(tmp_path):
    first = romerr.sweep(failing, {"a": [1, 2]}, folder=tmp_path)
    assert list(first.failures) == [1]
    assert len(table_of(tmp_path)[1]) == 2
    assert romerr.sweep(failing, {"a": [1, 2]}, folder=tmp_path).failures != {}
    assert romerr.sweep(failing, {"a": [1, 2]}, folder=tmp_path).complete()[1]["sum"] == 2.5
    assert CALLS == [1, 2, 2, 2]


def test_values_come_back_as_they_were(tmp_path):
    """Types too; floats to the last bit."""
    for _ in range(2):
        found = romerr.sweep(value, {"i": list(VALUES)}, folder=tmp_path).values
        assert repr(found) == repr(list(VALUES.values()))
        assert [type(x) for x in found] == [type(x) for x in VALUES.values()]


def test_reports_come_back_and_are_files_of_their_own(tmp_path):
    fresh, kept = (romerr.sweep(report, {"seed": [1, 2]}, folder=tmp_path).complete() for _ in range(2))
    assert [str(x) for x, _ in kept] == [str(x) for x, _ in fresh]
    for path in tmp_path.iterdir():
        assert str(romerr.load_report(path)) == str(read_result(path).value[0])


def test_what_makes_another_result_has_another_file(tmp_path):
    grid = {"a": [1], "b": [2.0]}
    for data in ({}, {"x": 1}, {"x": 2}):
        romerr.sweep(product, grid, folder=tmp_path, parameterFunctionData=data)
    romerr.sweep(counted, grid, folder=tmp_path)
    romerr.sweep(counted, grid, folder=tmp_path, addComputationIndex=True)  # a place in the grid, nothing else
    assert len(list(tmp_path.iterdir())) == 4
    with pytest.raises(romerr.InputError, match="parameterFunctionData: Object of type ndarray"):
        romerr.sweep(product, grid, folder=tmp_path, parameterFunctionData={"x": np.zeros(2)})


def test_what_has_no_place_in_a_file_is_refused(tmp_path):
    with pytest.raises(romerr.InputError, match="returned a function; with folder= it may return numbers, texts"):
        romerr.sweep(function_or_lambda, {"a": [1, 2, 3]}, folder=tmp_path)
    assert len(list(tmp_path.iterdir())) == 1
    (tmp_path / "file").touch()
    with pytest.raises(romerr.InputError, match="file' cannot be made"):
        romerr.sweep(product, GRID, folder=tmp_path / "file")


def test_a_damaged_result_is_named(tmp_path, capsys):
    romerr.sweep(product, {"a": [1], "b": [2.0]}, folder=tmp_path)
    (path,) = tmp_path.iterdir()
    path.write_bytes(path.read_bytes()[:-30])
    with pytest.raises(romerr.InputError, match=f"{path.name} cannot be read .*delete it"):
        romerr.sweep(product, {"a": [1], "b": [2.0]}, folder=tmp_path)
    assert main(["collect", str(tmp_path)]) == 1
    assert "delete it" in capsys.readouterr().err


def test_collect_prints_a_table(tmp_path, capsys):
    romerr.sweep(failing, {"a": [2, 1]}, folder=tmp_path)
    np.savez(tmp_path / "other.npz", x=1)  # no result of a sweep
    assert main(["collect", str(tmp_path)]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "| a | sum | row largest | failure                            |",
        "| - | --- | ----------- | ---------------------------------- |",
        "| 1 | 1.5 | 3           |                                    |",
        "| 2 |     |             | ValueError: the first \\| time only |",
    ]


def test_collect_writes_every_digit_of_numbers_and_reports(tmp_path, capsys):
    romerr.sweep(report, {"seed": [2, 1]}, folder=tmp_path / "results")
    to = tmp_path / "table.csv"
    assert main(["collect", str(tmp_path / "results"), "-o", str(to)]) == 0
    assert capsys.readouterr().out == f"written: {to}\n"
    with to.open(newline="", encoding="utf-8") as stream:
        head, *lines = csv.reader(stream)
    assert head[:2] == ["seed", "0 tip z largest [m]"]
    for line, seed in zip(lines, (1, 2), strict=True):
        out = report({"seed": seed})[0].output("tip z")
        row = dict(zip(head, map(float, line), strict=True))
        assert row["seed"] == seed
        assert row["0 tip z largest [m]"] == np.max(np.abs(out.value))
        assert row["0 tip z bound largest [m]"] == np.max(out.bound["best"])
        assert row["1"] == 3.0
    assert main(["collect", str(tmp_path / "results"), "-o", str(tmp_path / "table.md")]) == 0
    head, rule, *lines = (tmp_path / "table.md").read_text(encoding="utf-8").splitlines()
    assert (len(lines), set(rule)) == (2, set("|- "))
    assert [name.strip() for name in head.strip("|").split("|")] == ["seed", "1", "output", "largest", "bound"]


def test_reports_are_printed_a_row_a_line(tmp_path, capsys):
    """However many outputs they have; bounds with what they hold under, rounded up."""
    romerr.sweep(report, {"seed": [1]}, folder=tmp_path)
    made, *_ = report({"seed": 1})
    out = made.output("tip z")
    assert main(["collect", str(tmp_path)]) == 0
    (line,) = capsys.readouterr().out.splitlines()[2:]
    cells = [cell.strip() for cell in line.strip("|").split("|")]
    assert cells[2] == f"0 tip z [{out.unit}]"
    assert float(cells[3]) == float(f"{np.max(np.abs(out.value)):.4g}")
    assert cells[-1] == rounded_up(np.max(out.bound["best"]))


def test_bounds_of_mechanisms_are_called_what_they_are_of(tmp_path, capsys):
    """Not of the time steps, which the estimates beside them may have in them."""
    romerr.sweep(report_to_first_order, {"seed": [1]}, folder=tmp_path)
    assert main(["collect", str(tmp_path)]) == 0
    head, _, line = capsys.readouterr().out.splitlines()
    assert head.strip("| ").endswith("| reduction error bound")
    assert line.strip("| ").endswith(", to first order")


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["none"], "none is no folder; pass the one that sweep was given"),
        ([""], "is no folder"),
        (["."], ". has no result of a sweep"),
        (["results", "-o", "table.xlsx"], "table.xlsx does not end in .csv or .md"),
        (["results", "-o", "no/table.md"], "folder 'no' does not exist"),
    ],
)
def test_collect_refuses(arguments, says, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    romerr.sweep(product, {"a": [1], "b": [2.0]}, folder="results")
    assert main(["collect", *arguments]) == 1
    assert says in capsys.readouterr().err
    assert os.listdir() == ["results"]


def test_collect_needs_no_exudyn(tmp_path):
    """Nor matplotlib."""
    romerr.sweep(product, {"a": [1], "b": [2.0]}, folder=tmp_path / "results")
    code = (
        "import sys; sys.modules['exudyn'] = sys.modules['matplotlib'] = None\n"
        "from exudyn_romerr.__main__ import main; main(['collect', 'results'])"
    )
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    line = [sys.executable, "-c", code]
    done = subprocess.run(line, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True)
    assert done.stdout == "| a | b | value |\n| - | - | ----- |\n| 1 | 2 | 2     |\n"
