"""romerr run: bodies and solves of a script are found however they are made, and each sensor has its answer."""

import gc
import json
import math
import os
import re
import subprocess
import sys
import weakref
from html import unescape
from pathlib import Path

import numpy as np
import pytest
from jsonschema import validate

import exudyn_romerr as romerr
from exudyn_romerr.__main__ import main
from exudyn_romerr.mbs.scenes import found_bodies, recorded_solve
from exudyn_romerr.report.answers import STATUS, Answer
from exudyn_romerr.report.verdicts import CAUSES
from exudyn_romerr.scripts.run import NO_BODY

ROOT = Path(__file__).resolve().parents[2]
HEAD = "import exudyn as exu\nfrom models import floating\n"
SCENE = HEAD + "scene = floating.pendulum(4, t_end=0.05)\n"
SOLVE = "scene.mbs.Assemble()\nscene.mbs.SolveDynamic(scene.settings)\n"


def written(folder, text):
    path = folder / "script.py"
    path.write_text(text)
    return str(path)


def ran(folder, text, **options):
    """The run of a script that came to its end."""
    run = romerr.run(written(folder, text), **options)
    assert run.ending.error is None
    return run


@pytest.fixture(scope="module")
def pendulum(tmp_path_factory):
    """A run of a script of a pendulum, and what attach says of the same scene."""
    run = ran(tmp_path_factory.mktemp("script"), SCENE + SOLVE)
    from models import floating

    scene = floating.pendulum(4, t_end=0.05)
    monitor = romerr.attach(scene.mbs, [romerr.floating_body(scene.fem, scene.items)])
    scene.solve()
    return run, monitor.report()


def test_the_estimate_is_that_of_attach(pendulum):
    """By another core, to what both say of themselves; bounds are attach's."""
    run, report = pendulum
    assert {name for name in report.outputs if not name.endswith("in the frame")} == set(run.reports[0].outputs)
    for name, own in run.reports[0].outputs.items():
        out = report.output(name)
        assert np.array_equal(own.value.shape, out.value.shape)
        np.testing.assert_allclose(own.value, out.value, rtol=0, atol=1e-9 * np.max(np.abs(out.value)))
        off = np.abs(own.estimate - out.estimate).max(axis=0)
        assert np.all(off <= own.uncertainty.max(axis=0) + out.uncertainty.max(axis=0))
    (own,), (mesh,) = (x.at_nodes().estimate.values() for x in (*run.reports[0].bodies, report))
    np.testing.assert_allclose(own, mesh, rtol=0, atol=1e-6 * np.abs(mesh).max())


def test_rows_are_the_parts_of_the_estimate(pendulum):
    run, report = pendulum[0], pendulum[0].reports[0]
    rows = {(row["name"], row["component"]): row for row in run.rows}
    names = [name for name in report.outputs if not name.endswith("in the frame")]
    assert {name for name, _ in rows} == set(names)
    for (name, i), row in rows.items():
        out = report.output(name)
        assert row["modes"]["size"] == np.max(np.abs(out.estimate_parts["basis"][:, i]))
        assert row["step"]["size"] == np.max(np.abs(out.estimate_parts["time step"][:, i]))
        assert row["sum"]["size"] == np.max(np.abs(out.estimate[:, i]))
        most = np.max(np.abs(out.estimate[:, i]) + out.uncertainty[:, i])
        assert row["sum"]["size"] + row["sum"]["half_width"] >= most * (1 - 1e-12)  # rounding of a sum
        most = np.max(out.bound["best"][:, i] + out.round_off[:, i])
        assert row["bound"] == (most if np.isfinite(most) else None)
        assert set(row) >= {*CAUSES, "sum", "solve", "unit", "largest", "order", "noise"}
    assert {name for (name, _), row in rows.items() if row["bound"]} == {"sensor1"}  # the one in the frame


def test_numbers_stand_in_the_text(pendulum):
    text = str(pendulum[0])
    assert re.match(r"(Enough|Too large|Not known)", text)
    assert re.search(r"^Modes: .* at \w+", text, re.M)
    assert re.search(r"^Step: .* at \w+", text, re.M)
    assert re.search(r"^sensor +up to +modes about", text, re.M)
    assert not re.search(r"\d m\b", text)  # nobody knows units that are not given


