"""BoundReport: saved and loaded, compared, printed, plotted; all of it where Exudyn cannot be imported."""

import pickle
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from exudyn_romerr import InputError, load_report
from exudyn_romerr.report.data import NodeFields, made_here
from exudyn_romerr.report.scope import COUPLED, FROZEN, Reason
from exudyn_romerr.report.wording import AS_IN_THIS_RUN, NOT_THE_MECHANISM, rounded_up
from tests.helpers import tolerances as tol
from tests.helpers.theorem import random_case
from tests.report.saved_files import rewritten, same

ROOT = Path(__file__).resolve().parents[2]
PAPER = ("fast", "convolution")


@pytest.fixture
def case():
    """A chain with two displacement rows and two velocity rows."""
    return random_case(1, steps=40)


@pytest.fixture
def report(case):
    """Its report by the paper's estimators."""
    return case.report(estimators=PAPER)


def compared(report, case):
    report.compare("y", report.t, case.full[0] @ case.C.T)
    return report


def test_save_and_load_keep_everything(report, case, tmp_path):
    """Every array to the last bit, every word, in plain arrays and one JSON text; the summary reads the same."""
    report.save(tmp_path / "run.npz")
    assert same(report, load_report(tmp_path / "run.npz"))
    known(report, {"basis": 1e-4, "time step": 0.1}).uncertified = (Reason.GOES_ON.doubt(), Reason.UNBALANCED.doubt())
    report.remainder, report.planned_end, report.ended_by, report.on_purpose = {"fast": 0.1}, 9.0, "an error", True
    out = compared(report, case).output("y")
    out.tolerance, out.labels, out.estimate_scope, out.uncertified = 1e3, ("x", "y"), COUPLED, report.uncertified
    assert out.beside_steps
    report.save(tmp_path / "run.npz")
    again = load_report(tmp_path / "run.npz")
    assert same(report, again)
    assert report.origin == again.origin == str(tmp_path / "run.npz")
    assert (report.made["exudyn_romerr"], report.made["numpy"]) == (made_here()["exudyn_romerr"], np.__version__)
    assert str(again) == str(report)
    assert again.details == report.details
    with np.load(tmp_path / "run.npz", allow_pickle=False) as file:
        assert all(file[key].dtype.kind in "fU" for key in file.files)
    again.outputs["y"].value[3] += 1e-15
    assert not same(report, again)


@pytest.mark.parametrize(
    ("without", "words", "lacks"),
    [
        (("tolerances", "stopped"), (), {"tolerance": None, "stopped": None}),
        (("labels", "made"), (), {"labels": (), "row_names": ["y row 1", "y row 2"]}),
        (("estimate_scopes",), ("estimate", "uncertainty"), {"estimate": None, "estimate_scope": ""}),
    ],
)
def test_files_of_older_versions_still_load(report, tmp_path, without, words, lacks):
    """Those of 0.1 have less; the rest is as it was."""
    out = known(report, {"basis": 1e-4}).output("y")
    out.tolerance, out.labels = 1e3, ("x", "y")
    report.save(tmp_path / "run.npz")
    rewritten(tmp_path / "run.npz", without=without, words=words)
    older = load_report(tmp_path / "run.npz")
    assert {name: getattr(older.output("y"), name) for name in lacks} == lacks
    assert same(older.output("y").bound, out.bound)
    assert (" about " in str(older)) == (not words)
    assert (older.made == {}) == ("made" in without)


def known(report, parts, half=0.01):
    """The same with estimates of both outputs: shares of their values."""
    for out in report.outputs.values():
        out.estimate_parts = {name: share * out.value for name, share in parts.items()}
        out.estimate = sum(out.estimate_parts.values())
        out.uncertainty = half * np.abs(out.estimate)
        out.uncertainty_parts = {"vectors": out.uncertainty}
    return report


