"""Columns and CSV of a report; names of rows; files that are replaced when all is written, and not before."""

import csv
import errno
import os
import re
from dataclasses import replace

import numpy as np
import pytest

from exudyn_romerr import (
    Basis,
    ElasticBody,
    InputError,
    Output,
    evaluate,
    mean_displacement,
    mean_rotation,
    node_displacement,
    node_rotation,
    node_strain,
    node_velocity,
    relative_displacement,
)
from exudyn_romerr.report.formats import csv_table
from exudyn_romerr.report.scope import COMPLETE, COUPLED, FROZEN
from models import floating
from tests.helpers.bad_input import T, trajectory
from tests.helpers.theorem import random_case

ESTIMATORS = ("fast", "energy")


@pytest.fixture
def case():
    return random_case(1, steps=20)


@pytest.fixture
def report(case):
    """One row "tip z", and two rows "corner x", "corner y" that are velocities."""
    corner = Output("corner", case.C, unit="m/s", of="velocity", labels=("x", "y"))
    return case.report(outputs=[Output("tip z", case.C[0], unit="m"), corner], estimators=ESTIMATORS)


def of_row(name, unit, *more):
    parts = ["", "bound", "bound fast", "bound energy", *more, "round-off"]
    return [" ".join(filter(None, [name, part, f"[{unit}]"])) for part in parts]


WHOLE_BODY = [f"{kind} bound {e}" for kind in ("position", "velocity") for e in ESTIMATORS]


def read_csv(path):
    with open(path, encoding="utf-8-sig", newline="") as file:
        names, *rows = csv.reader(file)
    return names, np.array(rows, dtype=float)


def test_columns_are_all_there_is_over_time(report):
    """Names with units, in order; arrays (T,) equal to the report's own."""
    columns = report.to_dict()
    rows = [*of_row("tip z", "m"), *of_row("corner x", "m/s"), *of_row("corner y", "m/s")]
    assert list(columns) == ["t [s]", *rows, *WHOLE_BODY]
    assert {x.shape for x in columns.values()} == {report.t.shape}
    corner = report.output("corner")
    assert np.array_equal(columns["t [s]"], report.t)
    assert np.array_equal(columns["corner y [m/s]"], corner.value[:, 1])
    assert np.array_equal(columns["corner y bound [m/s]"], corner.bound["best"][:, 1])
    assert np.array_equal(columns["corner x bound energy [m/s]"], corner.bound["energy"][:, 0])
    assert np.array_equal(columns["corner y round-off [m/s]"], corner.round_off[:, 1])
    assert np.array_equal(columns["velocity bound energy"], report.velocity_bound["energy"])
    assert next(iter(replace(report, time="static").to_dict())) == "load factor"


def test_columns_have_truth_and_corrected_output_where_there_are_any(report, case):
    truth = case.full[0] @ case.C[0]
    report.compare("tip z", report.t, truth)
    out = report.output("tip z")
    out.corrected, out.corrected_bound = 2 * out.value, 3 * out.value
    columns = report.to_dict()
    assert np.array_equal(columns["tip z true error [m]"], truth - out.value[:, 0])
    assert np.array_equal(columns["tip z corrected [m]"], 2 * out.value[:, 0])
    assert np.array_equal(columns["tip z corrected bound [m]"], 3 * out.value[:, 0])
    assert not any("corner" in name and ("corrected" in name or "true" in name) for name in columns)


def with_estimate(out):
    """An estimate of two parts and two checks, told apart by their sizes."""
    out.estimate_parts = {"basis": 2 * out.value, "time step": -5 * out.value}
    out.uncertainty_parts = {"steps": np.abs(out.value), "vectors": 7 * np.abs(out.value)}
    out.estimate, out.uncertainty = -3 * out.value, 8 * np.abs(out.value)


