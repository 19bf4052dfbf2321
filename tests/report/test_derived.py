"""Peak, RMS and value at the end: numbers of a run, the errors of these numbers, and how far they may be off."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from exudyn_romerr.__main__ import main
from exudyn_romerr.report.derived import NAMES, features_of, features_table
from exudyn_romerr.report.scope import FROZEN
from tests.report.made_up import made_up

ROOT = Path(__file__).resolve().parents[2]
T = np.concatenate([np.linspace(0, 1, 101), np.linspace(1, 3, 401)[1:]])  # s; two sizes of steps


def output(y, estimate=None, off=None):
    """A report of one output with two components."""
    report = made_up()
    report.t = T
    out = next(iter(report.outputs.values()))
    none, bound = np.zeros(y.shape), np.full(y.shape, np.inf)
    known = {
        "estimate": estimate,
        "uncertainty": off,
        "estimate_parts": {} if estimate is None else {"basis": estimate},
    }
    known |= {"bound": dict.fromkeys(out.bound, bound), "reduction_bound": {}, "causes": {}, "round_off": none}
    known |= {"corrected": None, "corrected_bound": None, "error": None, "uncertainty_parts": {}}
    report.outputs = {"tip": replace(out, name="tip", labels=("x", "z"), value=y, **known)}
    return report


@pytest.fixture
def known():
    y = np.stack([3 * np.sin(2 * np.pi * T), 0.5 + 0.1 * T], axis=1)
    error = np.stack([0.03 * np.sin(2 * np.pi * T), np.full(len(T), -0.01)], axis=1)
    return y, error, np.full(y.shape, 1e-3)


def test_numbers_and_their_errors(known):
    """A sine of amplitude 3 that is 1 % too small has these features, and 1 % of them is missing."""
    y, error, off = known
    out = output(y, error, off).output("tip")
    np.testing.assert_allclose(out.peak.value, [3.0, 0.8], rtol=1e-12)
    np.testing.assert_allclose(out.peak.error, [0.03, -0.01], rtol=1e-9)
    rms = np.array([3 / np.sqrt(2), np.sqrt(np.mean((0.5 + 0.1 * np.linspace(0, 3, 100001)) ** 2))])
    np.testing.assert_allclose(out.rms.value, rms, rtol=1e-4)  # trapezoids of 1e-2 s
    assert out.rms.error[0] == pytest.approx(0.03 / np.sqrt(2), rel=1e-3)
    np.testing.assert_allclose(out.end.value, y[-1])
    np.testing.assert_allclose(out.end.error, error[-1])
    for name in NAMES:
        np.testing.assert_allclose(getattr(out, name).half_width, 1e-3, rtol=1e-9)


def test_a_shift_in_phase_changes_no_peak(known):
    y, _, off = known
    late = np.sin(2 * np.pi * (T - 0.05))[:, None] * [3, 0] + [[0, 1]] * y
    out = output(y, late - y, off).output("tip")
    assert abs(out.peak.error[0]) < 1e-3 * np.abs(late - y).max()


@pytest.mark.parametrize("seed", range(20))
def test_the_truth_is_within_half_widths(seed):
    """Whatever it is, within those of the output at every instant."""
    rng = np.random.default_rng(seed)
    y, error = rng.normal(size=(2, len(T), 2))
    off = 0.1 * rng.random((len(T), 2))
    truth = y + error + off * rng.choice([-1, 1], off.shape)
    found = features_of(output(y, error, off), output(y, error, off).outputs["tip"])
    true = features_of(output(truth), output(truth).outputs["tip"])
    for name in NAMES:
        missed = np.abs(true[name].value - found[name].value - found[name].error)
        assert np.all(missed <= found[name].half_width * (1 + 1e-12))


def test_table_says_what_is_known(known):
    y, error, off = known
    _, first, second = features_table([output(y, error, off)])
    assert first[0] == "tip x"
    assert first[1].endswith("(+0.03 +- 0.001)")
    assert second[3].endswith("(-0.01 +- 0.001)")
    assert features_table([output(y)])[1][1] == "3 mm (not covered)"
    assert features_table([output(y, error, np.full(y.shape, np.inf))])[1][1] == "3 mm (not known)"
    assert features_table([output(y, error, 10 * off)])[1][1] == "3 mm (0.04 or less)"


def test_what_covers_less_than_the_error_is_not_covered(known):
    """Under the forces of this run, or without the steps."""
    frozen = output(*known)
    frozen.outputs["tip"].estimate_scope = FROZEN
    assert features_table([frozen])[1][1] == "3 mm (not covered)"
    sampled = output(*known)
    sampled.time = "sampled"
    assert features_table([sampled])[1][1] == "3 mm (not covered)"


def test_command_prints_them(capsys):
    assert main(["run", "--features", str(ROOT / "examples" / "hinged_arm.py")]) == 0
    lines = capsys.readouterr().out.splitlines()
    (head,) = (i for i, line in enumerate(lines) if line.startswith("sensor") and "peak (full model" in line)
    assert [line.split("  ")[0] for line in lines[head + 1 : head + 4]] == ["tip x", "tip y", "tip z"]
