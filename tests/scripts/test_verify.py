"""romerr verify: measured errors against truths, and nothing of the user's changed."""

import hashlib
import json
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from jsonschema import validate

import exudyn_romerr as romerr
from exudyn_romerr.__main__ import main
from exudyn_romerr.errors import InputError, RunError
from exudyn_romerr.report.answers import Tolerances
from exudyn_romerr.report.verdict_text import reasons, summary
from exudyn_romerr.report.verdicts import Row, judge
from exudyn_romerr.scripts.child_run import ASKS, Request, Result, estimates, run_child
from exudyn_romerr.scripts.compared import (
    DO_NOT_SHRINK,
    OF_CALL,
    OTHER_INSTANTS,
    SAME_STEPS,
    SHRINK_LITTLE,
    UNSETTLED,
    Signal,
    disagreements,
    rows_of_signal,
    signals,
)
from exudyn_romerr.scripts.verify import BY_CALL, _planned

ROOT = Path(__file__).resolve().parents[2]
N, H, END = 2, 1e-3, 0.03
LIMIT = 300  # seconds, however busy the machine is: what takes longer hangs
BAR = f"""
import sys
sys.path.insert(1, {str(ROOT)!r})
from models import floating
scene = floating.pendulum(2, "RBE2", h={H}, t_end={END}, damping=(0.0, 1e-4))
scene.solve()
"""
# a mass on a spring, rigid: x = cos(w t), w = 10 rad/s
MASS = """
import sys
import exudyn as exu
from exudyn.utilities import *
SC = exu.SystemContainer()
mbs = SC.AddSystem()
mass = mbs.CreateMassPoint(referencePosition=[0, 0, 0], initialDisplacement=[1, 0, 0], mass=1)
ground = mbs.CreateGround()
mbs.CreateCartesianSpringDamper(bodyNumbers=[ground, mass], stiffness=[100, 100, 100])
mbs.AddSensor(SensorBody(name="mass", bodyNumber=mass, outputVariableType=exu.OutputVariableType.Displacement))
calls = [0]
def count(mbs, t):
    calls[0] += 1
    mbs.variables["last"] = t
    return True
mbs.SetPreStepUserFunction(count)
mbs.AddSensor(SensorUserFunction(name="calls", factors=[0], sensorUserFunction=lambda *a: [calls[0]]))
mbs.variables["last"] = 0.0
last = lambda mbs, *a: [mbs.variables["last"]]
mbs.AddSensor(SensorUserFunction(name="last", factors=[0], sensorUserFunction=last))
mbs.Assemble()
settings = exu.SimulationSettings()
settings.timeIntegration.endTime = 0.5
settings.timeIntegration.numberOfSteps = 50
settings.timeIntegration.verboseMode = 0
settings.solution.file.write = False
settings.solution.sensors.writePeriod = 0.25
ADAPTIVE
mbs.SolveDynamic(settings)
"""


def written(folder, text):
    folder.mkdir(exist_ok=True)
    path = folder / "script.py"
    path.write_text(text.replace("ADAPTIVE", ""))
    return str(path)


def request(path, **options):
    return Request("a run", path, os.path.dirname(path), timeout=LIMIT, **options)


@pytest.fixture(scope="module")
def bar(tmp_path_factory):
    return romerr.verify(written(tmp_path_factory.mktemp("bar"), BAR), tolerance="1%")


def shown(n, kind, h, every):
    """What the bar's sensors show at the steps of the unchanged run."""
    from models import floating

    scene = floating.pendulum(n, kind, h=h, t_end=END, damping=(0.0, 1e-4))
    scene.solve()
    return [scene.mbs.GetSensorStoredData(i)[::every, 1:] for i in range(3)]


def test_steps_are_those_of_a_finer_truth(bar):
    """Truth: Richardson from h/8 and h/16."""
    base, fine, finer = (shown(N, "RBE2", H / k, k) for k in (1, 8, 16))
    for j in range(3):
        truth = finer[j] + (finer[j] - fine[j]) / 3
        error = np.abs(truth - base[j]).max(axis=0)
        rows = [row for row in bar.judgement.rows if row.name == f"sensor{j}"]
        told = [(row.of["step"], error[c]) for c, row in enumerate(rows) if row.of["step"].half_width is not None]
        assert all(abs(step.size - true) <= step.half_width for step, true in told)
        assert any(step.half_width < step.size / 2 for step, _ in told)


