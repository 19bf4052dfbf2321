"""The benchmarks, shortened: they run and count what they say. No speed is asserted: machines differ."""

import os
import resource

import numpy as np
import pytest

from benchmarks import (
    against_rival,
    bounds,
    child,
    estimates,
    floating_cost,
    growth,
    half_widths,
    kernel_offline,
    large_bodies,
    offline,
    online_linkage,
    page,
    pairs,
    question,
    question_scenes,
    short_runs,
    speed,
    speed_figure,
    tune,
)
from models import floating


def test_online_linkage_measures_every_variant(capsys):
    variants, times = online_linkage.main(["--end", "0.05", "--pairs", "2"])
    assert times.shape == (2, 6)
    assert np.all(times > 0)
    assert [rows.shape for rows in variants[2].rows] == [(51, 13)] * 3
    assert len(variants[-1].report.t) == 51
    printed = capsys.readouterr().out
    for variant in variants:
        assert variant.label in printed
    assert printed.count("promised at most") == 2


def test_online_linkage_variants_simulate_the_same():
    end = 0.02
    states = []
    for kind in online_linkage.VARIANTS:
        variant = kind(end)
        variant.seconds()
        states.append(variant.mbs.systemData.GetODE2Coordinates())
    np.testing.assert_array_equal(states[1:], states[:1] * 5)


@pytest.mark.slow
def test_kernel_offline_tells_what_is_counted(capsys):
    exponential, kernels = kernel_offline.main(["--instants", "1"])
    printed = capsys.readouterr().out
    assert "omega_1 included" in printed
    assert "omega_1 not included" in printed
    assert exponential > kernels["certified"][0] > kernels["certified, omega_1 known"][0] > 0


def test_large_bodies_measures_every_task(capsys):
    tasks = ["factor", "attach", "Craig-Bampton"]
    (found,) = large_bodies.main(["--coordinates", "600", "--only", "superlu", "--tasks", *tasks])
    assert found["N"] == 3 * 12 * 16
    assert [large_bodies.measured("superlu", 600, (task,))["N"] for task in tasks[1:]] == [found["N"]] * 2
    assert found["attach, MB"] > found["before, MB"] > found["MB"] >= 0
    assert all(found[name] > 0 for name in large_bodies.FIGURES if "MB" not in name)
    threads, _, row = capsys.readouterr().out.splitlines()[:3]
    assert threads.startswith("OPENBLAS_NUM_THREADS=")
    assert row.split()[:2] == ["superlu", "576"]


def test_floating_cost_measures_every_variant(capsys):
    variants, times = floating_cost.main(["--steps", "50", "--pairs", "2"])
    assert times.shape == (2, 3)
    assert np.all(times > 0)
    assert [len(variant.report.t) for variant in variants[1:]] == [51, 51]
    assert [variant.report.time for variant in variants[1:]] == ["sampled", "reconstructed"]
    printed = capsys.readouterr().out
    for variant in variants:
        assert variant.label in printed
    assert printed.count("promised at most") == 2


def test_floating_cost_variants_simulate_the_same():
    tips = []
    for kind in (floating_cost.Bare, floating_cost.Sampled, floating_cost.Reconstructed):
        variant = kind(20, 1e-3)
        variant.seconds()
        tips.append(variant.scene.mbs.GetSensorValues(variant.scene.sensors["tip"]))
    # Exudyn's eigenmodes start from random numbers: they differ by sign and rounding
    np.testing.assert_allclose(tips[1:], tips[:1] * 2, atol=1e-9 * np.max(np.abs(tips[0])))


def test_floating_cost_of_a_mesh_counts_every_step(capsys):
    """On a stored mesh: the benchmark itself makes them with ngsolve."""
    mesh = floating_cost.reduced(floating.load_fem("bar"))
    costs = floating_cost.measure_meshes([mesh], steps=40, rounds=2, h=1e-3)
    assert costs.shape == (2, 1, 3)
    assert len(mesh.spent) == 41
    assert len(mesh.monitor.report().t) == 41
    simulation, extra, storing = costs[0, 0]
    assert simulation > 0
    assert extra > storing > 0
    floating_cost.print_meshes([mesh], costs)
    assert capsys.readouterr().out.count("largest over smallest mesh 1.000") == 2


def test_forked_runs_begin_where_they_were_forked():
    """Each anew, from the process before or after it was changed."""
    count = [0]

    def counted():
        count[0] += 1
        return count[0]

    before = short_runs.Forks(counted)
    count[0] = 10
    assert [before.next(), short_runs.forked(counted), before.next(), short_runs.forked(counted)] == [1, 11, 1, 11]
    before.end()
    assert count == [10]


def test_forked_runs_copy_no_memory():
    memory, page = bytearray(b"1") * 4_000_000, os.sysconf("SC_PAGE_SIZE")

    def written():
        before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
        memory[::page] = bytes(len(memory[::page]))
        return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

    assert short_runs.forked(written) < len(memory) / page / 10  # a fault for each page, where it is copied now