def test_first_come_answers_by_cause_then_a_table(report):
    """A line for each output, its worst component; the scope of bounds is in the head."""
    report.scope = dict.fromkeys(report.scope, COUPLED)
    known(report, {"basis": 1e-5, "time step": 0.1}).output("v").tolerance = 1e6
    for out in report.outputs.values():
        out.beside_steps, out.uncertainty_parts = (), {"steps": out.uncertainty}
    extent, first, step, modes, _, head, y, v, _, *rest = str(report).splitlines()
    assert extent == f"{len(report.t)} instants, t / s = 0 .. {report.t[-1]:g}"
    assert first == "Too large, by step: y (1 % assumed; report.assess)."
    assert modes.startswith("Modes: enough, ")
    action = r"take (?:[\d,]+ )?steps,? \d+ times as short"
    assert re.fullmatch(rf"Step: too large, about \S+ \+- \S+ m \(10 %\) at y row \d; {action}.", step)
    titles = ["output", "up to", "modes about", "step about", "whole error about", "at most (modes, to first order)"]
    assert re.split(r"  +", head) == titles
    assert [re.split(r"  +", line)[0].split()[0] for line in (y, v)] == ["y", "v"]
    bound = max(np.max(out.bound["best"] + out.round_off) for out in [report.output("y")])
    assert y.endswith(f" {rounded_up(bound, 2)}")
    assert any(line.startswith("  fast: ") or "scope: coupled" in line for line in rest)
    assert rest[-1].endswith("print(report.details)")


def test_details_have_every_component(report):
    lines = known(report, {"basis": 1e-4, "time step": 0.1}).details.splitlines()
    rows = [name for out in report.outputs.values() for name in out.row_names]
    assert [re.split(r"  +", line)[0] for line in lines if line.startswith(tuple(rows))] == rows
    for name in report.outputs:
        (said,) = [line for line in lines if line.startswith(f"{name}: its reduction error is at most ")]
        assert all(repr(e) in said for e in PAPER)


def test_frozen_inputs_are_said_first_and_cover_nothing(report):
    report.scope = dict.fromkeys(report.scope, FROZEN)
    known(report, {"basis": 1e-9, "time step": 1e-9})
    first, _, said, *_ = str(report).splitlines()
    assert first.startswith("! only the error under the forces, controller actions and frame motion of this run. ")
    assert first.endswith("type: romerr verify your_script.py")
    assert said == "Not covered by any estimate: y, v (1 % assumed; report.assess)."
    assert " at most " not in str(report)
    bounds = [line for line in report.details.splitlines() if " at most " in line]
    assert len(bounds) == len(report.outputs)
    assert all(AS_IN_THIS_RUN in line for line in bounds)
    assert [NOT_THE_MECHANISM in line for line in bounds] == [True, False]  # long lines are not read


def test_without_estimates_bounds_answer_for_the_whole_error(report):
    """What is at most is told in any case; where that is not the whole error nothing is answered."""
    report.time = "reconstructed"
    said = str(report).splitlines()
    assert said[1] == "Not known: y, v (1 % assumed; report.assess)."
    assert re.split(r"  +", said[3])[1:] == ["up to", "at most"]
    for out in report.outputs.values():
        out.tolerance = 1e6
    assert str(report).splitlines()[1] == "Enough: the error of every output is within its tolerance."
    report.time = "sampled"
    assert str(report).splitlines()[1] == "Not covered by any estimate: y, v."


def test_what_is_at_round_off_is_said(report):
    known(report, {"basis": 1e-12, "time step": 1e-12})
    for out in report.outputs.values():
        out.round_off = np.full_like(out.value, np.max(np.abs(out.value)))
    assert str(report).count("or less, at round-off") >= 4


def test_outputs_that_nobody_asked_for_are_in_the_table_alone(report):
    """Those of the frame's eyes stand beside what was asked for; sentences leave them out."""
    known(report, {"basis": 1e-4, "time step": 1e-4})
    beside = replace(report.outputs["v"], name="y in the frame", estimate_parts={"basis": report.output("v").value})
    report.outputs = {"y": report.outputs["y"], beside.name: beside}
    first, *rest = str(report).splitlines()[1:]
    assert (
        first == "Enough: the error of every output asked for is within its tolerance (1 % assumed; report.assess)."
    )
    assert sum("y in the frame" in line for line in rest) == 1


