"""How good estimates of the whole error are, basis, time steps, motion of frames: promised shares of the error.

Truths are models/estimate_truths.py: all modes and steps that do not matter. What is compared, and what is left out
and why, says benchmarks/estimates.py, whose rows these are.
"""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks import estimates
from benchmarks.estimates import Row
from exudyn_romerr.linear.estimators.causes import RESOLVED
from exudyn_romerr.report.derived import features_of
from models import estimate_truths
from models.estimate_scenes import SCENES

SMALL = pytest.mark.xfail(
    strict=True,
    reason="middle and tip in the plane, errors of 1e-9 m or 1e-5 of the output: off by up to 24 %, and not resolved",
)
INSIDE = 0.95  # of all instants
MANY = 3.0  # deviations that an uncertainty may be


@cache
def rows(scene: str, n: int) -> tuple[list[Row], list[str]]:
    return estimates.rows_of(scene, n)


def compared(scene: str, n: int, axes: str) -> list[Row]:
    """Rows of the outputs in some axes that bars are for; all of them have an estimate."""
    found, none = rows(scene, n)
    assert axes not in {estimates.axes_of(SCENES[scene], text.split(": ")[1]) for text in none}
    found = [row for row in found if row.axes == axes and (not row.left_out or _only_rings(row))]
    assert found
    return found


def _only_rings(row: Row) -> bool:
    """Of the driven bar all errors ring: by its first bending, whose phase the exact flow follows."""
    return row.scene == "driven_bar" and "rings" in row.left_out


def worst(found: list[Row]) -> float:
    """Largest deviation of an estimate, a share of its bar."""
    return max(row.off / estimates.bar_of(row) for row in found)


@pytest.mark.parametrize(
    ("scene", "axes"),
    [
        ("linear_bar", "frame"),
        ("clamped_bar", "frame"),
        ("clamped_bar", "global"),
        ("driven_bar", "frame"),
        ("driven_bar", "global"),
        ("slider_crank", "frame"),
        ("slider_crank", "global"),
        ("sprung_body", "frame"),
        ("sprung_body", "global"),
        pytest.param("double_pendulum", "frame", marks=SMALL),
        ("double_pendulum", "global"),
        pytest.param("wishbone_fine", "global", marks=pytest.mark.slow),
        ("slider_crank", "rigid"),
        ("slider_crank_fine", "joint"),
        pytest.param("wishbone_fine", "rigid", marks=pytest.mark.slow),
    ],
)
def test_estimate_is_the_error(scene, axes):
    assert worst(compared(scene, SCENES[scene].n[0], axes)) <= 1


def test_forces_along_a_crank_that_begins_to_turn():
    """1e-6 of the force: 9 and 5 % off where accelerations were squared, or what drives the remainder jumped."""
    found = {row.name: row.off for row in compared("slider_crank_fine", 0, "joint")}
    assert all(found[f"{joint} ForceLocal x"] <= 0.03 for joint in ("shaft", "crank pin"))


def test_forces_of_joints_that_ring_are_not_resolved():
    """Those that do not ring are as good as promised, 10 %; steps of the slider crank resolve no mode of its bar.

    One that is 1e-5 of the largest torque is off by more: it says so.
    """
    found = compared("slider_crank", 4, "joint")
    assert not [row.name for row in found if row.resolved and row.off > RESOLVED and row.within < INSIDE]


def test_what_is_off_by_more_than_promised_is_not_resolved():
    """In the frames of the double pendulum; there, and in the rigid one, the error is where the estimate says."""
    found = compared("double_pendulum", 4, "frame")
    assert not [row.name for row in found if row.resolved and row.off > RESOLVED and row.within < INSIDE]
    assert min(row.within for row in found) > INSIDE


def test_sudden_gravity_that_steps_resolve():
    assert worst(compared("hinged_bar_fine", 2, "frame")) <= 1


@pytest.mark.parametrize("n", [2, 8])
def test_sudden_gravity_that_steps_do_not_resolve(n):
    """The estimate says how far it is off: at most twice its uncertainty, which is no excuse."""
    found = [row for row in rows("hinged_bar", n)[0] if row.axes == "frame" and row.share > estimates.ABOVE]
    assert len(found) == 6
    assert min(row.wide for row in found) >= 1 / estimates.TIMES
    assert max(found, key=lambda row: row.error).wide <= MANY  # of small components it is much wider


def test_errors_by_cause_are_what_the_full_model_says():
    """A full run at the same steps tells the basis' part from the time steps'."""
    for scene in ("slider_crank", "sprung_body", "clamped_bar"):
        for row in compared(scene, 4, "frame"):
            for true, found in (row.steps, row.basis):
                assert np.abs(found - true) <= 2 * estimates.bar_of(row) * row.error


@pytest.mark.parametrize(("scene", "share"), [("slider_crank", 0.7), ("sprung_body", 0.9)])
def test_peaks_means_and_last_values(scene, share):
    """Errors of these numbers are within two half widths; forces of joints are resolved last."""
    of, told = SCENES[scene], []
    outputs, *_ = estimates.monitored(of, 4)
    for name, truth in estimate_truths.stored(scene).items():
        out, sizes = outputs[name], np.abs(truth.value - outputs[name].value).max(axis=0)
        report = SimpleNamespace(t=of.h * np.arange(len(out.value)), scope={}, time="sampled")
        found = features_of(report, out)
        true = features_of(report, replace(out, value=truth.value, estimate=None))
        compared = sizes > estimates.ABOVE * np.abs(truth.value).max()
        for feature, full in zip(found.values(), true.values(), strict=True):
            error = (full.value - feature.value)[compared]
            off = np.abs(error - feature.error[compared])
            assert np.all(off <= 2 * feature.half_width[compared] + truth.off[compared])
            told += list(off <= 0.3 * np.abs(error))
    assert np.mean(told) > share  # are told within 30 % of the error
