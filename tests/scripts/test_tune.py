"""romerr tune: forecasts against runs, pairs found against all pairs, and what is said where none is enough."""

import json
import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import exudyn_romerr as romerr
from exudyn_romerr.__main__ import main
from exudyn_romerr.errors import InputError, RunError
from exudyn_romerr.mode_selection.modal_content import Content
from exudyn_romerr.mode_selection.pairs import Pair, PairRun, PairSearch
from exudyn_romerr.mode_selection.search import cheapest, search
from exudyn_romerr.report.answers import Answer, Limit
from exudyn_romerr.report.verdicts import Row, judge, not_covered
from exudyn_romerr.scripts import tune as tune_module
from exudyn_romerr.scripts.child_run import Request, Result, run_child

ROOT = Path(__file__).resolve().parents[2]
CRANK = f"""
import sys
sys.path.insert(1, {str(ROOT)!r})
from models import mechanisms
scene = mechanisms.slider_crank(4, h=2.5e-4, t_end=0.03)
scene.mbs.Assemble()
scene.mbs.SolveDynamic(scene.settings)
"""
N, COUNT = 4, 240  # of the script that stands for others
TAKEN = [300.0, 0.0, 80.0, 20.0, 0.0, 6.0, 3.0, 0.0, 0.4] + [0.1] * 20  # of the tolerance, in %, by each mode


@pytest.fixture(scope="module")
def crank(tmp_path_factory):
    path = tmp_path_factory.mktemp("crank") / "script.py"
    path.write_text(CRANK)
    return str(path)


def ran(path, **options):
    return run_child(Request("a run", path, str(ROOT), timeout=300, **options))


@pytest.fixture(scope="module")
def watched(crank):
    return ran(crank, watch=True, further=4)


def changes_and_forecasts(crank, watched, n):
    """What a run with n modes changes of each sensor, and what the watched one with N of them forecasts."""
    other = ran(crank, numbers=(n,))
    for j, name in enumerate(watched.solves[0]["names"]):
        parts = watched.contents[0, name].parts[0]
        forecast = parts[N:n].sum(0) if n > N else -parts[n:N].sum(0)
        yield other.solves[0]["data"][j][:, 1:] - watched.solves[0]["data"][j][:, 1:], forecast


@pytest.mark.parametrize("n", [5, 8])
def test_forecast_of_more_modes_is_what_their_run_shows(crank, watched, n):
    """To 0.1 %: modes with fixed interfaces are orthogonal to vectors, which move none."""
    for changes, forecast in changes_and_forecasts(crank, watched, n):
        assert forecast.shape == changes.shape
        assert np.abs(forecast - changes).max() < 0.01 * np.abs(changes).max()


def test_forecast_of_fewer_modes_is_of_the_size_that_their_run_shows(crank, watched):
    """To a factor of 2: how static modes answer one that goes is left out."""
    for changes, forecast in changes_and_forecasts(crank, watched, 2):
        assert 1 / 3 < np.abs(forecast).max() / np.abs(changes).max() < 3


def test_modes_beyond_those_of_the_call_change_no_run(crank, watched):
    """The script's own call is made last: sensors agree as two runs of a sparse eigenvalue solver do."""
    for one, other in zip(ran(crank).solves[0]["data"], watched.solves[0]["data"], strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-7 * np.abs(one).max())


def test_pair_found_is_within_the_tolerance_by_the_truth(crank):
    """Truth: 16 modes, Richardson from h/4 and h/8."""
    tuned = romerr.tune(crank, tolerance="2%")
    assert tuned.answer.value == "enough"
    assert len(tuned.runs) <= tune_module.RUNS
    pair = tuned.found.pair
    coarse, fine = (ran(crank, numbers=(16,), steps=k).solves[0] for k in (4, 8))
    own = ran(crank, numbers=pair.numbers, steps=pair.steps / 120).solves[0]
    for j in range(len(own["names"])):
        at, now = fine["data"][j][:, 0], own["data"][j]
        truth = fine["data"][j][:, 1:].copy()
        truth[::2] += (truth[::2] - coarse["data"][j][:, 1:]) / 3
        seen = np.array([np.interp(now[:, 0], at[::2], y) for y in truth[::2].T]).T  # straight lines: 1e-4 of it
        assert np.abs(now[:, 1:] - seen).max() <= 0.02 * np.abs(truth).max()