@pytest.mark.parametrize(("scope", "said"), [(COMPLETE, ""), (COUPLED, ""), (FROZEN, ", inputs frozen")])
def test_columns_have_estimates_where_there_are_any(report, scope, said):
    """In every scope; what holds under frozen inputs only says so, "about" says the rest."""
    with_estimate(report.output("tip z"))
    report.scope = dict.fromkeys(report.scope, scope)
    columns, value = report.to_dict(), report.output("tip z").value[:, 0]
    assert np.array_equal(columns[f"tip z estimate{said} [m]"], -3 * value)
    assert np.array_equal(columns[f"tip z uncertainty{said} [m]"], 8 * np.abs(value))
    assert np.array_equal(columns[f"tip z estimate time step{said} [m]"], -5 * value)
    assert np.array_equal(columns[f"tip z uncertainty vectors{said} [m]"], 7 * np.abs(value))
    assert sum("estimate" in name or "uncertainty" in name for name in columns) == 6  # of tip z alone
    report.output("tip z").estimate_scope = COUPLED
    assert "tip z estimate [m]" in report.to_dict()


@pytest.mark.parametrize(
    ("scope", "of", "said"),
    [(COMPLETE, "", ""), (COUPLED, "reduction error ", ", to first order"), (FROZEN, "", ", inputs frozen")],
)
def test_columns_of_bounds_say_what_they_are_of_and_hold_under(report, scope, of, said):
    """A table has no scope beside it; estimates beside bounds without time steps have these, and may be larger.

    Other names are those of 0.1.
    """
    other = replace(report, scope=dict.fromkeys(report.scope, scope))
    bounds = [name for name in other.to_dict() if "bound" in name]
    assert bounds
    assert all(said in name for name in bounds)
    assert not any("frozen" in name or "first order" in name for name in report.to_dict())
    assert f"tip z {of}bound{said} [m]" in other.to_dict()
    assert all(f"tip z {of}bound {e}{said} [m]" in other.to_dict() for e in report.scope)
    assert f"tip z {of}bound{said} largest [m]" in csv_table.largest(other)


def test_no_column_hides_another(report):
    """An output called like another's bound."""
    report.outputs["tip z bound"] = replace(report.output("tip z"), name="tip z bound")
    columns = report.to_dict()
    assert np.array_equal(columns["tip z bound [m]"], report.output("tip z").bound["best"][:, 0])
    assert np.array_equal(columns["tip z bound [m] (2)"], report.output("tip z").value[:, 0])
    assert len(columns) == 1 + 4 * 5 + len(WHOLE_BODY)


def test_csv_is_the_columns_to_the_last_bit_as_the_standard_has_it(report, tmp_path):
    """RFC 4180: lines end in CR LF; no byte order mark where it is not needed."""
    report.to_csv(tmp_path / "run.csv")
    names, table = read_csv(tmp_path / "run.csv")
    columns = report.to_dict()
    assert names == list(columns)
    assert np.array_equal(table, np.column_stack(list(columns.values())))
    data = (tmp_path / "run.csv").read_bytes()
    assert data.startswith(b"t [s],tip z [m],")
    assert data.count(b"\r\n") == data.count(b"\n") == len(report.t) + 1


@pytest.mark.parametrize(
    ("name", "mark"), [('tip, "right"\nedge', False), ("=1+1; x", False), ("Größe", True), ("変位", True)]
)
def test_csv_keeps_any_name(report, tmp_path, name, mark):
    """Commas, quotes, line breaks; with other letters than English ones, a mark that Excel needs to read UTF-8."""
    report.output("tip z").name = name
    report.to_csv(tmp_path / "run.csv")
    names, table = read_csv(tmp_path / "run.csv")
    assert names == list(report.to_dict())
    assert names[1] == f"{name} [m]"
    assert table.shape == (len(report.t), len(names))
    assert (tmp_path / "run.csv").read_bytes().startswith(b"\xef\xbb\xbf") == mark