@pytest.mark.parametrize(
    ("tolerance", "answer"), [("10", Answer.ENOUGH), ("1e-12", Answer.TOO_LARGE), ("sensor1=1e-12", None)]
)
def test_exit_statuses(tolerance, answer, tmp_path, capsys):
    """Too large only where the estimate is resolved; of one sensor the others have no tolerance to miss."""
    clamped = HEAD + "scene = floating.clamped_bar(4, h=2e-4, t_end=0.04)\n"  # its whole error is proved
    script, to = written(tmp_path, clamped + SOLVE), tmp_path / "a.json"
    status = main(["run", "--tolerance", tolerance, "--json", str(to), script])
    told = json.loads(to.read_text())
    given = answer or max((Answer(row["sum"]["answer"]) for row in told["sensors"]), key=list(Answer).index)
    assert told["answer"] == given.value
    assert status == STATUS[given]
    out, what_next = (
        capsys.readouterr().out,
        f"how many modes are enough: romerr tune --tolerance {tolerance} {script}",
    )
    assert "sensor" in out
    assert (what_next in out) == any(row["modes"]["answer"] == "too large" for row in told["sensors"])
    if answer is None:
        answers = {row["name"]: row["sum"]["answer"] for row in told["sensors"] if row["sum"]["answer"] != "enough"}
        assert answers.pop("sensor1") != "no tolerance"
        assert set(answers.values()) == {"no tolerance"}


def test_files_are_written_and_can_be_read(tmp_path, capsys, monkeypatch):
    script = written(tmp_path, SCENE + SOLVE)
    files = {name: str(tmp_path / f"run.{name}") for name in ("npz", "html", "png", "json")}
    options = ["--save", files["npz"], "--html", files["html"], "--plot", files["png"], "--json", files["json"]]
    options += ["--units", "m", "--interfaces", "rigid"]
    assert main(["run", "--tolerance", "1e9", *options, script, "with", "a b"]) == 0
    assert capsys.readouterr().out.count("written: ") == 4
    assert romerr.load_report(files["npz"]).outputs
    page = unescape(Path(files["html"]).read_text(encoding="utf-8"))
    assert "is within its tolerance." in page  # the one that was asked for
    assert re.search(r"\d modes of object 0, in place of [\d,]+ coordinates", page)
    repeats = f"romerr run --html page.html --tolerance \"1e9\" --units m --interfaces rigid {script} with 'a b'"
    assert repeats in page
    assert Path(files["png"]).read_bytes().startswith(b"\x89PNG")
    told = json.loads(Path(files["json"]).read_text(), parse_constant=pytest.fail)  # no NaN, no Infinity
    assert told["bodies"] == 1
    assert told["solves"][0]["kind"] == "dynamic"
    assert math.isfinite(told["cpu_s"])
    validate(told, json.loads((ROOT / "docs" / "answer.schema.json").read_text()))
    assert {row["axis"] for row in told["sensors"]} == {"x", "y", "z"}
    assert all(0 <= row["sum"]["time"] <= 0.05 for row in told["sensors"])


KINDS = {
    "solver object": "solver = exu.MainSolverImplicitSecondOrder()\nscene.mbs.Assemble()\n"
    "assert solver.SolveSystem(scene.mbs, scene.settings)\nassert 'dynamicSolver' not in scene.mbs.sys",
    "solver not stored": "scene.mbs.Assemble()\nscene.mbs.SolveDynamic(scene.settings, storeSolver=False)\n"
    "assert 'dynamicSolver' not in scene.mbs.sys",
    "exu.SolveDynamic": "exu.SolveDynamic(scene.mbs, scene.settings)",
    "exudyn.solver": "from exudyn.solver import SolveDynamic\nSolveDynamic(scene.mbs, scene.settings)",
    "by steps": "solver = exu.MainSolverImplicitSecondOrder()\nscene.mbs.Assemble()\n"
    "solver.InitializeSolver(scene.mbs, scene.settings)\nsolver.SolveSteps(scene.mbs, scene.settings)\n"
    "solver.FinalizeSolver(scene.mbs, scene.settings)",
}