def row_of(**sizes):
    """A row of errors in % of its tolerance."""
    of = {cause: judge(size, 0.02 * size, 100.0, "estimated") for cause, size in sizes.items()}
    return Row("tip", 0, 0, "", 1e4, 1e4, of, Limit(100.0, True), "tip y", "y")


def stand_in(rigid=1.0, step=30.0, covered=True, order=2, failing=(), wave=1.0):
    """Stands for run_child: errors in % of the tolerance: by modes TAKEN, by steps of a given order."""

    def run(request):
        n = request.numbers[0] if request.numbers else N
        if n in failing:
            return Result("a run", "it breaks")
        times = float(request.steps)
        modes, of_steps = sum(TAKEN[n:]), step / times**order
        row = row_of(modes=modes, interfaces=rigid, step=of_steps, sum=modes + rigid + of_steps)
        if not covered:
            row = replace(row, of=dict.fromkeys(row.of, not_covered("it has a controller")))
        count = n + request.further
        parts = np.array(TAKEN[:count]).reshape(-1, 1, 1)
        contents = (
            {(0, "tip"): Content(np.array([[modes]]), {0: parts}, np.array([[of_steps]]), np.array([[rigid]]))}
            if request.further and covered
            else {}
        )
        call = {"file": "a.py", "line": 3, "call": "ComputeHurtyCraigBamptonModes", "argument": "nEigenModes"}
        facts = {"rows": [row], "calls": [call | {"number": N}], "modes": [6 + n], "status": 0, "our_seconds": 1.0}
        facts |= {"solve_seconds": 1.0 + COUNT * times * (6 + n) / 1000, "seconds": 3.0}
        t = np.linspace(0, 1, COUNT + 1)
        data = np.stack([t, 1e4 * np.cos(wave * t)], axis=1)  # what is shown between steps, too
        solve = {
            "kind": "dynamic",
            "count": COUNT,
            "fixed": True,
            "has_bodies": True,
            "names": ["tip"],
            "data": [data],
        }
        return Result("a run", solves=[solve], facts=facts, contents=contents)

    return run


def best_of_all(rigid, step, order=2):
    """The cheapest pair of all, time (6 + n) steps."""
    found = []
    for n in range(1, 20):
        left = 100 / 1.02 - rigid - sum(TAKEN[n:])
        if left > 0:
            found.append(((6 + n) * COUNT * (step / left) ** (1 / order), n, COUNT * (step / left) ** (1 / order)))
    return min(found)


@pytest.fixture
def fake(monkeypatch, tmp_path):
    path = tmp_path / "a.py"
    path.write_text("")

    def tuned(tolerance="1%", only=None, **options):
        monkeypatch.setattr(tune_module, "run_child", stand_in(**options))
        return romerr.tune(str(path), tolerance=tolerance, only=only)

    return tuned


@pytest.mark.parametrize(("step", "order"), [(30.0, 2), (1.0, 2), (800.0, 2), (300.0, 1)])
def test_finds_the_cheapest_of_all_pairs(fake, step, order):
    """As many modes or one more or, where that takes alike, one fewer; no pair cheaper by half, steps within 1.5."""
    tuned = fake(step=step, order=order)
    seconds, n, steps = best_of_all(1.0, step, order)
    (found,), count = tuned.found.pair
    assert tuned.answer.value == "enough"
    assert n - 1 <= found <= n + 1
    assert steps <= count <= 1.5 * steps
    assert tuned.found.seconds <= 1.5 * seconds / 1000
    assert len(tuned.runs) <= tune_module.RUNS
    said = str(tuned)
    assert f"a.py, line 3: ComputeHurtyCraigBamptonModes(..., nEigenModes={found})  # 4" in said or found == N
    assert f"numberOfSteps = {count}  # 240" in said
    assert {line["how"] for line in tuned.table} == {"run", "forecast"}
    assert [line["cpu_s"] for line in tuned.table] == sorted(line["cpu_s"] for line in tuned.table)


def test_steps_show_what_is_between_them(fake):
    """A cosine of 40 rad/s between samples h apart: (40 h)^4 / 384 of it is what a cubic spline is off inside."""
    tuned = fake(step=0.1, wave=40.0)
    steps = tuned.found.pair.steps
    assert 25 <= steps <= 60  # 1 %: (40 / 28.6)^4 / 384; ends are further off, strides are whole numbers
    assert fake(step=0.1).found.pair.steps < 25


def test_one_of_both_may_be_kept(fake):
    assert {run.pair.steps for run in fake(only="modes").runs} == {COUNT}
    tuned = fake(only="step", step=800.0)
    assert tuned.found is None or {run.pair.numbers for run in tuned.runs} == {(N,)}
    with pytest.raises(InputError, match="only='both'"):
        fake(only="both")