@pytest.mark.slow
def test_short_run_is_the_first_solve_of_its_process(capsys):
    found = short_runs.main(["--pairs", "1"])
    bare, ours = found[short_runs.CRANK]
    assert ours.variant.limit == short_runs.LIMIT
    assert bare.middle == 1 < ours.middle
    assert "before the solve" in capsys.readouterr().out


def test_ratios_are_taken_pair_by_pair():
    variants = [online_linkage.Bare(0.01), online_linkage.Bounds(0.01)]
    slow_machine = np.array([[1.0, 1.5], [10.0, 20.0], [2.0, 5.0]])
    first, second = pairs.ratios(variants, slow_machine)
    assert first[2:] == (1, 1, 1)
    assert second[2:] == (1.75, 2.0, 2.25)
    np.testing.assert_allclose(pairs.added(variants, slow_machine), [0, 3e6 / 10])
    assert [pairs.kept(2.0, 2.0), pairs.kept(2.1, 2.0)] == ["kept", "NOT KEPT"]


def test_growth_measures_modes_outputs_and_steps(monkeypatch):
    """Every variant is solved; times are given, for those of a machine tell nothing."""
    solved = []

    def measure(variants, rounds):
        assert min(variant.seconds() for variant in variants) > 0
        solved.extend(variants)
        return np.array(rounds * [[1.0, 3.0, 8.0]])

    monkeypatch.setattr(pairs, "measure", measure)
    assert growth.online(6, 2, steps=20, rounds=1) == pytest.approx((1e6 / 20, 2e6 / 20, 7e6 / 20))
    bare, *bounded = solved
    assert bare.finish() is None
    for variant, options in zip(bounded, (growth.PAPER, growth.SHARP), strict=True):
        report = variant.finish()
        assert len(report.t) == 20 + 1
        assert len(report.outputs) == 2
        for out in report.outputs.values():
            assert set(out.bound) - {"best"} == set(options["estimators"])


@pytest.mark.slow
def test_growth_runs_a_mesh_and_long_runs_in_processes_of_their_own():
    told = child.child(growth.__file__, "mesh", "1113")
    assert told["N"] == 1113
    assert min(told[name] for name in ("body", "modes", "attach", "memory")) > 0
    steps = {
        20: {kind: child.child(growth.__file__, "steps", kind, "20") for kind in ("Bare", "Bounds", "SharpBounds")}
    }
    found = growth.Growth(
        {6: (1.0, 2.0, 3.0)}, {1: (1.0, 2.0, 3.0)}, {100: (1.0, 2.0, 3.0)}, [{"asked": 1113, **told}], steps
    )
    printed = growth.text(found)
    for words in ("n = 6", "1 outputs", "100 steps", "    1113", "resident MB"):
        assert words in printed
    assert [promise.issue for promise in speed.growth_promises(found)] == [20, 20]


def test_a_child_that_does_not_end_is_ended(monkeypatch):
    monkeypatch.setattr(child, "LIMITS", (0.5, 8.0))
    told = child.child(growth.__file__, "steps", "SharpBounds", "10000000")
    assert told == {"ended": "not done within 0.5 s"}


def test_a_child_without_memory_says_so(monkeypatch):
    monkeypatch.setattr(child, "LIMITS", (60.0, 0.05))
    assert child.child(growth.__file__, "mesh", "1113")["ended"]


@pytest.mark.slow
def test_offline_phases_add_up(capsys):
    (found,) = offline.main(["--quick"])
    assert found.dof == 3 * 1123
    assert set(found.phases) == {*offline.PHASES, "all else"}
    assert min(found.phases.values()) > 0
    assert sum(found.phases.values()) == pytest.approx(found.total)
    assert "in all / Craig-Bampton" in capsys.readouterr().out
    (promise,) = speed.offline_promises([found, found._replace(name="frozen")])
    assert promise.found == found.total / found.craig_bampton


@pytest.mark.slow
def test_speed_prints_every_scene_and_limit(capsys, tmp_path, monkeypatch):
    few = [scene._replace(steps=(20, 20)) for scene in speed.SCENES]
    monkeypatch.setattr(speed, "SCENES", few)
    tables, promises = speed.main(["--quick", "--only", "ratios", "promises"])
    assert list(tables) == ["ratios", "promises"]
    printed = capsys.readouterr().out
    for scene in few:
        assert scene.title in printed
    assert [promise.issue for promise in promises] == sorted(promise.issue for promise in promises)
    assert {promise.issue for promise in promises} == {2, 20}
    # linkage 2, complete 2, frozen 2, mechanisms 2 each, a short run
    assert sum(promise.issue == 20 for promise in promises) == 13
    assert promises[0].verdict in ("kept", "NOT KEPT")