@pytest.mark.parametrize("kind", KINDS)
def test_every_way_to_solve_is_seen(kind, pendulum, tmp_path):
    """The same numbers as by SolveDynamic."""
    run = ran(tmp_path, SCENE + KINDS[kind])
    found, wanted = ([row["sum"]["size"] for row in of.rows] for of in (run, pendulum[0]))
    np.testing.assert_allclose(found, wanted, rtol=1e-4)  # modes are of a solver that begins with random numbers


WAYS = """
import exudyn as exu
from exudyn.FEM import ObjectFFRFreducedOrderInterface
from exudyn.itemInterface import ObjectFFRFreducedOrder, SensorSuperElement
from models import floating
fem, system = floating.load_fem("bar"), exu.SystemContainer()
fem.nodeSets = [{**of, "type": "boundary"} for of in fem.nodeSets if len(of["NodeNumbers"]) > 1]
floating.reduce(fem, 4)
cms, mbs, other = ObjectFFRFreducedOrderInterface(fem), system.AddSystem(), system.AddSystem()
force = lambda mbs, t, i, q, v: cms.UFforceFFRFreducedOrder(exu, mbs, t, q, v)
mass = lambda mbs, t, i, q, v: cms.UFmassFFRFreducedOrder(exu, mbs, t, q, v)
if WAY == "create":
    mbs.CreateFFRFReducedOrderObject("bar", fem, initialAngularVelocity=[0, 9, 0])
else:
    functions = {"UFforce": force, "UFmassMatrix": mass} if WAY == "functions" else {}
    cms.AddObjectFFRFreducedOrderWithUserFunctions(exu, other, initialAngularVelocity=[0, 9, 0], **functions)
    names = vars(ObjectFFRFreducedOrder())
    item = {key: x for key, x in other.GetObject(0).items() if key in names}
    if functions:
        item |= {"forceUserFunction": force, "massMatrixUserFunction": mass}
    for number in (0, 1):
        mbs.AddNode(other.GetNode(number))
    mbs.AddObject(ObjectFFRFreducedOrder(**item))
of = exu.OutputVariableType.Displacement
mbs.AddSensor(SensorSuperElement(bodyNumber=0, meshNodeNumber=6, outputVariableType=of))
mbs.Assemble()
mbs.SolveDynamic(floating.solver_settings(1e-3, 0.02))
"""


def test_every_way_to_make_a_body_is_seen(tmp_path):
    """A bar that spins freely."""
    runs = [romerr.run(written(tmp_path, f"WAY = {way!r}\n{WAYS}")) for way in ("create", "item", "functions")]
    assert [run.ending.error for run in runs] == [None] * 3
    sizes = [[row["sum"]["size"] for row in run.rows] for run in runs]
    assert len(sizes[0]) == 3
    np.testing.assert_allclose(sizes[1:], [sizes[0]] * 2, rtol=1e-4)  # as above


def test_a_body_at_rest_without_sensors_is_said_to_rest(tmp_path):
    way = WAYS.replace("[0, 9, 0]", "[0, 0, 0]").replace("mbs.AddSensor", "print")
    run = ran(tmp_path, f"WAY = 'create'\n{way}")
    assert "nothing moves: outputs chosen for the scene stay at zero" in str(run)


def test_a_static_solve_goes_before(tmp_path):
    text = SCENE.replace("pendulum(4", "clamped_bar(4") + "scene.mbs.Assemble()\n"
    text += "static = exu.SimulationSettings()\nstatic.staticSolver.verboseMode = 0\n"
    text += "scene.mbs.SolveStatic(static, updateInitialValues=True)\nscene.mbs.SolveDynamic(scene.settings)\n"
    run = romerr.run(written(tmp_path, text))
    assert [solve.kind for solve in run.solves] == ["static", "dynamic"]
    assert {row["solve"] for row in run.rows} == {0, 1}
    assert "solve 0 (static):" in str(run)