def test_report_comes_through_pickle(report):
    """As a sweep on several processes sends it; bounds at nodes only where they were asked for."""
    assert repr(report) == f"<BoundReport: 2 outputs, {len(report.t)} instants, t = 0 .. {report.t[-1]:g} s>"
    report.nodes = lambda: NodeFields({"fast": report.t})
    again = pickle.loads(pickle.dumps(report))
    assert str(again) == str(report)
    assert again.nodes is None
    with pytest.raises(InputError, match="ask for it before"):
        _ = again.node_bound
    assert np.array_equal(report.node_bound["fast"], report.t)  # the original has it still
    assert np.array_equal(pickle.loads(pickle.dumps(report)).node_bound["fast"], report.t)


def test_a_first_instant_is_no_run(case):
    first = case.report(stride=1000, estimators="fast")
    assert first.messages[0] == "only the first instant was bounded"
    assert "Enough" not in str(first)


@pytest.mark.parametrize("share", [0.0, 0.3, 0.9, 0.999])
def test_truncated_file_is_refused(report, tmp_path, share):
    """Cut anywhere: InputError that names the file."""
    path = tmp_path / "run.npz"
    report.save(path)
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    with pytest.raises(InputError, match=r"run\.npz is no report of exudyn_romerr, or it is truncated"):
        load_report(path)


def test_foreign_files_are_refused(tmp_path):
    """No such file, text, another .npz; a folder, which is not called truncated."""
    (tmp_path / "text.npz").write_text("not a report")
    np.savez(tmp_path / "other.npz", x=np.ones(3))
    kinds = {"missing.npz": "no file", "text.npz": "no report", "other.npz": "no report"}
    for name, what in (kinds | {"": "is a folder; pass one of the files"}).items():
        with pytest.raises(InputError, match=what) as caught:
            load_report(tmp_path / name)
        assert not any(word in str(caught.value) for word in ("pickle", "meta"))  # numpy's words say nothing here


@pytest.mark.parametrize("version", [0, 2**40, None, "old"])
def test_another_version_is_refused(report, tmp_path, version):
    """The message names both versions and what to do."""
    report.save(tmp_path / "run.npz")
    rewritten(tmp_path / "run.npz", {"format": version})
    with pytest.raises(InputError, match=rf"format {version!r}; this version reads format \d+: save it again"):
        load_report(tmp_path / "run.npz")


def test_compare_adds_error_and_effectivity(report, case):
    """Error = truth - value; effectivity = max_t bound / max_t |error| for each row."""
    out = compared(report, case).output("y")
    truth = case.full[0] @ case.C.T
    assert np.array_equal(out.error, truth - out.value)
    for e, bound in out.bound.items():
        wanted = bound.max(axis=0) / np.abs(out.error).max(axis=0)
        assert out.effectivity[e] == pytest.approx(wanted, rel=tol.SUMS)
        assert np.all(out.effectivity[e] >= 1)
    effectivity = report.compare("y", report.t, out.value).effectivity["fast"]  # of a truth equal to the value
    assert np.all(np.isinf(effectivity))


def test_compare_adds_how_far_the_estimate_was_off(report, case):
    """Largest |error - estimate| / max |error| of each row; 0 where both are zero, none without an estimate."""
    assert compared(report, case).output("y").estimate_off is None
    out = report.output("y")
    error = case.full[0] @ case.C.T - out.value
    out.estimate = error + 0.02 * np.max(np.abs(error), axis=0) * np.sin(report.t)[:, None]
    out.estimate_parts, out.uncertainty, out.uncertainty_parts = (
        {"basis": out.estimate},
        0 * error,
        {"proved": 0 * error},
    )
    out.estimate[:, 1] = 0.0
    wanted = [0.02 * np.max(np.abs(np.sin(report.t))), 1.0]
    assert compared(report, case).output("y").estimate_off == pytest.approx(wanted, rel=tol.SUMS)
    assert "; the estimate is off by up to " in str(report)
    assert np.all(report.compare("y", report.t, out.value + out.estimate).estimate_off == 0)