def test_modes_and_interfaces_are_those_of_the_full_body(bar):
    """Truth: all modes of the body with free interfaces; the body has 195 coordinates."""
    base, full = (shown(*of, H, 1) for of in ((N, "RBE2"), (0, "complete")))
    for j in range(3):
        error = np.abs(full[j] - base[j]).max(axis=0)
        rows = [row for row in bar.judgement.rows if row.name == f"sensor{j}"]
        c = int(np.argmax(error))
        told = rows[c].of["modes"].size + rows[c].of["interfaces"].size
        assert told == pytest.approx(error[c], rel=0.1)


def test_what_all_vectors_leave_out_is_in_the_half_width(bar):
    """Truth: all modes of the body less the run with all vectors. The estimate of that run knows it to a third."""
    (P, _), full = bar.results["unchanged"].vectors[0], shown(0, "complete", H, 1)
    assert P.shape[1] < 60  # of 195: something is left out
    finest = [data[:, 1:] for data in bar.results["free"].solves[0]["data"]]
    error = np.abs(full[1] - finest[1]).max(axis=0)
    c = int(np.argmax(error))
    row = next(row for row in bar.judgement.rows if row.name == "sensor1" and row.component == c)
    assert 0.7 * error[c] <= row.of["modes"].half_width <= 3 * error[c]  # and how else they change half the step


@pytest.mark.slow
def test_the_whole_is_that_of_the_full_body_at_short_steps(bar):
    """Truth: all modes of the body, Richardson from h/8 and h/16."""
    base, fine, finer = shown(N, "RBE2", H, 1), shown(0, "complete", H / 8, 8), shown(0, "complete", H / 16, 16)
    for j in range(3):
        error = np.abs(finer[j] + (finer[j] - fine[j]) / 3 - base[j]).max(axis=0)
        rows = (row for row in bar.judgement.rows if row.name == f"sensor{j}")
        known = [row for row in rows if row.of["sum"].half_width is not None]  # a step that is not resolved has none
        assert known
        assert all(abs(row.of["sum"].size - error[row.component]) <= row.of["sum"].half_width for row in known)


def test_causes_are_told_apart_and_estimates_stand_beside(bar):
    row = next(row for row in bar.judgement.rows if row.name == "sensor1" and row.component == 1)
    assert row.of["interfaces"].size > 0
    assert {verdict.how for verdict in row.of.values()} == {"measured"}
    assert row.estimated.how == "estimated"
    assert row.noise <= 1e-6 * row.largest
    text = str(bar)
    assert "modes measured" in text
    assert "estimated about" in text
    assert "at most" not in text


def test_answers_files_and_pictures(bar, tmp_path):
    assert bar.answer("sensor1", "1000%") == "enough"
    assert bar.answer("sensor1", 1e-30) != "enough"
    assert bar.answer("sensor1", "1000%", cause="step") == "enough"
    with pytest.raises(InputError, match="sensor9"):
        bar.answer("sensor9", 1.0)
    bar.save(tmp_path / "a.json")
    told = json.loads((tmp_path / "a.json").read_text(), parse_constant=pytest.fail)
    with pytest.raises(InputError, match="does not exist: make it"):
        bar.save(tmp_path / "none" / "a.json")
    assert {run["name"] for run in told["runs"]} == {*bar.results}
    assert told["sensors"] == bar.rows
    validate(told, json.loads((ROOT / "docs" / "answer.schema.json").read_text()))
    bar.plot(tmp_path / "a.png")
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")


def test_sensors_are_chosen_where_there_are_none(tmp_path):
    text = BAR.replace("scene = ", "floating._add_sensors = lambda *a: {}\nscene = ")
    solve = run_child(request(written(tmp_path, text))).solves[0]
    assert any("node" in name for name in solve["names"])
    assert sum("marker" in name for name in solve["names"]) == 2
    assert all(np.ptp(data[:, 1:]) > 0 for data in solve["data"][:2])


def test_mass_without_bodies_has_its_step_alone(tmp_path, capsys):
    """Exact: x = cos(10 t). Generalised-alpha with radius 0.9 is of second order."""
    path = written(tmp_path, MASS)
    status = main(["verify", "--tolerance", "mass=1", "--jobs", "2", path])
    assert status == 0
    out = capsys.readouterr().out
    assert "Step: enough" in out
    found = romerr.verify(path, executor=None, jobs=2)
    row = found.judgement.rows[0]
    t = found.results["unchanged"].solves[0]["data"][0][:, 0]
    x = found.results["unchanged"].solves[0]["data"][0][:, 1]
    assert len(t) == 51  # every step, though the script stores three
    true = np.abs(np.cos(10 * t) - x).max()
    assert row.of["step"].size == pytest.approx(true, rel=0.02)
    assert row.order == pytest.approx(2.0, abs=0.05)
    assert {*row.of} == {"step", "sum"}  # nothing is reduced