def test_many_solves_are_a_line_each(tmp_path):
    text = HEAD + "for n in (1, 2, 3, 4, 5):\n    scene = floating.pendulum(n, t_end=0.02)\n    scene.solve()\n"
    run = romerr.run(written(tmp_path, text))
    assert len(run.solves) == 5
    lines = str(run).split("\n")
    first = next(i for i, line in enumerate(lines) if line.startswith("solve "))
    assert [line.split()[0] for line in lines[first : first + 6]] == ["solve", *"01234"]


def test_equal_names_get_the_number_of_the_sensor_and_units_that_are_given_are_printed(tmp_path):
    """Exudyn refuses them where sensors are added, not where they are changed."""
    text = SCENE + "for i in (0, 2):\n    scene.mbs.SetSensorParameter(i, 'name', 'tip')\n" + SOLVE
    run = ran(tmp_path, text, units="mm")
    assert {row["name"] for row in run.rows} == {"tip (sensor 0)", "sensor1", "tip (sensor 2)"}
    assert {row["unit"] for row in run.rows} == {"mm"}
    assert re.search(r"^Step: .* mm (or less )?\(", str(run), re.M)


def test_outputs_are_chosen_where_there_are_no_sensors(tmp_path):
    text = SCENE.replace("scene = ", "add, floating._add_sensors = floating._add_sensors, lambda *a: {}\nscene = ")
    text += "floating._add_sensors = add\n" + SOLVE
    run = romerr.run(written(tmp_path, text))
    names = {row["name"] for row in run.rows}
    assert any("node" in name for name in names)
    assert any("marker" in name for name in names)
    assert "outputs chosen" in str(run)
    assert all(row["modes"]["how"] == "estimated" for row in run.rows)


def test_what_is_refused_says_why_and_what_to_type(tmp_path, monkeypatch, capsys):
    """A body whose FE model is gone; the script runs to its end."""
    monkeypatch.setattr(found_bodies, "fem_of", lambda item: None)
    text = SCENE + SOLVE + "print('the end')\n"
    run = romerr.run(written(tmp_path, text), ["two words", 3])
    assert run.ending.status == 0
    assert {row["sum"]["how"] for row in run.rows} == {"not covered"}
    assert len(run.rows) == 3
    assert capsys.readouterr().out == "the end\n"
    assert "no FEMinterface" in str(run)
    assert f"To measure what is not known: romerr verify {run.script} 'two words' 3" in str(run)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("print(1)", "nothing to tell"),
        ("import exudyn", "nothing to tell"),
        (SCENE, "no solve moves it"),
        (
            "import exudyn as exu\nSC = exu.SystemContainer()\nmbs = SC.AddSystem()\nmbs.Assemble()\n"
            "s = exu.SimulationSettings()\ns.timeIntegration.verboseMode = 0\n"
            "s.timeIntegration.numberOfSteps = 2\ns.solution.file.write = False\nmbs.SolveDynamic(s)",
            NO_BODY.split("{")[0],
        ),
    ],
)
def test_nothing_to_tell_is_told(text, said, tmp_path):
    run = romerr.run(written(tmp_path, text))
    assert run.ending.status == 0, run.ending.error
    assert run.rows == []
    assert said in str(run)


def test_a_solve_that_fails_keeps_what_was_bounded(tmp_path):
    text = (
        SCENE
        + "steps = []\ndef stop(mbs, t):\n    if t > 0.03:\n        raise ValueError('enough')\n    return True\n"
    )
    text += "scene.mbs.SetPreStepUserFunction(stop)\nscene.mbs.Assemble()\nscene.mbs.SolveDynamic(scene.settings)\n"
    run = romerr.run(written(tmp_path, text))
    assert run.ending.status == 1
    assert run.ending.error is not None
    assert 0.025 < run.solves[0].report.t[-1] <= 0.031


def test_scripts_that_attach_themselves_keep_their_monitors(tmp_path):
    text = "import exudyn_romerr as romerr\n" + SCENE
    text += "monitor = romerr.attach(scene.mbs, romerr.floating_body(scene.fem, scene.items))\n" + SOLVE
    text += "assert len(monitor.report().outputs) > 2\n"
    run = ran(tmp_path, text)
    assert "monitors of its own" in str(run)
    assert run.rows[0]["sum"]["how"] == "estimated"


