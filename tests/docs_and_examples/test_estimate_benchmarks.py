"""The benchmarks of estimates, shortened: they compare with the truth, leave out what they say, and resume."""

import numpy as np
import pytest

from benchmarks import estimates, page, search_estimates, sweep_estimates
from benchmarks.random_mechanisms import drawn
from models.estimate_scenes import SCENES

SEED = 0  # its truth takes a second
H, T = 1e-3, 0.2  # s


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("truths")


@pytest.fixture(scope="module")
def results(folder):
    return sweep_estimates.main([str(folder), "--seed", str(SEED), "--count", "1"])


def test_table_is_put_into_a_page(tmp_path, capsys):
    file = tmp_path / "page.md"
    file.write_text(f"<!-- {estimates.MARK} -->\n```text\nold\n```\n")
    rows = estimates.main(["--only", "driven_bar", "--table", str(file)])
    assert [row.name for row in rows if row.axes == "frame"] == [f"displacement local {c}" for c in "xyz"]
    for row in rows:
        assert row.off * row.error <= row.steps[0] + row.basis[0]  # an estimate of zero would be that far off
        assert str(row) in file.read_text()
    printed = capsys.readouterr().out
    assert page.PAGE != file
    assert "error 1e-07 of the output" in printed.partition("left out:")[2]


def test_ringing_is_what_is_faster():
    t = H * np.arange(round(T / H) + 1)
    slow, fast = np.sin(100 * t)[:, None], 0.1 * np.sin(700 * t)[:, None]
    found = estimates.ringing_of(slow + fast, H, 600.0)
    inside = slice(len(t) // 5, -len(t) // 5)  # at the ends the filter continues the signal somehow
    assert np.abs(found - fast)[inside].max() < 0.01
    assert not estimates.ringing_of(slow + fast, H, np.inf).any()


def test_modes_that_steps_resolve_have_no_slowest_one():
    """The hinged bar: modes of 573 rad/s and more are not resolved with 0.5 ms; all are with 0.125 ms."""
    frequencies = []
    for name in ("hinged_bar", "hinged_bar_fine"):
        scene = SCENES[name]
        made = scene.make(2, "RBE3", scene.h)
        made.mbs.Assemble()
        frequencies.append(estimates.slowest_unresolved(made, scene.h, scene.t_end))
    assert frequencies[0] == pytest.approx(2 / 5e-4 * np.arctan(573 * 5e-4 / 2), rel=1e-2)
    assert frequencies[1] == np.inf


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ((1e-9, 1.0, 0.0, 0.0), "of the output"),
        ((1e-3, 1.0, 1e-4, 0.0), "truth"),
        ((1e-3, 1.0, 0.0, 0.2), "rings"),
        ((1e-3, 1.0, 0.0, 0.0), ""),
    ],
)
def test_what_is_left_out_has_a_reason(values, reason):
    found = estimates.why_not(*values, estimates.RINGING)
    assert reason in found
    assert bool(found) == bool(reason)


def test_sweep_compares_with_a_truth(results):
    (result,) = results
    outputs = {key: out for key, out in result["outputs"].items() if out}
    assert {"tip 1", "middle 1", "tip 1 velocity"} <= outputs.keys()
    for out in outputs.values():
        assert out["error"] > out["floor"] > 0
        assert out["steps"] > 0
        assert 0 < out["inside"] <= out["values"]


def test_sweep_does_not_compute_truths_again(folder, results, monkeypatch, capsys):
    monkeypatch.setattr(sweep_estimates, "truth_of", None)
    assert sweep_estimates.main([str(folder), "--seed", str(SEED), "--count", "1"]) == results
    assert "frames" in capsys.readouterr().out


def test_search_keeps_what_is_off_by_more(folder, results, tmp_path, capsys):
    """One random mechanism, whose truth is stored; one change of it."""
    file = tmp_path / "page.md"
    file.write_text(f"<!-- {search_estimates.MARK} -->\n```text\nold\n```\n")
    arguments = [str(folder), "--seed", str(SEED), "--count", "1", "--rounds", "1", "--table", str(file)]
    worst = search_estimates.main(arguments)
    assert worst.deviation == worst.off / worst.half_width > 0
    assert worst.mechanism.seed == SEED
    table = file.read_text()
    assert str(worst) in table
    assert "components of 1 random mechanisms" in capsys.readouterr().out


def test_changes_are_of_one_feature():
    """Pulses are not shorter than a step, and of many changes all sorts come up."""
    rng, before, names = np.random.default_rng(3), drawn(SEED), set()
    for _ in range(60):
        mechanism, change = search_estimates.changes(before, rng)
        assert mechanism.loads[0].shape.duration >= min(mechanism.h, before.loads[0].shape.duration)
        names.add(change.split()[0])
    assert {"load", "h", "rho", "damping", "gravity"} <= names