def test_controllers_follow_or_are_held(tmp_path):
    path = written(tmp_path, MASS)
    for hold, calls in ((False, 100), (True, 50)):
        solve = run_child(request(path, steps=2, hold=hold)).solves[0]
        data = dict(zip(solve["names"], solve["data"], strict=True))
        assert data["calls"][-1, 1] == calls
        times, last = data["last"][1:, 0], data["last"][1:, 1]
        ends = 0.01 * np.ceil(times / 0.01 - 1e-9) if hold else times  # of the step that is under way
        np.testing.assert_allclose(last, ends, atol=1e-12)


def test_steps_that_adapt_are_compared_between_their_instants(tmp_path):
    """Exact: x = cos(10 t)."""
    text = MASS.replace(
        "ADAPTIVE",
        "settings.timeIntegration.solverType = exu.DynamicSolverType.DOPRI5\n"
        "settings.timeIntegration.relativeTolerance = settings.timeIntegration.absoluteTolerance = 1e-4\n"
        "settings.timeIntegration.numberOfSteps = 5",
    )
    path = written(tmp_path, text)
    base, finer = (run_child(request(path, steps=k)) for k in (1, 4))
    assert (base.failure, finer.failure) == ("", "")
    assert not base.solves[0]["fixed"]
    errors = []
    for one in (base, finer):
        t, x = one.solves[0]["data"][0][:, :2].T
        errors.append(np.abs(np.cos(10 * t) - x).max())
    assert 0 < errors[1] < errors[0] / 50


def test_solves_made_step_by_step_are_compared(tmp_path):
    """Exact: x = cos(10 t); half the step has a quarter of the error."""
    steps = "solver = exu.MainSolverImplicitSecondOrder()\nsolver.InitializeSolver(mbs, settings)\n"
    steps += "solver.SolveSteps(mbs, settings)\nsolver.FinalizeSolver(mbs, settings)"
    path = written(tmp_path, MASS.replace("mbs.SolveDynamic(settings)", steps))
    errors = []
    for k in (1, 2):
        (solve,) = run_child(request(path, steps=k)).solves
        t, x = solve["data"][0][:, :2].T
        errors.append(np.abs(np.cos(10 * t) - x).max())
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)


def test_runs_that_end_early_are_not_compared(tmp_path):
    """The controller fails after 60 calls: the unchanged run comes to its end, those with shorter steps do not."""
    fails = 'calls[0] += 1\n    if calls[0] > 60:\n        raise ValueError("too often")'
    found = romerr.verify(written(tmp_path, MASS.replace("calls[0] += 1", fails)))
    row = found.judgement.rows[0]
    assert "it ended at t = 0.3 s" in row.of["step"].reason
    assert row.answer.value == "not covered"
    said = [note for note in found.judgement.notes if note.startswith("half: the script ended with")]
    assert "too often" in said[0]
    assert "\n" not in said[0]


HANGS = """
import time
def wait(mbs, t):
    if t > 0 and abs(t / 0.01 - round(t / 0.01)) > 0.1:
        time.sleep(3600)
    return True
mbs.SetPreStepUserFunction(wait)
"""


def snapshot(folder):
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else ""
        for path in sorted(folder.rglob("*"))
    }


TAMPERS = """
import os, shutil, pathlib, subprocess
here = pathlib.Path(__file__).parent
home = pathlib.Path(HOME)
assert here != home and here.resolve() == pathlib.Path.cwd()
assert open("../beside/x.txt").read() == "beside"
open("../beside/y.txt", "w").write("y")
(here / "by_file.txt").write_text("mine")
assert open("input.txt").read() == "mine"
open("input.txt", "w").write("theirs")
open("data/table.txt", "a").write("more")
assert open("data/table.txt").read() == "table more".replace(" ", "")
os.remove("data/old.txt")
os.makedirs("new/deep")
open("new/deep/x.txt", "w").write("x")
os.rename("data/deep/a.txt", "data/deep/b.txt")
shutil.rmtree("gone")
os.chdir(home)
open("input.txt", "w").write("again")
for path in (home / "data" / "table.txt", home / "nowhere.txt"):
    try:
        open(path, "w")
    except PermissionError as error:
        print(error)
    else:
        raise SystemExit("it may write where it should not")
assert (home / "data" / "table.txt").read_text() == "table"
if GUARDED:
    assert subprocess.call(["sh", "-c", f"echo theirs > {home}/data/table.txt"]) != 0
import exudyn
"""