@pytest.mark.parametrize("how", ["at once", "one by one", "with few sensors"])
def test_scripts_that_attach_several_bodies_have_the_answers_of_all(how, tmp_path):
    """Of the second bar nothing was said: a list of sensors was asked for its last, and there was none."""
    text = "import exudyn_romerr as romerr\nfrom models import mechanisms\n"
    text += "scene = mechanisms.double_pendulum(1, h=2e-3, t_end=0.02)\n"
    text += "bars = [romerr.floating_body(scene.fem, bar) for bar in scene.bodies]\n"
    text += {
        "at once": "romerr.attach(scene.mbs, bars)\n",
        "one by one": "for bar in bars:\n    romerr.attach(scene.mbs, bar)\n",
        "with few sensors": "romerr.attach(scene.mbs, bars, outputs=list(scene.sensors.values()))\n",
    }[how]
    run = ran(tmp_path, text + SOLVE)
    shown = {row["name"] for row in run.rows}
    assert {f"sensor{i}" for i in range(8)} <= shown
    assert all(row["sum"]["how"] == "estimated" for row in run.rows if row["name"].startswith("sensor"))


def test_solves_in_other_processes_are_counted(tmp_path):
    text = "import multiprocessing\n" + HEAD
    text += "def work(n):\n    floating.pendulum(n, t_end=0.01).solve()\n"
    text += "if __name__ == '__main__':\n    with multiprocessing.get_context('fork').Pool(2) as pool:\n"
    text += "        pool.map(work, [1, 2, 3])\n"
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-m", "exudyn_romerr", "run", written(tmp_path, text)],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=300,
        check=True,
    )
    assert "3 solves in other processes (2 started) not watched" in done.stdout