def test_speed_figure_is_drawn(tmp_path):
    bare, bounded = online_linkage.Bare(0.01), online_linkage.Bounds(0.01)
    ratios = {"linkage": [pairs.Ratio(bare, 5.0, 1.0, 1.0, 1.0), pairs.Ratio(bounded, 9.0, 1.7, 1.8, 1.9)]}
    rows, size = {6: (1.0, 2.0, 3.0), 12: (2.0, 3.0, 4.0)}, {"N": 1113, "body": 0.1, "modes": 0.2, "attach": 0.3}
    speed_figure.draw(ratios, growth.Growth(rows, rows, rows, [size], {}), tmp_path / "speed.png")
    assert (tmp_path / "speed.png").stat().st_size > 10_000


def test_a_table_replaces_the_one_on_the_page(tmp_path):
    copy = tmp_path / "measured.md"
    copy.write_text(page.PAGE.read_text(encoding="utf-8"), encoding="utf-8")
    marks = ["ratios", "question", "estimators", "examples", "rivals"]
    marks += [script.MARK for script in (against_rival, bounds, estimates, half_widths)]
    for name in marks:
        page.put(name, f"new {name}\\1", copy)
    text = copy.read_text(encoding="utf-8")
    assert all(text.count(f"```text\nnew {name}\\1\n```") == 1 for name in marks)
    with pytest.raises(ValueError, match="no code block"):
        page.put("another", "", copy)
    copy.write_text("<!-- new -->\n```text\n```\n\n## Next\n\n```text\nold\n```\n", encoding="utf-8")
    page.put("new", "table", copy)  # an empty block took the next section with it
    assert copy.read_text(encoding="utf-8").endswith("```text\ntable\n```\n\n## Next\n\n```text\nold\n```\n")


def test_question_knows_claims_from_true_errors(tmp_path, capsys, monkeypatch):
    short = question_scenes.tip(0.05)
    monkeypatch.setattr(question, "tip", lambda end: short._replace(repeats=1, share=5e-4))
    (table,) = question.main([str(tmp_path), "--quick", "--only", "tip"])
    ways = {
        way: [answer for answer in table.answers if answer.way == way]
        for way in ("with bounds", "compared", "full order")
    }
    assert [len(answers) for answers in ways.values()] == [3, 3, 2]
    for answer in ways["with bounds"]:  # total error, scope complete
        assert answer.error <= answer.claim
    # both runs have the same time steps, which a difference cannot see
    assert ways["compared"][1].claim < 0.1 * ways["compared"][1].error
    assert "WRONG" in capsys.readouterr().out
    assert (tmp_path / "speed_question.png").stat().st_size > 10_000


@pytest.mark.slow
@pytest.mark.parametrize("make", [question_scenes.rod, question_scenes.ball_joint])
def test_question_runs_a_scene_with_bounds_and_without_alike(make):
    asked = make(0.0025)
    n, h = asked.bounded[0]
    bare, bounded = asked.run(n, h, False), asked.run(n, h, True)
    np.testing.assert_allclose(bare.t, bounded.t, atol=1e-12)
    # eigenmodes start from random numbers, and both runs end within the solver's tolerance
    np.testing.assert_allclose(bare.y, bounded.y, atol=1e-6 * np.max(np.abs(bounded.y)))
    assert np.max(np.abs(asked.truth(bare) - bare.y)) <= bounded.bound


@pytest.mark.slow
def test_a_full_order_step_is_not_waited_for():
    assert "over 1 s" in question.full_order(1.0)


@pytest.mark.parametrize(
    ("way", "claim", "error", "words"),
    [
        ("with bounds", 0.9, 0.8, "says yes; it is"),
        ("with bounds", 1.1, 0.8, "says no; it is"),
        ("with bounds", 0.9, 1.1, "BOUND TOO LOW"),
        ("compared", 0.1, 1.1, "says yes; it is not: WRONG"),
        ("compared", 2.0, 1.1, "says no; it is not"),
        ("full order", None, 1.1, "claims nothing; it is not"),
        ("full order", None, None, "claims nothing"),
    ],
)
def test_verdicts_of_a_question(way, claim, error, words):
    assert question.verdict(question.Answer(way, "", 1.0, 1.0, claim, error), within=1.0) == words


@pytest.mark.slow
def test_tune_is_compared_with_a_scan(capsys):
    """Two numbers of modes and two steps: what the scan knows is within the tolerance is what tune says."""
    ((runs, _, tuned, true),) = tune.main(["--short", "--cases", "1"])
    assert [(run.modes, run.steps) for run in runs] == [(1, 100), (1, 200), (2, 100), (2, 200)]
    assert all(np.isfinite(run.ratio) and run.ratio > 0 for run in runs)
    assert (tuned.answer.value == "enough") == (true <= 1)
    assert "% of that" in capsys.readouterr().out