def write_guard_holds():
    """Whether this system lets a process give up its right to write."""
    code = "from exudyn_romerr.scripts.overlay import write_only_in; print(write_only_in([]))"
    return "True" in subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True).stdout


def test_nothing_of_the_users_is_changed(tmp_path):
    home = tmp_path / "home"
    is_guarded = write_guard_holds()
    path = written(home, TAMPERS.replace("HOME", repr(str(home))).replace("GUARDED", repr(is_guarded)))
    for name, text in (
        ("input.txt", "mine"),
        ("data/table.txt", "table"),
        ("data/old.txt", "old"),
        ("data/deep/a.txt", "a"),
        ("gone/x.txt", "x"),
        ("../beside/x.txt", "beside"),
    ):
        (home / name).parent.mkdir(parents=True, exist_ok=True)
        (home / name).write_text(text)
    before = snapshot(tmp_path)
    result = run_child(request(path))
    assert result.facts["status"] == 0, result.facts["error"]
    assert snapshot(tmp_path) == before
    assert any("table.txt" in note for note in result.facts["notes"])


WRITES = """
settings.solution.restart.write = True
settings.solution.restart.writePeriod = 0.1
settings.solution.restart.name = "solution/restart.txt"
settings.solution.solverInformationFileName = "solution/information.txt"
settings.timeIntegration.verboseModeFile = 2
exu.SetWriteToFile("solution/console.txt", flagFlushAlways=True)
exu.Print("theirs")
exu.SetWriteToFile("", False)
assert "theirs" in open("solution/console.txt").read()
"""


def test_what_exudyn_writes_stays_in_the_runs_folder(tmp_path):
    """C++ opens files past Python: names are changed before, links taken away."""
    home = tmp_path / "home"
    away = tmp_path / "away.txt"
    text = MASS.replace("settings.solution.file.write = False", "settings.solution.file.name = 'solution/all'")
    text = text.replace('name="mass",', f'name="mass", fileName={str(away)!r},')
    text = text.replace('name="calls",', 'name="calls", fileName="solution/calls.txt",')
    text = text.replace("ADAPTIVE", WRITES) + "SC.renderer.Start()\nSC.renderer.RedrawAndSaveImage()\n"
    names = ("all.txt", "calls.txt", "restart.txt", "restart.txt.bck", "information.txt", "console.txt")
    (home / "solution").mkdir(parents=True)
    for name in names:
        (home / "solution" / name).write_text("mine")
    for more in (
        "",
        f"exu.config.outputDirectory = {str(home / 'elsewhere')!r}",
        "exu.config.outputDirectory = 'new'",
    ):
        path = written(home, text.replace("mbs.SolveDynamic", f"{more}\nmbs.SolveDynamic"))
        if more:  # Exudyn puts it in front of relative names, and refuses others
            path = written(home, Path(path).read_text().replace(f"fileName={str(away)!r},", ""))
        before = snapshot(tmp_path)
        result = run_child(request(path))
        assert (result.failure, result.facts["status"]) == ("", 0)
        assert snapshot(tmp_path) == before


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("import os; os._exit(3)", "status 3"),
        ("import time; time.sleep(3600)", "--timeout"),
        ("input('how many modes? ')", ASKS),
        ("def f(:", "SyntaxError"),
        ("import os, signal; os.kill(os.getpid(), signal.SIGKILL)", "memory"),
        ("raise ValueError('boo')", "ValueError: boo"),
    ],
)
def test_what_goes_wrong_is_one_line(text, said, tmp_path):
    result = run_child(replace(request(written(tmp_path, text)), timeout=3 if "sleep" in text else LIMIT))
    assert said in result.failure
    assert "\n" not in result.failure


def test_nothing_to_compare_is_an_error(tmp_path, capsys):
    path = written(tmp_path, "print(1)")
    with pytest.raises(RunError, match="nothing to compare"):
        romerr.verify(path)
    assert main(["verify", path]) == 2
    assert capsys.readouterr().err.startswith("romerr: ")
    with pytest.raises(InputError, match="no script"):
        romerr.verify(str(tmp_path / "no.py"))
    with pytest.raises(InputError, match="controllers"):
        romerr.verify(path, controllers="jump")
    with pytest.raises(InputError, match="top of a file"):
        romerr.verify(lambda: None)