def test_rigid_interfaces_are_not_cured_by_more_modes(fake):
    tuned = fake(rigid=150.0)
    assert (tuned.found, tuned.status) == (None, 3)
    assert str(tuned).startswith("Too large: no pair was found that is enough.")
    assert "RBE3" in str(tuned)


def test_what_is_not_covered_is_left_to_verify(fake):
    tuned = fake(covered=False)
    assert (len(tuned.runs), tuned.found, tuned.status) == (1, None, 4)
    assert str(tuned).startswith("Not covered: it has a controller; romerr verify ")
    assert json.loads(json.dumps(tuned.as_json(), allow_nan=False))["answer"] == "not covered"


def test_a_run_that_fails_costs_nothing_that_was_found(fake):
    tuned = fake(step=1.0, failing=(3,))
    assert tuned.found.is_enough
    assert "it breaks" in tuned.failed
    assert "not tried further, for a run failed: [3] modes" in str(tuned).replace("(3,)", "[3]")
    with pytest.raises(RunError, match="it breaks"):
        fake(failing=(N,))


def test_names_that_no_sensor_has_are_wrong_usage(fake):
    tuned = fake(tolerance=["1%", "tp=1%"])
    assert tuned.status == 2
    assert "did you mean 'tip'?" in str(tuned)


def test_command_line_writes_table_and_picture(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(tune_module, "run_child", stand_in())
    path = tmp_path / "a.py"
    path.write_text("")
    files = [str(tmp_path / name) for name in ("a.json", "a.png")]
    assert main(["tune", "--tolerance", "1%", "--json", files[0], "--plot", files[1], str(path)]) == 0
    told = capsys.readouterr()
    assert "Enough, by its run: " in told.out
    assert "4 modes, 240 steps: " in told.err
    saved = json.loads(Path(files[0]).read_text())
    assert saved["found"] == {"numbers": saved["found"]["numbers"], "steps": saved["found"]["steps"]}
    assert Path(files[1]).stat().st_size > 1000


def test_search_prefers_likely_to_unknown():
    """A bound within its tolerance beside an estimate that does not tell: the run whose error is likely within."""
    of = [SimpleNamespace(is_enough=True, is_likely=x, cost=c) for x, c in ((False, 1), (True, 3), (True, 2))]
    assert cheapest(of) is of[2]
    assert cheapest(of[:1]) is of[0]
    assert cheapest([]) is None


def test_search_keeps_what_was_enough_before_an_error():
    def run(n):
        if n == 3:
            raise ValueError("mine")
        return SimpleNamespace(is_enough=n == 2, is_likely=n == 2, cost=n)

    following = iter([2, 3, 4])
    tried, failed = search(run, [1], lambda runs: next(following), 9)
    assert [one.cost for one in tried] == [1, 2]
    assert (failed[0], str(failed[1])) == (3, "mine")
    with pytest.raises(ValueError, match="mine"):
        search(run, [1], lambda runs: 3, 9)
    assert len(search(run, [2], lambda runs: 2, 4)[0]) == 4


def test_causes_that_cancel_each_other_are_not_enough():
    """A beam was "enough" with twice the tolerance of either sign; with finer steps it was 8 times as wrong."""
    row = row_of(modes=240.0, step=250.0, sum=10.0)
    content = Content(np.array([[240.0]]), {0: np.array([[[30.0]]])}, np.array([[-250.0]]), np.zeros((1, 1)))
    run = PairRun(Pair((1,), 100), [row], {(0, "tip"): content}, 1.0)
    assert run.answer is Answer.TOO_LARGE
    assert not run.is_enough
    assert run.worst.ratio == pytest.approx(2.55)  # of the step with its half width
    assert run.expected(run.pair, 2.0).ratio == pytest.approx(2.55)
    assert not math.isfinite(run.steps_for((1,), 2.0))  # no step cures modes


def test_time_grows_with_modes_as_runs_show():
    """Seconds of n^2 a step, of two runs: the third is theirs."""
    runs = [SimpleNamespace(pair=Pair((n,), 100), seconds=(2 + n) ** 2.0) for n in (4, 10)]
    assert PairSearch(static=2).seconds(Pair((6,), 200), runs) == pytest.approx(2 * 8**2)
    assert math.isclose(PairSearch(static=2).seconds(Pair((10,), 100), runs), 144)