def test_nothing_of_ours_stays_in_front_of_exudyn_and_the_mbs_is_freed(tmp_path, pendulum):
    import exudyn as exu

    before = {name: getattr(exu.MainSystem, name) for name in ("AddObject", "Reset", "SolveDynamic")}
    run = ran(tmp_path, SCENE + SOLVE + "import sys, weakref\nsys.kept = weakref.ref(scene.mbs)\n")
    assert {name: getattr(exu.MainSystem, name) for name in before} == before
    gc.collect()
    assert isinstance(sys.kept, weakref.ref)
    assert sys.kept() is None
    assert run.rows
    del sys.kept


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["nowhere.py"], "there is no script 'nowhere.py'"),
        (["."], "is a folder"),
        (["--tolerance", "much", "script.py"], "--tolerance 'much'"),
        (["--tolerance", "1%", "--tolerance", "2%", "script.py"], "twice"),
        (["--json", "no/where.json", "script.py"], "there is no folder"),
        (["--json", "a.txt", "script.py"], "must end in .json"),
    ],
)
def test_wrong_usage_is_one_line(arguments, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    written(tmp_path, "raise SystemExit(9)")
    assert main(["run", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert said in err
    assert err.count("\n") == 1


@pytest.mark.parametrize("quiet", [[], ["--quiet"]])
def test_a_misspelt_sensor_is_wrong_usage(quiet, tmp_path, capsys):
    """Whatever the others say; the answer is printed all the same."""
    script = written(tmp_path, SCENE + SOLVE)
    assert main(["run", "--tolerance", "sensr1=1e9", *quiet, script]) == 2
    out, err = capsys.readouterr()
    assert "--tolerance names 'sensr1', which no sensor is called; did you mean 'sensor1'?" in (err if quiet else out)
    assert ("No tolerance: sensor0, sensor1, sensor2." in out) == (not quiet)
    script = written(tmp_path, SCENE + SOLVE + "raise SystemExit(7)")
    assert main(["run", "--tolerance", "sensr1=1e9", "--quiet", script]) == 7


FAILS = "def fail(mbs, t, load):\n    if t > 0.03:\n        raise ValueError('a user')\n    return [0, 0, 1]\n"
FAILS += "scene.mbs.SetLoadParameter(0, 'loadVectorUserFunction', fail)\nscene.mbs.Assemble()\n"
NEWTON = "newton = scene.settings.timeIntegration.newton\nnewton.maxIterations, newton.relativeTolerance = 1, 1e-30\n"
NEWTON += (
    "newton.absoluteTolerance = 1e-30\nscene.settings.timeIntegration.adaptiveStep = False\nscene.mbs.Assemble()\n"
)
MEANT = "scene.mbs.SetPostStepUserFunction(lambda mbs, t: t < 0.03)\n"
SOLVES = "scene.mbs.SolveDynamic(scene.settings)\n"
TRIED = f"scene.mbs.Assemble()\ntry:\n    {SOLVES}except Exception:\n    pass\n"
PULLED = FAILS.replace("ValueError('a user')", "KeyboardInterrupt")


REJECTED = """import numpy as np
failures = [True] * 12
def force(t):
    return (0.0, np.nan, 0.0) if t > 5.5e-3 and failures and failures.pop() else (0.0, 1e3 * t, 0.0)
scene = floating.pendulum(4, h=1e-3, t_end=0.02, force=force)
integration = scene.settings.timeIntegration
integration.adaptiveStep, integration.minimumStepSize = True, 1e-6
"""


def test_rejected_steps_that_are_halved_are_in_no_estimate(tmp_path):
    """Of 11 bars on springs the step was told 200 times too small, and that as enough."""
    run = ran(tmp_path, HEAD + REJECTED + SOLVE)
    assert {row["sum"]["how"] for row in run.rows} == {"not covered"}
    assert re.search(r"Newton failed \d+ times and Exudyn began the step anew", str(run))


@pytest.mark.parametrize("where", ["sensor_names", "Recorder"])
def test_ctrl_c_before_the_first_step_is_said_first(where, tmp_path, monkeypatch):
    """While a solve is made ready to be watched, which takes a second where it is the first."""

    def interrupted(*of):
        raise KeyboardInterrupt

    monkeypatch.setattr(recorded_solve, where, interrupted)
    run = romerr.run(written(tmp_path, SCENE + "scene.mbs.Assemble()\n" + SOLVES), tolerance="1e9")
    assert str(run).startswith("Until its first step: it was interrupted (Ctrl-C). Not covered by any estimate:")


@pytest.mark.parametrize(
    ("text", "first"),
    [
        (FAILS + SOLVES, "Until 0.029 of 0.05 s: ValueError: a user."),
        (PULLED + SOLVES, "Until 0.029 of 0.05 s: it was interrupted (Ctrl-C)."),
        (
            NEWTON + f"scene.mbs.Assemble()\ntry:\n    {SOLVES}except Exception:\n    pass\n",
            "Until 0 of 0.05 s: the solve failed.",
        ),
        (MEANT + SOLVE, "Until 0.03 of 0.05 s: a user function that returned False stopped it on purpose."),
    ],
)
def test_a_run_that_ended_early_says_when_and_by_what(text, first, tmp_path):
    """Nothing is enough then, unless that end was meant; a saved report says the same."""
    run = romerr.run(written(tmp_path, SCENE + text), tolerance="1e9")
    assert str(run).startswith(first)
    is_meant = "on purpose" in first
    assert (run.judgement.answer is Answer.ENOUGH) == is_meant
    assert len(run.reports) == ("Until 0 " not in first)  # without a step there is nothing to report
    for report in run.reports:
        report.save(tmp_path / "run.npz")
        assert romerr.load_report(tmp_path / "run.npz").ended_by == report.ended_by
        assert ("a user function" in first) == romerr.load_report(tmp_path / "run.npz").on_purpose
    assert "exudyn_romerr" not in str(run.ending.error)  # Exudyn lists frames in what it says


def test_a_script_that_is_no_python_is_told_as_that(tmp_path):
    run = romerr.run(written(tmp_path, "import exudyn\ndef f(:\n"))
    assert run.ending.status == 1
    assert isinstance(run.ending.error, SyntaxError)
    assert str(run).startswith("the script was not run: it is no Python that can be read (SyntaxError: ")


INTERVALS = """scene.mbs.Assemble()
s = scene.settings.timeIntegration
solver, end, count = exu.MainSolverImplicitSecondOrder(), s.endTime, s.numberOfSteps
s.endTime, s.numberOfSteps = end / 5, count // 5
solver.InitializeSolver(scene.mbs, scene.settings)
for k in range(5):
    s.startTime, s.endTime, s.numberOfSteps = k * end / 5, (k + 1) * end / 5, count // 5
    solver.InitializeSolverInitialConditions(scene.mbs, scene.settings)
    solver.SolveSteps(scene.mbs, scene.settings)
    state = scene.mbs.systemData.GetSystemState()
    scene.mbs.systemData.SetSystemState(state, configuration=exu.ConfigurationType.Initial)
solver.FinalizeSolver(scene.mbs, scene.settings)
"""


def test_intervals_of_one_solver_are_one_run(pendulum, tmp_path):
    """The numbers of one solve, to what five restarts of the accelerations change."""
    run = ran(tmp_path, SCENE + INTERVALS)
    (report,) = run.reports
    whole = pendulum[0].reports[0]
    np.testing.assert_allclose(report.t, whole.t, rtol=1e-12)
    for name, out in whole.outputs.items():
        joined = report.output(name)
        np.testing.assert_allclose(joined.value, out.value, rtol=0, atol=0.02 * np.max(np.abs(out.value)))
        assert np.all(np.abs(joined.estimate - out.estimate) <= joined.uncertainty + out.uncertainty)


HUM = """import numpy as np
h = scene.settings.timeIntegration.endTime / scene.settings.timeIntegration.numberOfSteps
def hum(mbs, t, load):
    return [0, 0, HOW_LOUD * np.sin(PARTS * np.pi * t / h) ** 2]
scene.mbs.SetLoadParameter(0, "loadVectorUserFunction", hum)
FINER
"""
FINER = """
scene.settings.timeIntegration.numberOfSteps *= 16
"""


def hummed(folder, parts, loud, finer=""):
    """A run with a load that repeats itself so many times in a step."""
    text = HUM.replace("HOW_LOUD", str(loud)).replace("PARTS", str(parts)).replace("FINER", finer)
    return romerr.run(written(folder, SCENE + text + SOLVE))


@pytest.mark.parametrize("parts", [2, 3, 4])
def test_a_load_that_hums_with_a_part_of_the_step_is_seen(parts, tmp_path):
    """Its mean, 50 N, is in no sample: the answer is that of no load at all; 16 times as many steps tell its error.

    Told as "enough", of the error 1e-5 of what it is, where it was 0 at all that was looked at: middle and quarters.
    """
    run, finer = hummed(tmp_path, parts, 100), hummed(tmp_path, parts, 100, FINER)
    truth = finer.reports[0].outputs
    told = {row["name"]: 0.0 for row in run.rows}
    for row in run.rows:
        step = row["step"]  # without a size it is not known
        most = np.inf if step["size"] is None else step["size"] + step["half_width"]
        told[row["name"]] = max(told[row["name"]], most)
    for name, most in told.items():
        assert most >= np.max(np.abs(truth[name].value[::16] - run.reports[0].output(name).value))
    assert run.judgement.answer is not Answer.ENOUGH


def test_a_static_solve_that_fails_has_nothing_that_is_enough(tmp_path):
    """Velocities are 0 in static solves, whatever the model, but not where there is none."""
    text = """
scene.mbs.Assemble()
static = exu.SimulationSettings()
static.staticSolver.verboseMode, static.staticSolver.numberOfLoadSteps = 0, 4
scene.mbs.SetLoadParameter(0, "loadVectorUserFunction", lambda mbs, t, load: [0, 0, float("nan") if t > 0.6 else t])
scene.mbs.AddSensor(exu.itemInterface.SensorNode(nodeNumber=0, storeInternal=True, name="speed",
                    outputVariableType=exu.OutputVariableType.Velocity))
scene.mbs.Assemble()
try:
    scene.mbs.SolveStatic(static)
except Exception:
    pass
"""
    run = romerr.run(written(tmp_path, SCENE + text), tolerance="1e9")
    assert str(run).startswith("Until load factor 0.")
    assert ": the solve failed." in str(run)
    assert "nough" not in str(run)
    assert run.judgement.answer is not Answer.ENOUGH


AT_HOME = f"import sys\nsys.path.insert(0, {str(ROOT)!r})\n"  # in a process of its own, too
PLAIN = """mbs = exu.SystemContainer().AddSystem()
mbs.CreateMassPoint(referencePosition=[0, 0, 0], mass=1)
mbs.Assemble()
mbs.SolveDynamic(scene.settings)
"""


def test_a_step_that_the_estimate_leaves_open_is_measured(tmp_path, capsys):
    """A tolerance as large as the estimate leaves it open; a solve without bodies before shifts no numbers."""
    scene = SCENE.replace("t_end", "h=1e-4, t_end")  # at ten times the step runs with shorter ones lead nowhere
    plain = ran(tmp_path, scene + SOLVE)
    estimated = max(plain.rows, key=lambda row: row["step"]["size"])
    asked = f"{estimated['name']}={estimated['step']['size']!r}"
    script, to = written(tmp_path, AT_HOME + scene + PLAIN + SOLVE), tmp_path / "a.json"
    main(["run", "--measure-step", "--tolerance", asked, "--json", str(to), script])
    said, told = capsys.readouterr(), json.loads(to.read_text())
    schema = json.loads((ROOT / "docs" / "answer.schema.json").read_text())
    validate(told, schema)
    (row,) = (row for row in told["sensors"] if row["step"]["how"] == "measured")
    assert (row["name"], row["component"]) == (estimated["name"], estimated["component"])
    assert "measured " in said.out
    assert "romerr: quarter: " in said.err
    found, expected = row["step"], estimated["step"]
    assert abs(found["size"] - expected["size"]) <= found["half_width"] + expected["half_width"]
    most = [sum(row[cause]["size"] + row[cause]["half_width"] for cause in CAUSES if row[cause])]
    assert row["sum"]["size"] + row["sum"]["half_width"] == pytest.approx(most[0], rel=1e-9)
    assert row["sum"]["how"] == "estimated"


def test_no_step_is_measured_that_is_known(tmp_path, capsys):
    assert main(["run", "--measure-step", "--tolerance", "1e9", written(tmp_path, SCENE + SOLVE)]) == 0
    assert capsys.readouterr().err == ""


def held_rigidly(n):
    """What the tip of a bar with n modes shows that leave interfaces rigid, (T, 3)."""
    from models import floating

    scene = floating.clamped_bar(n, "RBE2", h=2e-4, t_end=0.02)
    scene.settings.solution.sensors.writePeriod = 0.0
    scene.solve()
    return np.array(scene.mbs.GetSensorStoredData(scene.sensors["tip"]))[:, 1:]


def test_interfaces_that_are_rigid_in_reality_are_no_error(tmp_path):
    """Modes are beside all modes that leave them rigid; of RBE3 modes nothing changes."""
    text = HEAD + "scene = floating.clamped_bar(4, {!r}, h=2e-4, t_end=0.02)\n" + SOLVE
    free, rigid = (ran(tmp_path, text.format("RBE2"), interfaces=one) for one in ("free", "rigid"))
    assert all(row["interfaces"] for row in free.rows)
    assert not any(row["interfaces"] for row in rigid.rows)
    for said in (str(rigid), str(rigid.reports[0])):  # and what is saved of it
        assert "are taken to be so in reality" in said
    truth = np.abs(held_rigidly(60) - held_rigidly(4)).max(axis=0)
    for row, error in zip(rigid.rows, truth, strict=False):  # the tip comes first
        assert abs(row["modes"]["size"] - error) <= row["modes"]["half_width"]
    others = [ran(tmp_path, text.format("RBE3"), interfaces=one).rows for one in ("free", "rigid")]
    for one, other in zip(*others, strict=True):  # Exudyn's eigensolver begins with random numbers
        assert one["modes"]["size"] == pytest.approx(other["modes"]["size"], rel=1e-4)
        assert one["interfaces"] is other["interfaces"] is None


def test_unknown_interfaces_are_refused_before_the_script_runs(tmp_path):
    with pytest.raises(romerr.InputError, match="allowed: 'free', 'rigid'"):
        romerr.run(written(tmp_path, "raise SystemExit(3)"), interfaces="soft")