def test_temporary_files_of_the_script_are_where_it_looks_for_them(tmp_path):
    text = MASS.replace("import sys", "import sys, tempfile\nplace = tempfile.mkdtemp() + '/sensor.txt'", 1)
    text = text.replace('name="mass",', 'name="mass", fileName=place,') + "assert len(open(place).readlines()) > 50\n"
    told = run_child(request(written(tmp_path, text))).facts
    assert (told["status"], told["error"]) == (0, "")


def test_functions_and_any_executor(tmp_path):
    """A function at the top of a file, which solves by itself or returns what is to be solved."""
    text = MASS.replace("mbs.SolveDynamic(settings)", "")
    body = "\n".join(f"    {line}" for line in text.replace("ADAPTIVE", "").split("\n") if "import *" not in line)
    (tmp_path / "scene.py").write_text(
        "from exudyn.utilities import *\ndef build():" + body + "\n    return mbs, settings\n"
    )
    sys.path.insert(0, str(tmp_path))
    try:
        from scene import build

        with ProcessPoolExecutor(2) as pool:
            found = romerr.verify(build, executor=pool)
    finally:
        sys.path.remove(str(tmp_path))
    assert found.judgement.rows[0].order == pytest.approx(2.0, abs=0.05)


@pytest.mark.slow
def test_dask_takes_the_runs(tmp_path):
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        found = romerr.verify(written(tmp_path, MASS), executor=client.get_executor())
    assert found.judgement.rows[0].order == pytest.approx(2.0, abs=0.05)


def interruptible(*arguments):
    """The command, which Ctrl-C interrupts even where a shell's jobs ignore it."""
    code = "import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
    code += f"from exudyn_romerr.__main__ import main; sys.exit(main(['verify', *{arguments!r}]))"
    return [sys.executable, "-u", "-c", code]


