"""The benchmarks of estimates, shortened: they compare with the truth, leave out what they say, and resume."""

import re

import numpy as np
import pytest

from benchmarks import estimates, page
from models.estimate_scenes import SCENES

H, T = 1e-3, 0.2  # s


def test_table_is_put_into_a_page(tmp_path, capsys):
    file = tmp_path / "page.md"
    file.write_text(f"<!-- {estimates.MARK} -->\n```text\nold\n```\n")
    rows = estimates.main(["--only", "driven_bar", "--table", str(file)])
    assert [row.name for row in rows if row.axes == "frame"] == [f"displacement local {c}" for c in "xyz"]
    for row in rows:
        assert row.off * row.error <= row.steps[0] + row.basis[0]  # an estimate of zero would be that far off
    printed = capsys.readouterr().out
    assert all(str(row) in printed for row in rows)
    assert estimates.summary(rows) in file.read_text()
    assert re.search(
        r"(?m)^driven_bar, n = 4 +0 +6$", file.read_text()
    )  # nothing is left to compare: all of it rings
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
