"""The machinery that runs Exudyn's own examples, on a script of our own: Exudyn's checkout is not needed here."""

import numpy as np
import pytest

from benchmarks import exudyn_examples, exudyn_runs, page
from benchmarks.exudyn_patches import EXAMPLES, IMPORT, Example, PatchError, Truth, edited, inserted, ours

SCRIPT = """
import exudyn as exu
from exudyn.utilities import *
from exudyn.FEM import ObjectFFRFreducedOrderInterface
from models import floating

mbs = exu.SystemContainer().AddSystem()
fem = floating.load_fem("bar")
nModes = 2
floating.reduce(fem, nModes)
objFFRF = ObjectFFRFreducedOrderInterface(fem).AddObjectFFRFreducedOrder(mbs, massProportionalDamping=2.0)
faces = [floating.interface(fem, side) for side in ("left", "right")]
mLeft, mRight = (mbs.AddMarker(MarkerSuperElementRigid(bodyNumber=objFFRF["oFFRFreducedOrder"], meshNodeNumbers=nodes,
                                                       weightingFactors=w)) for nodes, w in faces)
oGround = mbs.AddObject(ObjectGround(referencePosition=faces[0][1] @ fem.GetNodePositionsAsArray()[faces[0][0]]))
mbs.AddObject(GenericJoint(markerNumbers=[mbs.AddMarker(MarkerBodyRigid(bodyNumber=oGround)), mLeft]))
mbs.AddLoad(LoadForceVector(markerNumber=mRight, loadVectorUserFunction=lambda mbs, t, v: [0, 1e4 * t, 0]))
sTip = mbs.AddSensor(SensorMarker(markerNumber=mRight, name="tip", fileName="solution/tip.txt",
                                  outputVariableType=exu.OutputVariableType.Displacement))
mbs.Assemble()
simulationSettings = exu.SimulationSettings()
simulationSettings.timeIntegration.endTime = 0.01
simulationSettings.timeIntegration.numberOfSteps = 20
if True:
    mbs.SolveDynamic(simulationSettings)
"""
FILE = "Examples/tiny.py"
OURS = ours("sTip")
TRUTH = Truth("20 modes", OURS, (("nModes = 2", "nModes = 20"),))


def run(example, tmp_path, monkeypatch, *options):
    """Run the script as Exudyn's examples are; return the rows of the table."""
    path = tmp_path / "main/pythonDev" / FILE
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(SCRIPT)
    monkeypatch.setattr(exudyn_examples, "EXAMPLES", {"tiny": example})
    return exudyn_examples.main([str(tmp_path), "--pairs", "1", *options])


def as_dicts(rows):
    return [dict(zip(exudyn_examples.COLUMNS, row, strict=True)) for row in rows]


def test_table_of_all_kinds_of_rows(tmp_path, monkeypatch, capsys):
    lines = {
        "sensor": OURS,
        "other": OURS + "\nsimulationSettings.timeIntegration.generalizedAlpha.spectralRadius = 0.5",
        "items": ours("sTip", items="{}"),
        "failing": ours("noSuchSensor"),
    }
    monkeypatch.setattr(exudyn_examples, "PAGE", tmp_path / "page.md")
    (tmp_path / "page.md").write_text("head\n<!-- examples -->\nold\n<!-- end of examples -->\ntail\n")
    rows = as_dicts(run(Example(FILE, lines, note="a note", parts=("bar",)), tmp_path, monkeypatch, "--docs"))
    row, other, refused, failing = rows
    assert [found["lines"] for found in rows] == list(lines)
    assert (row["scope"], row["output"]) == ("complete", "bar: tip")
    assert 0 < float(row["bound"]) < float(row["largest value"].split()[0])
    assert 0 < float(row["error about"].split(" +- ")[0]) < float(row["bound"])
    # q, q_t, ODE1, multipliers, data; the sensor's last value; its file
    assert int(row["results with and without"].removeprefix("all ").removesuffix(" arrays equal")) >= 7
    assert float(row["CPU time"].removesuffix(" times")) > 0
    assert "differ" in other["results with and without"]  # a simulation that our lines change is found out
    assert "refused by floating_body: items" in refused["scope"]
    assert refused["results with and without"].endswith(" equal")  # the script goes on without us
    assert "script fails: NameError: name 'noSuchSensor'" in failing["scope"]
    printed = capsys.readouterr().out
    assert "| tiny | sensor | complete | bar: tip |" in printed
    assert "*tiny:* a note." in printed
    written = (tmp_path / "page.md").read_text()
    assert written == "head\n<!-- examples -->\n" + printed.strip() + "\n<!-- end of examples -->\ntail\n"


def test_a_page_without_marks_is_an_error(tmp_path):
    (tmp_path / "page.md").write_text("<!-- examples -->\nno end\n")
    with pytest.raises(ValueError, match="no part between marks 'examples'"):
        page.put_between("examples", "new", tmp_path / "page.md")