@pytest.mark.skipif(os.name != "posix", reason="signals")
def test_interrupted_it_shows_what_is_there(tmp_path):
    """The runs with shorter steps hang; the one that repeats the unchanged run has ended."""
    path = written(tmp_path, MASS.replace("mbs.SolveDynamic", HANGS + "mbs.SolveDynamic"))
    process = subprocess.Popen(
        interruptible("--jobs", "3", path), cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert "more runs" in process.stderr.readline()
    while "again" not in (line := process.stderr.readline()):  # on a busy machine others come before it
        assert line
    process.send_signal(signal.SIGINT)
    out, error = process.communicate(timeout=LIMIT)
    assert process.returncode == 0
    assert "Runs that were not had: half (it was stopped)" in out.splitlines()[1]
    assert "Traceback" not in error


# a script that tells who runs it, and hangs; ended by us it leaves no file
STAYS = "import os, time\nopen('pid', 'w').write(str(os.getpid()))\ntime.sleep(3600)"


def started_with(command, tmp_path):
    """A process, once the script STAYS runs in another that it has started, and that one's number."""
    scratch, home = tmp_path / "scratch", tmp_path / "home"
    scratch.mkdir()
    environment = {**os.environ, "TMPDIR": str(scratch), "PYTHONPATH": str(ROOT)}
    process = subprocess.Popen(command, cwd=home, env=environment, stderr=subprocess.PIPE, text=True)
    place, limit = f"scratch/romerr_*/run{home}/pid", time.monotonic() + LIMIT
    while not (found := [text for path in tmp_path.glob(place) if (text := path.read_text())]):
        assert process.poll() is None
        assert time.monotonic() < limit
        time.sleep(0.05)
    return process, int(found[0])


def is_there(pid):
    """Whether a process runs: it is no zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):  # the latter if it ends while it is read
        return False


@pytest.mark.skipif(os.name != "posix", reason="signals")
def test_interrupted_at_once_it_says_so(tmp_path):
    """In the first run, as soon as the script is in it."""
    process, _ = started_with(interruptible(written(tmp_path / "home", STAYS)), tmp_path)
    process.send_signal(signal.SIGINT)
    assert process.communicate(timeout=LIMIT)[1].strip() == "romerr: stopped before there was anything to show"
    assert process.returncode == 130


@pytest.mark.skipif(os.name != "posix", reason="signals")
def test_processes_end_with_their_parent(tmp_path):
    path = written(tmp_path / "home", STAYS)
    code = "from exudyn_romerr.scripts.child_run import *\n"
    code += f"run_child(Request('a', {path!r}, {str(tmp_path / 'home')!r}))"
    parent, pid = started_with([sys.executable, "-c", code], tmp_path)
    parent.send_signal(signal.SIGKILL)
    parent.communicate()
    limit = time.monotonic() + LIMIT
    while is_there(pid):
        assert time.monotonic() < limit
        time.sleep(0.05)
    assert not any((tmp_path / "scratch").iterdir())


def test_modes_by_the_scripts_own_call_where_a_body_cannot_be_read():
    told, P = dict(TOLD), VECTORS[0][0]
    first = Result("unchanged", "", [{"kind": "dynamic", "has_bodies": True}], VECTORS, told)
    names = [one.name for one in _planned(request("a.py"), first, "follow", False)]
    assert names == ["again", "half", "quarter", "modes", "free", "all"]
    told["without_vectors"] = [1]
    assert [one.name for one in _planned(request("a.py"), first, "follow", False)][-2:] == ["twice", "four times"]
    assert "interfaces" in BY_CALL
    static = replace(first, solves=[{"kind": "static", "has_bodies": True}], vectors={0: (P, np.array([True, True]))})
    assert [one.name for one in _planned(request("a.py"), static, "follow", False)][:2] == ["again", "modes"]


def row_of(limit, changed=None, **runs):
    """The row of a sensor whose values at the end of each run are these; changed : fields of its Signal."""
    t = np.linspace(0, 1, 5)
    of = {name: np.outer(t, [x]) for name, x in runs.items() if x is not None}
    signal = Signal("tip", "Displacement", 0, False, t, of, {}, steps=4)._replace(**(changed or {}))
    (row,) = rows_of_signal(signal, Tolerances([str(limit)]))
    return row


RIGID = {"has_bodies": False}


@pytest.mark.parametrize(
    ("half", "quarter", "limit", "answer", "reason"),
    [
        (1.1, 0.9, 0.01, "too large", DO_NOT_SHRINK),  # runs differ by 0.2: one is off by 0.1 at least
        (1.1, 0.9, 0.15, "not known", DO_NOT_SHRINK),
        (1.1, 0.9, 0.4, "enough", ""),
        (1.1, 1.19, 0.01, "too large", SHRINK_LITTLE),
        (1.1, 1.19, 0.08, "not known", SHRINK_LITTLE),
        (1.24, 1.25, 0.1, "too large", ""),
    ],
)
def test_runs_that_differ_by_twice_the_tolerance_are_too_coarse(half, quarter, limit, answer, reason):
    """Whatever the order; chaos and contact only where finer pairs do not come closer."""
    row = row_of(limit, RIGID, unchanged=1.0, again=1.0, half=half, quarter=quarter)
    found = row.of["step"]
    assert (found.answer.value, found.reason) == (answer, reason)
    assert row.answer is found.answer
    if reason:
        assert found.half_width is None
        assert found.size == pytest.approx(max(abs(half - 1), abs(quarter - half), abs(quarter - 1)))
        assert (found.cure == OTHER_INSTANTS) == (reason == DO_NOT_SHRINK)


def speed_by_trapezoidal_rule(ends, steps):
    """Of a mass of 1 kg under 1 N until `ends`, at five instants of 4 s; the load is looked at where steps end."""
    load = np.linspace(0, 4, 4 * steps + 1) <= ends
    speed = np.append(0.0, np.cumsum(load[1:].astype(float) + load[:-1])) / (2 * steps)
    return speed[::steps, np.newaxis]


def test_loads_that_end_inside_steps_are_in_the_half_width():
    """The steps' part of what is measured of it is of either sign at each size of step (an attack read "enough")."""
    off = []
    for ends in np.random.default_rng(0).uniform(1, 2, 200):
        runs = {"unchanged": 1, "again": 1, "half": 2, "quarter": 4}
        of = {name: speed_by_trapezoidal_rule(ends, steps) for name, steps in runs.items()}
        true = abs(min(ends, 4.0) - of["unchanged"][-1, 0])
        signal = Signal("v", "Velocity", 0, False, np.arange(5.0), of, {}, steps=4)._replace(has_bodies=False)
        step = rows_of_signal(signal, Tolerances([f"{0.9 * true}"]))[0].of["step"]
        assert step.answer.value != "enough"
        off.append(abs(step.size - true) / step.half_width)
    assert max(off) <= 2
    assert np.mean(np.array(off) <= 1) > 0.9


def test_steps_to_take_follow_from_order_and_tolerance():
    """Of second order, 0.28 to 0.01: 5.3 times as short; of first order 28 times, of which 20 are told."""
    for half, quarter, order, action in (
        (1.21, 1.2625, 2.0, "take 24 steps, 6 times as short"),
        (1.14, 1.21, 1.0, "take 80 steps, 20 times as short, then ask again"),
    ):
        row = row_of(0.01, RIGID, unchanged=1.0, again=1.0, half=half, quarter=quarter)
        assert row.order == pytest.approx(order)
        assert row.of["step"].cure == row.of["sum"].cure == action


SIGNAL = {"unchanged": 1.0, "again": 1.0, "half": 1.00075, "quarter": 1.0009375, "modes": 1.002}


@pytest.mark.parametrize(
    ("changed", "runs", "answer"),
    [
        ({}, {}, "enough"),
        ({"missing": {"free": "it was ended after 60 s (--timeout)"}}, {}, "not covered"),
        ({}, {"free": 1.2}, "too large"),
        ({"unseen": OF_CALL}, {}, "not covered"),
        ({"unseen": OF_CALL}, {"free": 1.2}, "not covered"),
        ({"missing": {"half": "killed", "quarter": "killed"}}, {"half": None, "quarter": None}, "not covered"),
        ({"missing": {"modes": "killed"}}, {"modes": None}, "not covered"),
        ({"unseen": OF_CALL}, {"half": 1.75, "quarter": 1.9375}, "too large"),  # whatever interfaces add
    ],
)
def test_a_cause_that_nobody_measured_is_no_zero(changed, runs, answer):
    row = row_of(0.1, changed, **(SIGNAL | runs))
    assert row.answer.value == answer
    assert row.of["sum"].size is None or row.of["sum"].size >= max(
        x.size for x in row.of.values() if x.size is not None
    )
    if answer == "not covered":
        assert summary([row]).startswith("Not known, by ")
        assert reasons([row])


def test_the_whole_is_at_least_its_largest_part():
    """Steps that do not shrink beside interfaces that are ten times larger."""
    row = row_of(0.0004, **(SIGNAL | {"half": 1.001, "quarter": 1.0, "free": 1.1}))
    assert row.of["step"].reason == DO_NOT_SHRINK
    assert row.of["sum"].size == pytest.approx(row.of["interfaces"].size) == pytest.approx(0.098)


def test_stress_is_measured_by_the_scripts_own_call():
    """Vectors without stress modes change none."""
    runs = SIGNAL | {"modes": 1.0, "twice": 1.05, "four times": 1.06}
    row = row_of(0.01, {"by_call": True, "shows": "StressLocal"}, **runs)
    assert (row.of["modes"].size, row.of["modes"].half_width) == (pytest.approx(0.06), pytest.approx(0.01))
    assert row_of(0.01, {"by_call": True}, **SIGNAL).of["modes"].how == "not covered"
    for limit, answer in ((0.01, "too large"), (0.3, "not known")):  # doubling again changes more than before
        row = row_of(limit, {"by_call": True}, **(runs | {"four times": 1.5}))
        found = row.of["modes"]
        assert (found.size, found.half_width, found.answer.value) == (pytest.approx(0.5), None, answer)
        assert (row.answer.value, found.reason) == (answer, UNSETTLED)
    first = Result("unchanged", "", [{"kind": "static", "has_bodies": True, "shows": ["StressLocal"]}], VECTORS, TOLD)
    assert [one.name for one in _planned(request("a.py"), first, "follow", False)][-2:] == ["twice", "four times"]


VECTORS = {0: (np.ones((6, 2)), np.array([True, False]))}
TOLD = {"without_vectors": [], "bodies": 1, "rows": [], "may_be_rigid": False}


def result_of(name, t, x, **more):
    """What came of a run with one sensor."""
    solve = {
        "kind": "dynamic",
        "names": ["tip"],
        "numbers": [0],
        "shows": ["Displacement"],
        "fixed": True,
        "has_bodies": True,
    }
    return Result(name, "", [solve | {"data": [np.stack([t, x], axis=1)]} | more], {}, TOLD)


def test_what_vectors_change_is_known_as_far_as_half_the_step_says_the_same():
    """0.077 at the script's step, 0.027 at half of it: they ring with the step, interfaces do not."""
    runs = SIGNAL | {"modes": 1.0, "free": 1.077, "all": SIGNAL["half"] + 0.027}
    found = row_of(0.01, **runs).of["interfaces"]
    assert (found.size, found.half_width) == (pytest.approx(0.077), pytest.approx(0.05))
    assert found.answer.value == "not known"
    row = row_of(0.01, **(runs | {"all": SIGNAL["half"] + 0.077}))
    assert row.of["interfaces"].answer.value == "too large"


@pytest.mark.parametrize(("limit", "answer"), [("0.04", "too large"), ("0.1", "not known"), ("1", "not known")])
def test_of_one_difference_that_is_told(limit, answer):
    """Where the run with a quarter of the step is lost; what it tends to is not known."""
    lost = {"missing": {"quarter": "it was killed"}}
    found = row_of(limit, RIGID | lost, unchanged=1.0, again=1.0, half=1.1).of["step"]
    assert (found.size, found.half_width, found.answer.value) == (pytest.approx(0.1), None, answer)
    assert "a quarter of the step was not had: it was killed" in found.reason


def test_nothing_moves_in_a_static_solve():
    """Velocities are 0 there whatever the model; displacements need not be."""
    for shows, answer in (("Velocity", "enough"), ("AngularVelocityLocal", "enough"), ("Displacement", "not known")):
        row = row_of("1%", RIGID | {"is_static": True, "shows": shows}, unchanged=0.0, again=0.0)
        assert row.answer.value == answer


def test_of_a_solve_that_failed_its_last_row_is_left_out():
    """It may be of the step that did not converge; steps are those that were planned."""
    t = np.linspace(0, 0.8, 9)
    ended = {"until": "until 0.8 of 1 s: the solve failed", "on_purpose": False, "count": 10}
    (signal,) = signals({"unchanged": result_of("unchanged", t, np.append(t[:-1], 1e7), **ended)})
    assert (signal.t[-1], signal.of["unchanged"].max(), signal.steps) == (pytest.approx(0.7), pytest.approx(0.7), 10)


def test_runs_that_took_no_shorter_steps_measure_none():
    times = {"unchanged": np.linspace(0, 1, 5), "half": np.linspace(0, 1, 5), "quarter": np.linspace(0, 1, 17)}
    (signal,) = signals({name: result_of(name, t, t) for name, t in times.items()})
    assert signal.missing == {"half": SAME_STEPS}
    assert signal.steps == 4
    (row,) = rows_of_signal(signal, Tolerances(["9"]))
    assert (row.of["step"].how, row.answer.value) == ("not covered", "not covered")


def test_a_misspelt_sensor_is_wrong_usage(bar):
    """With the results all the same."""
    asked = replace(bar, tolerances=Tolerances(["sensr1=1"]))
    assert asked.status == 2
    assert "did you mean 'sensor1'?" in str(asked)
    assert "No tolerance: sensor0, sensor1, sensor2." in str(asked)
    assert replace(bar, tolerances=Tolerances(["sensor1=9"])).status == 0


def test_what_both_do_not_add_up_to_is_in_the_whole():
    """Errors of second order in the step: 0.01 with the script's modes, 0.21 with more, which change 0.1 at any."""
    steps, modes, both = 0.01, 0.1, 0.2
    values = {"unchanged": 0.0, "again": 0.0, "half": 0.75 * steps, "quarter": 0.9375 * steps, "modes": modes}
    whole = row_of("1%", **values, all=modes + 0.75 * (steps + both)).of["sum"]
    assert abs(steps + modes + both - whole.size) <= whole.half_width < 2 * both


def test_two_ways_to_more_modes_are_both_said():
    """Modes by the script's own call that agree with each other and not with our vectors."""

    def result(name, x):
        return result_of(name, [0.0, 1.0], [0.0, x], kind="static")

    values = {"unchanged": 1.0, "again": 1.0, "modes": 1.1, "twice": 1.01, "four times": 1.011}
    results = {name: result(name, x) for name, x in values.items()}
    (line,) = disagreements(results)
    assert line.startswith("tip: modes 1.0e-01 by our vectors, 1.1e-02 +- 1e-03 by the script's own call")
    assert disagreements(results | {"twice": result("twice", 1.1), "four times": result("four times", 1.1)}) == []


def test_what_is_below_noise_is_not_measurable():
    for limit, answer in ((0.2, "enough"), (0.01, "not known")):
        row = row_of(limit, unchanged=1.0, again=1.01, half=1.002, quarter=1.003)
        assert row.noise == pytest.approx(0.01)
        assert row.of["step"].half_width >= 0.03
        assert row.of["step"].answer.value == answer


def test_a_run_tells_of_solves_with_bodies_only():
    """The first solve moves none, so that the run's own number 0 is number 1 here."""
    row = Row("tip", 0, 0, "", 1.0, 1.0, {"sum": judge(1.0, 0.1, None, "estimated")})
    plain, moved = {"has_bodies": False}, {"has_bodies": True}
    results = {
        "unchanged": Result("unchanged", solves=[plain, moved]),
        "again": Result("again", facts={"rows": [row]}),
    }
    assert estimates(results, "again") == {("tip", 0, 1): row.of}
