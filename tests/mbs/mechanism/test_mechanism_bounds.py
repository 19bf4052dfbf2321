"""Bounds of bodies in mechanisms cover the feedback of joints; truth: the same simulation with all modes, stored.

Full and reduced run have the same integrator and the same steps, which are converged (tests of
models/mechanisms.py): their difference is the reduction error. Outputs are those seen from each bar's frame.
"""

from functools import cache

import numpy as np
import pytest

import exudyn_romerr as romerr
from models import mechanism_truths
from models.mechanism_truths import with_velocities
from tests.helpers import tolerances as tol

SCENES = ("double_pendulum", "slider_crank", "sprung_body")
BASES = [(kind, n) for kind in ("RBE2", "RBE3") for n in (0, 4, 16)]
COUPLED = "coupled (linearised)"
MATTERS = 1e-5  # of the output: smaller errors are not asked to be bounded sharply


def local_sensors(scene, i):
    """Names of the sensors in the frame of bar i."""
    return [name for name in scene.sensors if name.endswith(f" {i} local")]


@cache
def truth(name):
    """Sensor -> values (T, 3), no mode left out."""
    return mechanism_truths.stored(name)


@cache
def bounded(name, kind, n):
    """Reports by bar of the reduced run, and its sensors."""
    scene = with_velocities(name, n, kind)
    monitors = []
    for i, body in enumerate(scene.bodies, start=1):
        for key in local_sensors(scene, i):
            scene.mbs.SetSensorParameter(scene.sensors[key], "name", key)
        monitors.append(
            romerr.attach(
                scene.mbs,
                romerr.floating_body(scene.fem, body),
                outputs=[scene.sensors[key] for key in local_sensors(scene, i)],
            )
        )
    scene.solve()
    return [monitor.report() for monitor in monitors]


def cases(name, kind, n):
    """(output, true error (T, 3)) of all bars."""
    for report in bounded(name, kind, n):
        for key, out in report.outputs.items():
            yield out, truth(name)[key] - out.value


@pytest.mark.parametrize(("kind", "n"), BASES)
@pytest.mark.parametrize("name", SCENES)
def test_error_of_the_mechanism_is_below_its_bounds(name, kind, n):
    """At every time, in and out of the plane of the mechanism, displacements and velocities."""
    bounds = [(out.bound["best"], out, error) for out, error in cases(name, kind, n)]
    for bound, out, error in bounds:
        assert np.all(np.abs(error) <= bound + tol.MECHANISM_NEWTON * np.abs(out.value).max())
    # rigid interfaces leave idle forces; what is below rounding is not resolved
    assert kind == "RBE2" or n == 16 or all(np.isfinite(bound).all() for bound, *_ in bounds)


@pytest.mark.parametrize(("kind", "n"), BASES)
@pytest.mark.parametrize("name", SCENES)
def test_vectors_tell_the_error_and_bound_it_sharply(name, kind, n):
    """Estimate within 2 %, bound within 1.6, wherever the error matters."""
    seen = 0
    for out, error in cases(name, kind, n):
        if out.of == "velocity":
            continue
        size = np.abs(error).max(axis=0)
        matters = size > MATTERS * np.abs(out.value).max()
        known = out.estimate_parts["basis"] + out.estimate_parts["interfaces"]
        assert np.all(np.abs(error - known).max(axis=0)[matters] <= 0.02 * size[matters])
        if np.isfinite(out.bound["best"]).all():
            assert np.all(out.bound["best"].max(axis=0)[matters] <= 1.6 * size[matters])
        seen += matters.sum()
    assert seen > 0 or (name, kind, n) == ("double_pendulum", "RBE3", 16)  # all of its errors are tiny


@pytest.mark.parametrize("name", SCENES)
def test_reports_say_what_is_covered(name):
    """Scope, and that it is of first order, for every body."""
    for report in bounded(name, "RBE3", 4):
        assert report.scope == {"auxiliary": COUPLED}
        assert "to first order" in report.reason("auxiliary")


def test_frozen_inputs_hide_feedback_that_the_coupled_bound_covers():
    """A pendulum that falls at once: in its plane the frozen bound of the reduction error is too small by far."""
    reports = {}
    for scope in ("inputs frozen", COUPLED):
        scene = mechanism_truths.falling(4)
        flex = romerr.floating_body(scene.fem, scene.items)
        local = scene.sensors["tip local"]
        monitor = romerr.attach(scene.mbs, flex, outputs=[local], scope=scope, time="sampled", auxiliary_modes=40)
        scene.solve()
        reports[scope] = monitor.report()
    (frozen,), (coupled,) = (report.outputs.values() for report in reports.values())
    error = np.abs(truth("falling")["tip local"] - coupled.value)
    assert error[:, 2].max() > 2 * frozen.bound["auxiliary"][:, 2].max()
    assert np.all(error <= coupled.bound["best"])


@pytest.mark.parametrize("name", ["double_pendulum", "slider_crank"])
def test_two_levels_bound_the_coarse_run(name):
    """|fine - coarse| + bound of the fine run is above the true error, and near it."""

    def build(n):
        scene = with_velocities(name, n, "RBE3")
        monitors = []
        for i, body in enumerate(scene.bodies, start=1):
            key = f"middle {i} local"
            scene.mbs.SetSensorParameter(scene.sensors[key], "name", key)
            flex = romerr.floating_body(scene.fem, body)
            monitors.append(romerr.attach(scene.mbs, flex, outputs=[scene.sensors[key]]))
        return scene.mbs, monitors, scene.settings

    levels = romerr.two_level(build, 0, 4)
    assert levels.scope == COUPLED
    assert str(levels).count("from the finer run, reduction error, to first order, at most") == len(levels.outputs)
    for key, out in levels.outputs.items():
        error = np.abs(truth(name)[key] - out.value)
        assert np.all(error <= out.bound + tol.MECHANISM_NEWTON * np.abs(out.value).max())
        assert out.bound.max() <= 1.5 * error.max()