@pytest.mark.slow
def test_truth_compares_every_instant(tmp_path, monkeypatch):
    wrong = Truth("another load", OURS, (*TRUTH.more, ("1e4 * t", "2e4 * t")))  # that no bound of the first covers
    example = Example(FILE, {"sensor": OURS}, truth=(TRUTH, wrong))
    _, good, bad = as_dicts(run(example, tmp_path, monkeypatch))
    assert (good["truth"], bad["truth"]) == ("20 modes", "another load")
    assert good["above the bound"] == "0 of 21"
    assert good["error about"] == bad["error about"] != ""  # of the same run
    assert 0 < float(good["error about"].split()[0]) < float(good["bound"])
    assert float(bad["modes' part off by"].split()[0]) > 90  # percent: no estimate knows of the other load
    assert 0 < float(good["error"]) < float(good["bound"])
    assert int(bad["above the bound"].split()[0]) > 10


@pytest.mark.parametrize(
    ("bound", "error", "text"),
    [([[2.0], [3.0]], [[1.0], [0.5]], "3"), ([[2.0, 4.0]], [[1.0, 0.1]], "4, one row 40")],
)
def test_sharpness_of_all_rows_and_of_the_worst(bound, error, text):
    assert exudyn_examples.sharpness(np.array(bound), np.array(error)) == text


def test_notes_that_are_the_same_come_once(monkeypatch):
    examples = {"a": Example(FILE, {}, note="x"), "b": Example(FILE, {}), "c": Example(FILE, {}, note="x")}
    monkeypatch.setattr(exudyn_examples, "EXAMPLES", examples)
    assert exudyn_examples.noted(["a", "b", "c"]) == "*a, c:* x."


@pytest.mark.parametrize("old", ["not there", "mbs"])
def test_patches_match_once_or_name_the_example(old):
    with pytest.raises(PatchError, match=f"tiny: '{old}' is there [0-9]+ times, not once"):
        edited("tiny", SCRIPT, ((old, "new"),))


def test_patches_are_applied():
    assert "nModes = 5" in edited("tiny", SCRIPT, (("nModes = 2", "nModes = 5"),))


@pytest.mark.parametrize("source", ["pass", "mbs.SolveDynamic()\nmbs.SolveDynamic()", "# mbs.SolveDynamic()"])
def test_lines_need_one_solve(source):
    with pytest.raises(PatchError, match=r"tiny: [0-9] lines start with 'mbs"):
        inserted("tiny", source, OURS)


def test_lines_take_the_indentation_of_the_solve():
    rows = inserted("tiny", SCRIPT, OURS).split("\n")
    at = rows.index(f"    {IMPORT}")
    assert rows[at + 1 : at + 3] == [f"    {line}" for line in OURS.split("\n")]
    assert rows[at + 3].startswith("    mbs.SolveDynamic(")
    assert len(rows) == len(SCRIPT.split("\n")) + 3


@pytest.mark.parametrize(
    ("other", "names"),
    [
        ({"q": [1.0, 2.0], "file": [7]}, []),
        ({"q": [1.0, 2.0 + 1e-15], "file": [7]}, ["q"]),
        ({"q": [1.0, 2.0]}, ["file"]),
        ({"q": [1.0, 2.0], "file": [7, 8]}, ["file"]),
    ],
)
def test_differences_are_named(other, names):
    bare = {"q": np.array([1.0, 2.0]), "file": np.array([7], np.uint8)}
    assert exudyn_runs.differences(bare, {name: np.array(x) for name, x in other.items()}) == names


@pytest.mark.parametrize(
    ("x", "text"), [(0, "0"), (0.0123, "0.012"), (123.4, "120"), (5630, "5600"), (1e47, "1e+47"), (9.99e-4, "0.001")]
)
def test_numbers_are_readable(x, text):
    assert exudyn_examples.rounded(x) == text


def test_nothing_to_compare_is_an_error():
    with pytest.raises(RuntimeError, match="nothing to compare"):
        exudyn_runs.differences({"q": np.zeros(0)}, {"q": np.zeros(0)})


def test_a_path_without_exudyn_is_refused(tmp_path, capsys):
    with pytest.raises(SystemExit):
        exudyn_examples.main([str(tmp_path)])
    assert "work tree of github.com/jgerstmayr/EXUDYN" in capsys.readouterr().err


@pytest.mark.parametrize("name", EXAMPLES)
def test_our_lines_are_python_and_attach(name):
    example = EXAMPLES[name]
    for lines in (*example.lines.values(), *(truth.lines for truth in example.truth)):
        compile(lines, name, "exec")
        assert lines.count("romerr.attach(") == lines.count("romerr.floating_body(") > 0
