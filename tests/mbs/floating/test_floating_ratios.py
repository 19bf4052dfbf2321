"""Floating bodies damped by ratios of their full modes, and not above: errors, bounds, estimates in every scope.

Truths know the ratios only: the clamped bar in closed form, the full body under frozen inputs, and for the feedback
of a hinge the complete basis in Exudyn with a diagonal damping matrix.
"""

from dataclasses import replace
from functools import cache

import exudyn as exu
import numpy as np
import pytest

import exudyn_romerr as romerr
from models import floating
from tests.helpers import tolerances as tol
from tests.mbs.floating.test_floating_bounds import (
    assert_covered,
    attached_to,
    clamped_motion,
    frozen_motion,
    full_body,
    recorded,
)

RATIOS = [0.02, 0.03, 0.1, 0.05]
STEP, END = 1e-4, 0.02  # s
HINGED_STEP, HINGED_END = 5e-5, 0.006  # s: two runs with the same steps, whose errors by steps are about the same
CASES = [("RBE2", 2), ("RBE3", 0), ("RBE3", 4)]


@cache
def damped_body():
    body = full_body("bar")
    zeta = np.zeros(len(body.omega))
    zeta[: len(RATIOS)] = RATIOS
    return replace(body, zeta=zeta)


def damped_scene(make, n, kind, h, end):
    return make(n, kind, h=h, t_end=end, damping=(0.0, 0.0))


# scope "complete"


@cache
def clamped(kind, n):
    """Report of the clamped bar, and the exact motion (T, nodes, 3)."""
    scene, body = damped_scene(floating.clamped_bar, n, kind, STEP, END), damped_body()
    monitor = attached_to(scene, body, RATIOS, auxiliary_modes=40)
    scene.solve()
    report = monitor.report()
    return report, clamped_motion(body.P, report.t, body.zeta).reshape(len(report.t), -1, 3)


@pytest.mark.parametrize(("kind", "n"), CASES)
def test_total_errors_are_covered_and_estimated(kind, n):
    """By both bounds; the estimate within its half width of the error, and the bound sharp."""
    report, truth = clamped(kind, n)
    assert set(report.scope.values()) == {"complete"}
    assert not report.messages
    for name, node in full_body("bar").probes.items():
        out, own = report.output(f"{name} body"), truth[:, node]
        size = np.max(np.abs(own))
        for e in ("energy", "auxiliary"):
            assert_covered(np.abs(own - out.value), out.bound[e], size)
        assert_covered(np.abs(own - out.value - out.estimate), out.uncertainty, size)
        assert np.max(out.bound["best"]) < tol.SHARP_BAR * np.max(np.abs(own - out.value))


def test_the_ratios_count_in_the_truth():
    """Without the first ratio the motion is another one, by more than the bound of the reduced body."""
    report, truth = clamped("RBE3", 4)
    body, tip = damped_body(), full_body("bar").probes["tip"]
    zeta = body.zeta.copy()
    zeta[0] = 0.0
    other = clamped_motion(body.P, report.t, zeta).reshape(truth.shape)[:, tip]
    out = report.output("tip body")
    assert np.any(np.abs(other - out.value) > out.bound["best"])


# scope "inputs frozen"


@pytest.mark.parametrize(("kind", "n"), CASES)
def test_errors_under_frozen_inputs_are_covered_and_estimated(kind, n):
    scene, body = damped_scene(floating.pendulum, n, kind, STEP, END), damped_body()
    run = recorded(scene, body, ratios=RATIOS, auxiliary_modes=40)
    assert set(run.report.scope.values()) == {"inputs frozen"}
    assert not any("defect" in message for message in run.report.messages)
    u, _ = frozen_motion(run, body)
    for name, node in body.probes.items():
        out, own = run.report.output(f"{name} body"), u[:, 3 * node : 3 * node + 3]
        size = np.max(np.abs(own))
        for e in ("energy", "auxiliary"):
            assert_covered(np.abs(own - out.value), out.bound[e], size)
        assert_covered(np.abs(own - out.value - out.estimate), out.uncertainty, size)


# scope "coupled (linearised)"


@cache
def hinged_truth():
    """Stored displacements of the tip in the frame: the complete basis, whose matrix is diagonal."""
    scene, body = damped_scene(floating.pendulum, 0, "complete", HINGED_STEP, HINGED_END), damped_body()
    D = exu.MatrixContainer(np.diag(2 * body.zeta * body.omega))
    scene.mbs.SetObjectParameter(scene.items["oFFRFreducedOrder"], "dampingMatrixReduced", D)
    scene.solve()
    return scene.mbs.GetSensorStoredData(scene.sensors["tip local"])[:, 1:]


def hinged(n):
    """What the report says of the tip of a pendulum in its frame."""
    scene = damped_scene(floating.pendulum, n, "RBE3", HINGED_STEP, HINGED_END)
    flex = romerr.floating_body(scene.fem, scene.items, modal_damping=RATIOS)
    romerr.set_modal_damping(scene.mbs, flex)
    tip = scene.sensors["tip local"]
    monitor = romerr.attach(scene.mbs, flex, outputs=[tip])
    scene.solve()
    report = monitor.report()
    assert set(report.scope.values()) == {"coupled (linearised)"}
    return report.output(scene.mbs.GetSensor(tip)["name"])


def missed(out):
    """What the estimate of the basis' error misses of it (T, 3): steps err alike in both runs, and are left out."""
    return np.abs(hinged_truth() - out.value - out.estimate + out.estimate_parts["time step"])


@pytest.mark.parametrize("n", [0, 2])
def test_errors_of_a_hinged_bar_are_covered_and_estimated(n):
    """The estimate is off by 0.1 % and 0.9 % of the error: by what 40 vectors leave."""
    out, share = hinged(n), tol.HINGED_RATIOS
    error = np.abs(hinged_truth() - out.value)
    assert np.all(missed(out) <= out.uncertainty)
    assert np.max(missed(out)) < share * np.max(error)