def test_compare_takes_a_truth_at_more_instants(report, case):
    """The truth may be finer than the report, and one row may come as a vector."""
    t = np.sort(np.concatenate([report.t, report.t[:-1] + np.diff(report.t) / 3]))
    truth = np.column_stack([np.interp(t, report.t, y) for y in (case.full[0] @ case.C.T).T])
    fine = report.compare("y", t, truth).error
    assert fine == pytest.approx(compared(report, case).output("y").error, rel=tol.SUMS, abs=tol.SUMS)


@pytest.mark.parametrize(
    ("t", "y", "message"),
    [
        (lambda t: t[::2], lambda y: y[::2], "t lacks the report's instant"),
        (lambda t: t, lambda y: y[:, :1], "y has shape"),
        (lambda t: t, lambda y: y * np.nan, "y has a nan"),
    ],
)
def test_compare_refuses_what_does_not_fit(report, t, y, message):
    """Missing instants, wrong shapes, nan."""
    with pytest.raises(InputError, match=message):
        report.compare("y", t(report.t), y(report.output("y").value))


def test_best_is_the_smallest_bound(report):
    """bound["best"] is the minimum over the estimators at every instant and row."""
    for name in ("y", "v"):
        bound = report.output(name).bound
        assert np.array_equal(bound["best"], np.minimum(bound["fast"], bound["convolution"]))


def test_unknown_names_are_refused_with_the_known_ones(report):
    """Outputs and estimators."""
    with pytest.raises(InputError, match="'z' is unknown; allowed: 'y', 'v'"):
        report.output("z")
    with pytest.raises(InputError, match="'exact' is unknown; allowed: 'fast', 'convolution'"):
        report.reason("exact")


def test_summary_says_what_is_not_covered(report, case):
    """Outputs with their bounds, scope, and that sampled residuals do not see the time integration."""
    text = str(compared(report, case))
    assert "time integration is not covered" in text
    assert "scope complete" in text
    assert "bound / error: " in text
    text = report.details
    assert f"its reduction error is at most {rounded_up(report.output('y').bound['fast'].max())} m by 'fast'" in text
    assert "bound / error: " in text


WITHOUT_EXUDYN = """
import sys
sys.modules["exudyn"] = None  # import exudyn raises ImportError
import numpy as np
import exudyn_romerr as romerr
report = romerr.load_report(sys.argv[1])
print(report)
report.plot(sys.argv[2])
body = romerr.ElasticBody(np.eye(3), np.diag([1.0, 4.0, 9.0]), rayleigh=(0.1, 0.0))
t, B = np.linspace(0, 1, 20), np.ones((3, 1))
zero = np.zeros((20, 2))
trajectory = romerr.Trajectory(t, zero, zero, zero, t)
for basis in (romerr.modal_basis(body, 2), romerr.krylov_basis(body, B, 2)):
    found = romerr.evaluate(body, basis, trajectory, inputs=B, estimators="fast", time="sampled")
    assert found.position_bound["fast"][-1] > 0
try:
    romerr.attach
except ImportError:
    print("attach needs exudyn")
"""


def test_everything_but_mbs_works_without_exudyn(report, tmp_path):
    """load_report, summary, plot, evaluate, ElasticBody in a process where importing exudyn raises."""
    report.save(tmp_path / "run.npz")
    command = [sys.executable, "-c", WITHOUT_EXUDYN, str(tmp_path / "run.npz"), str(tmp_path / "run.png")]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    assert run.stdout.strip() == f"{report}\nattach needs exudyn"
    assert (tmp_path / "run.png").stat().st_size > 0


def test_an_output_is_told_in_a_line(report):
    """Not its arrays: of a run of 400 steps they were 9000 lines."""
    out = report.output("y")
    said = str(out)
    assert said == repr(out)
    assert len(said.splitlines()) == 1
    assert said.startswith(f"<OutputReport 'y row 1', 'y row 2': {out.of} in m, {len(report.t)} instants; value, ")