def test_csv_says_inf_where_there_is_no_finite_bound(report, tmp_path):
    bound = report.output("tip z").bound
    bound["fast"] = np.where(np.arange(len(report.t))[:, None] < 3, bound["fast"], np.inf)
    report.to_csv(tmp_path / "run.csv")
    names, table = read_csv(tmp_path / "run.csv")
    found = table[:, names.index("tip z bound fast [m]")]
    assert np.all(np.isinf(found[3:]))
    assert np.all(np.isfinite(found[:3]))


@pytest.mark.parametrize("name", ["run.csv", "run.html", "run.npz", "run.png"])
def test_a_failed_write_leaves_the_older_file(report, tmp_path, monkeypatch, name):
    """The disk is found full when all was handed over to it."""
    path = tmp_path / name
    path.write_bytes(b"older")

    def full(_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    write = {".csv": report.to_csv, ".html": report.to_html, ".npz": report.save, ".png": report.plot}[path.suffix]
    with pytest.raises(InputError, match="No space left on device"):
        write(path)
    assert path.read_bytes() == b"older"
    assert os.listdir(tmp_path) == [name]
    assert report.origin == ""


def test_rows_are_called_by_their_labels_everywhere_or_are_numbered(report, case):
    assert report.output("corner").row_names == ["corner x", "corner y"]
    text = report.details
    assert re.search(r"^corner x  +\S+ m/s", text, re.MULTILINE)
    assert re.search(r"^tip z  +\S+ m", text, re.MULTILINE)
    out = case.report(outputs=[Output("y", case.C, unit="m")], estimators="fast").output("y")
    assert out.row_names == ["y row 1", "y row 2"]


@pytest.mark.parametrize("labels", [("x",), ("x", "y", "z")])
def test_a_label_for_each_row(case, labels):
    with pytest.raises(InputError, match=r"labels=.* of output 'y'; it has 2 rows, each needs one"):
        case.report(outputs=[Output("y", case.C, unit="m", labels=labels)], estimators="fast")


CUBE = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]


@pytest.mark.parametrize(
    ("per_node", "output", "names"),
    [
        (3, node_displacement("u", node=0), ["u x", "u y", "u z"]),
        (3, node_displacement("u", node=0, component="z"), ["u"]),
        (3, node_velocity("u", node=0, component="zx"), ["u z", "u x"]),
        (3, mean_displacement("u", nodes=[0, 1], component="yz"), ["u y", "u z"]),
        (3, mean_rotation("u", nodes=[0, 1, 2, 3], component="xy"), ["u x", "u y"]),
        (3, relative_displacement("u", node=0, other=1), ["u x", "u y", "u z"]),
        (6, node_rotation("u", node=0, component="zy"), ["u z", "u y"]),
    ],
)
def test_components_are_labels(per_node, output, names):
    """Outputs of nodes: the rows of the report are called by what the maker was asked for, in its order."""
    N = 4 * per_node
    body = ElasticBody(np.eye(N), np.diag(1.0 + np.arange(N)), rayleigh=(0.1, 0.0), positions=np.array(CUBE, float))
    options = {"inputs": np.ones((N, 1)), "estimators": "fast", "time": "sampled"}
    found = evaluate(body, Basis(np.eye(N)[:, :3]), trajectory(), outputs=[output], **options).output("u")
    assert found.row_names == names
    assert found.value.shape == (len(T), len(names))


def test_stresses_and_strains_are_labelled_as_exudyn_has_them():
    fem = floating.load_fem("bar")
    assert node_strain("e", node=0, fem=fem).labels == ("xx", "yy", "zz", "yz", "xz", "xy")
    assert node_strain("e", node=0, fem=fem, component="yz").labels == ("yz",)


def test_global_axes_are_labels_of_what_is_shown():
    """Three rows in body axes, one or two of them seen."""
    body = ElasticBody(np.eye(12), np.eye(12), positions=np.array(CUBE, float))
    for component in ("z", "xz", "xyz"):
        output = node_displacement("u", node=1, component=component, frame="global")
        assert output.labels == tuple(component)
        assert output.resolve(body).shape == (3, 12)
